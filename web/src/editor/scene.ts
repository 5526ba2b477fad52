// What the editor shows on the stage: the clip, variants, keyframes, paths and handles.
import { Vector3 } from 'three';
import { groundLine, STAGES } from '../inside/overlays';
import type { Pose, Stage } from '../stage/types';
import type { Clip, Rig } from './clip';
import { copyPose, headingOf, poseAt } from './clip';
import type { Editor } from './editor';
import { Handles } from './handles';
import type { Doc } from './segment';
import { docPose, lengthOf, targetAt, targetPose } from './segment';
import type { EditorState } from './store';
import { docOf, isStale, useEditor } from './store';

/** Tint of what was captured, and of the keyframes. */
const GREY = 8;
const KEY_TINT = 0;
const CONTACT_TINT = 3;
/** Tints of variants, of the palette without grey. */
const VARIANT_TINTS = [0, 1, 2, 3, 4, 5, 6, 7];
/** Distance of variants that stand side by side, metres. */
const BESIDE_M = 1.3;
const PATHS = ['r_g3', 'r_g4'] as const;
/** Where the camera stands at first, from the left of the way on, radians. */
const ASIDE_RAD = 0.55;
const AHEAD_RAD = -1.15;

export function variantTint(variant: number): number {
  return VARIANT_TINTS[variant % VARIANT_TINTS.length]!;
}

interface Actor {
  tint: number;
  ghost: boolean;
  pose: Pose;
}

/** The direction in which variants stand side by side: to the left of the way through the gap. */
function sideOf({ clip, gap }: Doc, rig: Rig): Vector3 {
  const [first, last] = [poseAt(clip, gap.start), poseAt(clip, gap.end)];
  const way = new Vector3(last.root[0]! - first.root[0]!, 0, last.root[2]! - first.root[2]!);
  const heading = way.length() > 0.3 ? Math.atan2(way.x, way.z) : headingOf(first, rig.leftAxis);
  return new Vector3(Math.cos(heading), 0, -Math.sin(heading));
}

function shifted(pose: Pose, side: Vector3, metres: number): Pose {
  if (metres === 0) return pose;
  const moved = copyPose(pose);
  moved.root[0]! += side.x * metres;
  moved.root[2]! += side.z * metres;
  return moved;
}

function onGround({ roots, frames }: Clip, height: number): Float32Array {
  return Float32Array.from({ length: frames * 3 }, (_, i) => (i % 3 === 1 ? height : roots[i]!));
}

export class EditorScene {
  private readonly shown = new Map<string, Omit<Actor, 'pose'>>();
  private readonly handles: Handles;
  private lastRig: Rig | undefined;
  private drawn: EditorState | undefined;
  private time = 0;
  private gestures = 0;

  constructor(
    private readonly stage: Stage,
    private readonly editor: Editor,
  ) {
    this.handles = new Handles(stage, {
      onSelect: (handle) => {
        this.gestures++;
        useEditor.setState({ handle });
      },
      onMove: (name, place, turn) => {
        editor.moveHandle(name, place, turn, `handle ${this.gestures}`);
      },
      onEnd: () => {
        this.gestures++;
        editor.endGesture();
      },
    });
  }

  pixelOf(handle: string): { x: number; y: number } | undefined {
    return this.handles.pixelOf(handle);
  }

  /** A frame of the screen: time goes on, and what has changed is shown. */
  frame(dt: number): void {
    this.advance(dt);
    const state = useEditor.getState();
    if (state !== this.drawn) this.draw(state);
    this.handles.update();
  }

  /** Turns the camera to the gap: from the side, or from ahead where variants stand side by side. */
  lookAtGap(): void {
    const state = useEditor.getState();
    const { rig, layout, filled, chosen } = state;
    const doc = docOf(state);
    if (!doc || !rig) return;
    const { clip, gap } = doc;
    const [first, last] = [poseAt(clip, gap.start).root, poseAt(clip, gap.end).root];
    const count = layout === 'beside' ? (filled?.variants.length ?? 1) : 1;
    const side = sideOf(doc, rig);
    const spread = (count - 1) * BESIDE_M;
    const from_rad = Math.atan2(side.x, side.z) + (count > 1 ? AHEAD_RAD : ASIDE_RAD);
    const length = Math.hypot(last[0]! - first[0]!, last[2]! - first[2]!);
    const distance = count > 1 ? length * 0.8 + spread * 1.1 + 3.4 : length * 1.1 + 2.8;
    // The panels cover the right, so the middle of the picture is a little to the right of what it
    // shows.
    const middle = new Vector3((first[0]! + last[0]!) / 2, 0.6 * first[1]!, (first[2]! + last[2]!) / 2)
      .addScaledVector(side, count > 1 ? ((count - 1) / 2 - chosen) * BESIDE_M : 0)
      .addScaledVector(new Vector3(Math.cos(from_rad), 0, -Math.sin(from_rad)), 0.08 * distance);
    this.stage.setCamera([...middle.toArray(), from_rad, 1.22, distance]);
  }

  /** The character under a pointer is chosen, if it is a variant. */
  click(x: number, y: number): void {
    if (this.handles.isUnderPointer) return;
    const variant = /^variant-(\d+)$/.exec(this.stage.pick(x, y).character ?? '')?.[1];
    if (variant !== undefined) this.editor.choose(Number(variant));
    else useEditor.setState({ handle: undefined });
  }

  dispose(): void {
    this.handles.dispose();
    this.clear();
  }

  private advance(dt: number): void {
    const { isPlaying, frame, loopsGap } = useEditor.getState();
    const doc = this.editor.doc;
    if (!isPlaying || !doc) {
      this.time = 0;
      return;
    }
    this.time += dt * doc.clip.fps;
    const whole = Math.floor(this.time);
    if (whole === 0) return;
    this.time -= whole;
    const [from, to] = loopsGap ? [doc.gap.start, doc.gap.end] : [0, doc.clip.frames - 1];
    const next = frame + whole;
    this.editor.setFrame(frame < from || next > to ? from : next);
  }

  private draw(state: EditorState): void {
    const before = this.drawn;
    this.drawn = state;
    const doc = docOf(state);
    const { rig } = state;
    if (!doc || !rig || rig !== this.lastRig) this.clear();
    this.lastRig = rig;
    if (!doc || !rig) return;
    this.cast(rig, this.actors(state, doc, rig));
    this.drawContacts(state, rig);
    this.handles.set(this.editor.handlePoints(), state.handle, state.turns);
    const isSame = before && docOf(before) === doc && before.filled === state.filled && before.chosen === state.chosen;
    const isSameView = isSame && before.layout === state.layout && before.showsInside === state.showsInside;
    const posed = targetAt(doc, state.frame);
    const wasPosed = before && docOf(before) ? targetAt(docOf(before)!, before.frame) : undefined;
    if (!isSameView || posed !== wasPosed || before.showsCaptured !== state.showsCaptured) {
      this.drawKeyframes(doc, rig, posed);
      this.drawPaths(state, doc);
    }
  }

  /** Who is on the stage at the playhead. */
  private actors(state: EditorState, doc: Doc, rig: Rig): Map<string, Actor> {
    const { frame, filled, chosen, layout, showsCaptured, captured, isPlaying } = state;
    const actors = new Map<string, Actor>();
    const at = filled ? frame - filled.doc.gap.start : -1;
    const isPosing = !isPlaying && targetAt(doc, frame) !== undefined && (isStale(state) || state.handle !== undefined);
    const isInside = filled !== undefined && at >= 0 && frame <= filled.doc.gap.end && !isPosing;
    // In the context frames all variants are the clip: bodies at one place would show through each other.
    const isAlike = isInside && at < rig.limits.contextFrames;
    if (isInside) {
      const side = sideOf(filled.doc, rig);
      filled.variants.forEach(({ clip }, v) => {
        if ((layout === 'one' || (layout === 'over' && isAlike)) && v !== chosen) return;
        const pose = shifted(poseAt(clip, at), side, layout === 'beside' ? (v - chosen) * BESIDE_M : 0);
        actors.set(`variant-${v}`, { tint: variantTint(v), ghost: layout === 'over' && v !== chosen, pose });
      });
    } else {
      actors.set('main', { tint: KEY_TINT, ghost: false, pose: docPose(doc, frame) });
    }
    const differs =
      (isInside && !isAlike) || doc.targets[targetAt(doc, frame) ?? -1]?.edited !== undefined || doc.clip !== captured;
    if (showsCaptured && captured && differs && frame < captured.frames) {
      actors.set('captured', { tint: GREY, ghost: true, pose: poseAt(captured, frame) });
    }
    return actors;
  }

  private cast(rig: Rig, actors: Map<string, Actor>): void {
    for (const [id, was] of this.shown) {
      const now = actors.get(id);
      if (now?.ghost === was.ghost && now.tint === was.tint) continue;
      this.stage.remove(id);
      this.shown.delete(id);
    }
    for (const [id, { tint, ghost, pose }] of actors) {
      if (!this.shown.has(id)) {
        this.stage.add(id, rig.skeleton, { tint, ghost });
        this.shown.set(id, { tint, ghost });
      }
      this.stage.pose(id, pose);
    }
  }

  /** Discs under the joints of the chosen variant that stand, as the decoder has it. */
  private drawContacts({ showsInside, filled, chosen, frame }: EditorState, { contactJoints }: Rig): void {
    const id = `variant-${chosen}`;
    const joints = showsInside && this.shown.has(id) ? this.stage.jointPositions(id) : undefined;
    const variant = filled?.variants[chosen];
    const from =
      filled && variant ? Math.min(frame - filled.doc.gap.start, variant.clip.frames - 1) * contactJoints.length : 0;
    const places = contactJoints.flatMap((joint, c) =>
      joints && (variant?.contacts[from + c] ?? 0) > 0.5 ? [joints[joint * 3]!, 0.012, joints[joint * 3 + 2]!] : [],
    );
    this.stage.discs('contacts', places.length > 0 ? Float32Array.from(places) : null, CONTACT_TINT);
  }

  private drawKeyframes(doc: Doc, rig: Rig, posed: number | undefined): void {
    const context = [poseAt(doc.clip, doc.gap.start + rig.limits.contextFrames - 1)];
    const targets = doc.targets.flatMap((_, t) => (t === posed ? [] : [targetPose(doc, t)]));
    this.stage.ghosts('context', rig.skeleton, context, 0.3, GREY);
    this.stage.ghosts('targets', rig.skeleton, targets.length > 0 ? targets : null, 0.3, KEY_TINT);
  }

  private drawPaths({ filled, chosen, layout, showsInside, captured, showsCaptured }: EditorState, doc: Doc): void {
    const { gap } = filled?.doc ?? doc;
    const own = captured && gap.end < captured.frames ? captured : doc.clip;
    const way = onGround(own, 0.012).slice(gap.start * 3, (gap.start + lengthOf(gap)) * 3);
    this.stage.line('captured', showsCaptured ? way : null, { tint: GREY, width_m: 0.025, dashed: true });
    const variants = filled?.variants ?? [];
    for (let v = 0; v < VARIANT_TINTS.length; v++) {
      const clip = variants[v]?.clip;
      const isShown = clip && layout !== 'beside' && (layout === 'over' || v === chosen);
      const style = { tint: variantTint(v), width_m: v === chosen ? 0.035 : 0.015 };
      this.stage.line(`variant-${v}`, isShown ? onGround(clip, 0.016 + 0.001 * v) : null, style);
    }
    const inside = showsInside ? variants[chosen]?.intermediates : undefined;
    PATHS.forEach((name, nth) => {
      const { tint } = STAGES.find((one) => one.name === name)!;
      const numbers = inside?.[name === 'r_g3' ? 'root_r_g3' : 'root_r_g4'] ?? [];
      const line = numbers.length > 5 ? groundLine(numbers, 0.03 + 0.004 * nth) : null;
      this.stage.line(name, line, { tint, width_m: 0.03, dashed: name === 'r_g3' });
    });
  }

  private clear(): void {
    for (const id of this.shown.keys()) this.stage.remove(id);
    this.shown.clear();
    this.handles.set([], undefined, false);
    if (this.lastRig) for (const name of ['context', 'targets']) this.stage.ghosts(name, this.lastRig.skeleton, null);
    this.stage.discs('contacts', null, CONTACT_TINT);
    for (const name of ['captured', ...PATHS]) this.stage.line(name, null, { tint: GREY });
    for (let v = 0; v < VARIANT_TINTS.length; v++) this.stage.line(`variant-${v}`, null, { tint: GREY });
  }
}
