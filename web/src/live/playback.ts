// From ticks to the screen's rate: a clock that stays a little behind what has come, and poses
// between frames.
import type { DecodedBlock } from '../wire/codec';

/** Frames a second of the sessions' timelines. */
export const RATE_HZ = 30;
/** How far the picture stays behind the newest frame, seconds: two ticks. */
const DELAY_S = 2 / RATE_HZ;
/** Beyond these the clock jumps instead of going a little faster or slower. */
const MOST_BEHIND_S = 0.4;
const MOST_AHEAD_S = 0.2;

/** The time that is shown, in seconds of the stream. */
export class PlaybackClock {
  /** Time of the newest frame. */
  newest = 0;
  /** Time that is shown. */
  now = -DELAY_S;
  /** Seconds of the stream in a second. */
  speed = 1;
  private lead = DELAY_S;

  /** A frame came. */
  push(time: number): void {
    this.newest = Math.max(this.newest, time);
  }

  /** Goes on by a frame of the screen. */
  advance(dt: number): void {
    const delay = DELAY_S;
    this.now += dt * this.speed * (1 + clamp((this.lead - delay) * 2, -0.2, 0.2));
    const lead = this.newest - this.now;
    // Frames come in steps: what counts is the mean lead.
    this.lead += (lead - this.lead) * Math.min(1, dt * 5);
    if (lead > MOST_BEHIND_S || lead < -MOST_AHEAD_S) {
      this.now = this.newest - delay;
      this.lead = delay;
    }
    if (this.speed === 0) this.now = Math.min(this.newest, this.now + dt);
  }
}

interface Sample {
  time: number;
  block: DecodedBlock;
  /** Place of the character in the block. */
  place: number;
}

/** Samples of a character that are kept. */
const KEPT = 8;

/** The latest frames of one character. */
export class Track {
  private samples: Sample[] = [];

  push(time: number, block: DecodedBlock, place: number): void {
    const last = this.samples.at(-1);
    if (last && time <= last.time) return;
    this.samples.push({ time, block, place });
    if (this.samples.length > KEPT) this.samples.shift();
  }

  clear(): void {
    this.samples = [];
  }

  get isEmpty(): boolean {
    return this.samples.length === 0;
  }

  /** Key of the body whose joints the newest frame has. */
  get body(): string | undefined {
    return this.samples.at(-1)?.block.body;
  }

  /** Number of the newest frame on the session's timeline. */
  get frame(): number | undefined {
    const last = this.samples.at(-1);
    return last?.block.frames[last.place];
  }

  /** The newest `count` frames, oldest first: roots, and rotations as (x, y, z, w). Fewer if fewer came. */
  newest(count: number): { root: Float32Array; rotations: Float32Array }[] {
    return this.samples.slice(-count).map(({ block, place }) => ({
      root: block.roots.subarray(place * 3, place * 3 + 3),
      rotations: block.rotations.subarray(place * block.joints * 4, (place + 1) * block.joints * 4),
    }));
  }

  /** Writes the pose at a time. Contact bits are those of the frame before. Returns them, or -1 without a frame. */
  sample(time: number, root: Float32Array, rotations: Float32Array): number {
    const { samples } = this;
    if (samples.length === 0) return -1;
    let at = samples.length - 1;
    while (at > 0 && samples[at]!.time > time) at--;
    const a = samples[at]!;
    const b = samples[Math.min(at + 1, samples.length - 1)]!;
    const t = b.time > a.time ? clamp((time - a.time) / (b.time - a.time), 0, 1) : 0;
    for (let i = 0; i < 3; i++) {
      const from = a.block.roots[a.place * 3 + i]!;
      root[i] = from + (b.block.roots[b.place * 3 + i]! - from) * t;
    }
    const joints = Math.min(a.block.joints, b.block.joints, rotations.length / 4);
    const fromA = a.place * a.block.joints * 4;
    const fromB = b.place * b.block.joints * 4;
    for (let i = 0; i < joints * 4; i += 4) {
      slerp(a.block.rotations, fromA + i, b.block.rotations, fromB + i, t, rotations, i);
    }
    return a.block.contacts[a.place] ?? 0;
  }
}

/** Spherical interpolation between two rotations of unit length, the short way. */
export function slerp(
  a: Float32Array,
  ia: number,
  b: Float32Array,
  ib: number,
  t: number,
  out: Float32Array,
  to: number,
): void {
  const ax = a[ia]!;
  const ay = a[ia + 1]!;
  const az = a[ia + 2]!;
  const aw = a[ia + 3]!;
  const bx = b[ib]!;
  const by = b[ib + 1]!;
  const bz = b[ib + 2]!;
  const bw = b[ib + 3]!;
  const dot = ax * bx + ay * by + az * bz + aw * bw;
  const cos = Math.abs(dot);
  let wa = 1 - t;
  let wb = t;
  if (cos < 0.9995) {
    const angle = Math.acos(cos);
    const scale = 1 / Math.sin(angle);
    wa = Math.sin((1 - t) * angle) * scale;
    wb = Math.sin(t * angle) * scale;
  }
  if (dot < 0) wb = -wb;
  const x = ax * wa + bx * wb;
  const y = ay * wa + by * wb;
  const z = az * wa + bz * wb;
  const w = aw * wa + bw * wb;
  const scale = 1 / Math.sqrt(x * x + y * y + z * z + w * w);
  out[to] = x * scale;
  out[to + 1] = y * scale;
  out[to + 2] = z * scale;
  out[to + 3] = w * scale;
}

export function clamp(value: number, low: number, high: number): number {
  return Math.min(high, Math.max(low, value));
}
