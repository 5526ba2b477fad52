// Whether people look like people: the project's own body, or capsules.
import { useEffect } from 'react';
import { create } from 'zustand';
import { report } from '../live/store';
import type { Stage } from '../stage/types';
// Among the page's own parts, under /assets/: other paths of the server may ask for a key.
import HUMAN from './human.glb?url';

const KEPT = 'troupe-people';

/** The choice is the browser's, for all modes. */
export const usePeople = create(() => ({ isOn: localStorage.getItem(KEPT) !== 'capsules' }));

export function togglePeople(): void {
  const isOn = !usePeople.getState().isOn;
  localStorage.setItem(KEPT, isOn ? 'bodies' : 'capsules');
  usePeople.setState({ isOn });
}

let file: Promise<ArrayBuffer> | undefined;

/** The file; fetched once. */
function human(): Promise<ArrayBuffer> {
  file ??= fetch(HUMAN).then((answer) => {
    if (!answer.ok) throw new Error(`the body of people cannot be read: the server answered ${answer.status}`);
    return answer.arrayBuffer();
  });
  file.catch(() => {
    file = undefined;
  });
  return file;
}

/** Has the stage show what was chosen. */
export function usePeopleOn(stage: Stage | undefined): void {
  const isOn = usePeople((state) => state.isOn);
  useEffect(() => {
    if (!stage) return undefined;
    let isNow = true;
    const glb = isOn ? human() : Promise.resolve(null);
    glb.then((read) => (isNow ? stage.setPerson(read) : undefined)).catch(report);
    return () => {
      isNow = false;
    };
  }, [stage, isOn]);
}
