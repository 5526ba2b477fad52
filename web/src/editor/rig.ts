// From a pack's description to a rig.
import { Quaternion, Vector3 } from 'three';
import type { Body, Pack, Vec3 } from '../wire/types';
import { skeletonOf } from '../live/bodies';
import type { Rig } from './clip';

function vector(v: Vec3 | null | undefined): Vector3 {
  return new Vector3(v?.x ?? 0, v?.y ?? 0, v?.z ?? 0);
}

function quaternion(q: { x: number; y: number; z: number; w: number } | null | undefined): Quaternion {
  return q ? new Quaternion(q.x, q.y, q.z, q.w) : new Quaternion();
}

/** The rig of a pack, or of one of its bodies. */
export function rigOf(pack: Pack, body?: Body): Rig {
  const { joints, contact_joints, left_axis, robot } = body ?? pack;
  const skeleton = skeletonOf(joints);
  const hinges = (robot?.hinges ?? []).map(({ joint, axis, rest, lower, upper }) => ({
    joint: skeleton.names.indexOf(joint),
    axis: vector(axis),
    rest: quaternion(rest),
    lower_rad: lower,
    upper_rad: upper,
  }));
  const mimics = (robot?.mimics ?? []).map(({ joint, follows, multiplier, offset, axis, rest }) => ({
    joint: skeleton.names.indexOf(joint),
    follows: skeleton.names.indexOf(follows),
    multiplier,
    offset_rad: offset,
    axis: vector(axis),
    rest: quaternion(rest),
  }));
  return {
    pack: pack.name,
    fps: pack.fps,
    skeleton,
    leftAxis: left_axis ? vector(left_axis) : new Vector3(1, 0, 0),
    hinges,
    mimics,
    contactJoints: contact_joints.map((name) => skeleton.names.indexOf(name)),
    limits: {
      contextFrames: pack.context_frames,
      maxTargets: pack.max_targets,
      minFrames: pack.min_frames,
      maxFrames: pack.max_frames,
      framesPerToken: pack.frames_per_token,
    },
  };
}
