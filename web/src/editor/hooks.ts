// `window.editor`: what tests look at.
import type { Editor } from './editor';
import type { EditorScene } from './scene';
import { poseAt } from './clip';
import { targetFrame, targetPose } from './segment';
import { chosenVariant, docOf, isStale, useEditor } from './store';

export interface EditorHooks {
  frames: () => number;
  frame: () => number;
  gap: () => { start: number; end: number } | undefined;
  targets: () => number[];
  edited: () => boolean[];
  variants: () => { seed: number; frames: number; last: [number, number, number] }[];
  isStale: () => boolean;
  trouble: () => string;
  /** Joints of the user's own rig; 0 on a pack's body. */
  ownJoints: () => number;
  /** How far the chosen variant is from the keyframes that it has to meet, at most, metres and parts of quaternions. */
  missed: () => number;
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
    ownJoints: () => useEditor.getState().own?.rig.skeleton.names.length ?? 0,
    missed: () => {
      const { filled, rig } = useEditor.getState();
      const variant = chosenVariant(useEditor.getState());
      if (!filled || !variant || !rig) return NaN;
      const { doc: of } = filled;
      const { contextFrames } = rig.limits;
      const context = Array.from({ length: contextFrames }, (_, c) => [c, poseAt(of.clip, of.gap.start + c)] as const);
      const ends = of.targets.map((_, t) => {
        return [variant.clip.frames - of.targets.length + t, targetPose(of, t)] as const;
      });
      const apart = [...context, ...ends].flatMap(([frame, { root, rotations }]) => {
        const met = poseAt(variant.clip, frame);
        return [...root.map((x, i) => x - met.root[i]!), ...rotations.map((x, i) => x - met.rotations[i]!)];
      });
      return Math.max(...apart.map(Math.abs));
    },
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
