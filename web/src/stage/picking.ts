// What a ray meets: capsules and the ground.

/** A ray: origin and unit direction, 3 numbers each. */
export interface Ray {
  origin: readonly [number, number, number];
  direction: readonly [number, number, number];
}

/** Radii are taken a little larger, so that thin limbs can be hit, metres. */
const SLACK_M = 0.025;

/**
 * How far along a ray the nearest of some capsules lies, or Infinity.
 * `ends` has 8 numbers per capsule (place and radius of either end), from `offset` on.
 */
export function hitCapsules(ray: Ray, ends: Float32Array, offset: number, count: number): number {
  let nearest = Infinity;
  for (let c = 0, o = offset; c < count; c++, o += 8) {
    const t = hitCapsule(ray, ends, o);
    if (t < nearest) nearest = t;
  }
  return nearest;
}

/** One capsule: where the ray comes nearest to its axis, if that is within the radius there. */
function hitCapsule(ray: Ray, ends: Float32Array, o: number): number {
  const [ox, oy, oz] = ray.origin;
  const [dx, dy, dz] = ray.direction;
  const ax = ends[o]! - ox,
    ay = ends[o + 1]! - oy,
    az = ends[o + 2]! - oz;
  const bx = ends[o + 4]! - ends[o]!,
    by = ends[o + 5]! - ends[o + 1]!,
    bz = ends[o + 6]! - ends[o + 2]!;
  const bb = bx * bx + by * by + bz * bz;
  const bd = bx * dx + by * dy + bz * dz;
  const ab = ax * bx + ay * by + az * bz;
  const ad = ax * dx + ay * dy + az * dz;
  // The place on the axis that is nearest to the ray's line.
  const across = bb - bd * bd;
  // Along the axis all are equally near: the end that faces the eye counts.
  const s = across > 1e-9 ? Math.min(Math.max((ad * bd - ab) / across, 0), 1) : bd < 0 ? 1 : 0;
  const px = ax + s * bx,
    py = ay + s * by,
    pz = az + s * bz;
  const t = px * dx + py * dy + pz * dz;
  if (t < 0) return Infinity;
  const away = px * px + py * py + pz * pz - t * t;
  const radius = ends[o + 3]! + s * (ends[o + 7]! - ends[o + 3]!) + SLACK_M;
  if (away > radius * radius) return Infinity;
  return Math.max(t - Math.sqrt(radius * radius - away), 0);
}

/** Where a ray meets the ground, or null if it looks up or along it. */
export function hitGround(ray: Ray, height_m = 0, farthest_m = 200): [number, number, number] | null {
  const down = ray.direction[1];
  if (down >= -1e-4) return null;
  const t = (height_m - ray.origin[1]) / down;
  if (t < 0 || t > farthest_m) return null;
  return [ray.origin[0] + t * ray.direction[0], height_m, ray.origin[2] + t * ray.direction[2]];
}
