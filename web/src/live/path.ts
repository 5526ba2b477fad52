// Paths that are drawn on the ground.
import type { PathPoint } from '../wire/types';

/** A place on the ground: x and z, metres. */
export type Place = readonly [number, number];

/** Most points of a path that the server takes. */
const MOST_POINTS = 1024;
/** How far from the character a path may begin, metres. The server takes 5. */
const MOST_AWAY_M = 4.5;

export function distance(a: Place, b: Place): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1]);
}

/** How far a place is from the line between two others. */
function offLine(p: Place, a: Place, b: Place): number {
  const [dx, dz] = [b[0] - a[0], b[1] - a[1]];
  const length2 = dx * dx + dz * dz;
  const t = length2 === 0 ? 0 : Math.min(1, Math.max(0, ((p[0] - a[0]) * dx + (p[1] - a[1]) * dz) / length2));
  return distance(p, [a[0] + t * dx, a[1] + t * dz]);
}

/** The points that a line needs to stay within `tolerance` metres of all of them (Douglas and Peucker). */
export function simplify(places: readonly Place[], tolerance: number): Place[] {
  const kept = new Set<number>([0, places.length - 1]);
  const parts: [number, number][] = [[0, places.length - 1]];
  for (let part = parts.pop(); part; part = parts.pop()) {
    const [from, to] = part;
    let farthest = -1;
    let most = tolerance;
    for (let i = from + 1; i < to; i++) {
      const off = offLine(places[i]!, places[from]!, places[to]!);
      if (off > most) [most, farthest] = [off, i];
    }
    if (farthest < 0) continue;
    kept.add(farthest);
    parts.push([from, farthest], [farthest, to]);
  }
  return places.filter((_, i) => kept.has(i));
}

/** Leaves out places that are closer than `least` metres to the one before; the last one stays. */
export function spread(places: readonly Place[], least: number): Place[] {
  const kept: Place[] = [];
  for (const place of places) {
    const before = kept.at(-1);
    if (!before || distance(before, place) >= least) kept.push(place);
  }
  const last = places.at(-1);
  if (last && kept.length > 1 && kept.at(-1) !== last) kept[kept.length - 1] = last;
  return kept;
}

/**
 * Points of `follow_path` for a line that was drawn. The path begins at the character where the line begins too far from it.
 * `undefined` for a line that is too short to be one.
 */
export function pathFrom(drawn: readonly Place[], from: Place): PathPoint[] | undefined {
  const least = 0.15;
  let places = spread(simplify(drawn, 0.02), least);
  for (let tolerance = 0.04; places.length > MOST_POINTS - 1; tolerance *= 2) {
    places = spread(simplify(drawn, tolerance), least);
  }
  const first = places[0];
  if (!first) return undefined;
  if (distance(first, from) > MOST_AWAY_M) places = [from, ...places];
  if (places.length < 2) return undefined;
  return places.map(([x, z]) => ({ position: { x, y: 0, z } }));
}

/** Points for a line on the ground, three numbers each, in steps of some 10 cm along straight parts. */
export function ribbon(places: readonly Place[], height = 0.015): Float32Array {
  return Float32Array.from(places.flatMap(([x, z]) => [x, height, z]));
}
