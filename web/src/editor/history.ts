// Undo and redo over values that are never changed in place.

export interface History<T> {
  now: T;
  past: readonly T[];
  future: readonly T[];
  /** Changes of one gesture have the same key and are undone together. */
  gesture: string | undefined;
}

/** Steps that are kept. */
const MOST_STEPS = 200;

export function begin<T>(now: T): History<T> {
  return { now, past: [], future: [], gesture: undefined };
}

export function change<T>(history: History<T>, now: T, gesture?: string): History<T> {
  if (Object.is(now, history.now)) return history;
  const goesOn = gesture !== undefined && gesture === history.gesture;
  const past = goesOn ? history.past : [...history.past, history.now].slice(-MOST_STEPS);
  return { now, past, future: [], gesture };
}

/** The gesture is over: the next change is a step of its own. */
export function endGesture<T>(history: History<T>): History<T> {
  return history.gesture === undefined ? history : { ...history, gesture: undefined };
}

export function undo<T>({ now, past, future, ...rest }: History<T>): History<T> {
  const before = past.at(-1);
  if (before === undefined) return { now, past, future, ...rest };
  return { now: before, past: past.slice(0, -1), future: [now, ...future], gesture: undefined };
}

export function redo<T>({ now, past, future, ...rest }: History<T>): History<T> {
  const [next, ...later] = future;
  if (next === undefined) return { now, past, future, ...rest };
  return { now: next, past: [...past, now], future: later, gesture: undefined };
}
