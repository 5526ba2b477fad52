// Files of motion, read by the reader of the server and the command line (bindings/web). It is
// loaded with the first file. `scripts/web.sh reader` builds it into src/reader.
import type { Read } from '../reader/troupe_reader_web';
import wasm from '../reader/troupe_reader_web_bg.wasm?url';
import { MOST_FRAMES, type Clip, type Rig } from './clip';

type Reader = typeof import('../reader/troupe_reader_web');

/** What was understood of a file: what, its value, and one line of evidence. */
export type Row = readonly [what: string, value: string, evidence: string];

export interface Understood {
  clip: Clip;
  rows: readonly Row[];
}

/** Speed of hinges for the reader, which only plays them, rad/s. */
const ANY_SPEED = 1000;

let loading: Promise<Reader> | undefined;

/** The reader, from its address or its bytes. A failed try does not stay. */
export function loadReader(source: string | BufferSource = wasm): Promise<Reader> {
  loading ??= import('../reader/troupe_reader_web')
    .then(async (reader) => {
      await reader.default({ module_or_path: source });
      return reader;
    })
    .catch((error: unknown) => {
      loading = undefined;
      throw error;
    });
  return loading;
}

/** A file on a pack's skeleton, at the pack's rate. Of several animations it is the longest. */
export async function understand(name: string, bytes: Uint8Array, rig: Rig): Promise<Understood> {
  const reader = await loadReader();
  const names = /\.gl(b|tf)$/i.test(name) ? reader.animations(bytes) : [];
  const options = { ...tablesOf(rig), resample_fps: rig.fps };
  const asked = names.length > 1 ? names.map((animation) => ({ ...options, animation })) : [options];
  const found = asked.map((one) => taken(called(() => reader.read(name, bytes, JSON.stringify(one)))));
  const longest = found.reduce((best, one) => (one.clip.frames > best.clip.frames ? one : best));
  const { frames } = longest.clip;
  if (frames > MOST_FRAMES) throw new Error(`${name}: has ${frames} frames; at most ${MOST_FRAMES} are read`);
  return longest;
}

/** Calls the reader. Its errors name options, which the command line has. */
function called<T>(read: () => T): T {
  try {
    return read();
  } catch (error) {
    const message = error instanceof Error ? error.message : String(error);
    throw new Error(/--[a-z]/.test(message) ? `${message} (options of troupe clip convert)` : message, {
      cause: error,
    });
  }
}

/** Copies what was read, and frees it. */
function taken(read: Read): Understood {
  const clip = { fps: read.fps, frames: read.frames, roots: read.roots, rotations: read.rotations };
  const rows = JSON.parse(read.table) as Row[];
  read.free();
  return { clip, rows };
}

/** A rig as the tables of a pack's manifest. */
function tablesOf({ pack, skeleton, leftAxis, hinges }: Rig): object {
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
  return { ...tables, robot: { name: pack, hinges: table } };
}
