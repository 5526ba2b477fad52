// Frames that an answer holds, played in the place of a character.
import type { Frames } from '../wire/types';
import type { BodyKind } from './bodies';
import type { Character } from './character';
import { toXyzw } from './character';
import { slerp } from './playback';

export class Clip {
  private readonly roots: Float32Array;
  private readonly rotations: Float32Array;
  private readonly joints: number;
  private readonly fps: number;
  private time = 0;

  constructor(parts: readonly Frames[], kind: BodyKind) {
    this.joints = kind.skeleton.names.length;
    this.fps = kind.fps;
    this.roots = Float32Array.from(parts.flatMap((part) => part.root_positions));
    this.rotations = toXyzw(parts.flatMap((part) => part.rotations));
  }

  get frames(): number {
    return this.roots.length / 3;
  }

  /** Goes on by `dt` seconds and writes the pose. Returns false behind the last frame. */
  sample(dt: number, into: Pick<Character, 'root' | 'rotations'>): boolean {
    const at = this.time * this.fps;
    this.time += dt;
    const from = Math.floor(at);
    if (from >= this.frames - 1) return false;
    const t = at - from;
    for (let i = 0; i < 3; i++) {
      const a = this.roots[from * 3 + i]!;
      into.root[i] = a + (this.roots[from * 3 + 3 + i]! - a) * t;
    }
    const size = this.joints * 4;
    for (let i = 0; i < size; i += 4) {
      slerp(this.rotations, from * size + i, this.rotations, (from + 1) * size + i, t, into.rotations, i);
    }
    return true;
  }
}
