// From a skeleton to the capsules that make its body: which, and how thick.
import { buildHuman } from './rig-human';
import { buildAnimal } from './rig-animal';
import { buildRobot } from './rig-robot';
import { partKey } from './names';
import type { Skeleton } from './types';

/** Where a capsule ends: at a joint, or at a place in its frame. */
export interface End {
  joint: number;
  /** In the joint's frame, metres. */
  local?: readonly [number, number, number];
  /** The heel of this ankle instead: behind and below it, away from the toes. */
  heel?: { knee: number; toes: number; length_m: number };
}

/** A tapered capsule between two ends. */
export interface Capsule {
  from: End;
  to: End;
  /** Radii at the two ends, metres. */
  radii: readonly [number, number];
  /** Mixed into the tint: above 0 that share of white, below 0 of black. */
  shade: number;
}

export type Kind = 'human' | 'robot' | 'animal';

/** The body of a skeleton. */
export interface Rig {
  kind: Kind;
  capsules: Capsule[];
  /** Radius of the ring and of the soft shadow under the body, metres. */
  footprint_m: number;
}

/** What the builders need to know of a skeleton's tree. */
export interface Tree {
  skeleton: Skeleton;
  count: number;
  children: number[][];
  /** Length of each joint's offset, metres. */
  lengths: number[];
  /** Longest way from each joint to an end below it, metres. */
  below: number[];
  /** Ends at or below each joint. */
  tips: number[];
}

/** Joints of a person that have to be there. */
const HUMAN = [
  'hips',
  'head',
  'upperarm.l',
  'upperarm.r',
  'lowerarm.l',
  'lowerarm.r',
  'upperleg.l',
  'upperleg.r',
  'lowerleg.l',
  'lowerleg.r',
  'foot.l',
  'foot.r',
];
/** Names of a robot's axes: a joint turns about one of them. */
const AXIS = /(_|^)(pitch|roll|yaw)(_|$)/i;

export function treeOf(skeleton: Skeleton): Tree {
  const count = skeleton.names.length;
  const children: number[][] = Array.from({ length: count }, () => []);
  const lengths = new Array<number>(count).fill(0);
  const below = new Array<number>(count).fill(0);
  const tips = new Array<number>(count).fill(0);
  for (let j = count - 1; j >= 0; j--) {
    const o = j * 3;
    lengths[j] = Math.hypot(skeleton.offsets[o]!, skeleton.offsets[o + 1]!, skeleton.offsets[o + 2]!);
    tips[j] = Math.max(tips[j]!, 1);
    const parent = skeleton.parents[j]!;
    if (parent < 0) continue;
    children[parent]!.unshift(j);
    below[parent] = Math.max(below[parent]!, below[j]! + lengths[j]!);
    tips[parent]! += tips[j]!;
  }
  return { skeleton, count, children, lengths, below, tips };
}

export function kindOf(skeleton: Skeleton): Kind {
  const keys = new Set(skeleton.names.map(partKey));
  const axes = skeleton.names.filter((name) => AXIS.test(name)).length;
  if (axes * 3 > skeleton.names.length) return 'robot';
  return HUMAN.every((key) => keys.has(key)) ? 'human' : 'animal';
}

/** Works out the body of a skeleton. */
export function rigOf(skeleton: Skeleton): Rig {
  const tree = treeOf(skeleton);
  const kind = kindOf(skeleton);
  const build = { human: buildHuman, robot: buildRobot, animal: buildAnimal }[kind];
  return { kind, ...build(tree) };
}

/** The point beyond a joint that goes on as its own bone came in, in the joint's frame. */
export function beyond(tree: Tree, joint: number, length_m: number): [number, number, number] {
  // In the pose with identity rotations all frames are parallel, so the incoming direction is the
  // offset's.
  const length = tree.lengths[joint]!;
  if (length < 1e-6) return [0, length_m, 0];
  const scale = length_m / length;
  const [x, y, z] = tree.skeleton.offsets.subarray(joint * 3, joint * 3 + 3);
  return [x! * scale, y! * scale, z! * scale];
}
