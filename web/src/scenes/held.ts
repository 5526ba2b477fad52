// Places of objects in hands, at the times of their frames: shown as late as the characters that
// carry them.
import { slerp } from '../live/playback';

interface Sample {
  time: number;
  /** x, y, z. */
  position: readonly [number, number, number];
  /** x, y, z, w. */
  rotation: Float32Array;
}

/** Samples that are kept: half a second. */
const KEPT = 16;

export class HeldTrack {
  private samples: Sample[] = [];

  push(
    time: number,
    position: readonly [number, number, number],
    rotation: readonly [number, number, number, number],
  ): void {
    const last = this.samples.at(-1);
    if (last && time <= last.time) return;
    this.samples.push({ time, position, rotation: Float32Array.from(rotation) });
    if (this.samples.length > KEPT) this.samples.shift();
  }

  /** Time of the newest sample. */
  get newest(): number {
    return this.samples.at(-1)?.time ?? -Infinity;
  }

  /** Writes the place at a time. Returns whether the object is in the hand by then; beyond the newest it stays there. */
  sample(time: number, position: Float32Array, rotation: Float32Array): boolean {
    const { samples } = this;
    if (samples.length === 0 || time < samples[0]!.time) return false;
    let at = samples.length - 1;
    while (at > 0 && samples[at]!.time > time) at--;
    const a = samples[at]!;
    const b = samples[Math.min(at + 1, samples.length - 1)]!;
    const t = b.time > a.time ? Math.min(1, (time - a.time) / (b.time - a.time)) : 0;
    for (let i = 0; i < 3; i++) position[i] = a.position[i]! + (b.position[i]! - a.position[i]!) * t;
    slerp(a.rotation, 0, b.rotation, 0, t, rotation, 0);
    return true;
  }
}
