// What the editor's tests share: the project's example on its own skeleton, and a small robot.
import { readFileSync } from 'node:fs';
import { Quaternion, Vector3 } from 'three';
import * as reader from '../reader/troupe_reader_web';
import type { Clip, Rig } from './clip';

// Node has no address to load the reader from.
reader.initSync({ module: readFileSync(new URL('../reader/troupe_reader_web_bg.wasm', import.meta.url)) });

const LIMITS = { contextFrames: 4, maxTargets: 4, minFrames: 12, maxFrames: 64, framesPerToken: 4 };

export function exampleText(): string {
  return readFileSync(new URL('../../../examples/walk.bvh', import.meta.url), 'utf8');
}

/** Parents of the joints of examples/walk.bvh, in the file's order. */
export const WALK_PARENTS = [-1, 0, 1, 2, 3, 2, 5, 6, 7, 2, 9, 10, 11, 0, 13, 14, 15, 0, 17, 18, 19];

export function example(): { rig: Rig; clip: Clip } {
  const read = reader.read('walk.bvh', new TextEncoder().encode(exampleText()), '{}');
  const { fps, frames, roots, rotations, names, parents, offsets } = read;
  const rig = {
    pack: 'human',
    fps: 30,
    skeleton: { names, parents, offsets },
    leftAxis: new Vector3(0, -1, 0),
    hinges: [],
    mimics: [],
    contactJoints: [],
    limits: LIMITS,
  };
  return { rig, clip: { fps, frames, roots, rotations } };
}

/** A pelvis with one leg of six hinges, and a foot that is fixed. Limits in radians. */
export function robot(): Rig {
  const hinge = (
    joint: number,
    axis: [number, number, number],
    lower_rad: number,
    upper_rad: number,
    rest = new Quaternion(),
  ) => ({
    joint,
    axis: new Vector3(...axis),
    rest,
    lower_rad,
    upper_rad,
  });
  const bent = (x: number) => new Quaternion().setFromAxisAngle(new Vector3(1, 0, 0), x);
  const names = [
    'pelvis',
    'left_hip_pitch',
    'left_hip_roll',
    'left_hip_yaw',
    'left_knee',
    'left_ankle_pitch',
    'left_ankle_roll',
  ];
  const offsets = [0, 0, 0, 0.06, -0.1, 0, 0.05, -0.03, 0, 0, -0.12, 0, 0, -0.18, 0, 0, -0.3, 0, 0, -0.02, 0];
  return {
    pack: 'g1',
    fps: 30,
    skeleton: { names, parents: Int16Array.from([-1, 0, 1, 2, 3, 4, 5]), offsets: Float32Array.from(offsets) },
    leftAxis: new Vector3(1, 0, 0),
    contactJoints: [6],
    mimics: [],
    hinges: [
      hinge(1, [1, 0, 0], -2.53, 2.88),
      hinge(2, [0, 0, 1], -0.52, 2.97, bent(-0.1749)),
      hinge(3, [0, 1, 0], -2.76, 2.76),
      hinge(4, [1, 0, 0], -0.087, 2.88, bent(0.1749)),
      hinge(5, [1, 0, 0], -0.87, 0.52),
      hinge(6, [0, 0, 1], -0.26, 0.26),
    ],
    limits: LIMITS,
  };
}

/** How far two lists of numbers are apart at most. */
export function farthest(a: ArrayLike<number>, b: ArrayLike<number>): number {
  let far = a.length === b.length ? 0 : Infinity;
  for (let i = 0; i < a.length; i++) far = Math.max(far, Math.abs(a[i]! - b[i]!));
  return far;
}

/** The largest angle between the rotations of two lists, radians. */
export function farthestTurn(a: Float32Array, b: Float32Array): number {
  let far = a.length === b.length ? 0 : Infinity;
  for (let i = 0; i < a.length; i += 4) {
    far = Math.max(
      far,
      new Quaternion().fromArray(a, i).normalize().angleTo(new Quaternion().fromArray(b, i).normalize()),
    );
  }
  return far;
}
