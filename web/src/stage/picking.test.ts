import { expect, test } from 'vitest';
import { hitCapsules, hitGround, type Ray } from './picking';

/** An upright capsule of radius 0.1 between 0.5 and 1.5 m over (0, 0), and one of 0.2 behind it. */
const ENDS = Float32Array.of(0, 0.5, 0, 0.1, 0, 1.5, 0, 0.1, 0, 0.5, -3, 0.2, 0, 1.5, -3, 0.2);
const ahead = (x: number, y: number): Ray => ({ origin: [x, y, 5], direction: [0, 0, -1] });

test('the nearest capsule counts, from its surface on', () => {
  expect(hitCapsules(ahead(0, 1), ENDS, 0, 2)).toBeCloseTo(5 - 0.125);
});

test('a ray beside the thin one meets the thick one behind', () => {
  expect(hitCapsules(ahead(0.18, 1), ENDS, 0, 1)).toBe(Infinity);
  expect(hitCapsules(ahead(0.18, 1), ENDS, 0, 2)).toBeGreaterThan(7.7);
});

test('the ends are round', () => {
  expect(hitCapsules(ahead(0, 1.6), ENDS, 0, 1)).toBeLessThan(5);
  expect(hitCapsules(ahead(0.1, 1.6), ENDS, 0, 1)).toBe(Infinity);
});

test('what lies behind the eye is not hit', () => {
  expect(hitCapsules({ origin: [0, 1, -5], direction: [0, 0, -1] }, ENDS, 0, 2)).toBe(Infinity);
});

test('a ray along an axis hits the end', () => {
  expect(hitCapsules({ origin: [0, 5, 0], direction: [0, -1, 0] }, ENDS, 0, 1)).toBeCloseTo(3.375, 1);
});

test('the ground is hit from above alone', () => {
  const slope = Math.SQRT1_2;
  expect(hitGround({ origin: [1, 2, 3], direction: [0, -slope, -slope] })).toEqual([1, 0, 1]);
  expect(hitGround({ origin: [1, 2, 3], direction: [0, slope, -slope] })).toBeNull();
  expect(hitGround({ origin: [1, 2, 3], direction: [0, 0, -1] })).toBeNull();
});
