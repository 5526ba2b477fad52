// The bodies of the server's packs, as the retargeter sees them.
import type { Clip } from '../editor/clip';
import { rigOf } from '../editor/rig';
import { tablesOf } from '../editor/reading';
import { motionOf, type Leg } from '../editor/walk';
import type { Body } from '../reader/troupe_reader_web';
import type { Api } from '../wire/api';
import type { Body as PackBody, Pack } from '../wire/types';
import { loadReader } from './reader';

/** A pack's body. A short motion of its own shows how it stands. */
export interface Source {
  body: Body;
  /** None for robots, whose hinges say how they stand. */
  motion: Clip | undefined;
  ground_m: number;
}

/** It stands, then walks ahead, m/s. */
const LEGS: readonly Leg[] = [
  { velocity: { x: 0, y: 0, z: 0 }, frames: 24 },
  { velocity: { x: 0, y: 0, z: 1.2 }, frames: 96 },
];

const found = new Map<string, Promise<Source>>();

/** The body of a pack, or one of its bodies. The server makes its motion; once for each. */
export function sourceOf(api: Api, pack: string, body: string): Promise<Source> {
  const key = `${pack}/${body}`;
  const known = found.get(key) ?? make(api, pack, body);
  found.set(key, known);
  known.catch(() => found.delete(key));
  return known;
}

async function make(api: Api, name: string, bodyName: string): Promise<Source> {
  const [reader, pack] = await Promise.all([loadReader(), api.pack(name)]);
  const body = pack.bodies?.find((one) => one.name === bodyName);
  const tables = JSON.stringify(packTables(pack, body));
  const isRobot = (body ?? pack).robot != null;
  const motion = isRobot ? undefined : await motionOf(api, { pack: name, body: bodyName }, pack.fps, LEGS);
  const none = new Float32Array(0);
  const made = reader.body_of_pack(tables, pack.fps, motion?.roots ?? none, motion?.rotations ?? none);
  return { body: made, motion, ground_m: pack.ground_y };
}

/** The tables of a pack's manifest, with the heights of joints that stand. */
function packTables(pack: Pack, body: PackBody | undefined): object {
  const { skeleton, ...tables } = tablesOf(rigOf(pack, body));
  const { contact_joints, contact_rules, ground_y } = pack;
  // Heights are those of the pack's own skeleton.
  const isKnown = !body && contact_rules !== undefined && contact_rules.clearance.length === contact_joints.length;
  const contacts = isKnown && {
    joints: contact_joints,
    max_height_m: contact_rules.max_height,
    max_speed_mps: contact_rules.max_speed,
    clearance_m: contact_rules.clearance,
  };
  return { ...tables, skeleton: { ...skeleton, ground_y_m: ground_y, ...(contacts ? { contacts } : {}) } };
}
