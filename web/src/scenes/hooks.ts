// `window.troupeScenes`: what tests measure and look at.
import type { OnScreen } from '../stage/types';
import type { Connection } from '../live/store';
import type { Scenes } from './scenes';
import { useScenes } from './store';
import type { Placement, SceneObject } from './types';

export interface SceneHooks {
  frames: () => number;
  connection: () => Connection;
  scene: () => string | null;
  objects: () => readonly SceneObject[];
  /** Where an object is drawn: in the hand while it is carried. */
  drawn: (id: string) => Placement | undefined;
  chosen: () => string | null;
  /** Root of the chosen character as shown. */
  position: () => [number, number, number] | undefined;
  /** Where the chosen character is in the picture, pixels. */
  onScreen: () => OnScreen | undefined;
}

declare global {
  interface Window {
    troupeScenes?: SceneHooks;
  }
}

export function installSceneHooks(scenes: Scenes): () => void {
  window.troupeScenes = {
    frames: () => scenes.frames,
    connection: () => useScenes.getState().connection,
    scene: () => useScenes.getState().scene,
    objects: () => useScenes.getState().objects,
    drawn: (id) => scenes.drawing.placement(id),
    chosen: () => useScenes.getState().object,
    onScreen: () => (scenes.actors.own ? scenes.stage.onScreen(scenes.actors.own.id) : undefined),
    position: () => {
      const { own } = scenes.actors;
      return own?.isShown ? [own.root[0]!, own.root[1]!, own.root[2]!] : undefined;
    },
  };
  return () => {
    delete window.troupeScenes;
  };
}
