// Keys of the live mode, except those that steer.
import { useComputedColorScheme, useMantineColorScheme } from '@mantine/core';
import { useEffect } from 'react';
import { togglePeople } from '../bodies/person';
import { isTyping } from './control';
import type { Live } from './live';
import { useLive } from './store';

/** Listens while the mode is there. */
export function useKeys(live: Live | undefined, onHelp: () => void): void {
  const { setColorScheme } = useMantineColorScheme();
  const scheme = useComputedColorScheme('light');
  useEffect(() => {
    if (!live) return undefined;
    const press = (event: KeyboardEvent) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key === 'Escape') leave(live);
      if (isTyping(event.target, event.code) || document.querySelector('[role="dialog"]')) return;
      const isOnStage = event.target === live.stage.three.canvas || event.target === document.body;
      if (event.key === '?') onHelp();
      else if (event.key === 'v') togglePeople();
      else if (event.key === 't') setColorScheme(scheme === 'dark' ? 'light' : 'dark');
      else if (!act(live, event, isOnStage)) return;
      event.preventDefault();
    };
    window.addEventListener('keydown', press);
    return () => {
      window.removeEventListener('keydown', press);
    };
  }, [live, onHelp, scheme, setColorScheme]);
}

/** Does what a key stands for. Returns whether it stands for anything. */
function act(live: Live, event: KeyboardEvent, isOnStage: boolean): boolean {
  const { tool, follow, inside, numbers, time } = useLive.getState();
  switch (event.key) {
    case 'p':
      live.setTool(tool === 'draw' ? 'point' : 'draw');
      return true;
    case 'f':
      live.follow(!follow);
      return true;
    case 'i':
      useLive.setState({ inside: !inside });
      return true;
    case 'n':
      useLive.setState({ numbers: !numbers });
      return true;
    case 'x':
      live.faceFreely();
      return true;
    case 'c':
      live.findOwn();
      return true;
    case 'Home':
      live.resetView();
      return true;
    case '.':
      live.step();
      return true;
    case ' ':
      if (!isOnStage) return false;
      live.setTime(!time.paused, time.speed);
      return true;
    case 'Tab':
      // With the focus elsewhere Tab goes through the controls, as everywhere.
      if (event.target !== live.stage.three.canvas) return false;
      live.selectNext(event.shiftKey ? -1 : 1);
      return true;
    default:
      return false;
  }
}

function leave(live: Live): void {
  if (useLive.getState().tool === 'draw') live.setTool('point');
  // From the stage on to the controls; from a control to the stage.
  const { activeElement } = document;
  const { canvas } = live.stage.three;
  if (activeElement === canvas) document.querySelector<HTMLElement>('.bar button')?.focus();
  else if (!document.querySelector('[role="dialog"]')) canvas.focus();
}
