import { Quaternion, Vector3 } from 'three';
import { describe, expect, it } from 'vitest';
import { forward } from '../stage/kinematics';
import type { Pose } from '../stage/types';
import type { Rig } from './clip';
import { copyPose, poseAt, quaternionAt } from './clip';
import { hingeAngle } from './csv';
import { reach } from './ik';
import { limbsOf, type Limb } from './limbs';
import { understand } from './reading';
import { example, robot } from './testing';

function world({ skeleton }: Rig, { root, rotations }: Pose) {
  const places = new Float32Array(skeleton.names.length * 3);
  const turns = new Float32Array(skeleton.names.length * 4);
  forward(skeleton, root, rotations, places, turns);
  return {
    place: (joint: number) => new Vector3().fromArray(places, joint * 3),
    turn: (joint: number) => quaternionAt(turns, joint),
  };
}

/** The side to which a limb bends: the axis from upper to lower bone. */
function bendOf(rig: Rig, pose: Pose, { upper, lower, end }: Limb): Vector3 {
  const { place } = world(rig, pose);
  const first = place(lower).sub(place(upper));
  return first.cross(place(end).sub(place(lower)));
}

const { rig, clip } = example();
const limbs = limbsOf(rig, clip);
const limb = (name: string) => limbs.find((one) => one.name === name)!;

describe('two bones', () => {
  it('finds hands and feet', () => {
    expect(limbs.map(({ name }) => name)).toEqual(['left hand', 'left foot', 'right hand', 'right foot']);
  });

  it.each(['left hand', 'left foot', 'right hand', 'right foot'])('brings the %s to its place', (name) => {
    const one = limb(name);
    for (const frame of [0, 17, 63]) {
      const pose = poseAt(clip, frame);
      const was = world(rig, pose);
      const length =
        was.place(one.upper).distanceTo(was.place(one.lower)) + was.place(one.lower).distanceTo(was.place(one.end));
      // Places within reach, off the limb's own line.
      const towards = was.place(one.end).sub(was.place(one.upper)).normalize();
      for (const [share, x, z] of [
        [0.6, 0.1, 0.2],
        [0.8, -0.15, 0.1],
        [0.9, 0, -0.2],
      ] as const) {
        const direction = towards
          .clone()
          .add(new Vector3(x, 0, z))
          .normalize();
        const target = was.place(one.upper).addScaledVector(direction, share * length);
        const now = world(rig, reach(rig, pose, one, target));
        expect(now.place(one.end).distanceTo(target)).toBeLessThan(1e-4);
        for (const [a, b] of [
          [one.upper, one.lower],
          [one.lower, one.end],
        ] as const) {
          expect(now.place(a).distanceTo(now.place(b))).toBeCloseTo(was.place(a).distanceTo(was.place(b)), 5);
        }
        // The hand or foot is turned as it was; what is above the limb stays.
        expect(now.turn(one.end).angleTo(was.turn(one.end))).toBeLessThan(3e-3);
        expect(now.place(one.upper).distanceTo(was.place(one.upper))).toBeLessThan(1e-6);
      }
    }
  });

  it('keeps the side of the bend, in and out again', () => {
    const one = limb('left foot');
    let pose = poseAt(clip, 30);
    const before = bendOf(rig, pose, one).normalize();
    const { place } = world(rig, pose);
    const hip = place(one.upper);
    for (const down of [0.5, 0.79, 0.3, 0.6]) {
      pose = reach(rig, pose, one, hip.clone().add(new Vector3(0, -down, 0.05)));
      expect(bendOf(rig, pose, one).normalize().dot(before)).toBeGreaterThan(0.9);
    }
  });

  it('bends a straight leg forward, as the clip does', () => {
    const one = limb('right foot');
    const pose = copyPose(poseAt(clip, 0));
    // Straight: the lower bone along the upper one.
    const straight = world(rig, pose);
    const along = straight.place(one.lower).sub(straight.place(one.upper));
    const lower = straight.place(one.end).sub(straight.place(one.lower));
    const turn = new Quaternion()
      .setFromUnitVectors(lower.normalize(), along.normalize())
      .multiply(straight.turn(one.lower));
    straight
      .turn(one.upper)
      .invert()
      .multiply(turn)
      .toArray(pose.rotations, one.lower * 4);
    expect(bendOf(rig, pose, one).length()).toBeLessThan(1e-4);
    const hip = straight.place(one.upper);
    const target = hip.clone().add(new Vector3(0, -0.6, 0));
    const bent = reach(rig, pose, one, target);
    const now = world(rig, bent);
    expect(now.place(one.end).distanceTo(target)).toBeLessThan(1e-4);
    // Heading 0 faces +Z: so does a knee.
    expect(now.place(one.lower).z - hip.z).toBeGreaterThan(0.1);
  });

  it('stretches towards what is out of reach', () => {
    const one = limb('left hand');
    const pose = poseAt(clip, 0);
    const shoulder = world(rig, pose).place(one.upper);
    const far = shoulder.clone().add(new Vector3(0, 0, 5));
    const hand = world(rig, reach(rig, pose, one, far)).place(one.end);
    expect(
      hand
        .clone()
        .sub(shoulder)
        .angleTo(new Vector3(0, 0, 1)),
    ).toBeLessThan(1e-3);
    expect(hand.distanceTo(shoulder)).toBeGreaterThan(0.46);
  });

  it('changes no other joint, nor the pose it is given', () => {
    const one = limb('left hand');
    const pose = poseAt(clip, 10);
    const kept = copyPose(pose);
    const moved = reach(
      rig,
      pose,
      one,
      world(rig, pose)
        .place(one.end)
        .add(new Vector3(0, 0.1, 0.1)),
    );
    expect(pose.rotations).toEqual(kept.rotations);
    rig.skeleton.names.forEach((_, joint) => {
      if ([one.upper, one.lower, one.end].includes(joint)) return;
      expect(moved.rotations.slice(joint * 4, joint * 4 + 4)).toEqual(pose.rotations.slice(joint * 4, joint * 4 + 4));
    });
  });
});

describe('hinges', async () => {
  const robotRig = robot();
  const row = new TextEncoder().encode('0,0,0.7,0,0,0,1,-0.3,0,0,0.6,-0.3,0');
  const { clip: stand } = await understand('stand.csv', row, robotRig);
  const [leg] = limbsOf(robotRig, stand);

  it('bring a foot to its place within their limits', () => {
    expect(leg?.name).toBe('left foot');
    const pose = poseAt(stand, 0);
    for (const by of [new Vector3(0.05, 0.1, 0.1), new Vector3(-0.02, 0.05, -0.15), new Vector3(0.1, 0.15, 0)]) {
      const target = world(robotRig, pose).place(leg!.end).add(by);
      const done = reach(robotRig, pose, leg!, target);
      expect(world(robotRig, done).place(leg!.end).distanceTo(target)).toBeLessThan(2e-3);
      for (const hinge of robotRig.hinges) {
        const local = quaternionAt(done.rotations, hinge.joint);
        const angle = hingeAngle(hinge, local);
        expect(angle).toBeGreaterThanOrEqual(hinge.lower_rad - 1e-4);
        expect(angle).toBeLessThanOrEqual(hinge.upper_rad + 1e-4);
        // Nothing but a turn about the hinge's axis.
        const turned = hinge.rest.clone().multiply(new Quaternion().setFromAxisAngle(hinge.axis, angle));
        expect(local.angleTo(turned)).toBeLessThan(2e-3);
      }
    }
  });

  it('take along the joints that follow them', async () => {
    const mimic = {
      joint: 6,
      follows: 4,
      multiplier: -0.5,
      offset_rad: 0.1,
      axis: new Vector3(0, 0, 1),
      rest: new Quaternion(),
    };
    const follower = { ...robotRig, hinges: robotRig.hinges.slice(0, 5), mimics: [mimic] };
    const short = new TextEncoder().encode('0,0,0.7,0,0,0,1,-0.3,0,0,0.6,-0.3');
    const { clip } = await understand('stand.csv', short, follower);
    const pose = poseAt(clip, 0);
    const wanted = (angle: number) => new Quaternion().setFromAxisAngle(mimic.axis, -0.5 * angle + 0.1);
    expect(quaternionAt(pose.rotations, 6).angleTo(wanted(0.6))).toBeLessThan(1e-3);
    const [limb] = limbsOf(follower, clip);
    const target = world(follower, pose)
      .place(limb!.end)
      .add(new Vector3(0.02, 0.1, 0.05));
    const done = reach(follower, pose, limb!, target);
    const knee = hingeAngle(follower.hinges[3]!, quaternionAt(done.rotations, 4));
    expect(Math.abs(knee - 0.6)).toBeGreaterThan(0.05);
    expect(quaternionAt(done.rotations, 6).angleTo(wanted(knee))).toBeLessThan(1e-3);
  });
});
