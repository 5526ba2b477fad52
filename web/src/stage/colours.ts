// Colours of the stage: those of the project's pictures (cli/src/graphics/theme.rs).
import { Color } from 'three';
import type { Theme } from './types';

/** Tints of characters and overlays, in the order in which styles get them. */
export const PALETTE = [
  0x1b6fd8, 0xd8438c, 0xf08c00, 0x2f9e44, 0x7a4dd8, 0x0c8599, 0xe03131, 0x868e20, 0x5c6b7a, 0x9c5f2c,
] as const;

/** The one accent: selection and whatever is chosen. */
export const ACCENT = 0x1b6fd8;

export interface Surroundings {
  background: number;
  /** The ground near the focus; it fades into the background. */
  ground: number;
  grid: number;
  gridMajor: number;
  sky: number;
  bounce: number;
  hemisphere: number;
  key: number;
  fill: number;
  /** Opacity of cast shadows and of the soft blobs under characters. */
  shadow: number;
  blob: number;
  /** Brightness of a body where its surface turns away from the eye. */
  edge: number;
  /** Share of white in tints. */
  lift: number;
  accent: number;
}

export const SURROUNDINGS: Record<Theme, Surroundings> = {
  light: {
    background: 0xf6f8fa,
    ground: 0xfdfefe,
    grid: 0xe3e8ed,
    gridMajor: 0xd0d7de,
    sky: 0xffffff,
    bounce: 0xe3e9ef,
    hemisphere: 2.5,
    key: 2.1,
    fill: 0.6,
    shadow: 0.2,
    blob: 0.2,
    edge: 0.74,
    lift: 0.04,
    accent: ACCENT,
  },
  dark: {
    background: 0x12171d,
    ground: 0x1b222a,
    grid: 0x2a333d,
    gridMajor: 0x3a4653,
    sky: 0xdfe9f5,
    bounce: 0x2a333d,
    hemisphere: 1.5,
    key: 2.4,
    fill: 0.8,
    shadow: 0.5,
    blob: 0.45,
    edge: 0.86,
    lift: 0.14,
    accent: 0x5aa2f5,
  },
};

const WHITE = new Color(0xffffff);

/** A tint of the palette as the theme shows it, in linear colour. */
export function tintColour(tint: number, theme: Theme, target = new Color()): Color {
  const index = ((Math.trunc(tint) % PALETTE.length) + PALETTE.length) % PALETTE.length;
  return target.setHex(PALETTE[index] ?? ACCENT).lerp(WHITE, SURROUNDINGS[theme].lift);
}
