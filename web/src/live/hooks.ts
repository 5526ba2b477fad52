// `window.troupe`: what tests measure and look at.
import type { OnScreen } from '../stage/types';
import type { Connection } from './store';
import type { Live } from './live';
import { useLive } from './store';

export interface TroupeHooks {
  /** Frames of the screen so far. */
  frames: () => number;
  /** Main-thread time of a frame of the screen, ms. */
  frameMs: () => { median: number; p99: number };
  /** Time to decode a tick in the worker, ms. */
  decodeMs: () => { median: number; p99: number };
  bytesPerSecond: () => number;
  characters: () => number;
  /** Characters on the stage. */
  shown: () => number;
  /** Names of the characters; the own one is first. */
  ids: () => string[];
  /** Root of a character as shown; the own one without a name. */
  position: (id?: string) => [number, number, number] | undefined;
  /** Whether a character wears a skin; the own one without a name. */
  isSkinned: (id?: string) => boolean;
  /** Where the own character is in the picture, pixels; `undefined` if it is behind the camera. */
  onScreen: () => OnScreen | undefined;
  connection: () => Connection;
  underruns: () => number;
  droppedTicks: () => number;
  selected: () => string | null;
  path: () => string;
  /** Begins the measurements again. */
  clearMeters: () => void;
}

declare global {
  interface Window {
    troupe?: TroupeHooks;
  }
}

export function installHooks(live: Live): () => void {
  const { meters, crowd } = live;
  window.troupe = {
    frames: () => meters.frames,
    frameMs: () => ({ median: meters.frame_ms.quantile(0.5), p99: meters.frame_ms.quantile(0.99) }),
    decodeMs: () => ({ median: meters.decode_ms.quantile(0.5), p99: meters.decode_ms.quantile(0.99) }),
    bytesPerSecond: () => meters.bytes.perSecond(performance.now()),
    characters: () => crowd.all.size,
    shown: () => [...crowd.all.values()].filter((one) => one.isShown).length,
    ids: () => {
      const own = live.own?.id;
      const others = [...crowd.all.keys()].filter((id) => id !== own);
      return own ? [own, ...others] : others;
    },
    position: (id) => {
      const one = id === undefined ? live.own : crowd.all.get(id);
      return one?.isShown ? [one.root[0]!, one.root[1]!, one.root[2]!] : undefined;
    },
    isSkinned: (id = live.own?.id ?? '') => live.stage.isSkinned(id),
    onScreen: () => (live.own ? live.stage.onScreen(live.own.id) : undefined),
    connection: () => useLive.getState().connection,
    underruns: () => meters.underruns,
    droppedTicks: () => meters.dropped,
    selected: () => useLive.getState().selected,
    path: () => useLive.getState().path.state,
    clearMeters: () => {
      meters.frame_ms.clear();
      meters.decode_ms.clear();
    },
  };
  return () => {
    delete window.troupe;
  };
}
