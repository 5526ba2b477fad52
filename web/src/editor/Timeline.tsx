// The timeline: a ruler, the gap with its two handles, context and keyframes, and the playhead.
import { ActionIcon, Tooltip } from '@mantine/core';
import { useElementSize, useMergedRef } from '@mantine/hooks';
import { Pause, Play, Redo2, Repeat, SkipBack, SkipForward, Undo2, ZoomIn, ZoomOut } from 'lucide-react';
import type { KeyboardEvent, PointerEvent, ReactNode } from 'react';
import { useEffect, useRef } from 'react';
import type { Editor } from './editor';
import type { Doc } from './segment';
import { lengthOf, moved, panned, rulerStep, withEnd, withStart, zoomed } from './segment';
import { docOf, useEditor } from './store';

function Button({
  label,
  isOn,
  isOff,
  onClick,
  children,
}: {
  label: string;
  isOn?: boolean;
  isOff?: boolean;
  onClick: () => void;
  children: ReactNode;
}) {
  return (
    <Tooltip label={label}>
      <ActionIcon
        variant={isOn ? 'light' : 'subtle'}
        color={isOn ? 'accent' : 'gray'}
        size="md"
        aria-label={label}
        aria-pressed={isOn}
        disabled={isOff ?? false}
        onClick={onClick}
      >
        {children}
      </ActionIcon>
    </Tooltip>
  );
}

function Transport({ editor, doc }: { editor: Editor; doc: Doc }) {
  const frame = useEditor((state) => state.frame);
  const isPlaying = useEditor((state) => state.isPlaying);
  const loopsGap = useEditor((state) => state.loopsGap);
  const canUndo = useEditor((state) => (state.history?.past.length ?? 0) > 0);
  const canRedo = useEditor((state) => (state.history?.future.length ?? 0) > 0);
  const zoom = (factor: number) => {
    useEditor.setState(({ range }) => ({ range: zoomed(range, factor, frame, doc.clip.frames) }));
  };
  return (
    <div className="transport">
      <Button
        label="Start of the gap (Home)"
        onClick={() => {
          editor.setFrame(doc.gap.start);
        }}
      >
        <SkipBack size={16} />
      </Button>
      <Button
        label={isPlaying ? 'Pause (Space)' : 'Play (Space)'}
        onClick={() => {
          editor.togglePlay();
        }}
      >
        {isPlaying ? <Pause size={18} /> : <Play size={18} />}
      </Button>
      <Button
        label="Last keyframe (End)"
        onClick={() => {
          editor.setFrame(doc.gap.end);
        }}
      >
        <SkipForward size={16} />
      </Button>
      <Button
        label={loopsGap ? 'Loops the gap' : 'Loops the whole clip'}
        isOn={loopsGap}
        onClick={() => {
          useEditor.setState({ loopsGap: !loopsGap });
        }}
      >
        <Repeat size={16} />
      </Button>
      <output className="frame" aria-label="Frame">
        {frame}
        <small>
          {' '}
          / {doc.clip.frames - 1} · {(frame / doc.clip.fps).toFixed(2)} s
        </small>
      </output>
      <span className="grow" />
      <small>
        gap {doc.gap.start}–{doc.gap.end}: {lengthOf(doc.gap)} frames, {(lengthOf(doc.gap) / doc.clip.fps).toFixed(2)} s
      </small>
      <span className="grow" />
      <Button
        label="Undo (Ctrl+Z)"
        isOff={!canUndo}
        onClick={() => {
          editor.undo();
        }}
      >
        <Undo2 size={16} />
      </Button>
      <Button
        label="Redo (Ctrl+Shift+Z)"
        isOff={!canRedo}
        onClick={() => {
          editor.redo();
        }}
      >
        <Redo2 size={16} />
      </Button>
      <Button
        label="Show more frames"
        onClick={() => {
          zoom(1 / 1.5);
        }}
      >
        <ZoomOut size={16} />
      </Button>
      <Button
        label="Show fewer frames"
        onClick={() => {
          zoom(1.5);
        }}
      >
        <ZoomIn size={16} />
      </Button>
    </div>
  );
}

/** A pointer that moved less has clicked, pixels. */
const CLICK_PX = 3;

/** Follows a pointer until it is lifted. `onMove` gets the distance from where it went down, in frames. */
function follow(
  event: PointerEvent,
  pixelsPerFrame: number,
  onMove: (frames: number) => void,
  onEnd: (isClick: boolean) => void,
): void {
  if (event.button !== 0) return;
  event.preventDefault();
  event.stopPropagation();
  const { pointerId, clientX } = event;
  const element = event.currentTarget as HTMLElement;
  if (element.tabIndex >= 0) element.focus({ preventScroll: true });
  element.setPointerCapture(pointerId);
  let isClick = true;
  const move = (moveEvent: globalThis.PointerEvent) => {
    isClick &&= Math.abs(moveEvent.clientX - clientX) < CLICK_PX;
    if (!isClick) onMove((moveEvent.clientX - clientX) / pixelsPerFrame);
  };
  const end = () => {
    element.removeEventListener('pointermove', move);
    onEnd(isClick);
  };
  element.addEventListener('pointermove', move);
  element.addEventListener('lostpointercapture', end, { once: true });
}

interface TrackProps {
  editor: Editor;
  doc: Doc;
  contextFrames: number;
}

function Track({ editor, doc, contextFrames }: TrackProps) {
  const track = useRef<HTMLDivElement>(null);
  const { ref: sized, width } = useElementSize<HTMLDivElement>();
  const ref = useMergedRef(track, sized);
  const range = useEditor((state) => state.range);
  const { clip, gap, targets } = doc;
  const perFrame = width / Math.max(range.to - range.from, 1);
  const x = (frame: number) => (frame - range.from) * perFrame;
  const wide = (frames: number) => Math.max(frames * perFrame, 1);

  useEffect(() => {
    const element = track.current;
    if (!element) return undefined;
    const wheel = (event: WheelEvent) => {
      event.preventDefault();
      const at = range.from + (event.clientX - element.getBoundingClientRect().left) / perFrame;
      const by = event.shiftKey ? event.deltaY + event.deltaX : event.deltaX;
      const next =
        Math.abs(by) > Math.abs(event.shiftKey ? 0 : event.deltaY)
          ? panned(range, by / perFrame, clip.frames)
          : zoomed(range, Math.exp(-event.deltaY / 400), at, clip.frames);
      useEditor.setState({ range: next });
    };
    element.addEventListener('wheel', wheel, { passive: false });
    return () => {
      element.removeEventListener('wheel', wheel);
    };
  }, [range, perFrame, clip.frames]);

  const frameAt = ({ clientX }: PointerEvent) => {
    const left = track.current?.getBoundingClientRect().left ?? 0;
    return Math.round(range.from + (clientX - left) / perFrame - 0.5);
  };
  const scrub = (event: PointerEvent) => {
    const first = frameAt(event);
    useEditor.setState({ isPlaying: false });
    editor.setFrame(first);
    follow(
      event,
      perFrame,
      (by) => {
        editor.setFrame(first + by);
      },
      () => undefined,
    );
  };
  const drag = (what: 'start' | 'end' | 'gap', event: PointerEvent) => {
    const was = gap;
    const change = (by: number) => {
      editor.setGap((_, { limits }, frames) => {
        if (what === 'start') return withStart(was, was.start + by, limits);
        if (what === 'end') return withEnd(was, was.end + by, limits, frames);
        return moved(was, by, frames);
      }, `drag ${what}`);
    };
    const frame = frameAt(event);
    follow(event, perFrame, change, (isClick) => {
      editor.endGesture();
      if (isClick && what === 'gap') editor.step(frame - useEditor.getState().frame);
    });
  };
  const steps = (what: 'start' | 'end') => (event: KeyboardEvent) => {
    const by = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageUp: 10, PageDown: -10 }[event.key];
    if (by === undefined) return;
    event.preventDefault();
    event.stopPropagation();
    editor.setGap(
      (now, { limits }, frames) =>
        what === 'start' ? withStart(now, now.start + by, limits) : withEnd(now, now.end + by, limits, frames),
      `key ${what}`,
    );
  };

  const step = rulerStep(perFrame || 1);
  const firstMark = Math.ceil(range.from / step) * step;
  const marks = Array.from(
    { length: Math.max(0, Math.ceil((range.to - firstMark) / step)) },
    (_, n) => firstMark + n * step,
  );
  const handle = (what: 'start' | 'end', frame: number, label: string) => (
    <div
      className={`gap-handle ${what}`}
      role="slider"
      tabIndex={0}
      aria-label={label}
      aria-valuemin={0}
      aria-valuemax={clip.frames - 1}
      aria-valuenow={what === 'start' ? gap.start : gap.end}
      style={{ left: x(frame) }}
      onPointerDown={(event) => {
        drag(what, event);
      }}
      onKeyDown={steps(what)}
    />
  );
  return (
    <div className="track" ref={ref}>
      <div className="ruler" onPointerDown={scrub}>
        {marks.map((frame) => (
          <span key={frame} style={{ left: x(frame + 0.5) }}>
            {frame}
          </span>
        ))}
      </div>
      <div className="lane" onPointerDown={scrub}>
        <div className="clip" style={{ left: x(0), width: wide(clip.frames) }} />
        <div
          className="gap"
          style={{ left: x(gap.start), width: wide(lengthOf(gap)) }}
          onPointerDown={(event) => {
            drag('gap', event);
          }}
        />
        {Array.from({ length: contextFrames }, (_, c) => (
          <i key={c} className="context" style={{ left: x(gap.start + c), width: wide(1) }} />
        ))}
        {targets.map(({ givesRoot, givesPose, edited }, t) => (
          <i
            key={t}
            className="target"
            data-part={givesRoot && givesPose ? 'whole' : givesRoot ? 'root' : 'pose'}
            data-edited={edited !== undefined}
            style={{ left: x(gap.end - (targets.length - 1 - t)), width: wide(1) }}
          />
        ))}
        {handle('start', gap.start, 'First context frame')}
        {handle('end', gap.end + 1, 'Last keyframe')}
      </div>
      <Playhead x={x} />
    </div>
  );
}

function Playhead({ x }: { x: (frame: number) => number }) {
  const frame = useEditor((state) => state.frame);
  return <div className="playhead" style={{ left: x(frame + 0.5) }} />;
}

export function Timeline({ editor }: { editor: Editor }) {
  const doc = useEditor(docOf);
  const limits = useEditor((state) => state.rig?.limits);
  if (!doc || !limits) return null;
  return (
    <section className="timeline" aria-label="Timeline">
      <Transport editor={editor} doc={doc} />
      <Track editor={editor} doc={doc} contextFrames={limits.contextFrames} />
    </section>
  );
}
