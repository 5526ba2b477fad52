// How a foreign skeleton follows ours: which joint moves which bone, and by what constant.
import { Matrix4, Quaternion, Vector3 } from 'three';
import { forward, multiply, type Joints } from './kinematics';
import { mapNames } from './names';
import type { Skeleton } from './types';

/** A bone of a glb at rest. Parents come before their children. */
export interface RestBone {
  name: string;
  parent: number;
  /** At rest, in the world of the file, metres. May carry a scale. */
  world: Matrix4;
}

/** Bones whose lengths differ by less than this have the pack's own frames, metres. */
const NATIVE_M = 2e-3;

/** How bones follow joints. */
export interface Fit {
  /** Whether bones have the pack's own frames. */
  native: boolean;
  /** Per bone: the joint that moves it. */
  drivers: Int16Array;
  /** Per bone: its place at rest, relative to the joint that moves it. */
  relative: Matrix4[];
  /** Writes the driven joints: places (3) and rotations (4) in the world. */
  follow(joints: Joints, positions: Float32Array, rotations: Float32Array): void;
  /** World rotations of the pose at rest (4 per joint), for a native skin. */
  neutral: Float32Array | null;
}

/** Fits bones to a skeleton, or throws an error that names the joints for which none was found. */
export function fitBones(skeleton: Skeleton, bones: readonly RestBone[]): Fit {
  const mapping = mapNames(
    skeleton.names,
    bones.map((bone) => bone.name),
  );
  if (mapping.missing.length > 0) {
    const [few, rest] = [mapping.missing.slice(0, 12), mapping.missing.length - 12];
    const more = rest > 0 ? ` and ${rest} more` : '';
    throw new Error(
      `The skin has no bones for these joints: ${few.join(', ')}${more}. ` +
        `Its ${bones.length} bones are named ${bones
          .slice(0, 6)
          .map((bone) => bone.name)
          .join(', ')}, …`,
    );
  }
  const rest = Array.from(mapping.bones, (bone) => withoutScale(bones[bone]!.world));
  const native = isNative(skeleton, rest);
  const drivers = driversOf(mapping.bones, bones);
  const relative = bones.map((bone, b) => rest[drivers[b]!]!.clone().invert().multiply(bone.world));
  if (native) {
    return { native, drivers, relative, neutral: rotationsOf(rest), follow: followNative };
  }
  return { native, drivers, relative, neutral: null, follow: retarget(skeleton, rest) };
}

/** Files in centimetres carry a scale: the place is kept, the axes are made unit vectors. */
function withoutScale(matrix: Matrix4): Matrix4 {
  const [x, y, z] = [new Vector3(), new Vector3(), new Vector3()];
  matrix.extractBasis(x, y, z);
  const rigid = new Matrix4().makeBasis(x.normalize(), y.normalize(), z.normalize());
  return rigid.setPosition(new Vector3().setFromMatrixPosition(matrix));
}

/** Poses apply as they are if every bone's place in its parent's frame is the joint's offset. */
function isNative(skeleton: Skeleton, rest: readonly Matrix4[]): boolean {
  const [local, place] = [new Matrix4(), new Vector3()];
  return rest.every((world, j) => {
    const parent = skeleton.parents[j]!;
    if (parent < 0) return true;
    place.setFromMatrixPosition(local.copy(rest[parent]!).invert().multiply(world));
    const [x, y, z] = skeleton.offsets.subarray(j * 3, j * 3 + 3);
    return Math.hypot(place.x - x!, place.y - y!, place.z - z!) < NATIVE_M;
  });
}

/** The nearest mapped bone at or above each bone; the first joint for those above all. */
function driversOf(mapped: Int16Array, bones: readonly RestBone[]): Int16Array {
  const drivers = new Int16Array(bones.length).fill(-1);
  mapped.forEach((bone, joint) => {
    drivers[bone] = joint;
  });
  bones.forEach((bone, b) => {
    if (drivers[b]! < 0) drivers[b] = bone.parent >= 0 ? drivers[bone.parent]! : 0;
  });
  return drivers;
}

function rotationsOf(rest: readonly Matrix4[]): Float32Array {
  const rotations = new Float32Array(rest.length * 4);
  const [place, turn, scale] = [new Vector3(), new Quaternion(), new Vector3()];
  rest.forEach((world, j) => {
    world.decompose(place, turn, scale);
    turn.toArray(rotations, j * 4);
  });
  return rotations;
}

function followNative(joints: Joints, positions: Float32Array, rotations: Float32Array): void {
  positions.set(joints.positions);
  rotations.set(joints.rotations);
}

/**
 * Carries rotations over to bones with other frames and lengths. A joint's turn away from the neutral pose is applied to
 * the bone, which first is swung from its direction at rest to the direction that the joint has in the neutral pose.
 */
function retarget(skeleton: Skeleton, rest: readonly Matrix4[]): Fit['follow'] {
  const count = skeleton.names.length;
  const neutral = skeleton.neutral ?? identities(count);
  const ours = placesOf(skeleton, neutral);
  const theirs = rest.map((world) => new Vector3().setFromMatrixPosition(world));
  const swings = swingsOf(skeleton, ours, theirs);
  const restTurns = rotationsOf(rest);

  // turn[j] = joint rotation * constant[j], with constant = neutral⁻¹ * swing * rest. Offsets in
  // the joint's neutral frame.
  const constants = new Float32Array(count * 4);
  const undo = new Float32Array(4);
  const offsets = new Float32Array(count * 3);
  const inverse = new Quaternion();
  for (let j = 0; j < count; j++) {
    multiply(swings, j * 4, restTurns, j * 4, constants, j * 4);
    inverse
      .fromArray(neutral, j * 4)
      .invert()
      .toArray(undo);
    multiply(undo, 0, constants, j * 4, constants, j * 4);
    const parent = skeleton.parents[j]!;
    if (parent < 0) continue;
    const away = theirs[j]!.clone().sub(theirs[parent]!);
    away.applyQuaternion(new Quaternion().fromArray(swings, parent * 4));
    away.applyQuaternion(inverse.fromArray(neutral, parent * 4).invert()).toArray(offsets, j * 3);
  }
  // The root's height scales as the bodies' legs do.
  const scale = legLength(skeleton, theirs) / Math.max(legLength(skeleton, ours), 1e-6);
  return (joints, positions, rotations) => {
    const { parents } = skeleton;
    positions[0] = joints.positions[0]!;
    positions[1] = joints.positions[1]! * scale;
    positions[2] = joints.positions[2]!;
    for (let j = 0; j < count; j++) {
      multiply(joints.rotations, j * 4, constants, j * 4, rotations, j * 4);
      const parent = parents[j]!;
      if (parent < 0) continue;
      addTurned(joints.rotations, parent * 4, offsets, j * 3, positions, parent * 3, j * 3);
    }
  };
}

/** `positions[to] = positions[from] + rotation * offset` */
function addTurned(
  turns: Float32Array,
  q: number,
  offsets: Float32Array,
  o: number,
  positions: Float32Array,
  from: number,
  to: number,
): void {
  const qx = turns[q]!,
    qy = turns[q + 1]!,
    qz = turns[q + 2]!,
    qw = turns[q + 3]!;
  const x = offsets[o]!,
    y = offsets[o + 1]!,
    z = offsets[o + 2]!;
  const tx = 2 * (qy * z - qz * y),
    ty = 2 * (qz * x - qx * z),
    tz = 2 * (qx * y - qy * x);
  positions[to] = positions[from]! + x + qw * tx + qy * tz - qz * ty;
  positions[to + 1] = positions[from + 1]! + y + qw * ty + qz * tx - qx * tz;
  positions[to + 2] = positions[from + 2]! + z + qw * tz + qx * ty - qy * tx;
}

function identities(count: number): Float32Array {
  return Float32Array.from({ length: count * 4 }, (_, c) => (c % 4 === 3 ? 1 : 0));
}

/** Places of joints whose world rotations are given. */
function placesOf(skeleton: Skeleton, world: Float32Array): Vector3[] {
  const local = new Float32Array(world.length);
  const undo = new Float32Array(4);
  skeleton.parents.forEach((parent, j) => {
    if (parent < 0) local.set(world.subarray(0, 4));
    else {
      new Quaternion()
        .fromArray(world, parent * 4)
        .invert()
        .toArray(undo);
      multiply(undo, 0, world, j * 4, local, j * 4);
    }
  });
  const positions = new Float32Array(skeleton.names.length * 3);
  forward(skeleton, new Float32Array(3), local, positions, new Float32Array(world.length));
  return skeleton.names.map((_, j) => new Vector3().fromArray(positions, j * 3));
}

/** Per joint, the least turn that brings its bone's direction at rest to ours. Bones without one turn with their parent. */
function swingsOf(skeleton: Skeleton, ours: readonly Vector3[], theirs: readonly Vector3[]): Float32Array {
  const swings = identities(skeleton.names.length);
  const turn = new Quaternion();
  skeleton.names.forEach((_, j) => {
    const children = skeleton.names.flatMap((_name, c) => (skeleton.parents[c] === j ? [c] : []));
    const parent = skeleton.parents[j]!;
    const [child] = children;
    if (children.length === 1 && child !== undefined && parent >= 0) {
      const [from, to] = [theirs[child]!.clone().sub(theirs[j]!), ours[child]!.clone().sub(ours[j]!)];
      if (from.length() > 1e-4 && to.length() > 1e-4)
        turn.setFromUnitVectors(from.normalize(), to.normalize()).toArray(swings, j * 4);
    } else if (parent >= 0 && children.length === 0) {
      swings.copyWithin(j * 4, parent * 4, parent * 4 + 4);
    }
  });
  return swings;
}

/** From the root down to the lowest joint, metres. */
function legLength(skeleton: Skeleton, places: readonly Vector3[]): number {
  const lowest = skeleton.names.reduce((low, _, j) => Math.min(low, places[j]!.y), Infinity);
  return Math.max(places[0]!.y - lowest, 1e-3);
}
