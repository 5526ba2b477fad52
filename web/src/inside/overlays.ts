// What a plan looks like on the stage.
import type { Pose, Stage } from '../stage/types';
import type { Keyframe, PeekResponse } from '../wire/types';
import type { Character } from '../live/character';
import { toXyzw } from '../live/character';

/** The root at each stage of a plan: name, meaning, and index into the palette. */
export const STAGES = [
  { name: 'r_g1', says: 'where the command alone leads', tint: 8 },
  { name: 'r_g2', says: "the spring's path", tint: 2 },
  { name: 'r_g3', says: "the root module's path", tint: 4 },
  { name: 'r_g4', says: "the decoder's path", tint: 1 },
] as const;

const LIFT_M = 0.02;
const CONTACT_TINT = 3;
/** Opacity of keyframes. */
const GHOST = 0.32;

/** Points on the ground of frames x 5 numbers (x, y, z, cos heading, sin heading). */
export function groundLine(numbers: readonly number[], lift: number): Float32Array {
  const points = new Float32Array(Math.floor(numbers.length / 5) * 3);
  for (let i = 0, to = 0; to < points.length; i += 5, to += 3) {
    points[to] = numbers[i]!;
    points[to + 1] = lift;
    points[to + 2] = numbers[i + 2]!;
  }
  return points;
}

/** The poses of keyframes that have both root and pose. */
export function posesOf(keyframes: readonly Keyframe[]): Pose[] {
  return keyframes.flatMap(({ root, pose }) => {
    const at = root?.position;
    if (!at || !pose?.rotations.length) return [];
    return [{ root: Float32Array.of(at.x, at.y, at.z), rotations: toXyzw(pose.rotations) }];
  });
}

/** Draws the newest plan of a character. */
export function drawPlan(stage: Stage, of: Character, peek: PeekResponse): void {
  const { plan } = peek;
  if (!plan) return;
  const targets = posesOf(plan.targets);
  stage.ghosts('plan', of.kind.skeleton, targets.length > 0 ? targets : null, GHOST, of.tint);
  const paths = [plan.root_r_g2, plan.root_r_g3, plan.root_r_g4];
  paths.forEach((numbers, i) => {
    const { name, tint } = STAGES[i + 1]!;
    const line = groundLine(numbers, LIFT_M + i * 0.004);
    stage.line(name, line.length > 3 ? line : null, { tint, width_m: 0.035 });
  });
  const goal = plan.root_r_g1?.position;
  const from = plan.root_r_g2;
  const line = goal && from.length >= 5 ? Float32Array.of(from[0]!, LIFT_M, from[2]!, goal.x, LIFT_M, goal.z) : null;
  stage.line('r_g1', line, { tint: STAGES[0].tint, width_m: 0.025, dashed: true });
}

/** Draws a disc under each joint that stands. */
export function drawContacts(stage: Stage, of: Character): void {
  const joints = stage.jointPositions(of.id);
  const places = joints
    ? of.kind.contactJoints.flatMap((joint, i) =>
        (of.contactBits >> i) & 1 && joint >= 0 ? [joints[joint * 3]!, 0.012, joints[joint * 3 + 2]!] : [],
      )
    : [];
  stage.discs('contacts', places.length > 0 ? Float32Array.from(places) : null, CONTACT_TINT);
}

export function clearPlan(stage: Stage, of: Character | undefined): void {
  for (const { name, tint } of STAGES) stage.line(name, null, { tint });
  stage.discs('contacts', null, CONTACT_TINT);
  if (of) stage.ghosts('plan', of.kind.skeleton, null);
}
