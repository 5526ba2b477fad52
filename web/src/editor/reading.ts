// Files of motion, read by the reader of the server and the command line.
import type { Read } from '../reader/troupe_reader_web';
import { loadReader } from '../retarget/reader';
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
  const animations = /\.gl(b|tf)$/i.test(name) ? reader.animations(bytes) : [];
  const options = { ...tablesOf(rig), resample_fps: rig.fps, ...valuesOf(given, await optionsFor(rig)) };
  const read = (more: object) => {
    try {
      return taken(reader.read(name, bytes, JSON.stringify({ ...options, ...more })));
    } catch (error) {
      throw new Misread(error, animations);
    }
  };
  const isOpen = animations.length > 1 && given['animation'] === undefined;
  const found = isOpen ? animations.map((animation) => read({ animation })) : [read({})];
  const longest = found.reduce((best, one) => (one.clip.frames > best.clip.frames ? one : best));
  const { frames } = longest.clip;
  if (frames > MOST_FRAMES) throw new Error(`${name}: has ${frames} frames; at most ${MOST_FRAMES} are read`);
  return { ...longest, animations };
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
