// Writes BVH, in centimetres.
import { Euler } from 'three';
import type { Clip, Rig } from './clip';
import { poseAt, quaternionAt } from './clip';

const UNIT_M = 0.01;

/** Six decimals, without trailing zeros. */
function number(value: number): string {
  const text = value.toFixed(6).replace(/\.?0+$/, '');
  return text === '-0' ? '0' : text;
}

/** Writes a clip: six channels at the root, three rotations (Z X Y) at every other joint. */
export function writeBvh(clip: Clip, { skeleton }: Rig): string {
  const { names, parents, offsets } = skeleton;
  const lines = ['HIERARCHY'];
  const order: number[] = [];
  const write = (joint: number, depth: number): void => {
    const tab = '\t'.repeat(depth);
    const at = joint === 0 ? [0, 0, 0] : Array.from(offsets.subarray(joint * 3, joint * 3 + 3), (m) => m / UNIT_M);
    const children = names.flatMap((_, child) => (parents[child] === joint ? [child] : []));
    const moves = joint === 0 ? 'CHANNELS 6 Xposition Yposition Zposition' : 'CHANNELS 3';
    order.push(joint);
    lines.push(`${tab}${joint === 0 ? 'ROOT' : 'JOINT'} ${names[joint]}`, `${tab}{`);
    lines.push(`${tab}\tOFFSET ${at.map(number).join(' ')}`, `${tab}\t${moves} Zrotation Xrotation Yrotation`);
    for (const child of children) write(child, depth + 1);
    if (children.length === 0) lines.push(`${tab}\tEnd Site`, `${tab}\t{`, `${tab}\t\tOFFSET 0 0 0`, `${tab}\t}`);
    lines.push(`${tab}}`);
  };
  write(0, 0);
  lines.push('MOTION', `Frames: ${clip.frames}`, `Frame Time: ${1 / clip.fps}`);
  const angles = new Euler();
  for (let f = 0; f < clip.frames; f++) {
    const { root, rotations } = poseAt(clip, f);
    const row = Array.from(root, (metres) => metres / UNIT_M);
    for (const joint of order) {
      angles.setFromQuaternion(quaternionAt(rotations, joint), 'ZXY');
      for (const radians of [angles.z, angles.x, angles.y]) row.push((radians * 180) / Math.PI);
    }
    lines.push(row.map(number).join(' '));
  }
  return `${lines.join('\n')}\n`;
}
