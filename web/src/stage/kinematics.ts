// Forward kinematics without garbage: local rotations become places and rotations in the world.
import type { Pose, Skeleton } from './types';

/** World state of all joints of one character. */
export class Joints {
  /** 3 per joint, metres. */
  readonly positions: Float32Array;
  /** 4 per joint, x y z w. */
  readonly rotations: Float32Array;
  /** The same relative to the parents; the first joint's in the world. */
  readonly local: Float32Array;

  constructor(readonly skeleton: Skeleton) {
    const count = skeleton.names.length;
    this.positions = new Float32Array(count * 3);
    this.rotations = new Float32Array(count * 4);
    for (let j = 0; j < count; j++) this.rotations[j * 4 + 3] = 1;
    this.local = this.rotations.slice();
  }

  /** Takes over a pose. */
  update(pose: Pose): void {
    for (let i = 0; i < this.local.length; i++) this.local[i] = pose.rotations[i]!;
    forward(this.skeleton, pose.root, pose.rotations, this.positions, this.rotations);
  }
}

/** Checks what forward kinematics relies on. Call it once per skeleton. */
export function checkSkeleton(skeleton: Skeleton): void {
  const count = skeleton.names.length;
  if (count === 0) throw new Error('skeleton.names: is empty; a skeleton has at least one joint');
  if (skeleton.parents.length !== count)
    throw new Error(`skeleton.parents: has ${skeleton.parents.length} entries; ${count} joints need ${count}`);
  if (skeleton.offsets.length !== count * 3)
    throw new Error(`skeleton.offsets: has ${skeleton.offsets.length} numbers; ${count} joints need ${count * 3}`);
  for (let j = 0; j < count; j++) {
    const parent = skeleton.parents[j] ?? 0;
    const fits = j === 0 ? parent === -1 : parent >= 0 && parent < j;
    if (!fits) throw new Error(`skeleton.parents[${j}]: is ${parent}; allowed: ${j === 0 ? '-1' : `0 to ${j - 1}`}`);
  }
}

/** Rotates (x, y, z) by the quaternion at `q` of `rotations`, adds the point at `p` of `from`, writes to `o` of `out`. */
export function place(
  rotations: Float32Array,
  q: number,
  from: Float32Array,
  p: number,
  x: number,
  y: number,
  z: number,
  out: Float32Array,
  o: number,
): void {
  const qx = rotations[q]!,
    qy = rotations[q + 1]!,
    qz = rotations[q + 2]!,
    qw = rotations[q + 3]!;
  const tx = 2 * (qy * z - qz * y),
    ty = 2 * (qz * x - qx * z),
    tz = 2 * (qx * y - qy * x);
  out[o] = from[p]! + x + qw * tx + qy * tz - qz * ty;
  out[o + 1] = from[p + 1]! + y + qw * ty + qz * tx - qx * tz;
  out[o + 2] = from[p + 2]! + z + qw * tz + qx * ty - qy * tx;
}

/** `out[o..] = a[i..] * b[j..]` for quaternions x y z w. `out` may be `a` or `b` at other indices. */
export function multiply(a: Float32Array, i: number, b: Float32Array, j: number, out: Float32Array, o: number): void {
  const ax = a[i]!,
    ay = a[i + 1]!,
    az = a[i + 2]!,
    aw = a[i + 3]!;
  const bx = b[j]!,
    by = b[j + 1]!,
    bz = b[j + 2]!,
    bw = b[j + 3]!;
  out[o] = aw * bx + ax * bw + ay * bz - az * by;
  out[o + 1] = aw * by - ax * bz + ay * bw + az * bx;
  out[o + 2] = aw * bz + ax * by - ay * bx + az * bw;
  out[o + 3] = aw * bw - ax * bx - ay * by - az * bz;
}

/** Places (3 per joint) and rotations (4 per joint) in the world from a root and local rotations. */
export function forward(
  skeleton: Skeleton,
  root: Float32Array,
  local: Float32Array,
  positions: Float32Array,
  rotations: Float32Array,
): void {
  const { parents, offsets } = skeleton;
  const count = parents.length;
  positions[0] = root[0]!;
  positions[1] = root[1]!;
  positions[2] = root[2]!;
  for (let c = 0; c < 4; c++) rotations[c] = local[c]!;
  for (let j = 1; j < count; j++) {
    const parent = parents[j]!;
    const o = j * 3;
    place(rotations, parent * 4, positions, parent * 3, offsets[o]!, offsets[o + 1]!, offsets[o + 2]!, positions, o);
    multiply(rotations, parent * 4, local, j * 4, rotations, j * 4);
  }
}
