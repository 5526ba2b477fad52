// The limbs that have a handle: arms and legs, found by the joints' names.
import { Vector3 } from 'three';
import { partKey } from '../stage/names';
import { forward } from '../stage/kinematics';
import type { Skeleton } from '../stage/types';
import type { Clip, Rig } from './clip';
import { poseAt, quaternionAt } from './clip';

export interface Limb {
  /** `left hand`, `right foot`. */
  name: string;
  /** Two bones: the joint that they begin at, the one between them, and the one that is moved. */
  upper: number;
  lower: number;
  end: number;
  /**
   * The axis about which a straight limb bends, in the upper joint's frame. A limb that is bent goes on bending to its
   * own side.
   */
  bend: Vector3;
  /** Indices into the rig's hinges: those that bring the end to its place, and those that keep how it is turned. */
  reach: readonly number[];
  keep: readonly number[];
}

const PARTS = [
  ['hand', 'upperarm', 'lowerarm', 'hand'],
  ['foot', 'upperleg', 'lowerleg', 'foot'],
] as const;
/** Of robots: hinges from the first to the second are those of one limb. */
const ROBOT_PARTS = [
  ['hand', /shoulder/, /elbow/, /wrist/],
  ['foot', /hip/, /knee/, /ankle/],
] as const;

/** Finds the limbs of a rig. How they bend is learnt from a clip. */
export function limbsOf(rig: Rig, clip: Clip): Limb[] {
  return (['l', 'r'] as const).flatMap((side) =>
    rig.hinges.length > 0 ? robotLimbs(rig, side) : bodyLimbs(rig, clip, side),
  );
}

function sideName(side: 'l' | 'r'): string {
  return side === 'l' ? 'left' : 'right';
}

function bodyLimbs({ skeleton }: Rig, clip: Clip, side: 'l' | 'r'): Limb[] {
  const index = new Map(skeleton.names.map((name, j) => [partKey(name), j]));
  return PARTS.flatMap(([part, ...joints]) => {
    const [upper, lower, end] = joints.map((joint) => index.get(`${joint}.${side}`));
    if (upper === undefined || lower === undefined || end === undefined) return [];
    if (skeleton.parents[lower] !== upper || skeleton.parents[end] !== lower) return [];
    const limb = { name: `${sideName(side)} ${part}`, upper, lower, end, reach: [], keep: [] };
    return [{ ...limb, bend: usualBend(skeleton, clip, limb) }];
  });
}

function robotLimbs({ skeleton, hinges }: Rig, side: 'l' | 'r'): Limb[] {
  return ROBOT_PARTS.flatMap(([part, first, middle, last]) => {
    const at = (pattern: RegExp): number[] =>
      hinges.flatMap(({ joint }, h) => {
        const name = skeleton.names[joint]!;
        return name.startsWith(sideName(side)) && pattern.test(name) ? [h] : [];
      });
    const [from, between, keep] = [at(first), at(middle), at(last)];
    const end = keep.at(-1);
    if (from.length === 0 || between.length !== 1 || end === undefined) return [];
    const lower = hinges[between[0]!]!;
    return [
      {
        name: `${sideName(side)} ${part}`,
        upper: hinges[from[0]!]!.joint,
        lower: lower.joint,
        end: hinges[end]!.joint,
        bend: lower.axis.clone(),
        reach: [...from, ...between],
        keep,
      },
    ];
  });
}

/** The mean axis of a limb's bend over a clip, weighted by how much it is bent. The upper joint's Z if it never bends. */
function usualBend(
  skeleton: Skeleton,
  clip: Clip,
  { upper, lower, end }: Pick<Limb, 'upper' | 'lower' | 'end'>,
): Vector3 {
  const places = new Float32Array(skeleton.names.length * 3);
  const turns = new Float32Array(skeleton.names.length * 4);
  const sum = new Vector3();
  const step = Math.max(1, Math.floor(clip.frames / 200));
  for (let f = 0; f < clip.frames; f += step) {
    const { root, rotations } = poseAt(clip, f);
    forward(skeleton, root, rotations, places, turns);
    const [a, b, c] = [upper, lower, end].map((joint) => new Vector3().fromArray(places, joint * 3));
    const axis = b!.clone().sub(a!).cross(c!.sub(b!));
    sum.add(axis.applyQuaternion(quaternionAt(turns, upper).invert()));
  }
  return sum.length() > 1e-6 ? sum.normalize() : new Vector3(0, 0, 1);
}
