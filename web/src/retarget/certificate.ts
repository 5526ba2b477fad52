// What is kept of motion that is carried over, in figures.

/** Lengths and speeds are in the size of the body that the motion is carried to. */
export interface Figures {
  /** Mean angle between the bones of limbs in the source and in the target, degrees. */
  directions_deg: number;
  /** The largest mean of a single bone, degrees. */
  worst_deg: number;
  /** Mean speed of the target's feet over the ground while the source's stand, m/s. */
  skate_mps: number;
  /** The same of the source's feet, scaled. */
  source_skate_mps: number;
  /** Farthest that a foot is under the ground, deeper than in the source, metres. */
  under_m: number;
  /** Farthest that a foot remains from its place, metres. */
  short_m: number;
}

/** The figures of a pair of bodies. */
export interface Certificate {
  trials: readonly { name: string; figures: Figures }[];
  /** What is beyond the bar: each as a sentence. Empty if motion may be carried over. */
  faults: readonly string[];
}

/** Columns of a table of figures: a short head, what it means, and the value as text. */
export const COLUMNS: readonly { head: string; means: string; of: (figures: Figures) => string }[] = [
  {
    head: 'bones',
    means: 'Angle between the bones of limbs in the pack’s body and in the character: mean, and that of the worst bone',
    of: ({ directions_deg, worst_deg }) => `${directions_deg.toFixed(1)}° (${worst_deg.toFixed(0)}°)`,
  },
  {
    head: 'sliding',
    means: 'Speed of standing feet, and that of the pack’s body in the same size, cm/s',
    of: ({ skate_mps, source_skate_mps }) => `${(100 * skate_mps).toFixed(1)} (${(100 * source_skate_mps).toFixed(1)})`,
  },
  {
    head: 'under',
    means: 'Feet under the ground, deeper than those of the pack’s body, cm',
    of: ({ under_m }) => (100 * under_m).toFixed(1),
  },
  {
    head: 'short',
    means: 'Feet short of their places, cm',
    of: ({ short_m }) => (100 * short_m).toFixed(1),
  },
];
