// Sentences for the own character: which pack makes motion of them, and how it goes.
import type { Skeleton } from '../stage/types';
import type { EventKind, Joint } from '../wire/types';

/** Most characters of a sentence. */
export const MOST_CHARACTERS_OF_TEXT = 1000;

/** State of the sentence that was said last. */
export interface Saying {
  /** `waiting`: the character goes on until the first frames come. */
  state: 'silent' | 'waiting' | 'performing';
  text: string;
  /** Words that the pack does not know. */
  unknown: readonly string[];
  /** What became of it, for people; empty while it goes well. */
  trouble: string;
}

export const SILENT: Saying = { state: 'silent', text: '', unknown: [], trouble: '' };

/** A pack that may make motion of words. */
export interface Speaker {
  name: string;
  joints: readonly Joint[];
}

/** Why the own character takes no sentences; `undefined` if a pack makes motion for its skeleton. */
export function whyMute(speakers: readonly Speaker[], skeleton: Skeleton): string | undefined {
  if (speakers.length === 0) return 'No pack of this server makes motion from text.';
  if (speakers.some((speaker) => isFor(speaker, skeleton))) return undefined;
  const names = speakers.map((speaker) => speaker.name).join(', ');
  return `This body cannot act out words: ${names} has other joints.`;
}

function isFor({ joints }: Speaker, { names, parents }: Skeleton): boolean {
  return (
    joints.length === names.length && joints.every((joint, i) => joint.name === names[i] && joint.parent === parents[i])
  );
}

/** What the page says of a performance that failed, by the server's reason. */
const ENDS: Record<string, string> = {
  FAILED: 'That could not be acted out',
  LATE: 'The server is too busy for sentences',
  RESTARTED: 'The server restarted',
};

/** The state after an event of the own character. `sequence` is the number of the command that said the sentence. */
export function after(saying: Saying, kind: EventKind, sequence: number): Saying {
  if (kind.performing && Number(kind.performing.sequence) === sequence) {
    const { text, unknown_words } = kind.performing;
    return { state: 'performing', text, unknown: unknown_words, trouble: '' };
  }
  if (kind.performed && Number(kind.performed.sequence) === sequence) {
    const { reason, message } = kind.performed;
    const end = ENDS[reason];
    const trouble = end === undefined ? '' : message ? `${end}: ${message}` : `${end}.`;
    return { ...saying, state: 'silent', trouble };
  }
  return saying;
}

/** A line about words that the pack does not know. */
export function unknownNote(unknown: readonly string[]): string {
  return unknown.length === 0 ? '' : `The pack has not learnt: ${unknown.join(', ')}`;
}
