// Which joint moves which bone of a skin, and by what constant.
import { Matrix4, Vector3 } from 'three';
import type { Skeleton } from './types';

/** A bone of a glb at rest. Parents come before their children. */
export interface RestBone {
  name: string;
  parent: number;
  /** At rest, in the world of the file. May carry a scale. */
  world: Matrix4;
}

/** Bones stand this near to where the joints' offsets say, metres. */
const NEAR_M = 2e-3;

/** How bones follow joints. */
export interface Fit {
  /** Per bone: the joint that moves it. */
  drivers: Int16Array;
  /** Per bone: its place at rest, relative to the joint that moves it. Brings the file's unit to metres. */
  relative: Matrix4[];
  /** Joints that have a bone of their own. */
  joints: number;
}

/** A skin whose bones are not the skeleton's joints: its motion has to be carried over. */
export class OtherBones extends Error {}

/**
 * Fits bones to the joints of their names. Bones without one go along with the bone that they hang on. Throws
 * `OtherBones` if a joint has no bone or if a bone stands elsewhere in its parent than the joint.
 */
export function fitBones(skeleton: Skeleton, bones: readonly RestBone[]): Fit {
  const byName = new Map(bones.map(({ name }, b) => [name, b]));
  const mapped = skeleton.names.map((name) => byName.get(name) ?? -1);
  const missing = skeleton.names.filter((_, j) => mapped[j]! < 0);
  if (missing.length > 0) {
    const [few, rest] = [missing.slice(0, 12), missing.length - 12];
    const more = rest > 0 ? ` and ${rest} more` : '';
    throw new OtherBones(`The skin has no bones for these joints: ${few.join(', ')}${more}.`);
  }
  const rest = mapped.map((bone) => withoutScale(bones[bone]!.world));
  const unit_m = unitOf(skeleton, rest);
  const stray = skeleton.names.find((_, j) => strayed(skeleton, rest, unit_m, j) > NEAR_M);
  if (stray !== undefined) throw new OtherBones(`Bone ${stray} stands elsewhere in its parent than the joint.`);
  const drivers = driversOf(mapped, bones);
  const relative = bones.map(({ world }, b) =>
    new Matrix4().makeScale(unit_m, unit_m, unit_m).multiply(rest[drivers[b]!]!.clone().invert()).multiply(world),
  );
  return { drivers, relative, joints: skeleton.names.length };
}

/** Files in centimetres carry a scale: the place is kept, the axes are made unit vectors. */
function withoutScale(matrix: Matrix4): Matrix4 {
  const [x, y, z] = [new Vector3(), new Vector3(), new Vector3()];
  matrix.extractBasis(x, y, z);
  const rigid = new Matrix4().makeBasis(x.normalize(), y.normalize(), z.normalize());
  return rigid.setPosition(new Vector3().setFromMatrixPosition(matrix));
}

/** A joint's place in its parent, as the file has it. */
function placeOf({ parents }: Skeleton, rest: readonly Matrix4[], joint: number): Vector3 {
  const parent = rest[parents[joint]!]!.clone().invert();
  return new Vector3().setFromMatrixPosition(parent.multiply(rest[joint]!));
}

/** Metres a unit of the file: the joints' distances from their parents, by those in the file. */
function unitOf(skeleton: Skeleton, rest: readonly Matrix4[]): number {
  let [ours, theirs] = [0, 0];
  for (let j = 1; j < skeleton.names.length; j++) {
    ours += new Vector3().fromArray(skeleton.offsets, j * 3).length();
    theirs += placeOf(skeleton, rest, j).length();
  }
  return ours > 0 && theirs > 0 ? ours / theirs : 1;
}

/** How far a bone stands from where the joint's offset says, metres. */
function strayed(skeleton: Skeleton, rest: readonly Matrix4[], unit_m: number, joint: number): number {
  if (skeleton.parents[joint]! < 0) return 0;
  const place = placeOf(skeleton, rest, joint).multiplyScalar(unit_m);
  return place.distanceTo(new Vector3().fromArray(skeleton.offsets, joint * 3));
}

/** The joint of each bone, or of the nearest bone above that has one; the first joint for those above all. */
function driversOf(mapped: readonly number[], bones: readonly RestBone[]): Int16Array {
  const drivers = new Int16Array(bones.length).fill(-1);
  mapped.forEach((bone, joint) => {
    drivers[bone] = joint;
  });
  bones.forEach(({ parent }, b) => {
    if (drivers[b]! < 0) drivers[b] = parent >= 0 ? drivers[parent]! : 0;
  });
  return drivers;
}
