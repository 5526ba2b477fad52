// The editor at work: opens clips, changes the document, asks the server, hands out files.
import { Quaternion, Vector3 } from 'three';
import { notice } from '../live/store';
import { sourceOf } from '../retarget/source';
import { forward } from '../stage/kinematics';
import type { Pose } from '../stage/types';
import type { Api } from '../wire/api';
import { ApiError } from '../wire/api';
import type { Clip, Rig } from './clip';
import { copyPose, goOnFrom, join, poseAt, quaternionAt, slice } from './clip';
import { bytesOf, readClip, save, writeClip, type Format } from './files';
import type { HandlePoint } from './handles';
import { begin, change, endGesture, redo, undo } from './history';
import { reach } from './ik';
import { limbsOf, type Limb } from './limbs';
import { carried, dressed, openOwn, ownVariant, packDoc, type OwnRig } from './own';
import { fillRequest, variantsOf, type FillOptions } from './request';
import { Misread, needsOwnRig, optionsFor, type Given, type Row } from './reading';
import { rigOf } from './rig';
import type { Doc, Gap, Target } from './segment';
import * as segment from './segment';
import { chosenVariant, docOf, packRigOf, useEditor, type Reading } from './store';
import { serversWalk } from './walk';

/** Name of the clip that the server makes. */
export const WALK = 'walk';
export const ROOT = 'root';

export type Scope = 'segment' | 'clip';

export class Editor {
  private readonly rigs = new Map<string, Rig>();
  private opened: File | undefined;
  private asked = 0;
  private isDisposed = false;
  private limbs: { of: Clip; found: Limb[] } | undefined;

  constructor(readonly api: Api) {}

  /** Loads the packs that fill gaps, and chooses one. */
  async start(wanted: string): Promise<void> {
    const packs = (await this.api.packs()).filter((pack) => pack.capabilities.includes('inbetween'));
    const pack = packs.find(({ name }) => name === wanted) ?? packs.find((one) => one.is_default) ?? packs[0];
    if (this.isDisposed) return;
    if (!pack) throw new Error('the server has no pack that fills gaps (capability inbetween)');
    useEditor.setState({ packs });
    await this.choosePack(pack.name);
  }

  /** Changes to a pack. A clip that was opened is read again, if it has the pack's joints. */
  async choosePack(name: string): Promise<void> {
    const rig = this.rigs.get(name) ?? rigOf(await this.api.pack(name));
    this.rigs.set(name, rig);
    const { reading } = useEditor.getState();
    if (packRigOf(useEditor.getState()) === rig) return;
    const given = reading?.given;
    useEditor.setState({ rig, own: undefined });
    this.clear();
    if (this.opened) await this.open(this.opened, given);
  }

  /**
   * Opens a file. The reader's options decide what it leaves open. One with another skeleton than the pack's is opened
   * on its own rig.
   */
  async open(file: File, given: Given = {}): Promise<void> {
    const { reading, ...state } = useEditor.getState();
    const rig = packRigOf(state);
    if (!rig) return;
    await this.busy(async () => {
      const isOpen = this.opened === file && reading?.isOpen === true;
      this.opened = file;
      const as = { file: file.name, options: await optionsFor(rig), given, isOpen };
      try {
        const animations = await this.readOnPack(file, rig, given).catch((error: unknown) => {
          if (needsOwnRig(error, file.name)) return this.readOnOwn(file, rig, given, error);
          throw error;
        });
        this.showReading({ ...as, animations, asked: [] });
      } catch (error) {
        const { animations, options: asked } = error instanceof Misread ? error : { animations: [], options: [] };
        this.showReading({ ...as, animations, asked, isOpen: isOpen || asked.length > 0 });
        throw error;
      }
    }, true);
  }

  /** Opens the last file on its own rig, even if its figures are beyond the bar. */
  async openOnOwn(): Promise<void> {
    const { reading, ...state } = useEditor.getState();
    const rig = packRigOf(state);
    const file = this.opened;
    if (!rig || !file) return;
    const given = reading?.given ?? {};
    await this.busy(async () => {
      const animations = await this.readOnOwn(file, rig, given, undefined, true);
      this.showReading({
        file: file.name,
        options: await optionsFor(rig),
        given,
        animations,
        asked: [],
        isOpen: false,
      });
    }, true);
  }

  private async readOnPack(file: File, rig: Rig, given: Given): Promise<readonly string[]> {
    const { clip, rows, animations } = await readClip(file, rig, given);
    useEditor.setState({ rig, own: undefined });
    this.show(clip, file.name, rows);
    return animations;
  }

  /** Opens a file on its own rig. `why` it is not on the pack's. */
  private async readOnOwn(
    file: File,
    pack: Rig,
    given: Given,
    why: Misread | undefined,
    anyway = false,
  ): Promise<readonly string[]> {
    const bytes = await bytesOf(file);
    const found = await sourceOf(this.api, pack.pack, '')
      .then((source) => openOwn(file.name, bytes, pack, source, given))
      .catch((error: unknown) => {
        if (!why) throw error;
        why.message += `. On its own rig: ${error instanceof Error ? error.message : String(error)}`;
        throw why;
      });
    const { own, rows, animations } = found;
    if (own.certificate.faults.length > 0 && !anyway) {
      this.clear();
      useEditor.setState({ rig: pack, own: undefined, refused: { file: file.name, certificate: own.certificate } });
      return animations;
    }
    const clip = found.clip ?? carried(own.back, await serversWalk(this.api, pack));
    useEditor.setState({ rig: own.rig, own });
    this.show(clip, file.name, rows);
    return animations;
  }

  /** Reads the file again with another value of an option. Without one, the file decides. */
  async readAs(option: string, value: string | undefined): Promise<void> {
    const { reading, isBusy } = useEditor.getState();
    if (!reading || !this.opened || isBusy) return;
    await this.open(this.opened, { ...reading.given, [option]: value });
  }

  /** Opens a clip that the server's own character walks. On the user's own rig it is carried over to that. */
  async walk(): Promise<void> {
    const { own, ...state } = useEditor.getState();
    const pack = packRigOf({ ...state, own });
    if (!pack) return;
    await this.busy(async () => {
      const walk = await serversWalk(this.api, pack);
      this.show(own ? carried(own.back, walk) : walk, WALK);
      this.opened = undefined;
    });
  }

  // The document.

  get doc(): Doc | undefined {
    return docOf(useEditor.getState());
  }

  /** Changes the document. Changes of one gesture are one step of undo. */
  edit(by: (doc: Doc, rig: Rig) => Doc, gesture?: string): void {
    const { history, rig } = useEditor.getState();
    if (!history || !rig) return;
    useEditor.setState({ history: change(history, by(history.now, rig), gesture) });
  }

  endGesture(): void {
    const { history } = useEditor.getState();
    if (history) useEditor.setState({ history: endGesture(history) });
  }

  undo(): void {
    const { history } = useEditor.getState();
    if (history) useEditor.setState({ history: undo(history) });
    this.setFrame(useEditor.getState().frame);
  }

  redo(): void {
    const { history } = useEditor.getState();
    if (history) useEditor.setState({ history: redo(history) });
    this.setFrame(useEditor.getState().frame);
  }

  setGap(by: (gap: Gap, rig: Rig, clipFrames: number) => Gap, gesture: string): void {
    this.edit((doc, rig) => {
      const gap = by(doc.gap, rig, doc.clip.frames);
      return gap.start === doc.gap.start && gap.end === doc.gap.end ? doc : { ...doc, gap };
    }, gesture);
  }

  addTarget(): void {
    this.edit((doc, rig) => segment.withTarget(doc, rig.limits));
  }

  removeTarget(target: number): void {
    this.edit((doc) => segment.withoutTarget(doc, target));
  }

  changeTarget(target: number, by: Partial<Target>): void {
    this.edit((doc) => segment.changedTarget(doc, target, by));
  }

  resetTarget(target: number): void {
    this.edit((doc) => segment.resetTarget(doc, target));
  }

  // Time.

  setFrame(frame: number): void {
    const frames = this.doc?.clip.frames ?? 1;
    useEditor.setState({ frame: Math.min(Math.max(Math.round(frame), 0), frames - 1) });
  }

  step(by: number): void {
    useEditor.setState({ isPlaying: false });
    this.setFrame(useEditor.getState().frame + by);
  }

  togglePlay(): void {
    if (this.doc) useEditor.setState(({ isPlaying }) => ({ isPlaying: !isPlaying }));
  }

  // Posing.

  limbsNow(): readonly Limb[] {
    const { rig, captured } = useEditor.getState();
    if (!rig || !captured) return [];
    if (this.limbs?.of !== captured) this.limbs = { of: captured, found: limbsOf(rig, captured) };
    return this.limbs.found;
  }

  /** The keyframe under the playhead, while time stands. */
  get posed(): number | undefined {
    const { isPlaying, frame } = useEditor.getState();
    return this.doc && !isPlaying ? segment.targetAt(this.doc, frame) : undefined;
  }

  /** Moves what a handle holds: a limb's end, or the root, which turns too. */
  moveHandle(name: string, place: Vector3, turn: Quaternion | undefined, gesture: string): void {
    const target = this.posed;
    const limb = this.limbsNow().find((one) => one.name === name);
    if (target === undefined || (!limb && name !== ROOT)) return;
    this.edit((doc, rig) => {
      const pose = segment.targetPose(doc, target);
      const edited = limb ? reach(rig, pose, limb, place) : withRoot(pose, place, turn);
      return segment.changedTarget(doc, target, { edited });
    }, gesture);
  }

  /** Moves the selected handle by a step. */
  nudge(by: Vector3): void {
    const { handle } = useEditor.getState();
    const point = this.handlePoints().find(({ name }) => name === handle);
    if (point) this.moveHandle(point.name, point.place.add(by), undefined, `nudge ${point.name}`);
  }

  /** The handles of the keyframe under the playhead: the root, and the limbs' ends. */
  handlePoints(): HandlePoint[] {
    const { rig } = useEditor.getState();
    const { doc, posed } = this;
    if (!rig || !doc || posed === undefined) return [];
    const pose = segment.targetPose(doc, posed);
    const joints = rig.skeleton.names.length;
    const [places, turns] = [new Float32Array(joints * 3), new Float32Array(joints * 4)];
    forward(rig.skeleton, pose.root, pose.rotations, places, turns);
    const ends = this.limbsNow().map(({ name, end }) => ({ name, place: new Vector3().fromArray(places, end * 3) }));
    return [{ name: ROOT, place: new Vector3().fromArray(places), turn: quaternionAt(turns, 0) }, ...ends];
  }

  // The server.

  options(): FillOptions {
    const { form } = useEditor.getState();
    const { count, firstSeed, ...rest } = form;
    return { ...rest, seeds: Array.from({ length: count }, (_, nth) => firstSeed + nth) };
  }

  /** Asks for all variants in one request. */
  async fill(): Promise<void> {
    const { rig, own, isBusy } = useEditor.getState();
    const { doc } = this;
    if (!rig || !doc || isBusy) return;
    const options = this.options();
    const ask = ++this.asked;
    await this.busy(async () => {
      const answer = await this.api.inBetween(
        own ? fillRequest(own.pack, packDoc(own, doc), options) : fillRequest(rig, doc, options),
      );
      if (ask !== this.asked) return;
      const made = variantsOf(rig, answer, options.seeds);
      const variants = own ? made.map((variant) => ownVariant(own, doc, variant)) : made;
      const total_us = Number(answer.timing?.total_us ?? 0);
      const filled = { doc, variants, options, pack: answer.pack, version: answer.pack_version, total_us };
      useEditor.setState({ filled, chosen: 0 });
    });
  }

  choose(variant: number): void {
    const count = useEditor.getState().filled?.variants.length ?? 0;
    if (count > 0) useEditor.setState({ chosen: ((variant % count) + count) % count });
  }

  /** The clip with the chosen variant in its gap. What follows goes on from where the variant ends. */
  filledClip(): Clip | undefined {
    const { filled, rig } = useEditor.getState();
    const variant = chosenVariant(useEditor.getState());
    if (!filled || !rig || !variant) return undefined;
    const { clip, gap } = filled.doc;
    const last = poseAt(variant.clip, variant.clip.frames - 1);
    const rest = slice(clip, gap.end + 1, clip.frames);
    const after = rest.frames > 0 ? goOnFrom(rest, poseAt(clip, gap.end), last, rig.leftAxis) : rest;
    return join([slice(clip, 0, gap.start), variant.clip, after]);
  }

  /** Takes the chosen variant into the clip; it can be undone. */
  apply(): void {
    const clip = this.filledClip();
    const { filled } = useEditor.getState();
    if (!clip || !filled) return;
    this.edit((doc, { limits }) => {
      const end = Math.min(doc.gap.start + filled.variants[0]!.clip.frames - 1, clip.frames - 1);
      const targets = doc.targets.map(({ givesRoot, givesPose }) => ({ givesRoot, givesPose }));
      return { clip, gap: segment.withEnd(doc.gap, end, limits, clip.frames), targets };
    });
    useEditor.setState({ filled: undefined });
    notice('The clip now has this variant. Ctrl+Z undoes it.');
  }

  async export(format: Format, scope: Scope): Promise<void> {
    const { rig, own, file } = useEditor.getState();
    const variant = chosenVariant(useEditor.getState());
    const clip = scope === 'segment' ? variant?.clip : (this.filledClip() ?? this.doc?.clip);
    if (!rig || !clip) return;
    const stem = file.replace(/\.[^.]*$/, '') || 'clip';
    const seed = variant ? `-seed-${variant.seed}` : '';
    const name = `${stem}${seed}${scope === 'segment' ? '-gap' : ''}`;
    save(this.withMesh(own, clip, format, name) ?? (await writeClip(clip, rig, format)), `${name}.${format}`);
  }

  /** A glb of the user's own keeps its mesh. */
  private withMesh(own: OwnRig | undefined, clip: Clip, format: Format, name: string): Blob | undefined {
    return own && format === 'glb' ? dressed(own, clip, name) : undefined;
  }

  /** Answers that are still under way change nothing any more. */
  dispose(): void {
    this.isDisposed = true;
    this.asked++;
  }

  private clear(): void {
    this.asked++;
    useEditor.setState({
      history: undefined,
      captured: undefined,
      understood: [],
      reading: undefined,
      refused: undefined,
      file: '',
      filled: undefined,
      frame: 0,
      trouble: undefined,
    });
    useEditor.setState({ isPlaying: false, handle: undefined });
  }

  private show(clip: Clip, file: string, understood: readonly Row[] = []): void {
    const { rig } = useEditor.getState();
    if (!rig || this.isDisposed) return;
    const doc = segment.newDoc(clip, rig, file);
    this.clear();
    const range = { from: 0, to: clip.frames };
    useEditor.setState({ captured: clip, file, understood, history: begin(doc), range, frame: doc.gap.start });
  }

  private showReading(reading: Reading): void {
    if (!this.isDisposed) useEditor.setState({ reading });
  }

  private async busy(work: () => Promise<void>, isOfFile = false): Promise<void> {
    useEditor.setState({ isBusy: true, trouble: undefined });
    try {
      await work();
    } catch (error) {
      if (this.isDisposed) return;
      const message = error instanceof Error ? error.message : String(error);
      const { field, allowed } = error instanceof ApiError ? error : { field: '', allowed: '' };
      useEditor.setState({ trouble: { message, field, allowed, isOfFile } });
    } finally {
      if (!this.isDisposed) useEditor.setState({ isBusy: false });
    }
  }
}

function withRoot(pose: Pose, place: Vector3, turn: Quaternion | undefined): Pose {
  const moved = copyPose(pose);
  place.toArray(moved.root);
  (turn ?? quaternionAt(pose.rotations, 0)).toArray(moved.rotations, 0);
  return moved;
}
