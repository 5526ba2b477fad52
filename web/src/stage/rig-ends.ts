// The ends of a body's capsules in a pose, written into a buffer without garbage.
import { place } from './kinematics';
import type { Joints } from './kinematics';
import type { End, Rig } from './rig';

/** A rig as flat arrays. */
export interface FlatRig {
  count: number;
  /** Joint of each of the 2 ends per capsule. */
  joints: Int16Array;
  /** 3 per end, in the joint's frame. */
  locals: Float32Array;
  /** 0: at the joint; 1: at `locals`; 2: a heel. */
  modes: Uint8Array;
  /** 2 per end: knee and toes of a heel. */
  heels: Int16Array;
  /** One per end, metres. */
  radii: Float32Array;
  shades: Float32Array;
}

export function flatten(rig: Rig): FlatRig {
  const count = rig.capsules.length;
  const flat: FlatRig = {
    count,
    joints: new Int16Array(count * 2),
    locals: new Float32Array(count * 6),
    modes: new Uint8Array(count * 2),
    heels: new Int16Array(count * 4),
    radii: new Float32Array(count * 2),
    shades: new Float32Array(count),
  };
  rig.capsules.forEach((capsule, c) => {
    flat.shades[c] = capsule.shade;
    [capsule.from, capsule.to].forEach((end: End, side) => {
      const e = c * 2 + side;
      flat.joints[e] = end.joint;
      flat.radii[e] = capsule.radii[side]!;
      if (end.heel) {
        flat.modes[e] = 2;
        flat.heels.set([end.heel.knee, end.heel.toes], e * 2);
        flat.locals[e * 3] = end.heel.length_m;
      } else if (end.local) {
        flat.modes[e] = 1;
        flat.locals.set(end.local, e * 3);
      }
    });
  });
  return flat;
}

/** Writes place and radius of every end: 4 numbers, 2 ends per capsule, from `offset` on. */
export function writeEnds(flat: FlatRig, joints: Joints, out: Float32Array, offset: number): void {
  const { positions, rotations } = joints;
  const { modes, locals, radii } = flat;
  const ends = flat.count * 2;
  for (let e = 0, o = offset; e < ends; e++, o += 4) {
    const joint = flat.joints[e]!;
    const mode = modes[e]!;
    if (mode === 0) {
      out[o] = positions[joint * 3]!;
      out[o + 1] = positions[joint * 3 + 1]!;
      out[o + 2] = positions[joint * 3 + 2]!;
    } else if (mode === 1) {
      const l = e * 3;
      place(rotations, joint * 4, positions, joint * 3, locals[l]!, locals[l + 1]!, locals[l + 2]!, out, o);
    } else {
      writeHeel(positions, joint, flat.heels[e * 2]!, flat.heels[e * 2 + 1]!, locals[e * 3]!, out, o);
    }
    out[o + 3] = radii[e]!;
  }
}

/** A heel lies on along the shank, and away from the toes. */
function writeHeel(
  places: Float32Array,
  ankle: number,
  knee: number,
  toes: number,
  length: number,
  out: Float32Array,
  o: number,
): void {
  const a = ankle * 3,
    k = knee * 3,
    t = toes * 3;
  let sx = places[a]! - places[k]!,
    sy = places[a + 1]! - places[k + 1]!,
    sz = places[a + 2]! - places[k + 2]!;
  const shank = 1 / (Math.sqrt(sx * sx + sy * sy + sz * sz) || 1);
  let tx = places[t]! - places[a]!,
    ty = places[t + 1]! - places[a + 1]!,
    tz = places[t + 2]! - places[a + 2]!;
  const foot = 0.62 / (Math.sqrt(tx * tx + ty * ty + tz * tz) || 1);
  sx *= shank;
  sy *= shank;
  sz *= shank;
  tx *= foot;
  ty *= foot;
  tz *= foot;
  const hx = sx - tx,
    hy = sy - ty,
    hz = sz - tz;
  const scale = length / (Math.sqrt(hx * hx + hy * hy + hz * hz) || 1);
  out[o] = places[a]! + hx * scale;
  out[o + 1] = places[a + 1]! + hy * scale;
  out[o + 2] = places[a + 2]! + hz * scale;
}
