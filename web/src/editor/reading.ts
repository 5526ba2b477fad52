// Files of motion, read by the reader of the server and the command line.
import { Vector3 } from 'three';
import type { Body, Read } from '../reader/troupe_reader_web';
import type { Skeleton } from '../stage/types';
import { loadReader, type Reader } from '../retarget/reader';
import { MOST_FRAMES, type Clip, type Rig } from './clip';

/** What was understood of a file: what, its value, and one line of evidence. */
export type Row = readonly [what: string, value: string, evidence: string];

/** An option of the reader. */
export interface Option {
  name: string;
  takes: 'name' | 'text' | 'number' | 'flag';
  /** Names that it takes; empty if only the file has them. */
  values: readonly string[];
  is_of_robots: boolean;
}

/** An option that decides, and the values that fit the file; empty if they are not known. */
export interface Choice {
  option: string;
  values: readonly string[];
}

/** Values of options by their names, all as text. Without one, the file decides. */
export type Given = Readonly<Record<string, string | undefined>>;

export interface Understood {
  clip: Clip;
  rows: readonly Row[];
  /** Names of the file's animations; empty for formats without them. */
  animations: readonly string[];
}

/** A file that the reader refused. */
export class Misread extends Error {
  /** The options that decide. */
  readonly options: readonly Choice[];
  /** Whether the file has another skeleton than the pack. */
  readonly isOtherBody: boolean;

  constructor(
    cause: unknown,
    /** Names of the file's animations; empty for formats without them. */
    readonly animations: readonly string[],
  ) {
    super(cause instanceof Error ? cause.message : String(cause), { cause });
    const { options = '[]', is_other_body = false } = Object(cause) as { options?: string; is_other_body?: boolean };
    this.options = JSON.parse(options) as Choice[];
    this.isOtherBody = is_other_body;
  }
}

/** Whether a file that was refused has another skeleton than the pack, or a character without a motion. */
export function needsOwnRig(error: unknown, name: string): error is Misread {
  return error instanceof Misread && (error.isOtherBody || (isScene(name) && error.animations.length === 0));
}

/** Speed of hinges for the reader, which only plays them, rad/s. */
const ANY_SPEED = 1000;

/** The reader's options for a body: those of robots' files for robots alone. */
export async function optionsFor(rig: Rig): Promise<Option[]> {
  const reader = await loadReader();
  const options = JSON.parse(reader.options()) as Option[];
  return options.filter((option) => !option.is_of_robots || rig.hinges.length > 0);
}

/** A file on a pack's skeleton, at the pack's rate. Of several animations it is the longest, unless one is given. */
export async function understand(name: string, bytes: Uint8Array, rig: Rig, given: Given = {}): Promise<Understood> {
  const reader = await loadReader();
  const animations = animationsOf(reader, name, bytes);
  const options = { ...tablesOf(rig), resample_fps: rig.fps, ...valuesOf(given, await optionsFor(rig)) };
  const longest = longestOf(name, animations, given, (more) =>
    taken(reader.read(name, bytes, JSON.stringify({ ...options, ...more }))),
  );
  return { ...longest, animations };
}

/** A file on its own skeleton. */
export interface OwnUnderstood {
  /** None for a character's file without a motion. */
  clip: Clip | undefined;
  rows: readonly Row[];
  animations: readonly string[];
  skeleton: Skeleton;
  /** The body's left in the first joint's own frame, unit length. */
  leftAxis: Vector3;
  body: Body;
}

/** A file on its own skeleton, at a pack's rate. A character's file without animations has no clip. */
export async function understandOwn(
  name: string,
  bytes: Uint8Array,
  pack: Rig,
  given: Given = {},
): Promise<OwnUnderstood> {
  const reader = await loadReader();
  const animations = animationsOf(reader, name, bytes);
  if (isScene(name) && animations.length === 0) {
    const found = ownOf(name, reader.character(name, bytes));
    return { ...found, animations, clip: undefined };
  }
  const options = { resample_fps: pack.fps, ...valuesOf(given, await optionsFor(pack)) };
  const longest = longestOf(name, animations, given, (more) =>
    ownOf(name, reader.read(name, bytes, JSON.stringify({ ...options, ...more }))),
  );
  return { ...longest, animations };
}

/** Whether a file is one of a scene, whose animations have names. */
function isScene(name: string): boolean {
  return /\.(gl(b|tf)|vrm)$/i.test(name);
}

function animationsOf(reader: Reader, name: string, bytes: Uint8Array): string[] {
  return isScene(name) ? reader.animations(bytes) : [];
}

/** Reads a file: of several animations the longest, unless one is given. */
function longestOf<T extends { clip: Clip }>(
  name: string,
  animations: readonly string[],
  given: Given,
  read: (more: object) => T,
): T {
  const tried = (more: object): T => {
    try {
      return read(more);
    } catch (error) {
      throw new Misread(error, animations);
    }
  };
  const isOpen = animations.length > 1 && given['animation'] === undefined;
  const found = isOpen ? animations.map((animation) => tried({ animation })) : [tried({})];
  const longest = found.reduce((best, one) => (one.clip.frames > best.clip.frames ? one : best));
  const { frames } = longest.clip;
  if (frames > MOST_FRAMES) throw new Error(`${name}: has ${frames} frames; at most ${MOST_FRAMES} are read`);
  return longest;
}

/** What is given, as the reader takes it. Options that the body does not have are left out. */
function valuesOf(given: Given, options: readonly Option[]): object {
  const of = options.filter(({ name }) => given[name] !== undefined);
  return Object.fromEntries(of.map((option) => [option.name, valueOf(option, given[option.name]!)]));
}

function valueOf({ name, takes }: Option, text: string): string | number | boolean {
  if (takes === 'flag') return text === 'true';
  if (takes !== 'number') return text;
  const value = Number(text);
  if (Number.isNaN(value)) throw new Error(`${name} is "${text}"; allowed: a number above 0`);
  return value;
}

/** Copies what was read, and frees it. */
function taken(read: Read): Omit<Understood, 'animations'> {
  const clip = { fps: read.fps, frames: read.frames, roots: read.roots, rotations: read.rotations };
  const rows = JSON.parse(read.table) as Row[];
  read.free();
  return { clip, rows };
}

/** Copies what was read on its own skeleton, and frees it. */
function ownOf(name: string, read: Read): Omit<OwnUnderstood, 'animations' | 'clip'> & { clip: Clip } {
  const { names, parents, offsets } = read;
  const leftAxis = new Vector3().fromArray(read.left_axis);
  try {
    const body = read.body('');
    return { ...taken(read), skeleton: { names, parents, offsets }, leftAxis, body };
  } catch (error) {
    read.free();
    throw new Error(`${name}: ${error instanceof Error ? error.message : String(error)}`, { cause: error });
  }
}

/** A rig as the tables of a pack's manifest. */
export function tablesOf({ pack, skeleton, leftAxis, hinges, mimics }: Rig): { skeleton: object; robot?: object } {
  const { names, parents, offsets } = skeleton;
  const joints = names.map((name, j) => ({
    name,
    parent: parents[j]! < 0 ? '' : names[parents[j]!]!,
    offset_m: Array.from(offsets.subarray(j * 3, j * 3 + 3)),
  }));
  const tables = { skeleton: { left_axis: leftAxis.toArray(), joints } };
  if (hinges.length === 0) return tables;
  const table = hinges.map(({ joint, axis, rest, lower_rad, upper_rad }) => ({
    joint: names[joint]!,
    axis: axis.toArray(),
    rest: [rest.w, rest.x, rest.y, rest.z],
    lower_rad,
    upper_rad,
    max_speed_rad_per_s: ANY_SPEED,
  }));
  const followers = mimics.map(({ joint, follows, multiplier, offset_rad, axis, rest }) => ({
    joint: names[joint]!,
    follows: names[follows]!,
    multiplier,
    offset_rad,
    axis: axis.toArray(),
    rest: [rest.w, rest.x, rest.y, rest.z],
  }));
  return { ...tables, robot: { name: pack, hinges: table, mimics: followers } };
}
