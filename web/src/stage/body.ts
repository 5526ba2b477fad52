// What a character looks like: capsules, or a skin.
import type { Color } from 'three';
import type { CapsuleField, Slots } from './capsules';
import type { Joints } from './kinematics';
import { writeEnds, type FlatRig } from './rig-ends';

/** A visible body that follows its joints. */
export interface BodyView {
  /** Takes over the joints' places and rotations. */
  pose(joints: Joints): void;
  tint(colour: Color, opacity: number): void;
  dispose(): void;
}

/** Capsules in a shared field. */
export class CapsuleBody implements BodyView {
  private readonly slots: Slots;
  private readonly shaded: Color;

  constructor(
    private readonly field: CapsuleField,
    private readonly rig: FlatRig,
    scratch: Color,
  ) {
    this.slots = field.take(rig.count);
    this.shaded = scratch.clone();
  }

  pose(joints: Joints): void {
    writeEnds(this.rig, joints, this.field.ends, this.slots.start * 8);
    this.field.touch();
  }

  tint(colour: Color, opacity: number): void {
    for (let c = 0; c < this.rig.count; c++) {
      const shade = this.rig.shades[c]!;
      // Towards white or black, in linear colour.
      this.shaded.copy(colour).multiplyScalar(1 - Math.abs(shade));
      if (shade > 0) this.shaded.setRGB(this.shaded.r + shade, this.shaded.g + shade, this.shaded.b + shade);
      this.field.paint(this.slots.start + c, this.shaded, opacity);
    }
  }

  dispose(): void {
    this.field.release(this.slots);
  }
}
