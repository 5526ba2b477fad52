import { expect, it } from 'vitest';
import { groundLine, posesOf } from './overlays';

it('a root path becomes points on the ground', () => {
  const line = groundLine([1, 0.9, 2, 1, 0, 3, 0.9, 4, 0, 1], 0.02);
  expect(Array.from(line).map((v) => Number(v.toFixed(3)))).toEqual([1, 0.02, 2, 3, 0.02, 4]);
});

it('only keyframes with root and pose become ghosts, with the real part last', () => {
  const poses = posesOf([
    { root: { position: { x: 1, y: 2, z: 3 } }, pose: { rotations: [0.5, 0.1, 0.2, 0.3] } },
    { root: { position: { x: 1, y: 2, z: 3 } } },
    { pose: { rotations: [1, 0, 0, 0] } },
  ]);
  expect(poses).toHaveLength(1);
  expect(Array.from(poses[0]!.rotations).map((v) => Number(v.toFixed(2)))).toEqual([0.1, 0.2, 0.3, 0.5]);
});
