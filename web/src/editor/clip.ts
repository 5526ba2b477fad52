// Motion in the editor: frames on a pack's skeleton, never changed in place.
import { Quaternion, Vector3 } from 'three';
import { slerp } from '../live/playback';
import type { Pose, Skeleton } from '../stage/types';

/** A joint that turns about one axis, with its limits. */
export interface Hinge {
  /** Index of the joint. */
  joint: number;
  /** In the joint's own frame, unit length. */
  axis: Vector3;
  /** The joint's rotation relative to its parent at angle 0. */
  rest: Quaternion;
  lower_rad: number;
  upper_rad: number;
}

/** A joint that follows a hinge: its angle is `multiplier` times that of the hinge, plus `offset_rad`. */
export interface Mimic {
  /** Index of the joint. */
  joint: number;
  /** Index of the joint with the hinge. */
  follows: number;
  multiplier: number;
  offset_rad: number;
  /** In the joint's own frame, unit length. */
  axis: Vector3;
  /** The joint's rotation relative to its parent at angle 0. */
  rest: Quaternion;
}

/** What the editor knows of a pack. */
export interface Rig {
  pack: string;
  fps: number;
  skeleton: Skeleton;
  /** The body's left in the first joint's own frame, unit length. */
  leftAxis: Vector3;
  /** Hinges of a robot, in the order of its CSV; none for other bodies. */
  hinges: readonly Hinge[];
  /** Joints of a robot that follow hinges. */
  mimics: readonly Mimic[];
  /** Joints that touch the ground, in the order of an answer's contacts. */
  contactJoints: readonly number[];
  limits: Limits;
}

/** What the pack allows of a segment. */
export interface Limits {
  contextFrames: number;
  maxTargets: number;
  minFrames: number;
  maxFrames: number;
  framesPerToken: number;
}

/** Frames at a steady rate. */
export interface Clip {
  fps: number;
  frames: number;
  /** 3 per frame, metres. */
  roots: Float32Array;
  /** 4 per joint per frame, x y z w; the first joint's in the world, others relative to their parents. */
  rotations: Float32Array;
}

/** Frames that are read from a file at most. */
export const MOST_FRAMES = 20_000;

export function jointsOf(clip: Clip): number {
  return clip.rotations.length / 4 / Math.max(clip.frames, 1);
}

/** The pose of a frame, as views. Frames outside of the clip are its first and last one. */
export function poseAt(clip: Clip, frame: number): Pose {
  const at = Math.min(Math.max(Math.round(frame), 0), clip.frames - 1);
  const size = jointsOf(clip) * 4;
  return {
    root: clip.roots.subarray(at * 3, at * 3 + 3),
    rotations: clip.rotations.subarray(at * size, (at + 1) * size),
  };
}

export function copyPose({ root, rotations }: Pose): Pose {
  return { root: Float32Array.from(root), rotations: Float32Array.from(rotations) };
}

/** Frames `from` up to `to`, without it. */
export function slice(clip: Clip, from: number, to: number): Clip {
  const size = jointsOf(clip) * 4;
  return {
    fps: clip.fps,
    frames: to - from,
    roots: clip.roots.slice(from * 3, to * 3),
    rotations: clip.rotations.slice(from * size, to * size),
  };
}

export function join(parts: readonly Clip[]): Clip {
  const all = parts.filter((part) => part.frames > 0);
  const frames = all.reduce((sum, part) => sum + part.frames, 0);
  const roots = new Float32Array(frames * 3);
  const rotations = new Float32Array(all.reduce((sum, part) => sum + part.rotations.length, 0));
  let [r, q] = [0, 0];
  for (const part of all) {
    roots.set(part.roots, r);
    rotations.set(part.rotations, q);
    r += part.roots.length;
    q += part.rotations.length;
  }
  return { fps: all[0]?.fps ?? 30, frames, roots, rotations };
}

/** The clip at another rate: places on straight lines, rotations by slerp. */
export function resample(clip: Clip, fps: number): Clip {
  if (Math.abs(clip.fps - fps) < 1e-3) return { ...clip, fps };
  const joints = jointsOf(clip);
  const frames = Math.floor(((clip.frames - 1) / clip.fps) * fps + 1e-6) + 1;
  const roots = new Float32Array(frames * 3);
  const rotations = new Float32Array(frames * joints * 4);
  for (let f = 0; f < frames; f++) {
    const at = Math.min((f / fps) * clip.fps, clip.frames - 1);
    const a = Math.floor(at);
    const b = Math.min(a + 1, clip.frames - 1);
    for (let c = 0; c < 3; c++) {
      const from = clip.roots[a * 3 + c]!;
      roots[f * 3 + c] = from + (clip.roots[b * 3 + c]! - from) * (at - a);
    }
    for (let j = 0; j < joints; j++) {
      const [ia, ib] = [(a * joints + j) * 4, (b * joints + j) * 4];
      slerp(clip.rotations, ia, clip.rotations, ib, at - a, rotations, (f * joints + j) * 4);
    }
  }
  return { fps, frames, roots, rotations };
}

/** Which way a pose faces: the angle about +Y, 0 along +Z, radians. */
export function headingOf({ rotations }: Pose, leftAxis: Vector3): number {
  const left = leftAxis.clone().applyQuaternion(quaternionAt(rotations, 0));
  return Math.atan2(-left.z, left.x);
}

export function quaternionAt(rotations: Float32Array, joint: number): Quaternion {
  return new Quaternion().fromArray(rotations, joint * 4);
}

/** Turns a clip about the vertical and moves it over the ground, so that its first root stands and faces as `to` does. */
export function goOnFrom(clip: Clip, first: Pose, to: Pose, leftAxis: Vector3): Clip {
  const turn = new Quaternion().setFromAxisAngle(
    new Vector3(0, 1, 0),
    headingOf(to, leftAxis) - headingOf(first, leftAxis),
  );
  const roots = Float32Array.from(clip.roots);
  const rotations = Float32Array.from(clip.rotations);
  const size = jointsOf(clip) * 4;
  const place = new Vector3();
  for (let f = 0; f < clip.frames; f++) {
    place.fromArray(roots, f * 3);
    place.set(place.x - first.root[0]!, place.y, place.z - first.root[2]!).applyQuaternion(turn);
    place.set(place.x + to.root[0]!, place.y, place.z + to.root[2]!).toArray(roots, f * 3);
    turn
      .clone()
      .multiply(new Quaternion().fromArray(rotations, f * size))
      .toArray(rotations, f * size);
  }
  return { fps: clip.fps, frames: clip.frames, roots, rotations };
}
