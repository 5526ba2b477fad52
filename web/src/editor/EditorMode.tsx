// The in-between editor on the page: makes it run, and lays out its panels.
import './editor.css';
import { Text, useComputedColorScheme, useMantineColorScheme } from '@mantine/core';
import { CircleHelp, Moon, ScanSearch, Sun } from 'lucide-react';
import { useEffect, useState } from 'react';
import { create } from 'zustand';
import { Help } from '../app/Help';
import { Tool } from '../app/Tool';
import { PeopleTool } from '../bodies/PeopleTool';
import type { ModeProps } from '../app/modes';
import { Notices } from '../live/Signs';
import { runLoop } from '../live/stage-events';
import { notice, report } from '../live/store';
import type { Stage } from '../stage/types';
import { ApiError } from '../wire/api';
import { ClipPanel, KeyframesPanel, OpenButtons } from './ClipPanel';
import { Editor, WALK } from './editor';
import { FillPanel, TroubleAlert } from './FillPanel';
import { installEditorHooks } from './hooks';
import { HELP, useEditorKeys } from './keys';
import type { OwnRig } from './own';
import { readEditorLink, writeEditorLink } from './link';
import { EditorScene } from './scene';
import { withEnd, withStart } from './segment';
import { docOf, INITIAL, useEditor } from './store';
import { Timeline } from './Timeline';
import { ExportPanel, VariantsPanel } from './VariantsPanel';

/** Time between writes of the address, ms. */
const LINK_MS = 700;
/** Time between tries to start, ms. */
const RETRY_MS = 1500;

interface Running {
  editor: Editor;
  scene: EditorScene;
}

const useRunning = create<{ running: Running | undefined }>(() => ({ running: undefined }));

/** Starts the mode; it ends with the component. */
function useEditorOn({ stage, api }: ModeProps): Running | undefined {
  useEffect(() => {
    useEditor.setState(INITIAL, true);
    const editor = new Editor(api);
    const scene = new EditorScene(stage, editor);
    const stop = runLoop(stage, {
      frame: (_, dt) => {
        scene.frame(dt);
      },
      click: (x, y) => {
        scene.click(x, y);
      },
    });
    const uninstall = installEditorHooks(editor, scene);
    // Another clip, another view.
    const unsubscribe = useEditor.subscribe((now, before) => {
      if (now.own !== before.own) dress(stage, now.own, before.own);
      if (now.captured !== before.captured || (now.layout !== before.layout && now.filled)) scene.lookAtGap();
    });
    const abort = new AbortController();
    start(editor, stage, abort.signal).catch(report);
    const timer = setInterval(() => {
      writeAddress(stage);
    }, LINK_MS);
    useRunning.setState({ running: { editor, scene } });
    return () => {
      abort.abort();
      clearInterval(timer);
      unsubscribe();
      stop();
      uninstall();
      scene.dispose();
      editor.dispose();
      dress(stage, undefined, useEditor.getState().own);
      useRunning.setState({ running: undefined });
    };
  }, [stage, api]);
  return useRunning((state) => state.running);
}

/** Shows the mesh of the user's own rig. Without one, or if it does not fit, the rig has capsules. */
function dress(stage: Stage, own: OwnRig | undefined, before: OwnRig | undefined): void {
  if (before?.glb) stage.setSkin(before.rig.skeleton, null).catch(report);
  if (own?.glb) stage.setSkin(own.rig.skeleton, own.glb.buffer).catch(report);
}

/** Opens what the address says. */
async function start(editor: Editor, stage: Stage, signal: AbortSignal): Promise<void> {
  const link = readEditorLink(location.hash);
  useEditor.setState(({ form }) => ({ form: { ...form, ...link.form } }));
  await startPatiently(editor, link.pack ?? '', signal);
  if (signal.aborted) return;
  if (link.clip !== WALK) return;
  await editor.walk();
  for (let t = 1; t < (link.targets ?? 1); t++) editor.addTarget();
  const { from, to, cam } = link;
  if (from !== undefined) {
    // The end moves first, so that the beginning has room.
    editor.setGap(
      ({ start: was }, { limits }, frames) => withEnd({ start: was, end: was }, to ?? from, limits, frames),
      'link',
    );
    editor.setGap((gap, { limits }) => withStart(gap, from, limits), 'link');
  }
  if (to !== undefined) editor.setGap((gap, { limits }, frames) => withEnd(gap, to, limits, frames), 'link');
  editor.setFrame(editor.doc?.gap.start ?? 0);
  if (cam) stage.setCamera(cam);
}

/** A server that is not there yet is asked again. */
async function startPatiently(editor: Editor, pack: string, signal: AbortSignal): Promise<void> {
  while (!signal.aborted) {
    try {
      await editor.start(pack);
      return;
    } catch (error) {
      if (!(error instanceof ApiError && error.mayPass)) throw error;
      notice(`${error.message}; asking again …`, 'error');
      await new Promise((done) => setTimeout(done, RETRY_MS));
    }
  }
}

function writeAddress(stage: Stage): void {
  const state = useEditor.getState();
  const doc = docOf(state);
  if (!state.rig) return;
  const isWalk = state.file === WALK;
  const hash = writeEditorLink({
    pack: state.rig.pack,
    form: state.form,
    ...(isWalk && doc ? { clip: WALK, from: doc.gap.start, to: doc.gap.end, targets: doc.targets.length } : {}),
    ...(isWalk ? { cam: stage.cameraState() } : {}),
  });
  if (hash !== location.hash) history.replaceState(null, '', hash);
}

/** A file that is dropped anywhere is opened. Returns whether one hovers over the page. */
function useDrop(editor: Editor | undefined): boolean {
  const [isOver, setOver] = useState(false);
  useEffect(() => {
    if (!editor) return undefined;
    const abort = new AbortController();
    const { signal } = abort;
    const listen = (name: 'dragover' | 'dragleave' | 'drop', does: (event: DragEvent) => void) => {
      window.addEventListener(
        name,
        (event) => {
          event.preventDefault();
          does(event);
        },
        { signal },
      );
    };
    listen('dragover', () => {
      setOver(true);
    });
    listen('dragleave', ({ relatedTarget }) => {
      if (!relatedTarget) setOver(false);
    });
    listen('drop', ({ dataTransfer }) => {
      setOver(false);
      const file = dataTransfer?.files[0];
      if (file) void editor.open(file);
    });
    return () => {
      abort.abort();
    };
  }, [editor]);
  return isOver;
}

function Head() {
  const file = useEditor((state) => state.file);
  const frames = useEditor((state) => docOf(state)?.clip.frames);
  return (
    <header className="head">
      <h1>Troupe</h1>
      <p>{file ? `${file} · ${frames} frames` : 'fills gaps in motion'}</p>
    </header>
  );
}

function DropArea({ editor, isOver }: { editor: Editor; isOver: boolean }) {
  const pack = useEditor((state) => state.rig?.pack);
  const isEmpty = useEditor((state) => state.history === undefined);
  if (!isEmpty && !isOver) return null;
  return (
    <section className="card" data-over={isOver} aria-label="Open a clip">
      <Text fw={600} mb={4}>
        Drop a clip
      </Text>
      <Text size="sm" c="dimmed" mb="md">
        BVH, glb, vrm, or CSV for robots. With other joints than those of pack {pack ?? '…'} it keeps its own rig.
      </Text>
      {isEmpty && <OpenButtons editor={editor} />}
      {isEmpty && <TroubleAlert />}
    </section>
  );
}

function Tools({ scene, onHelp }: { scene: EditorScene; onHelp: () => void }) {
  const { setColorScheme } = useMantineColorScheme();
  const scheme = useComputedColorScheme('light');
  return (
    <nav className="bar under-head" aria-label="Tools">
      <Tool
        label="Look at the gap (C)"
        icon={ScanSearch}
        onClick={() => {
          scene.lookAtGap();
        }}
      />
      <PeopleTool />
      <Tool
        label="Light or dark (T)"
        icon={scheme === 'dark' ? Sun : Moon}
        onClick={() => {
          setColorScheme(scheme === 'dark' ? 'light' : 'dark');
        }}
      />
      <Tool label="Help (?)" icon={CircleHelp} onClick={onHelp} />
    </nav>
  );
}

export function EditorMode(props: ModeProps) {
  const running = useEditorOn(props);
  const [isHelpOpen, setHelpOpen] = useState(false);
  const isOver = useDrop(running?.editor);
  const toggleHelp = () => {
    setHelpOpen((isOpen) => !isOpen);
  };
  useEditorKeys(running?.editor, running?.scene, toggleHelp);
  if (!running) return null;
  const { editor } = running;
  return (
    <>
      <Head />
      <DropArea editor={editor} isOver={isOver} />
      <aside className="side" aria-label="Panels">
        <ClipPanel editor={editor} />
        <KeyframesPanel editor={editor} />
        <FillPanel editor={editor} />
        <VariantsPanel editor={editor} />
        <ExportPanel editor={editor} />
      </aside>
      <Tools scene={running.scene} onHelp={toggleHelp} />
      <Timeline editor={editor} />
      <Notices />
      <Help
        opened={isHelpOpen}
        onClose={() => {
          setHelpOpen(false);
        }}
        keys={HELP}
      >
        Drag the ends of the gap on the timeline, or the gap as a whole; the wheel zooms, with Shift it moves along. At
        a keyframe drag a ball: hands and feet bend their limb, the ball at the pelvis moves the body. Click a variant
        to choose it.
      </Help>
    </>
  );
}
