// What events say, for people.
import type { components } from '../wire/gen/openapi';
import type { EventKind } from '../wire/types';

type KeyframeReached = components['schemas']['KeyframeReached'];

export interface LogEntry {
  id: number;
  /** Frame of the session's timeline. */
  frame: number;
  /** Seconds of the session's timeline. */
  seconds: number;
  /** Name of the character on the page. */
  who: string;
  text: string;
  failed: boolean;
}

function centimetres(metres: number | null | undefined): string {
  return `${((metres ?? 0) * 100).toFixed(0)} cm`;
}

/** A line for an event; `undefined` for a kind that this page does not know. */
export function describe(kind: EventKind): { text: string; failed: boolean } | undefined {
  const fine = (text: string) => ({ text, failed: false });
  if (kind.started) {
    const { instance, variant, approach } = kind.started;
    return fine(`started ${variant} at ${instance}${approach ? ` from ${approach}` : ''}`);
  }
  if (kind.entered) return fine(`entered ${kind.entered.set} of ${kind.entered.instance}`);
  if (kind.reached) return fine(reached(kind.reached));
  if (kind.attached) return fine(`took ${kind.attached.instance} (${kind.attached.socket})`);
  if (kind.released) return fine(`put down ${kind.released.instance}`);
  if (kind.done) return fine(`done with ${kind.done.instance}`);
  if (kind.interrupted) return fine(`broke off ${kind.interrupted.instance}`);
  if (kind.fell) return fine('fell');
  if (kind.landed) return fine(`landed at ${kind.landed.speed.toFixed(1)} m/s`);
  if (kind.arrived) return fine(`arrived, ${centimetres(kind.arrived.off)} from the end`);
  if (kind.failed) {
    const { instance, reason, message } = kind.failed;
    return { text: `failed at ${instance}: ${message || reason}`, failed: true };
  }
  return undefined;
}

function reached({ set, instance, before, early_frames }: KeyframeReached): string {
  const early = early_frames > 0 ? `, ${early_frames} frames early` : '';
  const pinned = before ? ` (${centimetres(before.joint_m)} off before it was pinned)` : '';
  return `reached ${set} of ${instance}${early}${pinned}`;
}
