import { expect, test } from 'vitest';
import { Matrix4, Quaternion, Vector3 } from 'three';
import { Joints } from './kinematics';
import { fitBones, OtherBones, type RestBone } from './skin-fit';
import { identityPose, PERSON } from './testing';

/** Bones that rest where the person's joints are, turned by `turn` in their own frames, with lengths times `scale`. */
function bonesOf(turn: Quaternion, scale: number): RestBone[] {
  const joints = new Joints(PERSON);
  joints.update(identityPose(PERSON, 0.94));
  return PERSON.names.map((name, j) => {
    const place = new Vector3().fromArray(joints.positions, j * 3).multiplyScalar(scale);
    const world = new Matrix4().makeRotationFromQuaternion(turn).setPosition(place);
    return { name, parent: PERSON.parents[j]!, world };
  });
}

test("bones in the skeleton's own frames follow their joints", () => {
  const { drivers, relative, joints } = fitBones(PERSON, bonesOf(new Quaternion(), 1));
  expect(Array.from(drivers)).toEqual(PERSON.names.map((_, j) => j));
  expect(joints).toBe(PERSON.names.length);
  for (const matrix of relative)
    matrix.elements.forEach((value, e) => {
      expect(value).toBeCloseTo(e % 5 === 0 ? 1 : 0, 5);
    });
});

test('bones in centimetres are brought to metres', () => {
  const { relative } = fitBones(PERSON, bonesOf(new Quaternion(), 100));
  for (const matrix of relative) expect(matrix.elements[0]).toBeCloseTo(0.01, 6);
});

test('bones without a joint go along with the bone that they hang on', () => {
  const bones = bonesOf(new Quaternion(), 1);
  const hand = PERSON.names.indexOf('Hand_L');
  const finger = bones[hand]!.world.clone().multiply(new Matrix4().makeTranslation(0.1, 0, 0));
  bones.push({ name: 'Finger_L', parent: hand, world: finger });
  const { drivers, relative } = fitBones(PERSON, bones);
  expect(drivers.at(-1)).toBe(hand);
  expect(new Vector3().setFromMatrixPosition(relative.at(-1)!).x).toBeCloseTo(0.1, 6);
});

test('bones with other frames are another body', () => {
  const turn = new Quaternion().setFromAxisAngle(new Vector3(0, 0.6, 0.8), 1.1);
  expect(() => fitBones(PERSON, bonesOf(turn, 1))).toThrow(OtherBones);
});

test('an error names the joints without a bone', () => {
  const bones = bonesOf(new Quaternion(), 1).filter(({ name }) => !/Hand_L|Toes/.test(name));
  expect(() => fitBones(PERSON, bones)).toThrow('no bones for these joints: Hand_L, Toes_L, Toes_R');
});
