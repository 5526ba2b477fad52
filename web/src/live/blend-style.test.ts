import { expect, it } from 'vitest';
import { can } from '../wire/types';
import { blendStyle } from './blend-style';

it('weights are at most 1 in all', () => {
  const { style } = blendStyle(
    [
      { word: 'walk', share: 1 },
      { word: 'old', share: 1 },
      { word: 'idle', share: 1 },
    ],
    1.2,
  );
  expect(style.words.reduce((sum, { weight }) => sum + weight, 0)).toBeLessThanOrEqual(1);
  expect(style.words).toHaveLength(3);
});

it('names say what is in the blend, and are such as the server takes', () => {
  const { name } = blendStyle(
    [
      { word: 'walk', share: 0.5 },
      { word: 'head-but', share: 0.25 },
    ],
    1,
  );
  expect(name).toBe('blend-walk50-head-but25');
  expect(name).toMatch(/^[\w.-]{1,64}$/);
});

it('words are for packs with the capability alone', () => {
  expect(can({ capabilities: ['live', 'text'] }, 'text')).toBe(true);
  expect(can({ capabilities: ['live', 'path'] }, 'text')).toBe(false);
  expect(can(undefined, 'text')).toBe(false);
});
