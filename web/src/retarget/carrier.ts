// A crowd of characters on the stage, carried over in WebAssembly. Poses go through its memory:
// nothing is allocated for a frame.
import type { Crowd, Retargeter } from '../reader/troupe_reader_web';
import type { Carrier, Pose, Skeleton } from '../stage/types';
import { readerMemory } from './reader';

/** Views of the crowd's numbers. They end when the memory grows. */
interface Views {
  buffer: ArrayBufferLike;
  due: Uint8Array;
  roots: Float32Array;
  rotations: Float32Array;
  /** One for each member. */
  poses: Pose[];
}

/** Carries a pack's skeleton over to a character. `skeleton` is the character's, `joints` the number of the pack's. */
export class WasmCarrier implements Carrier {
  readonly scale: number;
  private readonly crowd: Crowd;
  private members = 0;
  private views: Views | undefined;

  constructor(
    retargeter: Retargeter,
    readonly skeleton: Skeleton,
    private readonly joints: number,
    readonly ground_m: number,
  ) {
    this.scale = retargeter.scale;
    this.crowd = retargeter.crowd();
  }

  grow(members: number): void {
    this.crowd.grow(members);
    this.members = members;
    this.views = undefined;
  }

  reset(member: number): void {
    this.crowd.reset(member);
  }

  put(member: number, root: Float32Array, rotations: Float32Array): void {
    const views = this.now();
    views.roots.set(root, member * 3);
    views.rotations.set(rotations, member * this.joints * 4);
    views.due[member] = 1;
  }

  carry(passed_s: number): void {
    this.crowd.pose(passed_s);
  }

  pose(member: number): Pose {
    return this.now().poses[member]!;
  }

  dispose(): void {
    this.crowd.free();
  }

  private now(): Views {
    const { buffer } = readerMemory();
    if (this.views?.buffer === buffer) return this.views;
    const { crowd, members, joints } = this;
    const own = this.skeleton.names.length * 4;
    const [ownRoots, ownRotations] = [crowd.own_roots(), crowd.own_rotations()];
    this.views = {
      buffer,
      due: new Uint8Array(buffer, crowd.due(), members),
      roots: new Float32Array(buffer, crowd.roots(), members * 3),
      rotations: new Float32Array(buffer, crowd.rotations(), members * joints * 4),
      poses: Array.from({ length: members }, (_, member) => ({
        root: new Float32Array(buffer, ownRoots + member * 12, 3),
        rotations: new Float32Array(buffer, ownRotations + member * own * 4, own),
      })),
    };
    return this.views;
  }
}
