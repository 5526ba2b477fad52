// What the page and the worker that owns the stream say to each other.
import type { DecodedBlock } from './codec';
import type { Command, CommandResult, Problem, SessionEvents, SessionProblem } from './types';

export type ToWorker =
  | { kind: 'open'; url: string; rate_hz: number }
  | { kind: 'attach'; ids: string[] }
  | { kind: 'detach'; ids: string[] }
  | { kind: 'commands'; commands: Command[] }
  | { kind: 'close' };

/** Where an object is that a character carries. */
export interface HeldPlace {
  /** Of the character. */
  slot: number;
  instance: string;
  /** x, y, z, metres. */
  position: [number, number, number];
  /** x, y, z, w. */
  rotation: [number, number, number, number];
}

export interface TickMessage {
  kind: 'tick';
  /** Counts the stream's ticks, those that were dropped too. */
  tick: number;
  /** Ticks of this stream that were not sent. */
  dropped_ticks: number;
  underruns: number;
  blocks: DecodedBlock[];
  /** Objects in hands, at the last of the frames. */
  held: HeldPlace[];
  /** Bytes of the message. */
  bytes: number;
  decode_ms: number;
}

export type FromWorker =
  | TickMessage
  | { kind: 'opened' }
  | { kind: 'closed'; code: number; reason: string }
  | { kind: 'attached'; sessions: { session_id: string; slot: number }[]; problems: SessionProblem[] }
  | { kind: 'left'; sessions: SessionProblem[] }
  | { kind: 'refused'; results: CommandResult[] }
  | { kind: 'events'; sessions: SessionEvents[] }
  | { kind: 'closing'; reason: Problem };
