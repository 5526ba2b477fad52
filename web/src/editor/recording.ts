// What a file holds, before it is on a skeleton: named joints and their places in the world.
import { Quaternion, Vector3 } from 'three';
import { MOST_FRAMES, resample, type Clip, type Rig } from './clip';

export interface Recording {
  names: readonly string[];
  fps: number;
  frames: number;
  /** 3 per joint per frame: places in the world, metres. */
  places: Float32Array;
  /** 4 per joint per frame: rotations in the world, x y z w. */
  turns: Float32Array;
}

/** How far a joint may stand from the skeleton's offset, metres. */
const MOST_OFFSET_ERROR_M = 0.02;

/** How many frames of `joints` joints a file may have. */
export function checkLength(frames: number, file: string): void {
  if (frames < 1) throw new Error(`${file}: has no frames`);
  if (frames > MOST_FRAMES) throw new Error(`${file}: has ${frames} frames; at most ${MOST_FRAMES} are read`);
}

/** The recording on a pack's skeleton, at the pack's rate. Joints go by name; others are folded into their descendants. */
export function onSkeleton(recording: Recording, rig: Rig, file: string): Clip {
  const { skeleton } = rig;
  const index = new Map<string, number>();
  recording.names.forEach((name, i) => {
    if (!index.has(name)) index.set(name, i);
  });
  const missing = skeleton.names.filter((name) => !index.has(name));
  if (missing.length > 0) {
    const some = missing.slice(0, 8).join(', ') + (missing.length > 8 ? `, and ${missing.length - 8} more` : '');
    throw new Error(
      `${file}: lacks ${missing.length} of the ${skeleton.names.length} joints of pack ${rig.pack}: ${some}`,
    );
  }
  const taken = skeleton.names.map((name) => index.get(name)!);
  const all = recording.names.length;
  const joints = taken.length;
  const roots = new Float32Array(recording.frames * 3);
  const rotations = new Float32Array(recording.frames * joints * 4);
  const [place, parentPlace, offset] = [new Vector3(), new Vector3(), new Vector3()];
  const [turn, back] = [new Quaternion(), new Quaternion()];
  let worst = { error_m: 0, joint: 0, frame: 0 };
  for (let f = 0; f < recording.frames; f++) {
    for (let j = 0; j < joints; j++) {
      const at = f * all + taken[j]!;
      place.fromArray(recording.places, at * 3);
      turn.fromArray(recording.turns, at * 4);
      const parent = skeleton.parents[j]!;
      if (parent < 0) {
        place.toArray(roots, f * 3);
      } else {
        const from = f * all + taken[parent]!;
        back.fromArray(recording.turns, from * 4).invert();
        place.sub(parentPlace.fromArray(recording.places, from * 3)).applyQuaternion(back);
        const error_m = place.distanceTo(offset.fromArray(skeleton.offsets, j * 3));
        if (error_m > worst.error_m) worst = { error_m, joint: j, frame: f };
        turn.premultiply(back);
      }
      turn.normalize().toArray(rotations, (f * joints + j) * 4);
    }
  }
  if (worst.error_m > MOST_OFFSET_ERROR_M) {
    const where = `joint ${skeleton.names[worst.joint]} stands ${worst.error_m.toFixed(3)} m from its place in pack ${rig.pack}`;
    throw new Error(`${file}: ${where} (frame ${worst.frame}); allowed: ${MOST_OFFSET_ERROR_M} m. The bones differ.`);
  }
  return resample({ fps: recording.fps, frames: recording.frames, roots, rotations }, rig.fps);
}
