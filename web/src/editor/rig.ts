// From a pack's description to a rig.
import { Quaternion, Vector3 } from 'three';
import type { Pack, Vec3 } from '../wire/types';
import { skeletonOf } from '../live/bodies';
import type { Rig } from './clip';

function vector(v: Vec3 | null | undefined): Vector3 {
  return new Vector3(v?.x ?? 0, v?.y ?? 0, v?.z ?? 0);
}

export function rigOf(pack: Pack): Rig {
  const skeleton = skeletonOf(pack.joints);
  const hinges = (pack.robot?.hinges ?? []).map(({ joint, axis, rest, lower, upper }) => ({
    joint: skeleton.names.indexOf(joint),
    axis: vector(axis),
    rest: rest ? new Quaternion(rest.x, rest.y, rest.z, rest.w) : new Quaternion(),
    lower_rad: lower,
    upper_rad: upper,
  }));
  return {
    pack: pack.name,
    fps: pack.fps,
    skeleton,
    leftAxis: pack.left_axis ? vector(pack.left_axis) : new Vector3(1, 0, 0),
    hinges,
    contactJoints: pack.contact_joints.map((name) => skeleton.names.indexOf(name)),
    limits: {
      contextFrames: pack.context_frames,
      maxTargets: pack.max_targets,
      minFrames: pack.min_frames,
      maxFrames: pack.max_frames,
      framesPerToken: pack.frames_per_token,
    },
  };
}
