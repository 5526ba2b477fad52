// What the panels of the scenes mode show and change.
import { create } from 'zustand';
import type { Connection } from '../live/store';
import type { Pack, Style } from '../wire/types';
import type { LogEntry } from './log';
import type { ObjectDefinition, SceneObject, SceneSummary } from './types';

/** What the pointer does: choose, move or turn the chosen object, or put another one down. */
export type SceneTool = 'choose' | 'move' | 'turn' | 'place';

export interface ScenesState {
  connection: Connection;
  trouble: string;
  /** Whether the lists of scenes and definitions have been read. */
  isRead: boolean;
  scenes: SceneSummary[];
  definitions: ObjectDefinition[];
  packs: Pack[];
  /** Name of the scene that is shown. */
  scene: string | null;
  ground: number;
  colliders: number;
  objects: SceneObject[];
  /** Id of the chosen object. */
  object: string | null;
  tool: SceneTool;
  /** Definition that the next click puts down. */
  placing: string | null;
  /** Name of the chosen character on the page. */
  actor: string | null;
  actors: number;
  /** Styles of the chosen character's body, and what it does. */
  styles: Style[];
  style: string;
  speed: number;
  follow: boolean;
  /** Whether the person wants no character in the scene: none comes by itself. */
  isLeftEmpty: boolean;
  log: LogEntry[];
  busy: boolean;
}

const NOTHING: ScenesState = {
  connection: 'connecting',
  trouble: '',
  isRead: false,
  scenes: [],
  definitions: [],
  packs: [],
  scene: null,
  ground: 0,
  colliders: 0,
  objects: [],
  object: null,
  tool: 'choose',
  placing: null,
  actor: null,
  actors: 0,
  styles: [],
  style: '',
  speed: 1.3,
  follow: false,
  isLeftEmpty: false,
  log: [],
  busy: false,
};

export const useScenes = create<ScenesState>(() => NOTHING);

/** Lines of the log that are kept. */
const KEPT = 200;

let logged = 0;

export function log(entry: Omit<LogEntry, 'id'>): void {
  const made = { ...entry, id: ++logged };
  useScenes.setState(({ log: before }) => ({ log: [...before, made].slice(-KEPT) }));
}

/** As when the mode begins. */
export function clearScenes(): void {
  useScenes.setState(NOTHING);
}

/** An id for another object of a definition: the definition's name and the first free number. */
export function freeId(definition: string, objects: readonly SceneObject[]): string {
  const taken = new Set(objects.map((object) => object.id));
  for (let i = 1; ; i++) if (!taken.has(`${definition}-${i}`)) return `${definition}-${i}`;
}
