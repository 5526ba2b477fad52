import { expect, test } from 'vitest';
import { Matrix4, Quaternion, Vector3 } from 'three';
import { Joints } from './kinematics';
import { fitBones, type RestBone } from './skin-fit';
import { identityPose, PERSON } from './testing';

/** Bones that rest where the person's joints are, turned by `turn` in their own frames, with lengths times `scale`. */
function bonesOf(turn: Quaternion, scale: number, rename: (name: string) => string = (name) => name): RestBone[] {
  const joints = new Joints(PERSON);
  joints.update(identityPose(PERSON, 0.94));
  return PERSON.names.map((name, j) => {
    const place = new Vector3().fromArray(joints.positions, j * 3).multiplyScalar(scale);
    const world = new Matrix4().makeRotationFromQuaternion(turn).setPosition(place);
    return { name: rename(name), parent: PERSON.parents[j]!, world };
  });
}

function followed(bones: RestBone[], joints: Joints): { positions: Float32Array; native: boolean } {
  const fit = fitBones(PERSON, bones);
  const positions = new Float32Array(joints.positions.length);
  fit.follow(joints, positions, new Float32Array(joints.rotations.length));
  return { positions, native: fit.native };
}

/** A pose that bends elbows and knees. */
function bent(): Joints {
  const pose = identityPose(PERSON, 0.94);
  for (const name of ['LowerArm_L', 'LowerLeg_R', 'Spine']) {
    new Quaternion()
      .setFromAxisAngle(new Vector3(1, 0.5, 0.2).normalize(), 0.8)
      .toArray(pose.rotations, PERSON.names.indexOf(name) * 4);
  }
  const joints = new Joints(PERSON);
  joints.update(pose);
  return joints;
}

test("bones in the pack's own frames follow as they are", () => {
  const joints = bent();
  const { positions, native } = followed(bonesOf(new Quaternion(), 1), joints);
  expect(native).toBe(true);
  expect(Array.from(positions)).toEqual(Array.from(joints.positions));
});

test('bones with other frames and lengths follow too, by their own lengths', () => {
  const joints = bent();
  const turn = new Quaternion().setFromAxisAngle(new Vector3(0, 0.6, 0.8), 1.1);
  const { positions, native } = followed(
    bonesOf(turn, 1.1, (name) => name.replace('UpperArm_L', 'mixamorig:LeftArm')),
    joints,
  );
  expect(native).toBe(false);
  joints.positions.forEach((value, c) => {
    expect(positions[c], `${PERSON.names[Math.floor(c / 3)]}`).toBeCloseTo(value * 1.1, 4);
  });
});

test('an error names the joints without a bone', () => {
  const bones = bonesOf(new Quaternion(), 1).filter(({ name }) => !/Hand_L|Toes/.test(name));
  expect(() => fitBones(PERSON, bones)).toThrow('no bones for these joints: Hand_L, Toes_L, Toes_R');
});
