// Drawing on the ground with the pointer.
import type { DrawOptions } from './types';

const SPACING_M = 0.1;

interface Host {
  canvas: HTMLCanvasElement;
  /** The place on the ground under a pointer. */
  ground(x: number, y: number): [number, number, number] | undefined;
  /** Holds the camera still, or lets it go. */
  holdCamera(held: boolean): void;
}

/** Points of a stroke that lie at least `spacing_m` apart. */
export class Stroke {
  private readonly kept: number[] = [];

  constructor(private readonly spacing_m: number) {}

  /** Whether the point was far enough from the last one. */
  add([x, y, z]: readonly [number, number, number]): boolean {
    const last = this.kept.length - 3;
    if (last >= 0 && Math.hypot(x - this.kept[last]!, z - this.kept[last + 2]!) < this.spacing_m) return false;
    this.kept.push(x, y, z);
    return true;
  }

  points(): Float32Array {
    return new Float32Array(this.kept);
  }
}

/** Listens until the returned function is called. The camera rests meanwhile; wheel and second button still move it. */
export function drawOnGround(host: Host, options: DrawOptions): () => void {
  const { canvas } = host;
  let stroke: Stroke | null = null;
  const add = (event: PointerEvent): void => {
    // A slow screen puts several places into one event.
    const events = event.getCoalescedEvents();
    let isLonger = false;
    for (const { clientX, clientY } of events.length > 0 ? events : [event]) {
      const place = host.ground(clientX, clientY);
      if (place && stroke?.add(place)) isLonger = true;
    }
    if (isLonger && stroke) options.onDraw?.(stroke.points());
  };
  const down = (event: PointerEvent): void => {
    if (event.button !== 0) return;
    stroke = new Stroke(options.spacing_m ?? SPACING_M);
    canvas.setPointerCapture(event.pointerId);
    add(event);
  };
  const move = (event: PointerEvent): void => {
    if (stroke) add(event);
  };
  const end = (event: PointerEvent): void => {
    if (!stroke) return;
    const points = stroke.points();
    stroke = null;
    if (canvas.hasPointerCapture(event.pointerId)) canvas.releasePointerCapture(event.pointerId);
    options.onEnd(points);
  };
  host.holdCamera(true);
  canvas.addEventListener('pointerdown', down);
  canvas.addEventListener('pointermove', move);
  canvas.addEventListener('pointerup', end);
  canvas.addEventListener('pointercancel', end);
  return () => {
    stroke = null;
    host.holdCamera(false);
    canvas.removeEventListener('pointerdown', down);
    canvas.removeEventListener('pointermove', move);
    canvas.removeEventListener('pointerup', end);
    canvas.removeEventListener('pointercancel', end);
  };
}
