// The live mode on the page: makes it run, and lays out its panels.
import { useEffect, useState } from 'react';
import { create } from 'zustand';
import type { ModeProps } from '../app/modes';
import { Help } from '../app/Help';
import { OutfitPanel } from '../bodies/OutfitPanel';
import { ApiError } from '../wire/api';
import { InsidePanel } from '../inside/InsidePanel';
import { NumbersPanel } from '../numbers/NumbersPanel';
import { CrowdPanel } from './CrowdPanel';
import type { Link } from './hash';
import { readLink, writeLink } from './hash';
import { installHooks } from './hooks';
import { useKeys } from './keys';
import { Live } from './live';
import { PlayerPanel } from './PlayerPanel';
import { Banner, connectionAfter, Head, Notices } from './Signs';
import { useLive } from './store';
import { Toolbar } from './Toolbar';
import { runStage } from './stage-events';

/** Time between writes of the address, ms. */
const LINK_MS = 700;
/** Time between tries to start, ms. */
const RETRY_MS = 1000;

const useRunning = create<{ live: Live | undefined }>(() => ({ live: undefined }));

/** Starts the mode; it ends with the component. */
function useLiveOn({ stage, api }: ModeProps): Live | undefined {
  useEffect(() => {
    const live = new Live(stage, api);
    const link = readLink(location.hash);
    const open = link.open ?? [];
    useLive.setState({
      inside: open.includes('inside'),
      numbers: open.includes('numbers'),
      follow: link.follow ?? false,
    });
    const stop = runStage(live);
    const uninstall = installHooks(live);
    const abort = new AbortController();
    void begin(live, link, abort.signal);
    const timer = setInterval(() => {
      writeAddress(live);
    }, LINK_MS);
    useRunning.setState({ live });
    return () => {
      abort.abort();
      clearInterval(timer);
      stop();
      uninstall();
      live.dispose();
      useRunning.setState({ live: undefined });
    };
  }, [stage, api]);
  return useRunning((state) => state.live);
}

/** Starts it; a server that is not there yet is asked again. */
async function begin(live: Live, link: Link, signal: AbortSignal): Promise<void> {
  while (!signal.aborted) {
    try {
      await live.start(link);
      if (link.sel && live.crowd.all.has(link.sel)) live.select(link.sel);
      return;
    } catch (error) {
      const trouble = error instanceof Error ? error.message : String(error);
      const mayPass = error instanceof ApiError && error.mayPass;
      useLive.setState({ connection: connectionAfter(error), trouble });
      if (!mayPass) return;
      await new Promise((done) => setTimeout(done, RETRY_MS));
    }
  }
}

function writeAddress(live: Live): void {
  const { crowd, player, selected, inside, numbers, follow, connection } = useLive.getState();
  if (connection === 'connecting' || !live.own) return;
  const open = [inside && 'inside', numbers && 'numbers'].filter((name) => name !== false);
  const hash = writeLink({
    mode: 'live',
    pack: player.pack,
    body: player.body,
    style: player.style,
    n: crowd.count,
    who: crowd.who,
    cam: live.stage.cameraState(),
    follow,
    ...(selected && selected !== live.own.id ? { sel: selected } : {}),
    ...(open.length > 0 ? { open } : {}),
  });
  if (hash !== location.hash) history.replaceState(null, '', hash);
}

export function LiveMode(props: ModeProps) {
  const live = useLiveOn(props);
  const [isHelpOpen, setHelpOpen] = useState(false);
  useKeys(live, () => {
    setHelpOpen((isOpen) => !isOpen);
  });
  if (!live) return null;
  return (
    <>
      <Head />
      <Banner />
      <aside className="side" aria-label="Panels">
        <PlayerPanel live={live} />
        <CrowdPanel live={live} />
        <OutfitPanel room={live} />
        <InsidePanel live={live} />
        <NumbersPanel live={live} />
      </aside>
      <Toolbar
        live={live}
        onHelp={() => {
          setHelpOpen(true);
        }}
      />
      <Notices />
      <Help
        opened={isHelpOpen}
        onClose={() => {
          setHelpOpen(false);
        }}
      />
    </>
  );
}
