// Keyframes that hold exactly in motion that was carried there and back. What the way lost at the
// keyframes is given back, and eases from those before the gap to those after it. Pure.
import { Quaternion, Vector3 } from 'three';
import type { Pose } from '../stage/types';
import { headingOf, poseAt, type Clip } from './clip';

/** A keyframe that a clip meets. What it does not give stays as the clip has it. */
export interface Held {
  frame: number;
  pose: Pose;
  givesRoot: boolean;
  givesPose: boolean;
}

/** What a keyframe differs by from a frame. */
interface Residual {
  place: Vector3;
  /** One for each joint, from the left. */
  turns: Quaternion[];
}

/** The clip with its keyframes. Those of `before` end where the gap begins, and those of `after` begin at its end. */
export function held(clip: Clip, before: readonly Held[], after: readonly Held[], leftAxis: Vector3): Clip {
  const made = { ...clip, roots: Float32Array.from(clip.roots), rotations: Float32Array.from(clip.rotations) };
  const poses = [...before, ...after].map((key) => ({ frame: key.frame, pose: placed(clip, key, leftAxis) }));
  const [from, to] = [poses[before.length - 1], poses[before.length]];
  if (from && to) {
    const [first, last] = [from, to].map(({ frame, pose }) => residual(poseAt(clip, frame), pose)) as [
      Residual,
      Residual,
    ];
    for (let f = from.frame + 1; f < to.frame; f++) {
      give(poseAt(made, f), first, last, eased((f - from.frame) / (to.frame - from.frame)));
    }
  }
  for (const { frame, pose } of poses) {
    const into = poseAt(made, frame);
    into.root.set(pose.root);
    into.rotations.set(pose.rotations);
  }
  return made;
}

function eased(share: number): number {
  return share * share * (3 - 2 * share);
}

/** The pose that a keyframe has in the clip: its own, as far as it gives it. */
function placed(clip: Clip, { frame, pose, givesRoot, givesPose }: Held, leftAxis: Vector3): Pose {
  if (givesRoot && givesPose) return pose;
  const made = poseAt(clip, frame);
  if (givesRoot) return { root: pose.root, rotations: made.rotations };
  // The server chooses place and heading.
  const rotations = Float32Array.from(pose.rotations);
  const turn = new Quaternion().setFromAxisAngle(
    new Vector3(0, 1, 0),
    headingOf(made, leftAxis) - headingOf(pose, leftAxis),
  );
  turn.multiply(new Quaternion().fromArray(rotations)).toArray(rotations);
  return { root: Float32Array.of(made.root[0]!, pose.root[1]!, made.root[2]!), rotations };
}

function residual(from: Pose, to: Pose): Residual {
  const turns = Array.from({ length: from.rotations.length / 4 }, (_, j) =>
    new Quaternion()
      .fromArray(to.rotations, j * 4)
      .multiply(new Quaternion().fromArray(from.rotations, j * 4).conjugate())
      .normalize(),
  );
  return { place: new Vector3().fromArray(to.root).sub(new Vector3().fromArray(from.root)), turns };
}

/** Changes a pose by what lies between two residuals. */
function give({ root, rotations }: Pose, first: Residual, last: Residual, share: number): void {
  new Vector3().fromArray(root).add(first.place.clone().lerp(last.place, share)).toArray(root);
  first.turns.forEach((turn, j) => {
    turn
      .clone()
      .slerp(last.turns[j]!, share)
      .multiply(new Quaternion().fromArray(rotations, j * 4))
      .normalize()
      .toArray(rotations, j * 4);
  });
}
