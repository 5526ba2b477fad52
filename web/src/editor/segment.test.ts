import { describe, expect, it } from 'vitest';
import { goOnFrom, headingOf, join, poseAt, slice } from './clip';
import { begin, change, endGesture, redo, undo } from './history';
import { readEditorLink, writeEditorLink } from './link';
import { fillRequest, variantsOf, type FillOptions } from './request';
import * as segment from './segment';
import { example, farthest, farthestTurn } from './testing';

const { rig, clip } = example();
const { limits } = rig;
const doc = segment.newDoc(clip, rig, 'walk.bvh');

describe('the gap', () => {
  it('begins within clip and limits', () => {
    expect(segment.lengthOf(doc.gap)).toBe(40);
    expect(() => segment.newDoc(slice(clip, 0, 11), rig, 'short.bvh')).toThrow(
      'short.bvh: has 11 frames; a segment has 12 to 64',
    );
    expect(segment.newDoc(slice(clip, 0, 12), rig, 'x').gap).toEqual({ start: 0, end: 11 });
  });

  it.each([
    [-50, { start: 0, end: 39 }],
    [10, { start: 10, end: 39 }],
    [100, { start: 28, end: 39 }],
  ])('its begin moves to %d as far as it may', (to, expected) => {
    expect(segment.withStart({ start: 5, end: 39 }, to, limits)).toEqual(expected);
  });

  it('is at most 64 frames long', () => {
    expect(segment.withStart({ start: 80, end: 110 }, 3, limits)).toEqual({ start: 47, end: 110 });
    expect(segment.withEnd({ start: 20, end: 40 }, 119, limits, clip.frames)).toEqual({ start: 20, end: 83 });
  });

  it('is at least 12 frames long, and ends in the clip', () => {
    expect(segment.withEnd({ start: 20, end: 40 }, 22, limits, clip.frames)).toEqual({ start: 20, end: 31 });
    expect(segment.withEnd({ start: 90, end: 110 }, 500, limits, clip.frames)).toEqual({ start: 90, end: 119 });
    expect(segment.moved({ start: 90, end: 110 }, 40, clip.frames)).toEqual({ start: 99, end: 119 });
    expect(segment.moved({ start: 5, end: 30 }, -40, clip.frames)).toEqual({ start: 0, end: 25 });
  });

  it('has one to four keyframes at its end', () => {
    let now = doc;
    for (let i = 0; i < 6; i++) now = segment.withTarget(now, limits);
    expect(now.targets).toHaveLength(4);
    expect(segment.targetFrame(now, 0)).toBe(now.gap.end - 3);
    expect(segment.targetAt(now, now.gap.end)).toBe(3);
    expect(segment.targetAt(now, now.gap.end - 4)).toBeUndefined();
    expect(segment.targetAt(now, now.gap.end + 1)).toBeUndefined();
    for (let i = 0; i < 6; i++) now = segment.withoutTarget(now, 0);
    expect(now.targets).toHaveLength(1);
  });

  it('keeps a keyframe that gives something', () => {
    const rootOnly = segment.changedTarget(doc, 0, { givesPose: false });
    expect(rootOnly.targets[0]).toEqual({ givesRoot: true, givesPose: false });
    expect(segment.changedTarget(rootOnly, 0, { givesRoot: false })).toBe(rootOnly);
  });

  it('takes an edited pose along with its end', () => {
    const edited = poseAt(clip, 3);
    const posed = segment.changedTarget(doc, 0, { edited });
    const later = { ...posed, gap: segment.withEnd(posed.gap, posed.gap.end + 5, limits, clip.frames) };
    expect(segment.docPose(later, later.gap.end)).toBe(edited);
    expect(segment.resetTarget(later, 0).targets[0]).toEqual({ givesRoot: true, givesPose: true });
  });
});

describe('the timeline', () => {
  it('zooms around a frame and stays in the clip', () => {
    const near = segment.zoomed({ from: 0, to: 120 }, 2, 30, 120);
    expect(near).toEqual({ from: 15, to: 75 });
    expect(segment.zoomed(near, 0.01, 30, 120)).toEqual({ from: 0, to: 120 });
    expect(segment.zoomed(near, 1000, 30, 120).to - segment.zoomed(near, 1000, 30, 120).from).toBe(16);
    expect(segment.panned(near, 500, 120)).toEqual({ from: 60, to: 120 });
  });

  it('numbers as many frames as fit', () => {
    expect([50, 10, 5, 1.1, 0.05].map((pixels) => segment.rulerStep(pixels))).toEqual([1, 5, 10, 50, 1000]);
  });
});

describe('undo', () => {
  it('goes back and forth, gesture by gesture', () => {
    let now = begin(0);
    for (const value of [1, 2, 3]) now = change(now, value, 'drag');
    now = change(endGesture(now), 4, 'drag');
    now = change(now, 5);
    expect(now.past).toEqual([0, 3, 4]);
    now = undo(undo(now));
    expect(now.now).toBe(3);
    now = redo(now);
    expect(now.now).toBe(4);
    expect(undo(undo(undo(now))).now).toBe(0);
    expect(redo(change(now, 9)).now).toBe(9);
  });

  it('does nothing without a change to undo', () => {
    const now = begin('a');
    expect(undo(now).now).toBe('a');
    expect(redo(now).now).toBe('a');
    expect(change(now, 'a')).toBe(now);
  });
});

const OPTIONS: FillOptions = { seeds: [7, 8, 9], temperature: 0.5, poseSteps: 2, holdFeet: true, modelsLength: false };

describe('a request', () => {
  it('has a character for each seed', () => {
    const request = fillRequest(rig, doc, OPTIONS);
    expect(request.characters.map(({ seed }) => seed)).toEqual([7, 8, 9]);
    const [first] = request.characters;
    const root = (key: (typeof first & object)['context'][number]) => key.root?.position;
    expect({
      ...first,
      context: first!.context.map((key) => ({
        root: root(key),
        rotations: key.pose?.rotations.length,
        heading: key.root?.heading,
      })),
      targets: first!.targets.map((key) => ({ root: root(key), rotations: key.pose?.rotations.slice(0, 4) })),
    }).toMatchSnapshot();
  });

  it('gives the parts of a keyframe that are chosen', () => {
    const rootOnly = fillRequest(rig, segment.changedTarget(doc, 0, { givesPose: false }), OPTIONS).characters[0]!
      .targets[0]!;
    expect(rootOnly.pose).toBeUndefined();
    expect(rootOnly.root?.heading).toBeCloseTo(headingOf(poseAt(clip, doc.gap.end), rig.leftAxis), 5);
    const poseOnly = fillRequest(rig, segment.changedTarget(doc, 0, { givesRoot: false }), OPTIONS).characters[0]!
      .targets[0]!;
    expect(poseOnly.root).toBeUndefined();
    expect(poseOnly.pose?.root_height).toBeCloseTo(poseAt(clip, doc.gap.end).root[1]!, 5);
    expect(poseOnly.pose?.rotations).toHaveLength(84);
  });

  it('leaves the length out where the model chooses it', () => {
    expect(fillRequest(rig, doc, { ...OPTIONS, modelsLength: true }).characters[0]).not.toHaveProperty('frame_count');
  });

  it('becomes variants', () => {
    const { targets } = fillRequest(rig, doc, OPTIONS).characters[0]!;
    const rotations = targets[0]!.pose!.rotations;
    const frames = {
      frame_count: 1,
      root_positions: [1, 2, 3],
      rotations,
      contacts: [1],
      positions: [],
      six_d: [],
      qpos: [],
      hinge_residuals: [],
      clamped_hinges: [],
      hinge_speed_ratios: [],
      fastest_hinges: [],
      hinge_accelerations: [],
    };
    const answer = {
      pack: 'human',
      pack_version: '1',
      characters: [{ id: 'a', frames }],
    };
    const [variant] = variantsOf(rig, answer, [7]);
    expect(variant?.seed).toBe(7);
    expect(farthest(variant!.clip.roots, [1, 2, 3])).toBe(0);
    expect(farthestTurn(variant!.clip.rotations, poseAt(clip, doc.gap.end).rotations)).toBeLessThan(2e-3);
  });
});

it('what follows a gap goes on from where it ends', () => {
  const rest = slice(clip, 60, 120);
  const last = poseAt(clip, 59);
  const moved = { root: Float32Array.of(3, last.root[1]!, -2), rotations: Float32Array.from(last.rotations) };
  const after = goOnFrom(rest, last, moved, rig.leftAxis);
  const step = (a: Float32Array, b: Float32Array) => Math.hypot(a[0]! - b[0]!, a[2]! - b[2]!);
  expect(step(after.roots.subarray(0, 3), moved.root)).toBeCloseTo(step(rest.roots.subarray(0, 3), last.root), 5);
  expect(join([slice(clip, 0, 60), after]).frames).toBe(120);
});

it('links come back', () => {
  const link = {
    pack: 'human',
    clip: 'walk',
    from: 10,
    to: 49,
    targets: 2,
    form: { count: 3, temperature: 0.4 },
    cam: [0, 1, 0, 0, 1, 5],
  };
  expect(readEditorLink(writeEditorLink(link))).toEqual(link);
  expect(readEditorLink('#variants=99&temperature=9&steps=0').form).toEqual({ count: 8, temperature: 2, poseSteps: 1 });
});
