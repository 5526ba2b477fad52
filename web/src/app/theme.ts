// Colours and type: those of the project's pictures (cli/src/graphics/theme.rs).
import type { MantineColorsTuple } from '@mantine/core';
import { createTheme } from '@mantine/core';
import { PALETTE } from '../stage';

/** The one accent, from light to dark. */
const ACCENT: MantineColorsTuple = [
  '#eaf2fd',
  '#d3e3f9',
  '#a4c5f3',
  '#72a5ec',
  '#4b8ae6',
  '#337ae3',
  '#1b6fd8',
  '#145cb8',
  '#0d4f9f',
  '#053f84',
];

/** Greys of the dark theme: those of the stage's ground. */
const DARK: MantineColorsTuple = [
  '#e6ebf0',
  '#c3ccd5',
  '#98a4b0',
  '#6f7c89',
  '#3a4653',
  '#2f3943',
  '#252e37',
  '#1b222a',
  '#161c23',
  '#12171d',
];

export const theme = createTheme({
  primaryColor: 'accent',
  primaryShade: { light: 6, dark: 6 },
  colors: { accent: ACCENT, dark: DARK },
  fontFamily: 'system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", "Liberation Sans", sans-serif',
  fontFamilyMonospace: 'ui-monospace, "SF Mono", Menlo, Consolas, "Liberation Mono", monospace',
  defaultRadius: 'md',
  cursorType: 'pointer',
  respectReducedMotion: true,
  focusRing: 'auto',
});

/** A colour of the palette, for the page. */
export function tintCss(tint: number): string {
  return `#${(PALETTE[tint % PALETTE.length] ?? PALETTE[0]).toString(16).padStart(6, '0')}`;
}
