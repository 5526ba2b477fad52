// Documents that people write: which kind a dropped file is, and what the page draws of a
// definition.
import type { Approach, Drawn, Shape } from './types';

export interface TextDocument {
  kind: 'object' | 'scene';
  name: string;
  format: 'toml' | 'json';
  text: string;
}

type Numbers3 = [number, number, number];

interface ShapeDocument {
  box?: { half_extents_m: Numbers3; center_m?: Numbers3 };
  convex?: { points_m: Numbers3[] };
}

interface ObjectDocument {
  shape: ShapeDocument;
  anchor?: { pivot_m?: Numbers3 };
  approaches?: { name: string; directions_deg: [number, number]; distance_m?: number }[];
  sets?: { hold_until_ended?: boolean; keyframes?: { height_m?: number }[] }[];
}

/** Hips below this height sit, metres: docs/objects.md, the default of a set's `motion`. */
const SITS_BELOW_M = 0.7;

/** Finds out what a file is. The server checks its content. Throws if it has no name, or is no such document. */
export function readDocument(file: string, text: string): TextDocument {
  const ending = file.toLowerCase().split('.').at(-1);
  if (ending === 'toml') return { ...tellToml(file, text), format: 'toml', text };
  if (ending === 'json') return { ...tellJson(file, text), format: 'json', text };
  throw new Error(`${file}: drop the TOML or JSON file of an object definition or a scene`);
}

function tellToml(file: string, text: string): Pick<TextDocument, 'kind' | 'name'> {
  const head = text.split(/^\s*\[/m, 1)[0] ?? '';
  const name = /^\s*name\s*=\s*(?:"([^"]*)"|'([^']*)')/m.exec(head);
  const isObject = /^\s*\[+\s*(?:shape|variants|sets)\b/m.test(text) || /^\s*(?:shape|variants|sets)\b/m.test(head);
  return { kind: isObject ? 'object' : 'scene', name: named(file, name?.[1] ?? name?.[2]) };
}

function tellJson(file: string, text: string): Pick<TextDocument, 'kind' | 'name'> {
  let read: unknown;
  try {
    read = JSON.parse(text);
  } catch (error) {
    throw new Error(`${file}: is not JSON: ${error instanceof Error ? error.message : String(error)}`, {
      cause: error,
    });
  }
  if (typeof read !== 'object' || read === null) throw new Error(`${file}: is not a JSON object`);
  const isObject = 'shape' in read || 'variants' in read || 'sets' in read;
  const name = 'name' in read && typeof read.name === 'string' ? read.name : undefined;
  return { kind: isObject ? 'object' : 'scene', name: named(file, name) };
}

function named(file: string, name: string | undefined): string {
  if (!name) throw new Error(`${file}: name: is missing; 1 to 64 letters, digits, '-', '_' or '.'`);
  return name;
}

/** What the page draws of a definition that the server gave as JSON. */
export function drawnOf(text: string): Drawn {
  const { shape, anchor, approaches = [], sets = [] } = JSON.parse(text) as ObjectDocument;
  return {
    shape: shapeOf(shape),
    pivot: anchor?.pivot_m ?? [0, 0, 0],
    approaches: approaches.map(approachOf),
    isSeat: sets.some((set) => set.hold_until_ended && (hipsOf(set) ?? Infinity) < SITS_BELOW_M),
  };
}

/** Height of the hips in a set's last keyframe, metres; `undefined` if it is free. */
function hipsOf({ keyframes = [] }: NonNullable<ObjectDocument['sets']>[number]): number | undefined {
  return keyframes.at(-1)?.height_m;
}

function shapeOf({ box, convex }: ShapeDocument): Shape {
  if (box) return { kind: 'box', centre: box.center_m ?? [0, 0, 0], half: box.half_extents_m };
  if (convex) return { kind: 'convex', points: convex.points_m };
  throw new Error('shape: is neither a box nor convex');
}

function approachOf(of: { name: string; directions_deg: [number, number]; distance_m?: number }): Approach {
  const [from, to] = of.directions_deg.map((angle) => (angle * Math.PI) / 180) as [number, number];
  return { name: of.name, from, to, distance: of.distance_m };
}
