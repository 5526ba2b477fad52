// The editor's keys.
import { useComputedColorScheme, useMantineColorScheme } from '@mantine/core';
import { useEffect } from 'react';
import { Vector3 } from 'three';
import { togglePeople } from '../bodies/person';
import { isTyping } from '../live/control';
import type { Editor } from './editor';
import { ROOT } from './editor';
import type { EditorScene } from './scene';
import { withEnd, withStart } from './segment';
import { useEditor } from './store';

/** How far a key moves the selected handle, metres. */
const NUDGE_M = 0.01;

export const HELP: readonly (readonly [readonly string[], string])[] = [
  [['Space'], 'play and pause'],
  [['←', '→'], 'one frame; with Shift ten'],
  [['Home', 'End'], 'start and end of the gap'],
  [['[', ']'], 'start the gap here, end it here'],
  [['K'], 'add a keyframe; with Shift remove one'],
  [['Enter'], 'fill the gap'],
  [['1', '…', '8'], 'choose a variant'],
  [['H'], 'next handle of the keyframe'],
  [['R'], "turn or move the root's handle"],
  [['Alt', 'arrows'], 'move the handle by a centimetre; Page Up and Down lift it'],
  [['Ctrl', 'Z'], 'undo; with Shift redo'],
  [['C'], 'look at the gap'],
  [['V'], 'people as bodies or as capsules'],
  [['T'], 'light or dark'],
  [['Esc'], 'let go of the handle'],
  [['?'], 'this help'],
];

export function useEditorKeys(editor: Editor | undefined, scene: EditorScene | undefined, onHelp: () => void): void {
  const { setColorScheme } = useMantineColorScheme();
  const scheme = useComputedColorScheme('light');
  useEffect(() => {
    if (!editor || !scene) return undefined;
    const press = (event: KeyboardEvent) => {
      if (isForControl(event) || document.querySelector('[role="dialog"]')) return;
      if (event.key === '?') onHelp();
      else if (event.key === 'v' && !event.ctrlKey && !event.metaKey) togglePeople();
      else if (event.key === 't') setColorScheme(scheme === 'dark' ? 'light' : 'dark');
      else if (event.key === 'c' && !event.ctrlKey && !event.metaKey) scene.lookAtGap();
      else if (event.altKey ? !nudge(editor, event) : !act(editor, event)) return;
      event.preventDefault();
    };
    window.addEventListener('keydown', press);
    return () => {
      window.removeEventListener('keydown', press);
    };
  }, [editor, scene, onHelp, scheme, setColorScheme]);
}

/** Whether a key press belongs to the control that has the focus. */
function isForControl({ target, key, code, ctrlKey, metaKey }: KeyboardEvent): boolean {
  if (!(target instanceof HTMLElement)) return false;
  if (target.closest('button, a, input[type="checkbox"]')) return key === ' ' || key === 'Enter';
  // A slider takes arrows, but no commands.
  if (ctrlKey || metaKey) return target.closest('input, textarea, [contenteditable]') !== null;
  return isTyping(target, code);
}

/** Does what a key stands for. Returns whether it stands for anything. */
function act(editor: Editor, event: KeyboardEvent): boolean {
  const { key, shiftKey } = event;
  const command = event.ctrlKey || event.metaKey;
  if (command) {
    const letter = key.toLowerCase();
    if (letter === 'y' || (letter === 'z' && shiftKey)) editor.redo();
    else if (letter === 'z') editor.undo();
    else return false;
    return true;
  }
  const { frame, turns } = useEditor.getState();
  const doc = editor.doc;
  if (/^[1-8]$/.test(key)) editor.choose(Number(key) - 1);
  else if (key === ' ') editor.togglePlay();
  else if (key === 'ArrowLeft' || key === 'ArrowRight')
    editor.step((key === 'ArrowLeft' ? -1 : 1) * (shiftKey ? 10 : 1));
  else if (key === 'Home' && doc) editor.setFrame(doc.gap.start);
  else if (key === 'End' && doc) editor.setFrame(doc.gap.end);
  else if (key === '[') editor.setGap((gap, rig) => withStart(gap, frame, rig.limits), 'key [');
  else if (key === ']') editor.setGap((gap, rig, frames) => withEnd(gap, frame, rig.limits, frames), 'key ]');
  else if (key === 'k') editor.addTarget();
  else if (key === 'K') editor.removeTarget(0);
  else if (key === 'Enter') void editor.fill();
  else if (key === 'h' || key === 'H') nextHandle(editor, shiftKey ? -1 : 1);
  else if (key === 'r') useEditor.setState({ turns: !turns });
  else if (key === 'Escape') useEditor.setState({ handle: undefined });
  else return false;
  return true;
}

function nextHandle(editor: Editor, by: number): void {
  if (editor.posed === undefined) return;
  const names = [ROOT, ...editor.limbsNow().map(({ name }) => name)];
  const { handle } = useEditor.getState();
  const now = handle === undefined ? (by > 0 ? -1 : 0) : names.indexOf(handle);
  useEditor.setState({ handle: names[(now + by + names.length) % names.length] });
}

const STEPS: Record<string, readonly [number, number, number]> = {
  ArrowLeft: [1, 0, 0],
  ArrowRight: [-1, 0, 0],
  ArrowUp: [0, 0, 1],
  ArrowDown: [0, 0, -1],
  PageUp: [0, 1, 0],
  PageDown: [0, -1, 0],
};

function nudge(editor: Editor, { key }: KeyboardEvent): boolean {
  const step = STEPS[key];
  if (!step) return false;
  editor.nudge(new Vector3(...step).multiplyScalar(NUDGE_M));
  return true;
}
