// What the panels show and change. What changes with every frame is not here but in `Live`.
import { create } from 'zustand';
import type { Pack, Skill, Style } from '../wire/types';
import type { CrowdChoice } from './cast';
import type { Doing } from './skills';
import { NOTHING } from './skills';
import type { Saying } from './words';
import { SILENT } from './words';

/** `locked`: the server refuses the key, or wants one. */
export type Connection = 'connecting' | 'live' | 'reconnecting' | 'failed' | 'locked';
export type Tool = 'point' | 'draw';

/** How time goes: 1 is the server's clock; anything else is the page's own. */
export interface TimeChoice {
  paused: boolean;
  /** Share of real time: 1, 0.5, 0.25, 0.1. */
  speed: number;
}

export interface Notice {
  id: number;
  text: string;
  kind: 'info' | 'error';
}

export interface Player {
  pack: string;
  body: string;
  style: string;
  /** Metres a second. */
  speed: number;
  /** Empty: the gaits that suit the velocity. */
  gait: string;
  /** Metres; `undefined`: the style's. */
  height: number | undefined;
  /** Whether it faces a way of its own. */
  facesAway: boolean;
}

export interface LiveState {
  connection: Connection;
  /** What the banner says while the connection is broken. */
  trouble: string;
  packs: Pack[];
  /** Styles of the own character's body. */
  styles: Style[];
  words: readonly string[];
  /** Skills of the own character's pack. */
  skills: readonly Skill[];
  crowd: CrowdChoice;
  /** Characters on the stage. */
  characters: number;
  player: Player;
  selected: string | null;
  tool: Tool;
  follow: boolean;
  time: TimeChoice;
  inside: boolean;
  numbers: boolean;
  path: { state: 'none' | 'walking' | 'arrived'; text: string };
  /** Why the own character takes no sentences; empty while that is not known, `undefined` if it takes them. */
  mute: string | undefined;
  saying: Saying;
  doing: Doing;
  notices: Notice[];
  busy: boolean;
}

const INITIAL: LiveState = {
  connection: 'connecting',
  trouble: '',
  packs: [],
  styles: [],
  words: [],
  skills: [],
  crowd: { count: 24, who: 'mixed', style: '' },
  characters: 0,
  player: { pack: '', body: '', style: '', speed: 1.3, gait: '', height: undefined, facesAway: false },
  selected: null,
  tool: 'point',
  follow: false,
  time: { paused: false, speed: 1 },
  inside: false,
  numbers: false,
  path: { state: 'none', text: '' },
  mute: '',
  saying: SILENT,
  doing: NOTHING,
  notices: [],
  busy: false,
};

export const useLive = create<LiveState>(() => INITIAL);

/**
 * Everything as when the page was opened. The live mode calls it when it begins: a new `Live` knows no packs yet, so
 * panels must not see those of the one before. Notices stay, because all modes show them.
 */
export function clearLive(): void {
  useLive.setState(({ notices }) => ({ ...INITIAL, notices }));
}

let noticed = 0;

/** Shows a line for a few seconds. */
export function notice(text: string, kind: Notice['kind'] = 'info'): void {
  const id = ++noticed;
  useLive.setState(({ notices }) => ({
    notices: [...notices.filter((other) => other.text !== text), { id, text, kind }].slice(-3),
  }));
  setTimeout(
    () => {
      useLive.setState(({ notices }) => ({ notices: notices.filter((other) => other.id !== id) }));
    },
    kind === 'error' ? 9000 : 4000,
  );
}

/** Shows what went wrong, in the server's words. */
export function report(error: unknown): void {
  notice(error instanceof Error ? error.message : String(error), 'error');
}
