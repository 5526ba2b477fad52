import { readFileSync } from 'node:fs';
import { describe, expect, it } from 'vitest';
import { drawnOf, readDocument } from './document';

const examples = new URL('../../../examples/', import.meta.url);
const read = (path: string) => readFileSync(new URL(path, examples), 'utf8');

describe('readDocument', () => {
  it.each(['cup', 'greeter', 'seat', 'shrine', 'sign'])('knows %s.toml for a definition', (name) => {
    const document = readDocument(`${name}.toml`, read(`objects/${name}.toml`));
    expect(document).toMatchObject({ kind: 'object', name, format: 'toml' });
  });

  it.each(['courtyard', 'plaza'])('knows %s.toml for a scene', (name) => {
    const document = readDocument(`${name}.toml`, read(`scenes/${name}.toml`));
    expect(document).toMatchObject({ kind: 'scene', name, format: 'toml' });
  });

  it('knows both kinds in JSON', () => {
    expect(readDocument('a.json', '{"name": "a", "sets": []}').kind).toBe('object');
    expect(readDocument('A.JSON', '{"name": "a", "objects": []}').kind).toBe('scene');
  });

  it('says what is missing', () => {
    expect(() => readDocument('a.toml', '[shape.box]\nname = "inner"')).toThrow(/a\.toml: name: is missing/);
    expect(() => readDocument('a.json', '{')).toThrow(/is not JSON/);
    expect(() => readDocument('a.bvh', '')).toThrow(/TOML or JSON/);
  });
});

describe('drawnOf', () => {
  it('reads a box and its approaches', () => {
    const drawn = drawnOf(
      '{"shape": {"box": {"half_extents_m": [1, 2, 3]}}, "approaches": [{"name": "front", "directions_deg": [-90, 180], "distance_m": 0.5}]}',
    );
    expect(drawn.shape).toEqual({ kind: 'box', centre: [0, 0, 0], half: [1, 2, 3] });
    expect(drawn.pivot).toEqual([0, 0, 0]);
    expect(drawn.approaches).toEqual([{ name: 'front', from: -Math.PI / 2, to: Math.PI, distance: 0.5 }]);
  });

  it('reads a hull about a pivot', () => {
    const drawn = drawnOf('{"shape": {"convex": {"points_m": [[0, 0, 1]]}}, "anchor": {"pivot_m": [0, 1, 0]}}');
    expect(drawn).toEqual({
      shape: { kind: 'convex', points: [[0, 0, 1]] },
      pivot: [0, 1, 0],
      approaches: [],
      isSeat: false,
    });
  });

  it('knows a seat: its hips are low, and held until the interaction is ended', () => {
    const isSeat = (set: string) => drawnOf(`{"shape": {"convex": {"points_m": []}}, "sets": [${set}]}`).isSeat;
    expect(isSeat('{"hold_until_ended": true, "keyframes": [{"height_m": 0.94}, {"height_m": 0.55}]}')).toBe(true);
    expect(isSeat('{"hold_until_ended": true, "keyframes": [{"height_m": 0.94}]}')).toBe(false);
    expect(isSeat('{"hold_until_ended": true, "keyframes": [{}]}')).toBe(false);
    expect(isSeat('{"keyframes": [{"height_m": 0.55}]}')).toBe(false);
  });

  it('refuses a shape that it does not know', () => {
    expect(() => drawnOf('{"shape": {}}')).toThrow(/shape/);
  });
});
