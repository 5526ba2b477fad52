// `window.editor`: what tests look at.
import type { Editor } from './editor';
import type { EditorScene } from './scene';
import { targetFrame } from './segment';
import { docOf, isStale, useEditor } from './store';

export interface EditorHooks {
  frames: () => number;
  frame: () => number;
  gap: () => { start: number; end: number } | undefined;
  targets: () => number[];
  edited: () => boolean[];
  variants: () => { seed: number; frames: number; last: [number, number, number] }[];
  isStale: () => boolean;
  trouble: () => string;
  /** Where a handle is on the page, pixels. */
  handleAt: (name: string) => { x: number; y: number } | undefined;
  /** Where a handle is in the world, metres. */
  placeOf: (name: string) => [number, number, number] | undefined;
}

declare global {
  interface Window {
    editor?: EditorHooks;
  }
}

export function installEditorHooks(editor: Editor, scene: EditorScene): () => void {
  const doc = () => docOf(useEditor.getState());
  window.editor = {
    frames: () => doc()?.clip.frames ?? 0,
    frame: () => useEditor.getState().frame,
    gap: () => doc()?.gap,
    targets: () => {
      const now = doc();
      return now ? now.targets.map((_, t) => targetFrame(now, t)) : [];
    },
    edited: () => doc()?.targets.map(({ edited }) => edited !== undefined) ?? [],
    variants: () =>
      (useEditor.getState().filled?.variants ?? []).map(({ seed, clip }) => {
        const [x, y, z] = clip.roots.slice(-3) as unknown as [number, number, number];
        return { seed, frames: clip.frames, last: [x, y, z] };
      }),
    isStale: () => isStale(useEditor.getState()),
    trouble: () => useEditor.getState().trouble?.message ?? '',
    handleAt: (name) => scene.pixelOf(name),
    placeOf: (name) =>
      editor
        .handlePoints()
        .find((point) => point.name === name)
        ?.place.toArray(),
  };
  return () => {
    delete window.editor;
  };
}
