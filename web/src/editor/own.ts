// Clips on a rig of the user's own: read on their own joints, carried to the pack's body for the
// server, and back.
import type { Body, Retargeter } from '../reader/troupe_reader_web';
import type { Certificate } from '../retarget/certificate';
import { loadReader } from '../retarget/reader';
import type { Source } from '../retarget/source';
import { join, poseAt, slice, type Clip, type Rig } from './clip';
import { understandOwn, type Given, type OwnUnderstood } from './reading';
import type { Variant } from './request';
import { held, type Held } from './residual';
import { lengthOf, targetPose, type Doc } from './segment';

/** A rig of the user's own beside the pack whose server fills its gaps. */
export interface OwnRig {
  /** The pack's limits and rate, on the user's joints. */
  rig: Rig;
  pack: Rig;
  body: Body;
  /** From the user's rig to the pack's body, and back. */
  there: Retargeter;
  back: Retargeter;
  /** What is kept on the way back: of motion of the pack on the user's rig. */
  certificate: Certificate;
  /** The file, if it is a glb or vrm, whose mesh is kept. */
  glb: Uint8Array<ArrayBuffer> | undefined;
}

/** A file on its own rig, fitted to a pack. */
export interface OwnClip extends Pick<OwnUnderstood, 'rows' | 'animations'> {
  own: OwnRig;
  /** None for a character's file without a motion. */
  clip: Clip | undefined;
}

/** Frames before the gap that are carried too, so that what depends on frames before has begun. */
const LEAD = 15;

/** Reads a file on its own rig. Throws an error that says why it does not go together with the pack's body. */
export async function openOwn(
  name: string,
  bytes: Uint8Array<ArrayBuffer>,
  pack: Rig,
  source: Source,
  given: Given,
): Promise<OwnClip> {
  const reader = await loadReader();
  const { skeleton, leftAxis, body, clip, rows, animations } = await understandOwn(name, bytes, pack, given);
  try {
    const there = new reader.Retargeter(body, source.body);
    const back = new reader.Retargeter(source.body, body);
    const certificate = JSON.parse(back.certificate()) as Certificate;
    const rig = { ...pack, skeleton, leftAxis, hinges: [], mimics: [], contactJoints: [] };
    const glb = /\.(glb|vrm)$/i.test(name) ? bytes : undefined;
    return { own: { rig, pack, body, there, back, certificate, glb }, clip, rows, animations };
  } catch (error) {
    throw new Error(`${name}: ${error instanceof Error ? error.message : String(error)}`, { cause: error });
  }
}

/** A clip on the joints that a retargeter carries it to. */
export function carried(retargeter: Retargeter, clip: Clip): Clip {
  const made = retargeter.carry(clip.fps, clip.roots, clip.rotations);
  const { roots, rotations } = made;
  made.free();
  return { fps: clip.fps, frames: clip.frames, roots, rotations };
}

/** The document's segment on the pack's body: its keyframes are as they were posed. */
export function packDoc({ there }: OwnRig, doc: Doc): Doc {
  const { clip, gap, targets } = doc;
  const lead = Math.max(0, gap.start - LEAD);
  const posed = targets.map((_, t) => {
    const { root, rotations } = targetPose(doc, t);
    return { fps: clip.fps, frames: 1, roots: root, rotations };
  });
  const way = join([slice(clip, lead, gap.end + 1 - targets.length), ...posed]);
  const whole = carried(there, way);
  return {
    clip: slice(whole, gap.start - lead, whole.frames),
    gap: { start: 0, end: lengthOf(gap) - 1 },
    targets: targets.map(({ givesRoot, givesPose }) => ({ givesRoot, givesPose })),
  };
}

/** A variant of the pack's body on the user's rig. The keyframes are exactly the document's. */
export function ownVariant({ rig, back }: OwnRig, doc: Doc, variant: Variant): Variant {
  const { contextFrames } = rig.limits;
  const { frames } = variant.clip;
  const context = Array.from({ length: contextFrames }, (_, c): Held => ({
    frame: c,
    pose: poseAt(doc.clip, doc.gap.start + c),
    givesRoot: true,
    givesPose: true,
  }));
  const targets = doc.targets.map(({ givesRoot, givesPose }, t): Held => {
    return { frame: frames - doc.targets.length + t, pose: targetPose(doc, t), givesRoot, givesPose };
  });
  const clip = held(carried(back, variant.clip), context, targets, rig.leftAxis);
  const { intermediates } = variant;
  if (!intermediates) return { ...variant, clip };
  const [root_r_g3, root_r_g4] = [intermediates.root_r_g3, intermediates.root_r_g4].map((numbers) =>
    // Five numbers a frame: the first three are a place.
    numbers.map((value, i) => (i % 5 < 3 ? value * back.scale : value)),
  ) as [number[], number[]];
  return { ...variant, clip, intermediates: { ...intermediates, root_r_g3, root_r_g4 } };
}

/** The user's file with a clip as one animation more, or `undefined` if the file is no glb. */
export function dressed({ body, glb }: OwnRig, clip: Clip, name: string): Blob | undefined {
  if (!glb) return undefined;
  const made = body.dress(glb, name, clip.fps, clip.roots, clip.rotations);
  return new Blob([made as Uint8Array<ArrayBuffer>], { type: 'model/gltf-binary' });
}
