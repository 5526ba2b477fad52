// Skeletons for the tests.
import type { Skeleton } from './types';

/** A joint: name, parent's name, offset from it in metres. */
type Row = [string, string, number, number, number];

export function skeletonOf(rows: readonly Row[]): Skeleton {
  const names = rows.map(([name]) => name);
  return {
    names,
    parents: Int16Array.from(rows, ([, parent]) => names.indexOf(parent)),
    offsets: Float32Array.from(rows.flatMap(([, , x, y, z]) => [x, y, z])),
  };
}

const SIDES: [string, number][] = [
  ['L', 1],
  ['R', -1],
];

/** A person who stands with arms spread in the pose with identity rotations: 21 joints. */
export const PERSON = skeletonOf([
  ['Hips', '', 0, 0, 0],
  ['Spine', 'Hips', 0, 0.16, 0],
  ['Chest', 'Spine', 0, 0.09, 0],
  ['Neck', 'Chest', 0, 0.16, 0],
  ['Head', 'Neck', 0, 0.065, 0],
  ...SIDES.flatMap(([side, x]): Row[] => [
    [`Shoulder_${side}`, 'Chest', 0.05 * x, 0.13, 0],
    [`UpperArm_${side}`, `Shoulder_${side}`, 0.054 * x, 0, 0],
    [`LowerArm_${side}`, `UpperArm_${side}`, 0.243 * x, 0, 0],
    [`Hand_${side}`, `LowerArm_${side}`, 0.223 * x, 0, 0],
    [`UpperLeg_${side}`, 'Hips', 0.065 * x, -0.02, 0],
    [`LowerLeg_${side}`, `UpperLeg_${side}`, 0, -0.39, 0],
    [`Foot_${side}`, `LowerLeg_${side}`, 0, -0.41, 0],
    [`Toes_${side}`, `Foot_${side}`, 0, -0.075, 0.09],
  ]),
]);

/** A leg and a trunk of a robot. */
export const ROBOT = skeletonOf([
  ['pelvis', '', 0, 0, 0],
  ['left_hip_pitch', 'pelvis', 0.06, -0.1, 0],
  ['left_hip_roll', 'left_hip_pitch', 0.05, -0.03, 0],
  ['left_knee', 'left_hip_roll', 0, -0.3, 0],
  ['left_ankle_pitch', 'left_knee', 0, -0.3, 0],
  ['waist_yaw', 'pelvis', 0, 0.04, 0],
  ['left_shoulder_pitch', 'waist_yaw', 0.1, 0.25, 0],
  ['left_elbow_pitch', 'left_shoulder_pitch', 0.05, -0.2, 0],
  ['right_shoulder_pitch', 'waist_yaw', -0.1, 0.25, 0],
  ['right_elbow_pitch', 'right_shoulder_pitch', -0.05, -0.2, 0],
]);

/** A beast with four legs, a tail and ears. */
export const BEAST = skeletonOf([
  ['hips', '', 0, 0, 0],
  ['spine', 'hips', 0, 0, 0.5],
  ['neck', 'spine', 0, 0.3, 0.3],
  ['head', 'neck', 0, 0.2, 0.2],
  ['ear_l', 'head', 0.05, 0.1, 0],
  ['tail_1', 'hips', 0, 0, -0.2],
  ['tail_2', 'tail_1', 0, -0.2, -0.2],
  ...SIDES.flatMap(([side, x]): Row[] => [
    [`back_upper_${side}`, 'hips', 0.1 * x, -0.1, 0],
    [`back_lower_${side}`, `back_upper_${side}`, 0, -0.4, 0],
    [`back_foot_${side}`, `back_lower_${side}`, 0, -0.4, 0],
    [`front_upper_${side}`, 'spine', 0.1 * x, -0.1, 0],
    [`front_lower_${side}`, `front_upper_${side}`, 0, -0.4, 0],
    [`front_foot_${side}`, `front_lower_${side}`, 0, -0.4, 0],
  ]),
]);

export function identityPose(skeleton: Skeleton, height_m: number): { root: Float32Array; rotations: Float32Array } {
  const rotations = Float32Array.from({ length: skeleton.names.length * 4 }, (_, c) => (c % 4 === 3 ? 1 : 0));
  return { root: Float32Array.of(0, height_m, 0), rotations };
}
