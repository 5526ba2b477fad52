// A clip without a file: the server lets a character of the pack walk, and stand.
import { toXyzw } from '../live/character';
import type { Api } from '../wire/api';
import type { Command, SessionOptions, Vec3 } from '../wire/types';
import type { Clip, Rig } from './clip';
import { join } from './clip';

/** A velocity, m/s, and the frames that it is followed for; a call makes up to 120. */
export interface Leg {
  velocity: Vec3;
  frames: number;
}

const LEGS: readonly Leg[] = [
  { velocity: { x: 0, y: 0, z: 1.2 }, frames: 90 },
  { velocity: { x: 1.1, y: 0, z: 0.4 }, frames: 60 },
];

export function serversWalk(api: Api, rig: Pick<Rig, 'pack' | 'fps'>): Promise<Clip> {
  return motionOf(api, { pack: rig.pack }, rig.fps, LEGS);
}

/** The motion of a character of the server that follows velocities. */
export async function motionOf(api: Api, who: SessionOptions, fps: number, legs: readonly Leg[]): Promise<Clip> {
  const [session] = await api.createSessions([{ ...who, seed: '1' }]);
  if (!session) throw new Error('the server opened no session');
  const parts: Clip[] = [];
  try {
    for (const [sequence, { velocity, frames }] of legs.entries()) {
      const command: Command = { session_id: session.id, sequence: sequence + 1, locomote: { velocity } };
      const { blocks, command_results } = await api.frames([session.id], frames, [command]);
      const refused = command_results.find((result) => result.problem)?.problem;
      if (refused) throw new Error(refused.message);
      const block = blocks[0];
      if (!block) throw new Error('the server made no frames');
      parts.push({
        fps,
        frames: block.frame_count,
        roots: Float32Array.from(block.root_positions),
        rotations: toXyzw(block.rotations),
      });
    }
  } finally {
    await api.closeSession(session.id).catch(() => undefined);
  }
  return join(parts);
}
