// Writes a robot's motion as Unitree publishes it: a row is a frame, without a header. First come
// `x y z qx qy qz qw` of the root in ROS axes (X forward, Y left, Z up), then an angle for each
// hinge, radians. The file knows no rate: it is the pack's.
import { Quaternion } from 'three';
import type { Clip, Hinge, Rig } from './clip';
import { poseAt, quaternionAt } from './clip';

/** A hinge joint's rotation relative to its parent at an angle. */
export function hingeRotation({ axis, rest }: Hinge, angle_rad: number): Quaternion {
  return rest.clone().multiply(new Quaternion().setFromAxisAngle(axis, angle_rad));
}

/** The angle at which a hinge comes nearest to a rotation relative to its parent: within π of the middle of its limits. */
export function hingeAngle({ axis, rest, lower_rad, upper_rad }: Hinge, local: Quaternion): number {
  const { x, y, z, w } = rest.clone().conjugate().multiply(local);
  const angle = 2 * Math.atan2(x * axis.x + y * axis.y + z * axis.z, w);
  const middle = (lower_rad + upper_rad) / 2;
  const turn = angle - middle;
  return middle + turn - 2 * Math.PI * Math.round(turn / (2 * Math.PI));
}

export function limited({ lower_rad, upper_rad }: Hinge, angle_rad: number): number {
  return Math.min(Math.max(angle_rad, lower_rad), upper_rad);
}

function robotOf(rig: Rig, file: string): readonly Hinge[] {
  if (rig.hinges.length === 0) {
    throw new Error(`${file}: a CSV holds hinge angles, but pack ${rig.pack} has no robot; choose a robot's pack`);
  }
  return rig.hinges;
}

/** Writes a clip whose frames are on the hinges, with six digits behind the point. Angles are kept within the limits. */
export function writeCsv(clip: Clip, rig: Rig): string {
  const hinges = robotOf(rig, 'CSV');
  const before = new Quaternion();
  let text = '';
  for (let f = 0; f < clip.frames; f++) {
    const { root, rotations } = poseAt(clip, f);
    const turn = quaternionAt(rotations, 0);
    // Columns that are drawn as curves then have no jump to the other sign.
    if (turn.dot(before) < 0) turn.set(-turn.x, -turn.y, -turn.z, -turn.w);
    before.copy(turn);
    const angles = hinges.map((hinge) => limited(hinge, hingeAngle(hinge, quaternionAt(rotations, hinge.joint))));
    const row = [root[2]!, root[0]!, root[1]!, turn.z, turn.x, turn.y, turn.w, ...angles];
    text += `${row.map((value) => value.toFixed(6)).join(',')}\n`;
  }
  return text;
}
