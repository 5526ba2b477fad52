// The scenes mode on the page: makes it run, and lays out its panels.
import { useComputedColorScheme } from '@mantine/core';
import { useEffect, useState } from 'react';
import { create } from 'zustand';
import { Help } from '../app/Help';
import type { ModeProps } from '../app/modes';
import type { Link } from '../live/hash';
import { readLink, writeLink } from '../live/hash';
import { ConnectionBanner, connectionAfter, Notices } from '../live/Signs';
import { runLoop } from '../live/stage-events';
import { ActorPanel } from './ActorPanel';
import { EmptyServer } from './EmptyServer';
import { installSceneHooks } from './hooks';
import { SCENE_KEYS, useSceneKeys } from './keys';
import { LogPanel } from './LogPanel';
import { ObjectPanel } from './ObjectPanel';
import { ObjectsPanel } from './ObjectsPanel';
import { ScenePanel } from './ScenePanel';
import { Scenes } from './scenes';
import { ScenesToolbar } from './ScenesToolbar';
import { useScenes } from './store';

/** Time between writes of the address, ms. */
const LINK_MS = 700;
/** Time between tries to start, ms. */
const RETRY_MS = 1000;

const useRunning = create<{ scenes: Scenes | undefined }>(() => ({ scenes: undefined }));

/** Starts the mode; it ends with the component. */
function useScenesOn({ stage, api }: ModeProps): Scenes | undefined {
  useEffect(() => {
    const scenes = new Scenes(stage, api);
    const link = readLink(location.hash);
    const isOurs = link.mode === 'scenes';
    if (isOurs && link.cam) stage.setCamera(link.cam);
    const stop = runLoop(stage, {
      frame: (now_ms, dt) => {
        scenes.frame(now_ms, dt);
      },
      click: (x, y) => {
        scenes.click(x, y);
      },
      onTime: (ms) => {
        scenes.frame_ms.add(ms);
      },
      onFiles: async (files) => {
        const read = files.map(async (file) => ({ name: file.name, text: await file.text() }));
        await scenes.upload(await Promise.all(read));
      },
    });
    const uninstall = installSceneHooks(scenes);
    const abort = new AbortController();
    const { signal } = abort;
    // A page that is loaded again finds its seats free. One that the browser keeps goes on as it was.
    const close = ({ persisted }: PageTransitionEvent) => {
      if (!persisted) scenes.actors.leaveAll();
    };
    window.addEventListener('pagehide', close, { signal });
    void begin(scenes, isOurs ? link : {}, signal);
    const timer = setInterval(() => {
      writeAddress(scenes);
    }, LINK_MS);
    useRunning.setState({ scenes });
    return () => {
      abort.abort();
      clearInterval(timer);
      stop();
      uninstall();
      scenes.dispose();
      useRunning.setState({ scenes: undefined });
    };
  }, [stage, api]);
  return useRunning((state) => state.scenes);
}

/** Starts it; a server that is not there yet is asked again. */
async function begin(scenes: Scenes, link: Link, signal: AbortSignal): Promise<void> {
  while (!signal.aborted) {
    try {
      await scenes.start(link);
      return;
    } catch (error) {
      const trouble = error instanceof Error ? error.message : String(error);
      const connection = connectionAfter(error);
      useScenes.setState({ connection, trouble });
      if (connection !== 'reconnecting') return;
      await new Promise((done) => setTimeout(done, RETRY_MS));
    }
  }
}

function writeAddress({ stage }: Scenes): void {
  const { scene, object, follow, connection, isLeftEmpty } = useScenes.getState();
  if (connection === 'connecting') return;
  const hash = writeLink({
    mode: 'scenes',
    cam: stage.cameraState(),
    follow,
    ...(scene === null ? {} : { scene }),
    ...(isLeftEmpty ? { n: 0 } : {}),
    ...(object === null ? {} : { sel: object }),
  });
  if (hash !== location.hash) history.replaceState(null, '', hash);
}

function Head() {
  const { scene, objects, actors, connection } = useScenes();
  const count = (number: number, name: string) => `${number} ${name}${number === 1 ? '' : 's'}`;
  const says =
    scene === null ? 'no scene yet' : `${scene} · ${count(objects.length, 'object')} · ${count(actors, 'character')}`;
  return (
    <header className="head">
      <h1>Troupe</h1>
      <p>{connection === 'connecting' ? 'connecting …' : says}</p>
    </header>
  );
}

function Banner() {
  const { connection, trouble } = useScenes();
  return <ConnectionBanner connection={connection} trouble={trouble} />;
}

export function ScenesMode(props: ModeProps) {
  const scenes = useScenesOn(props);
  const scheme = useComputedColorScheme('light');
  const [isHelpOpen, setHelpOpen] = useState(false);
  useSceneKeys(scenes, () => {
    setHelpOpen((isOpen) => !isOpen);
  });
  useEffect(() => {
    scenes?.drawing.setTheme(scheme);
  }, [scenes, scheme]);
  if (!scenes) return null;
  return (
    <>
      <Head />
      <Banner />
      <EmptyServer scenes={scenes} />
      <aside className="side" aria-label="Panels">
        <ScenePanel scenes={scenes} />
        <ObjectsPanel scenes={scenes} />
        <ObjectPanel scenes={scenes} />
        <ActorPanel scenes={scenes} />
      </aside>
      <aside className="left" aria-label="Events">
        <LogPanel />
      </aside>
      <ScenesToolbar
        scenes={scenes}
        onHelp={() => {
          setHelpOpen(true);
        }}
      />
      <Notices />
      <Help
        opened={isHelpOpen}
        keys={SCENE_KEYS}
        onClose={() => {
          setHelpOpen(false);
        }}
      >
        Click an object or a character to choose it. With the handle an object moves and turns. Drag to turn the camera,
        drag with the second button to move it, turn the wheel to come nearer. The camera comes along when the chosen
        character walks out of the picture. Drop TOML or JSON files of objects and scenes on the page to upload them.
      </Help>
    </>
  );
}
