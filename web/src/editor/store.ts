// What the editor's panels show and change.
import { create } from 'zustand';
import type { Certificate } from '../retarget/certificate';
import type { Pack } from '../wire/types';
import type { Clip, Rig } from './clip';
import type { History } from './history';
import type { OwnRig } from './own';
import type { Choice, Given, Option, Row } from './reading';
import type { FillOptions, Variant } from './request';
import type { Doc, Range } from './segment';

/** How variants stand on the stage. */
export type Layout = 'one' | 'over' | 'beside';

/** An answer of the server, and the document that it is of. */
export interface Filled {
  doc: Doc;
  variants: readonly Variant[];
  options: FillOptions;
  pack: string;
  version: string;
  total_us: number;
}

export interface FillForm {
  /** Variants, each with a seed of its own. */
  count: number;
  firstSeed: number;
  temperature: number;
  poseSteps: number;
  holdFeet: boolean;
  modelsLength: boolean;
}

/** What went wrong, and the field that the server named. */
export interface Trouble {
  message: string;
  field: string;
  allowed: string;
  /** Whether a file was refused, and not a request. */
  isOfFile: boolean;
}

/** How the file that was opened last is read, whether or not it could be. */
export interface Reading {
  /** Name of the file. */
  file: string;
  /** The reader's options for the body. */
  options: readonly Option[];
  given: Given;
  /** Names of the file's animations; empty for formats without them. */
  animations: readonly string[];
  /** The options that the reader's error names. */
  asked: readonly Choice[];
  /** Whether the panel shows the options. */
  isOpen: boolean;
}

/** A file on a rig of the user's own that was not opened. */
export interface Refused {
  file: string;
  certificate: Certificate;
}

export interface EditorState {
  packs: readonly Pack[];
  /** What the clip is on: the pack's body, or the user's own rig. */
  rig: Rig | undefined;
  /** The user's own rig, if the clip is on it. */
  own: OwnRig | undefined;
  /** A rig whose figures are beyond the bar, until it is used all the same. */
  refused: Refused | undefined;
  /** Name of the clip; empty without one. */
  file: string;
  /** What was understood of the file; empty for a clip without one. */
  understood: readonly Row[];
  /** None for a clip without a file. */
  reading: Reading | undefined;
  /** The clip as it was opened. */
  captured: Clip | undefined;
  history: History<Doc> | undefined;
  frame: number;
  isPlaying: boolean;
  /** Whether playing goes around in the gap, or through the whole clip. */
  loopsGap: boolean;
  range: Range;
  form: FillForm;
  isBusy: boolean;
  trouble: Trouble | undefined;
  filled: Filled | undefined;
  chosen: number;
  layout: Layout;
  showsCaptured: boolean;
  showsInside: boolean;
  /** The handle that is selected: a limb's name or `root`. */
  handle: string | undefined;
  /** Whether the root's gizmo turns instead of moves. */
  turns: boolean;
}

export const MOST_VARIANTS = 8;
export const MOST_TEMPERATURE = 2;
export const MOST_POSE_STEPS = 10;

export const INITIAL: EditorState = {
  packs: [],
  rig: undefined,
  own: undefined,
  refused: undefined,
  file: '',
  understood: [],
  reading: undefined,
  captured: undefined,
  history: undefined,
  frame: 0,
  isPlaying: false,
  loopsGap: true,
  range: { from: 0, to: 1 },
  form: { count: 4, firstSeed: 1, temperature: 0.7, poseSteps: 1, holdFeet: true, modelsLength: false },
  isBusy: false,
  trouble: undefined,
  filled: undefined,
  chosen: 0,
  layout: 'over',
  showsCaptured: true,
  showsInside: false,
  handle: undefined,
  turns: false,
};

export const useEditor = create<EditorState>(() => INITIAL);

/** The rig of the pack whose server fills gaps. */
export function packRigOf({ rig, own }: Pick<EditorState, 'rig' | 'own'>): Rig | undefined {
  return own?.pack ?? rig;
}

export function docOf({ history }: EditorState): Doc | undefined {
  return history?.now;
}

/** Whether the document has changed since the gap was filled. */
export function isStale({ filled, history }: EditorState): boolean {
  return filled !== undefined && filled.doc !== history?.now;
}

export function chosenVariant({ filled, chosen }: EditorState): Variant | undefined {
  return filled?.variants[chosen];
}
