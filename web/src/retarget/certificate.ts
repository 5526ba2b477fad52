// What is kept of motion that is carried over, in figures.

/** Lengths and speeds are in the size of the body that motion is carried to. `null`: it could not be carried over. */
export interface Figures {
  /** Mean angle between the bones of limbs in the source and in the target, degrees. */
  directions_deg: number | null;
  /** The largest mean of a single bone, degrees. */
  worst_deg: number;
  /** The largest mean angle between a line through the body in the source and in the target, degrees. */
  lines_deg: number;
  /** Mean speed of the target's feet over the ground while the source's stand, m/s. */
  skate_mps: number;
  /** The same of the source's feet, scaled. */
  source_skate_mps: number;
  /** Farthest that a foot is under the ground, deeper than in the source, metres. */
  under_m: number;
  /** Farthest that a hand or foot remains from its place, metres. */
  short_m: number | null;
  /** Names of the target's joints that are worst; empty if none is. */
  joints: { bone: string; line: string; skate: string; under: string; short: string };
}

/** The figures of a pair of bodies. */
export interface Certificate {
  trials: readonly { name: string; figures: Figures }[];
  /** What is beyond the bar: each as a sentence with the motion and the joint. Empty if motion may be carried over. */
  faults: readonly string[];
}

/** A column of a table of figures. */
export interface Column {
  head: string;
  means: string;
  of: (figures: Figures) => string;
  /** The joint that the figure is of. */
  joint: (figures: Figures) => string;
}

const text = (value: number | null, digits: number, factor = 1): string =>
  value === null ? '–' : (factor * value).toFixed(digits);

export const COLUMNS: readonly Column[] = [
  {
    head: 'bones, °',
    means: 'Angle between the bones of limbs in both bodies: mean, and that of the worst bone',
    of: ({ directions_deg, worst_deg }) => `${text(directions_deg, 1)} (${text(worst_deg, 0)})`,
    joint: ({ joints }) => joints.bone,
  },
  {
    head: 'sliding, cm/s',
    means: 'Speed of standing feet, and that of the other body’s feet in the same size',
    of: ({ skate_mps, source_skate_mps }) => `${text(skate_mps, 1, 100)} (${text(source_skate_mps, 1, 100)})`,
    joint: ({ joints }) => joints.skate,
  },
  {
    head: 'under, cm',
    means: 'Feet under the ground, deeper than those of the other body',
    of: ({ under_m }) => text(under_m, 1, 100),
    joint: ({ joints }) => joints.under,
  },
  {
    head: 'short, cm',
    means: 'Hands and feet short of their places',
    of: ({ short_m }) => text(short_m, 1, 100),
    joint: ({ joints }) => joints.short,
  },
];
