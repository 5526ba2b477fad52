// Keys of the scenes mode, except those that steer.
import { useComputedColorScheme, useMantineColorScheme } from '@mantine/core';
import { useEffect } from 'react';
import type { Keys } from '../app/Help';
import { togglePeople } from '../bodies/person';
import { isTyping } from '../live/control';
import { report } from '../live/store';
import type { Scenes } from './scenes';
import type { SceneTool } from './store';
import { useScenes } from './store';

export const SCENE_KEYS: Keys = [
  [['W', 'A', 'S', 'D'], 'walk; arrow keys do the same'],
  [['Shift'], 'run'],
  [['Tab'], 'next object, while the stage has the focus'],
  [['M', 'R'], 'move, turn the chosen object'],
  [['P'], 'put an object where the pointer clicks'],
  [['Del'], 'remove the chosen object'],
  [['U'], 'use the chosen object'],
  [['X'], 'end it: stand up from a seat, put a thing back'],
  [['G'], 'put down what is in the hand'],
  [['B'], 'cancel what it does'],
  [['F'], 'follow the character'],
  [['C'], 'bring the character back into the picture'],
  [['Home'], 'camera as at the start'],
  [['V'], 'people as bodies or as capsules'],
  [['T'], 'light or dark'],
  [['Esc'], 'to the stage; then let go of the tool, then of the object'],
  [['?'], 'this help'],
];

/** Listens while the mode is there. */
export function useSceneKeys(scenes: Scenes | undefined, onHelp: () => void): void {
  const { setColorScheme } = useMantineColorScheme();
  const scheme = useComputedColorScheme('light');
  useEffect(() => {
    if (!scenes) return undefined;
    const press = (event: KeyboardEvent) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (document.querySelector('[role="dialog"], [role="menu"]')) return;
      if (event.key === 'Escape') leave(scenes);
      if (isTyping(event.target, event.code)) return;
      if (event.key === '?') onHelp();
      else if (event.key === 'v') togglePeople();
      else if (event.key === 't') setColorScheme(scheme === 'dark' ? 'light' : 'dark');
      else if (!act(scenes, event)) return;
      event.preventDefault();
    };
    window.addEventListener('keydown', press);
    return () => {
      window.removeEventListener('keydown', press);
    };
  }, [scenes, onHelp, scheme, setColorScheme]);
}

function toggle(scenes: Scenes, tool: SceneTool): void {
  scenes.setTool(useScenes.getState().tool === tool ? 'choose' : tool);
}

/** Does what a key stands for. Returns whether it stands for anything. */
function act(scenes: Scenes, event: KeyboardEvent): boolean {
  switch (event.key) {
    case 'm':
      toggle(scenes, 'move');
      return true;
    case 'r':
      toggle(scenes, 'turn');
      return true;
    case 'p':
      toggle(scenes, 'place');
      return true;
    case 'u':
      scenes.use();
      return true;
    case 'x':
      scenes.actors.tell({ end_interaction: {} });
      return true;
    case 'g':
      scenes.actors.tell({ drop: {} });
      return true;
    case 'b':
      scenes.actors.tell({ cancel: {} });
      return true;
    case 'f':
      scenes.actors.follow(!useScenes.getState().follow);
      return true;
    case 'c':
      scenes.findActor();
      return true;
    case 'Home':
      scenes.resetView();
      return true;
    case 'Delete':
      scenes.remove().catch(report);
      return true;
    case 'Tab':
      // With the focus elsewhere Tab goes through the controls, as everywhere.
      if (event.target !== scenes.stage.three.canvas) return false;
      scenes.chooseNext(event.shiftKey ? -1 : 1);
      return true;
    default:
      return false;
  }
}

function leave(scenes: Scenes): void {
  const { tool, object } = useScenes.getState();
  const { canvas } = scenes.stage.three;
  if (document.activeElement !== canvas) canvas.focus();
  else if (tool !== 'choose') scenes.setTool('choose');
  else if (object !== null) scenes.choose(null);
  else document.querySelector<HTMLElement>('.bar button')?.focus();
}
