// A robot's motion as Unitree publishes it: a row is a frame, without a header. `x y z qx qy qz qw`
// of the root in ROS axes (X forward, Y left, Z up), then an angle for each hinge, radians. The
// file knows no rate: it is the pack's.
import { Quaternion } from 'three';
import type { Clip, Hinge, Rig } from './clip';
import { poseAt, quaternionAt } from './clip';
import { checkLength } from './recording';

const ROOT_COLUMNS = 7;
/** How far a rotation may be from unit length. */
const UNIT_TOLERANCE = 1e-3;

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

export function readCsv(text: string, rig: Rig, file: string): Clip {
  const hinges = robotOf(rig, file);
  const expected = ROOT_COLUMNS + hinges.length;
  const rows = text.split(/\r?\n/).flatMap((line, nth) => (line.trim() === '' ? [] : [{ line, nth: nth + 1 }]));
  checkLength(rows.length, file);
  const joints = rig.skeleton.names.length;
  const roots = new Float32Array(rows.length * 3);
  const rotations = new Float32Array(rows.length * joints * 4);
  for (let i = 3; i < rotations.length; i += 4) rotations[i] = 1;
  rows.forEach(({ line, nth }, f) => {
    const cells = line.split(',');
    if (cells.length !== expected) {
      const needs = `${expected}: ${ROOT_COLUMNS} of the root and ${hinges.length} angles`;
      throw new Error(`${file}, line ${nth}: ${cells.length} columns; the robot of pack ${rig.pack} has ${needs}`);
    }
    const row = cells.map((cell, column) => {
      const value = Number(cell);
      if (cell.trim() === '' || !Number.isFinite(value)) {
        throw new Error(
          `${file}, line ${nth}, column ${column + 1}: "${cell.trim().slice(0, 32)}" is no finite number`,
        );
      }
      return value;
    });
    const [x, y, z, qx, qy, qz, qw] = row as [number, number, number, number, number, number, number];
    const turn = new Quaternion(qy, qz, qx, qw);
    const length = turn.length();
    if (Math.abs(length - 1) > UNIT_TOLERANCE) {
      const says = `the root's rotation, columns 4 to 7, has length ${length.toFixed(4)}`;
      throw new Error(`${file}, line ${nth}: ${says}; allowed: 0.999 to 1.001`);
    }
    // ROS axes are native ones in another order: (y, z, x).
    roots.set([y, z, x], f * 3);
    turn.normalize().toArray(rotations, f * joints * 4);
    hinges.forEach((hinge, h) => {
      hingeRotation(hinge, row[ROOT_COLUMNS + h]!).toArray(rotations, (f * joints + hinge.joint) * 4);
    });
  });
  return { fps: rig.fps, frames: rows.length, roots, rotations };
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
