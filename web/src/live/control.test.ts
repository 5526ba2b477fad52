import { expect, it } from 'vitest';
import type { Wish } from './control';
import { velocityOf } from './control';

const ahead: Wish = { right: 0, ahead: 1, runs: false, turn: 0 };

it('goes where the camera looks', () => {
  expect(velocityOf(ahead, 0, 1.5, 3)).toEqual({ x: 0, y: 0, z: 1.5 });
  expect(velocityOf(ahead, Math.PI / 2, 1.5, 3)).toEqual({ x: 1.5, y: 0, z: 0 });
});

it('right of the camera is -X where it looks along +Z', () => {
  expect(velocityOf({ ...ahead, ahead: 0, right: 1 }, 0, 1, 3)).toEqual({ x: -1, y: 0, z: 0 });
});

it('is no faster on the diagonal, and runs', () => {
  const both = velocityOf({ right: 1, ahead: 1, runs: true, turn: 0 }, 0.4, 1, 3)!;
  expect(Math.hypot(both.x, both.z)).toBeCloseTo(3, 1);
});

it('stands without a wish', () => {
  expect(velocityOf({ ...ahead, ahead: 0 }, 0, 1, 3)).toBeUndefined();
});
