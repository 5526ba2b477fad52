import { expect, test } from 'vitest';
import { Joints } from './kinematics';
import { kindOf, rigOf, type Capsule, type Rig } from './rig';
import { flatten, writeEnds } from './rig-ends';
import { BEAST, identityPose, PERSON, ROBOT } from './testing';
import type { Skeleton } from './types';

/** The capsule from one joint to another. */
function between(skeleton: Skeleton, rig: Rig, from: string, to: string): Capsule {
  const [a, b] = [skeleton.names.indexOf(from), skeleton.names.indexOf(to)];
  const found = rig.capsules.find((capsule) => {
    return capsule.from.joint === a && capsule.to.joint === b && !capsule.from.local && !capsule.to.local;
  });
  if (!found) throw new Error(`no capsule from ${from} to ${to}`);
  return found;
}

/** Ends in the pose with identity rotations: 4 per end. */
function endsOf(skeleton: Skeleton, height_m: number): Float32Array {
  const joints = new Joints(skeleton);
  joints.update(identityPose(skeleton, height_m));
  const flat = flatten(rigOf(skeleton));
  const ends = new Float32Array(flat.count * 8);
  writeEnds(flat, joints, ends, 0);
  return ends;
}

test('people, robots and animals are distinguished', () => {
  expect([PERSON, ROBOT, BEAST].map(kindOf)).toEqual(['human', 'robot', 'animal']);
});

test('a person is thicker at the trunk than at limbs, and limbs taper', () => {
  const rig = rigOf(PERSON);
  const radius = (from: string, to: string): number => between(PERSON, rig, from, to).radii[0];
  expect(radius('Spine', 'Chest')).toBeGreaterThan(radius('UpperLeg_L', 'LowerLeg_L'));
  expect(radius('UpperLeg_L', 'LowerLeg_L')).toBeGreaterThan(radius('LowerLeg_L', 'Foot_L'));
  expect(radius('UpperLeg_L', 'LowerLeg_L')).toBeGreaterThan(radius('UpperArm_L', 'LowerArm_L'));
  for (const [from, to] of [
    ['UpperArm_R', 'LowerArm_R'],
    ['LowerLeg_R', 'Foot_R'],
  ] as const) {
    const [start, end] = between(PERSON, rig, from, to).radii;
    expect(end).toBeLessThan(start);
  }
});

test('a person of 0.94 m at the hips is as tall as a person, and stands on the ground', () => {
  const ends = endsOf(PERSON, 0.94);
  let [top, bottom] = [-Infinity, Infinity];
  for (let o = 0; o < ends.length; o += 4) {
    top = Math.max(top, ends[o + 1]! + ends[o + 3]!);
    bottom = Math.min(bottom, ends[o + 1]! - ends[o + 3]!);
  }
  expect(top).toBeGreaterThan(1.58);
  expect(top).toBeLessThan(1.72);
  expect(Math.abs(bottom)).toBeLessThan(0.03);
});

test('radii grow with the body', () => {
  const twice = { ...PERSON, offsets: PERSON.offsets.map((metres) => 2 * metres) };
  const [one, two] = [rigOf(PERSON), rigOf(twice)];
  one.capsules.forEach((capsule, c) => {
    expect(two.capsules[c]!.radii[0]).toBeCloseTo(2 * capsule.radii[0], 5);
  });
});

test('heels lie behind ankles', () => {
  const rig = rigOf(PERSON);
  const c = rig.capsules.findIndex((capsule) => capsule.to.heel);
  const ends = endsOf(PERSON, 0.94);
  expect(ends[c * 8 + 6]!).toBeLessThan(ends[c * 8 + 2]! - 0.01);
  expect(ends[c * 8 + 5]!).toBeLessThan(ends[c * 8 + 1]!);
});

test('an animal has a thick trunk, thin tail and ears, and legs that taper', () => {
  const rig = rigOf(BEAST);
  const radius = (from: string, to: string): number => between(BEAST, rig, from, to).radii[1];
  expect(radius('hips', 'spine')).toBeGreaterThan(2 * radius('tail_1', 'tail_2'));
  expect(radius('hips', 'spine')).toBeGreaterThan(2 * radius('head', 'ear_l'));
  expect(radius('back_upper_L', 'back_lower_L')).toBeGreaterThan(radius('back_lower_L', 'back_foot_L'));
});

test('a robot without a head gets one above its shoulders', () => {
  const ends = endsOf(ROBOT, 0.8);
  let top = -Infinity;
  for (let o = 0; o < ends.length; o += 4) top = Math.max(top, ends[o + 1]!);
  expect(top).toBeGreaterThan(0.8 + 0.04 + 0.25 + 0.1);
});

test('posing 200 people takes less than 4 ms', () => {
  const flat = flatten(rigOf(PERSON));
  const crowd = Array.from({ length: 200 }, () => new Joints(PERSON));
  const pose = identityPose(PERSON, 0.94);
  const ends = new Float32Array(flat.count * 8 * crowd.length);
  const times: number[] = [];
  for (let frame = 0; frame < 60; frame++) {
    const begin = performance.now();
    crowd.forEach((joints, c) => {
      joints.update(pose);
      writeEnds(flat, joints, ends, c * flat.count * 8);
    });
    times.push(performance.now() - begin);
  }
  const median = times.sort((a, b) => a - b)[30]!;
  console.log(`200 people, ${flat.count} capsules each: ${median.toFixed(2)} ms`);
  expect(median).toBeLessThan(4);
});
