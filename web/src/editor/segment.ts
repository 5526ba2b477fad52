// What is to be filled: a segment of the clip, its keyframes, and the limits that the pack sets.
// Pure.
import type { Clip, Limits, Rig } from './clip';
import { poseAt } from './clip';
import type { Pose } from '../stage/types';

/** First context frame and last target frame, both within the clip. */
export interface Gap {
  start: number;
  end: number;
}

/** A keyframe at the end. What it does not give is free. */
export interface Target {
  givesRoot: boolean;
  givesPose: boolean;
  /** A pose of its own; `undefined`: as captured. */
  edited?: Pose;
}

/** All that can be undone. */
export interface Doc {
  clip: Clip;
  gap: Gap;
  /** Consecutive; the last is at the gap's end. */
  targets: readonly Target[];
}

/** Frames of the first gap, where the clip has room. */
const FIRST_FRAMES = 40;

const clamp = (value: number, low: number, high: number): number => Math.min(Math.max(value, low), high);

export function lengthOf({ start, end }: Gap): number {
  return end - start + 1;
}

export function newDoc(clip: Clip, { limits }: Rig, file: string): Doc {
  if (clip.frames < limits.minFrames) {
    throw new Error(`${file}: has ${clip.frames} frames; a segment has ${limits.minFrames} to ${limits.maxFrames}`);
  }
  const length = clamp(Math.min(FIRST_FRAMES, clip.frames), limits.minFrames, limits.maxFrames);
  const start = Math.floor((clip.frames - length) / 3);
  return { clip, gap: { start, end: start + length - 1 }, targets: [{ givesRoot: true, givesPose: true }] };
}

/** Moves the first context frame, as far as clip and limits allow. */
export function withStart({ end }: Gap, start: number, { minFrames, maxFrames }: Limits): Gap {
  return { start: clamp(Math.round(start), Math.max(0, end - maxFrames + 1), end - minFrames + 1), end };
}

/** Moves the last target frame, as far as clip and limits allow. */
export function withEnd({ start }: Gap, end: number, { minFrames, maxFrames }: Limits, clipFrames: number): Gap {
  return { start, end: clamp(Math.round(end), start + minFrames - 1, Math.min(clipFrames, start + maxFrames) - 1) };
}

/** Moves the whole segment. */
export function moved(gap: Gap, by: number, clipFrames: number): Gap {
  const step = clamp(Math.round(by), -gap.start, clipFrames - 1 - gap.end);
  return { start: gap.start + step, end: gap.end + step };
}

/** The clip's frame of a target. */
export function targetFrame({ gap, targets }: Doc, target: number): number {
  return gap.end - (targets.length - 1 - target);
}

/** The target at a frame of the clip. */
export function targetAt({ gap, targets }: Doc, frame: number): number | undefined {
  const target = targets.length - 1 - (gap.end - frame);
  return target >= 0 && target < targets.length ? target : undefined;
}

export function targetPose(doc: Doc, target: number): Pose {
  return doc.targets[target]?.edited ?? poseAt(doc.clip, targetFrame(doc, target));
}

/** The pose of a frame as the document has it: captured, or that of a target. */
export function docPose(doc: Doc, frame: number): Pose {
  const target = targetAt(doc, frame);
  return target === undefined ? poseAt(doc.clip, frame) : targetPose(doc, target);
}

/** Adds a keyframe in front of the others. */
export function withTarget(doc: Doc, { maxTargets, contextFrames }: Limits): Doc {
  const room = lengthOf(doc.gap) - contextFrames;
  if (doc.targets.length >= Math.min(maxTargets, room)) return doc;
  return { ...doc, targets: [{ givesRoot: true, givesPose: true }, ...doc.targets] };
}

/** Takes a keyframe away; the last one stays. Those before it move towards the end. */
export function withoutTarget(doc: Doc, target: number): Doc {
  if (doc.targets.length <= 1 || !doc.targets[target]) return doc;
  return { ...doc, targets: doc.targets.filter((_, t) => t !== target) };
}

/** Changes a keyframe. One that would give nothing stays as it is. */
export function changedTarget(doc: Doc, target: number, change: Partial<Target>): Doc {
  const old = doc.targets[target];
  if (!old) return doc;
  const now = { ...old, ...change };
  if (!now.givesRoot && !now.givesPose) return doc;
  return { ...doc, targets: doc.targets.map((one, t) => (t === target ? now : one)) };
}

/** A keyframe as it was captured. */
export function resetTarget(doc: Doc, target: number): Doc {
  const old = doc.targets[target];
  if (!old?.edited) return doc;
  const { givesRoot, givesPose } = old;
  return { ...doc, targets: doc.targets.map((one, t) => (t === target ? { givesRoot, givesPose } : one)) };
}

/** The part of a clip that the timeline shows, in frames. */
export interface Range {
  from: number;
  to: number;
}

/** Fewest frames that the timeline shows. */
const FEWEST_SHOWN = 16;

/** The range brought nearer by a factor above 1, around the frame `at`. */
export function zoomed({ from, to }: Range, factor: number, at: number, clipFrames: number): Range {
  const shown = clamp((to - from) / factor, Math.min(FEWEST_SHOWN, clipFrames), clipFrames);
  const share = to > from ? (at - from) / (to - from) : 0.5;
  return panned({ from: at - share * shown, to: at + (1 - share) * shown }, 0, clipFrames);
}

export function panned({ from, to }: Range, by: number, clipFrames: number): Range {
  const shown = Math.min(to - from, clipFrames);
  const start = clamp(from + by, 0, clipFrames - shown);
  return { from: start, to: start + shown };
}

/** Distance of the ruler's numbers, frames: the finest of 1, 2, 5 and so on with `pixels` of room for each. */
export function rulerStep(pixelsPerFrame: number, pixels = 44): number {
  for (let ten = 1; ; ten *= 10) {
    for (const step of [ten, 2 * ten, 5 * ten]) if (step * pixelsPerFrame >= pixels) return step;
  }
}
