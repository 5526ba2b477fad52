// One character of the page: its session, its frames and its commands.
import type { Command, Intent, Keyframe } from '../wire/types';
import type { BodyKind } from './bodies';
import type { Role } from './cast';
import { Track } from './playback';
import type { Wanderer } from './steering';

export class Character {
  readonly track = new Track();
  readonly root = new Float32Array(3);
  readonly rotations: Float32Array;
  readonly contacts: Uint8Array;
  /** Bits of the contact joints that stand, of the frame that is shown. */
  contactBits = 0;
  /** Place on the stream. */
  slot: number | undefined;
  isShown = false;
  /** Wanders by itself; the own character does not. */
  wanderer: Wanderer | undefined;
  /** Seconds until it thinks again. */
  rest = 0;
  private sequence = 0;

  constructor(
    /** Its name on the page, for as long as it is there. */
    readonly id: string,
    /** Its name on the server; another one after it was opened again. */
    public session: string,
    readonly kind: BodyKind,
    readonly role: Role,
    readonly tint: number,
  ) {
    this.rotations = new Float32Array(kind.skeleton.names.length * 4);
    this.contacts = new Uint8Array(kind.contactJoints.length);
  }

  command(intent: Intent): Command {
    this.sequence += 1;
    return { session_id: this.session, sequence: this.sequence, ...intent };
  }

  /** A command that leaves the character to do what it does. */
  signOfLife(): Command {
    this.sequence += 1;
    return { session_id: this.session, sequence: this.sequence };
  }

  /** The server has taken commands up to here. */
  seen(sequence: number): void {
    this.sequence = Math.max(this.sequence, sequence);
  }

  /** Which way it heads over the ground, from its last frames; `undefined` if it stands. */
  get moving(): number | undefined {
    const [before, now] = this.track.newest(2);
    if (!before || !now) return undefined;
    const [dx, dz] = [now.root[0]! - before.root[0]!, now.root[2]! - before.root[2]!];
    return Math.hypot(dx, dz) < 0.004 ? undefined : Math.atan2(dx, dz);
  }

  /** The newest frame as a keyframe. */
  lastFrame(): Keyframe | undefined {
    return this.lastFrames(1)[0];
  }

  /** The newest frames as keyframes, oldest first. */
  lastFrames(count: number): Keyframe[] {
    return this.track.newest(count).map(({ root, rotations }) => ({
      root: { position: { x: root[0]!, y: root[1]!, z: root[2]! } },
      pose: { rotations: toWxyz(rotations) },
    }));
  }

  /** Writes the pose at a time to be shown. Returns whether there is one. */
  sample(time: number): boolean {
    const bits = this.track.sample(time, this.root, this.rotations);
    if (bits < 0) return false;
    this.contactBits = bits;
    for (let i = 0; i < this.contacts.length; i++) this.contacts[i] = (bits >> i) & 1;
    return true;
  }
}

/** The wire's order of a quaternion, from the stage's. */
export function toWxyz(xyzw: ArrayLike<number>): number[] {
  const out = new Array<number>(xyzw.length);
  for (let i = 0; i < xyzw.length; i += 4) {
    out[i] = xyzw[i + 3]!;
    out[i + 1] = xyzw[i]!;
    out[i + 2] = xyzw[i + 1]!;
    out[i + 3] = xyzw[i + 2]!;
  }
  return out;
}

/** The stage's order of a quaternion, from the wire's. */
export function toXyzw(wxyz: ArrayLike<number>): Float32Array {
  const out = new Float32Array(wxyz.length);
  for (let i = 0; i < wxyz.length; i += 4) {
    out[i] = wxyz[i + 1]!;
    out[i + 1] = wxyz[i + 2]!;
    out[i + 2] = wxyz[i + 3]!;
    out[i + 3] = wxyz[i]!;
  }
  return out;
}
