import { expect, test } from 'vitest';
import { Quaternion, Vector3 } from 'three';
import { checkSkeleton, Joints } from './kinematics';
import type { Skeleton } from './types';

/** A chain of bones of one metre along Y, with a second branch at joint 1. */
const skeleton: Skeleton = {
  names: ['a', 'b', 'c', 'd'],
  parents: Int16Array.of(-1, 0, 1, 1),
  offsets: Float32Array.of(9, 9, 9, 0, 1, 0, 0, 1, 0, 1, 0, 0),
};

function rotations(...turns: Quaternion[]): Float32Array {
  return Float32Array.from(turns.flatMap((turn) => turn.toArray()));
}

const turn = (x: number, y: number, z: number, angle: number): Quaternion =>
  new Quaternion().setFromAxisAngle(new Vector3(x, y, z), angle);

test('without rotations, offsets add up from the root', () => {
  const joints = new Joints(skeleton);
  const none = new Quaternion();
  joints.update({ root: Float32Array.of(1, 2, 3), rotations: rotations(none, none, none, none) });
  expect(Array.from(joints.positions)).toEqual([1, 2, 3, 1, 3, 3, 1, 4, 3, 2, 3, 3]);
});

test('a quarter turn carries everything below', () => {
  const joints = new Joints(skeleton);
  const [none, quarter] = [new Quaternion(), turn(0, 0, 1, Math.PI / 2)];
  joints.update({ root: new Float32Array(3), rotations: rotations(none, quarter, none, none) });
  expect(joints.positions[6]).toBeCloseTo(-1);
  expect(joints.positions[7]).toBeCloseTo(1);
  expect(joints.positions[10]).toBeCloseTo(2);
});

test('places and rotations are those that three.js gives', () => {
  const joints = new Joints(skeleton);
  const turns = [turn(0, 1, 0, 0.7), turn(1, 0, 0, -0.4), turn(0, 0, 1, 1.2), turn(0.6, 0.8, 0, 0.3)];
  joints.update({ root: Float32Array.of(0.1, 0.9, -0.2), rotations: rotations(...turns) });
  const world = turns[0]!.clone();
  const at = new Vector3(0.1, 0.9, -0.2).add(new Vector3(0, 1, 0).applyQuaternion(world));
  world.multiply(turns[1]!);
  at.add(new Vector3(0, 1, 0).applyQuaternion(world));
  world.multiply(turns[2]!);
  at.toArray().forEach((value, c) => {
    expect(joints.positions[6 + c]).toBeCloseTo(value, 5);
  });
  world.toArray().forEach((value, c) => {
    expect(joints.rotations[8 + c]).toBeCloseTo(value, 5);
  });
});

test('a skeleton whose children come before their parents is refused by name and range', () => {
  const wrong = { ...skeleton, parents: Int16Array.of(-1, 2, 1, 1) };
  expect(() => {
    checkSkeleton(wrong);
  }).toThrow('skeleton.parents[1]: is 2; allowed: 0 to 0');
  expect(() => {
    checkSkeleton({ ...skeleton, offsets: new Float32Array(3) });
  }).toThrow('skeleton.offsets: has 3 numbers; 4 joints need 12');
});
