// Skills of the own character: what its pack can do where it stands, and how it goes.
import type { EventKind } from '../wire/types';

/** State of the skill that was asked for last. */
export interface Doing {
  /** `asked`: nothing has begun yet. `held`: it stays so until a command ends it. `leaving`: it was held, and comes to its end. */
  state: 'none' | 'asked' | 'doing' | 'held' | 'leaving';
  name: string;
  /** The set of keyframes that it is in; empty before the first. */
  set: string;
  /** The skill that waits for the end of this one; empty for none. */
  next: string;
  /** What became of it, for people; empty while it goes well. */
  trouble: string;
}

export const NOTHING: Doing = { state: 'none', name: '', set: '', next: '', trouble: '' };

/** Whether a skill is under way, from its first frame to its end. */
export function isUnderWay({ state }: Doing): boolean {
  return state === 'doing' || state === 'held' || state === 'leaving';
}

/** The state after a skill was asked for. A skill that is under way ends first. */
export function afterAsking(doing: Doing, name: string): Doing {
  return isUnderWay(doing) ? { ...doing, next: name } : { ...NOTHING, state: 'asked', name };
}

/** The state after the last request was refused, or replaced by another command. */
export function withoutAsked(doing: Doing): Doing {
  if (doing.state === 'asked') return NOTHING;
  return doing.next ? { ...doing, next: '' } : doing;
}

/** The state after an event of the own character. */
export function afterEvent(doing: Doing, kind: EventKind): Doing {
  if (kind.started) {
    const name = kind.started.definition;
    return { ...NOTHING, state: 'doing', name, next: doing.next === name ? '' : doing.next };
  }
  if (!isUnderWay(doing)) return doing;
  if (kind.entered) {
    const state = doing.state === 'held' ? 'leaving' : doing.state;
    return { ...doing, state, set: kind.entered.set };
  }
  if (kind.failed) {
    return ended(doing, `That could not be done: ${kind.failed.message || kind.failed.reason}`);
  }
  return kind.done || kind.interrupted ? ended(doing, '') : doing;
}

function ended({ next }: Doing, trouble: string): Doing {
  return { ...NOTHING, state: next ? 'asked' : 'none', name: next, trouble };
}

/** What a character does, in the server's words. */
export interface Activity {
  kind: string;
  instance: string;
  set: string;
}

/** The state after the server's answer about the character; `looked` is the state when it was asked. */
export function afterLook(doing: Doing, looked: Doing, activity: Activity | undefined): Doing {
  // Events that came meanwhile are newer than the answer.
  if (!isUnderWay(doing) || doing.name !== looked.name || doing.set !== looked.set) return doing;
  if (activity?.instance !== doing.name) return ended(doing, '');
  const isHeld = activity.kind === 'ACTIVITY_KIND_HELD' && activity.set === doing.set;
  return isHeld && doing.state === 'doing' ? { ...doing, state: 'held' } : doing;
}

/** Lines about it, for people. */
export function linesOf({ state, name, next, trouble }: Doing): string[] {
  const now = {
    none: '',
    asked: `Is about to do “${name}”`,
    doing: `Does “${name}”`,
    held: `Holds “${name}” until it walks or you press the button again`,
    leaving: `Leaves “${name}”`,
  }[state];
  return [now, next && `Then does “${next}”`, trouble].filter((line) => line !== '');
}
