// A clip without a file: the server lets a character of the pack walk, and stand.
import { toXyzw } from '../live/character';
import type { Api } from '../wire/api';
import type { Command } from '../wire/types';
import type { Clip, Rig } from './clip';
import { join } from './clip';

/** Commands and the frames that each is followed for; a call makes up to 120. */
const LEGS: readonly { velocity: { x: number; y: number; z: number }; frames: number }[] = [
  { velocity: { x: 0, y: 0, z: 1.2 }, frames: 90 },
  { velocity: { x: 1.1, y: 0, z: 0.4 }, frames: 60 },
];

export async function serversWalk(api: Api, rig: Rig): Promise<Clip> {
  const [session] = await api.createSessions([{ pack: rig.pack, seed: '1' }]);
  if (!session) throw new Error('the server opened no session');
  const parts: Clip[] = [];
  try {
    for (const [sequence, { velocity, frames }] of LEGS.entries()) {
      const command: Command = { session_id: session.id, sequence: sequence + 1, locomote: { velocity } };
      const { blocks, command_results } = await api.frames([session.id], frames, [command]);
      const refused = command_results.find((result) => result.problem)?.problem;
      if (refused) throw new Error(refused.message);
      const block = blocks[0];
      if (!block) throw new Error('the server made no frames');
      parts.push({
        fps: rig.fps,
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
