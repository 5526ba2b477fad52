// Recorded motion for the demo: a BVH file as a skeleton and poses.
import { BVHLoader } from 'three/examples/jsm/loaders/BVHLoader.js';
import type { Bone, KeyframeTrack } from 'three';
import type { Pose, Skeleton } from '../types';

export interface Clip {
  skeleton: Skeleton;
  poses: Pose[];
  fps: number;
}

/** Length of the unit in which Troupe writes BVH files, metres. */
const UNIT_M = 0.01;

export function readBvh(text: string): Clip {
  const { skeleton: read, clip } = new BVHLoader().parse(text);
  const bones = read.bones.filter((bone) => bone.name !== 'ENDSITE');
  const index = new Map(bones.map((bone, b) => [bone as unknown, b]));
  const skeleton: Skeleton = {
    names: bones.map((bone) => bone.name),
    parents: Int16Array.from(bones, (bone) => index.get(bone.parent) ?? -1),
    offsets: Float32Array.from(bones.flatMap((bone: Bone) => bone.position.toArray().map((value) => value * UNIT_M))),
  };
  skeleton.offsets.fill(0, 0, 3);
  const tracks = new Map<string, KeyframeTrack>(clip.tracks.map((track) => [track.name, track]));
  const of = (name: string): KeyframeTrack => {
    const track = tracks.get(name);
    if (!track) throw new Error(`BVH: has no track ${name}`);
    return track;
  };
  const roots = of(`${bones[0]!.name}.position`);
  const turns = bones.map((bone) => of(`${bone.name}.quaternion`).values);
  const poses = Array.from({ length: roots.times.length }, (_, f): Pose => {
    const rotations = new Float32Array(bones.length * 4);
    turns.forEach((values, j) => {
      rotations.set(values.subarray(f * 4, f * 4 + 4), j * 4);
    });
    return { root: roots.values.slice(f * 3, f * 3 + 3).map((value) => value * UNIT_M), rotations };
  });
  return { skeleton, poses, fps: Math.round((poses.length - 1) / clip.duration) };
}
