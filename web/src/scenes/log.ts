// What events say, for people.
import type { components } from '../wire/gen/openapi';
import type { SessionEvent } from '../wire/types';

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
export function describe(kind: NonNullable<SessionEvent['kind']>): { text: string; failed: boolean } | undefined {
  const fine = (text: string) => ({ text, failed: false });
  if ('started' in kind) {
    const { instance, variant, approach } = kind.started;
    return fine(`started ${variant} at ${instance}${approach ? ` from ${approach}` : ''}`);
  }
  if ('entered' in kind) return fine(`entered ${kind.entered.set} of ${kind.entered.instance}`);
  if ('reached' in kind) return fine(reached(kind.reached));
  if ('attached' in kind) return fine(`took ${kind.attached.instance} (${kind.attached.socket})`);
  if ('released' in kind) return fine(`put down ${kind.released.instance}`);
  if ('done' in kind) return fine(`done with ${kind.done.instance}`);
  if ('interrupted' in kind) return fine(`broke off ${kind.interrupted.instance}`);
  if ('fell' in kind) return fine('fell');
  if ('landed' in kind) return fine(`landed at ${kind.landed.speed.toFixed(1)} m/s`);
  if ('arrived' in kind) return fine(`arrived, ${centimetres(kind.arrived.off)} from the end`);
  if ('failed' in kind) {
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
