// The loop of the screen, and what the pointer does on the stage.
import { wear } from '../bodies/wardrobe';
import type { Stage } from '../stage/types';
import type { Live } from './live';
import { notice, report, useLive } from './store';

/** A pointer that moved farther than this while it was down has dragged, pixels. */
const DRAG_PX = 5;
/** Frames that took longer count as this long, seconds. */
const LONGEST_S = 0.25;

/** What a mode does with the screen's frames and with clicks on the stage. */
export interface StageEvents {
  /** `dt` in seconds. */
  frame: (now_ms: number, dt: number) => void;
  click: (x: number, y: number) => void;
  /** Main-thread time of the frame and its drawing. */
  onTime?: (ms: number) => void;
  /** Files were dropped on the page. Without it the loop does not listen for them. */
  onFiles?: (files: File[]) => Promise<void>;
}

/** Renders the stage until the function that it returns is called. */
export function runStage(live: Live): () => void {
  return runLoop(live.stage, {
    frame: (now_ms, dt) => {
      live.frame(now_ms, dt);
    },
    click: (x, y) => {
      live.click(x, y);
    },
    onTime: (ms) => {
      live.meters.frame_ms.add(ms);
    },
    onFiles: (files) => giveSkin(live, files),
  });
}

/** Renders a stage for a mode until the function that it returns is called. */
export function runLoop(stage: Stage, events: StageEvents): () => void {
  const { canvas } = stage.three;
  const abort = new AbortController();
  const { signal } = abort;
  let last = performance.now();
  let request = requestAnimationFrame(function draw(now) {
    const started = performance.now();
    events.frame(now, Math.min(LONGEST_S, Math.max(0, (now - last) / 1000)));
    last = now;
    stage.render();
    events.onTime?.(performance.now() - started);
    request = requestAnimationFrame(draw);
  });
  let down: { x: number; y: number } | undefined;
  canvas.addEventListener(
    'pointerdown',
    (event) => {
      down = event.button === 0 ? { x: event.clientX, y: event.clientY } : undefined;
      canvas.focus({ preventScroll: true });
    },
    { signal },
  );
  canvas.addEventListener(
    'pointerup',
    (event) => {
      if (down && Math.hypot(event.clientX - down.x, event.clientY - down.y) < DRAG_PX) {
        events.click(event.clientX, event.clientY);
      }
      down = undefined;
    },
    { signal },
  );
  if (events.onFiles) takeFiles(events.onFiles, signal);
  return () => {
    cancelAnimationFrame(request);
    abort.abort();
  };
}

function takeFiles(onFiles: NonNullable<StageEvents['onFiles']>, signal: AbortSignal): void {
  window.addEventListener(
    'dragover',
    (event) => {
      event.preventDefault();
    },
    { signal },
  );
  window.addEventListener(
    'drop',
    (event) => {
      event.preventDefault();
      const files = [...(event.dataTransfer?.files ?? [])];
      if (files.length > 0) void onFiles(files).catch(report);
    },
    { signal },
  );
}

/** A character that is dropped becomes the skin of the selected character's body. A TOML beside it corrects its parts. */
export async function giveSkin(live: Live, files: readonly File[]): Promise<void> {
  const one = live.crowd.all.get(useLive.getState().selected ?? '') ?? live.own;
  const isParts = ({ name }: File) => name.toLowerCase().endsWith('.toml');
  const file = files.find((each) => !isParts(each)) ?? files[0];
  if (!one || !file) return;
  const corrections = (await files.find(isParts)?.text()) ?? '';
  const { kind, state, joints, triangles, fit } = await wear(live, one.kind, file, { corrections });
  if (state === 'refused') notice(`${file.name} is refused: ${fit!.certificate.faults[0]}.`, 'error');
  else notice(`${file.name} is the skin of ${kind.key}: ${joints} joints, ${triangles} triangles.`);
}
