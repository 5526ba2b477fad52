// From the document to a request of POST /v1/inbetween, and from its answer to variants.
import type { Pose } from '../stage/types';
import { toXyzw } from '../live/character';
import type { InBetweenRequest, InBetweenResponse, Intermediates, Keyframe } from '../wire/types';
import type { Clip, Rig } from './clip';
import { headingOf, poseAt } from './clip';
import type { Doc, Target } from './segment';
import { lengthOf, targetPose } from './segment';

export interface FillOptions {
  /** One character for each. */
  seeds: readonly number[];
  temperature: number;
  poseSteps: number;
  holdFeet: boolean;
  /** Whether the model chooses the length, instead of the gap as it is marked. */
  modelsLength: boolean;
}

/** One way to fill the gap. */
export interface Variant {
  seed: number;
  clip: Clip;
  /** Per frame and contact joint, 0 to 1. */
  contacts: readonly number[];
  intermediates?: Intermediates;
}

/** Seven digits: what the server's single precision holds. */
function short(value: number): number {
  return Number(value.toPrecision(7));
}

function keyframe(rig: Rig, pose: Pose, { givesRoot, givesPose }: Target): Keyframe {
  const key: Keyframe = {};
  const [x, y, z] = Array.from(pose.root, short) as [number, number, number];
  if (givesRoot) {
    // With a pose the server takes the heading from its first joint.
    const heading = givesPose ? {} : { heading: short(headingOf(pose, rig.leftAxis)) };
    key.root = { position: { x, y, z }, ...heading };
  }
  if (givesPose) {
    const rotations: number[] = [];
    for (let q = 0; q < pose.rotations.length; q += 4) {
      const [qx, qy, qz, qw] = [0, 1, 2, 3].map((c) => short(pose.rotations[q + c]!)) as [
        number,
        number,
        number,
        number,
      ];
      rotations.push(qw, qx, qy, qz);
    }
    key.pose = givesRoot ? { rotations } : { rotations, root_height: y };
  }
  return key;
}

/** One request with a character for each seed. */
export function fillRequest(rig: Rig, doc: Doc, options: FillOptions): InBetweenRequest {
  const whole: Target = { givesRoot: true, givesPose: true };
  const context = Array.from({ length: rig.limits.contextFrames }, (_, c) =>
    keyframe(rig, poseAt(doc.clip, doc.gap.start + c), whole),
  );
  const targets = doc.targets.map((target, t) => keyframe(rig, targetPose(doc, t), target));
  return {
    pack: rig.pack,
    characters: options.seeds.map((seed) => ({
      id: `seed-${seed}`,
      context,
      targets,
      ...(options.modelsLength ? {} : { frame_count: lengthOf(doc.gap) }),
      seed,
      temperature: options.temperature,
      pose_steps: options.poseSteps,
      hold_feet: options.holdFeet,
      return_intermediates: true,
    })),
  };
}

/** The answer's characters, in the order of the seeds. */
export function variantsOf(rig: Rig, answer: InBetweenResponse, seeds: readonly number[]): Variant[] {
  return answer.characters.map(({ frames, intermediates }, nth) => {
    if (!frames) throw new Error(`the answer has no frames of character ${nth}`);
    const clip: Clip = {
      fps: rig.fps,
      frames: frames.frame_count,
      roots: Float32Array.from(frames.root_positions),
      rotations: toXyzw(frames.rotations),
    };
    return {
      seed: seeds[nth]!,
      clip,
      contacts: frames.contacts,
      ...(intermediates ? { intermediates } : {}),
    };
  });
}
