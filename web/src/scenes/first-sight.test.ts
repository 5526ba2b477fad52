import { expect, test } from 'vitest';
import { firstSightOf } from './first-sight';
import type { Drawn, ObjectDefinition, SceneObject } from './types';
import { upright } from './types';

const DEFINITIONS = [
  { name: 'cup', pack: 'human' },
  { name: 'seat', pack: 'human' },
] as ObjectDefinition[];
const DRAWN = new Map([
  ['cup', { isSeat: false } as Drawn],
  ['seat', { isSeat: true } as Drawn],
]);

function object(id: string, definition: string, state = 'OBJECT_STATE_FREE'): SceneObject {
  return { id, definition, state, position: { x: 1, y: 0, z: 2 }, rotation: upright(Math.PI / 2) } as SceneObject;
}

test('a character comes to the first free seat, from before it', () => {
  const objects = [
    object('cup-1', 'cup'),
    object('stool-1', 'seat', 'OBJECT_STATE_RESERVED'),
    object('stool-2', 'seat'),
  ];
  const sight = firstSightOf(objects, DRAWN, DEFINITIONS)!;
  expect(sight).toMatchObject({ seat: 'stool-2', isFree: true, pack: 'human' });
  // The seat faces +X.
  expect(sight.start.x).toBeGreaterThan(1 + 3);
  const [dx, dz] = [1 - sight.start.x, 2 - sight.start.z];
  expect(sight.heading).toBeCloseTo(Math.atan2(dx, dz));
  // The camera looks at the middle of the way.
  expect(sight.camera[0]).toBeCloseTo((1 + sight.start.x) / 2);
  expect(sight.camera[2]).toBeCloseTo((2 + sight.start.z) / 2);
  expect(sight.camera).toHaveLength(6);
});

test('a character stands before a seat that another one has', () => {
  const sight = firstSightOf([object('stool', 'seat', 'OBJECT_STATE_RESERVED')], DRAWN, DEFINITIONS);
  expect(sight).toMatchObject({ seat: 'stool', isFree: false });
});

test('a scene without a seat has no first sight', () => {
  expect(firstSightOf([object('cup-1', 'cup')], DRAWN, DEFINITIONS)).toBeUndefined();
  expect(firstSightOf([object('stool', 'seat')], DRAWN, [])).toBeUndefined();
});
