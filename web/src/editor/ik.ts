// Inverse kinematics of a limb with two bones, and of a robot's limb on its hinges.
import { Quaternion, Vector3 } from 'three';
import { forward } from '../stage/kinematics';
import type { Pose, Skeleton } from '../stage/types';
import type { Hinge, Rig } from './clip';
import { copyPose, quaternionAt } from './clip';
import { hingeAngle, hingeRotation, limited } from './csv';
import type { Limb } from './limbs';

/** How near to its full length a limb is stretched. */
const STRETCH = 0.9995;
/** A limb bent by less, as the sine, has no side of its own. */
const STRAIGHT = 1e-3;
const ROUNDS = 60;
/** The most that a hinge turns in a round, radians. */
const MOST_TURN_RAD = 0.35;

/** World places and rotations of a pose's joints. */
class World {
  readonly places: Float32Array;
  readonly turns: Float32Array;

  constructor(
    private readonly skeleton: Skeleton,
    private readonly pose: Pose,
  ) {
    this.places = new Float32Array(skeleton.names.length * 3);
    this.turns = new Float32Array(skeleton.names.length * 4);
    this.update();
  }

  update(): void {
    forward(this.skeleton, this.pose.root, this.pose.rotations, this.places, this.turns);
  }

  place(joint: number): Vector3 {
    return new Vector3().fromArray(this.places, joint * 3);
  }

  turn(joint: number): Quaternion {
    return quaternionAt(this.turns, joint);
  }

  /** The rotation in the world of a joint's parent. */
  parentTurn(joint: number): Quaternion {
    return this.turn(this.skeleton.parents[joint]!);
  }
}

/** The pose with a limb's end at a place in the world, or as near as the limb reaches. The end keeps its world rotation. */
export function reach(rig: Rig, pose: Pose, limb: Limb, target: Vector3): Pose {
  return rig.hinges.length > 0
    ? followed(rig, reachOnHinges(rig.skeleton, rig.hinges, pose, limb, target))
    : reachTwoBones(rig.skeleton, pose, limb, target);
}

function reachTwoBones(skeleton: Skeleton, pose: Pose, limb: Limb, target: Vector3): Pose {
  const { upper, lower, end } = limb;
  const world = new World(skeleton, pose);
  const [a, b, c] = [world.place(upper), world.place(lower), world.place(end)];
  const first = b.clone().sub(a);
  const second = c.clone().sub(b);
  const [l1, l2] = [first.length(), second.length()];
  const toTarget = target.clone().sub(a);
  const distance = Math.min(Math.max(toTarget.length(), Math.abs(l1 - l2) * 1.001 + 1e-4), (l1 + l2) * STRETCH);
  const cross = first.clone().cross(second);
  const isStraight = cross.length() < STRAIGHT * l1 * l2;
  const axis = isStraight ? limb.bend.clone().applyQuaternion(world.turn(upper)) : cross.clone();
  axis.normalize();
  // How far the second bone is turned from the first one's direction: as it is, and as the distance
  // wants it.
  const now = Math.atan2(cross.dot(axis), first.dot(second));
  const cosine = (distance * distance - l1 * l1 - l2 * l2) / (2 * l1 * l2);
  const wanted = Math.acos(Math.min(Math.max(cosine, -1), 1));
  const bend = new Quaternion().setFromAxisAngle(axis, wanted - now);
  const reached = b.clone().add(second.applyQuaternion(bend)).sub(a);
  // The shortest turn of the whole limb leaves the bend on its side.
  const swing = new Quaternion().setFromUnitVectors(reached.normalize(), toTarget.normalize());
  const upperTurn = swing.clone().multiply(world.turn(upper));
  const lowerTurn = swing.multiply(bend).multiply(world.turn(lower));
  const done = copyPose(pose);
  const set = (joint: number, parent: Quaternion, turn: Quaternion): void => {
    parent
      .clone()
      .invert()
      .multiply(turn)
      .normalize()
      .toArray(done.rotations, joint * 4);
  };
  set(upper, world.parentTurn(upper), upperTurn);
  set(lower, upperTurn, lowerTurn);
  set(end, lowerTurn, world.turn(end));
  return done;
}

/** Cyclic coordinate descent on the hinges up to knee or elbow, then ankle or wrist turned back, all within their limits. */
function reachOnHinges(skeleton: Skeleton, hinges: readonly Hinge[], pose: Pose, limb: Limb, target: Vector3): Pose {
  const done = copyPose(pose);
  const world = new World(skeleton, done);
  const kept = world.turn(limb.end);
  for (let round = 0; round < ROUNDS; round++) {
    for (const h of [...limb.reach].reverse()) {
      turnTowards(world, hinges[h]!, done, world.place(limb.end), target);
      world.update();
    }
    keepTurn(world, hinges, limb, done, kept);
    if (world.place(limb.end).distanceTo(target) < 1e-4) break;
  }
  return done;
}

/** The pose with the joints that follow hinges turned as those are. */
function followed({ hinges, mimics }: Rig, pose: Pose): Pose {
  for (const { joint, follows, multiplier, offset_rad, axis, rest } of mimics) {
    const hinge = hinges.find((one) => one.joint === follows);
    if (!hinge) continue;
    const angle = multiplier * hingeAngle(hinge, quaternionAt(pose.rotations, follows)) + offset_rad;
    const turn = new Quaternion().setFromAxisAngle(axis, angle);
    rest
      .clone()
      .multiply(turn)
      .toArray(pose.rotations, joint * 4);
  }
  return pose;
}

/** Turns a hinge so that what is at `from` comes nearest to `target`. */
function turnTowards(world: World, hinge: Hinge, pose: Pose, from: Vector3, target: Vector3): void {
  const axis = hinge.axis.clone().applyQuaternion(world.turn(hinge.joint));
  const origin = world.place(hinge.joint);
  const flat = (point: Vector3): Vector3 => point.clone().sub(origin).projectOnPlane(axis);
  const [has, wants] = [flat(from), flat(target)];
  if (has.length() < 1e-6 || wants.length() < 1e-6) return;
  const turn = Math.atan2(has.clone().cross(wants).dot(axis), has.dot(wants));
  const angle = hingeAngle(hinge, quaternionAt(pose.rotations, hinge.joint));
  const step = Math.min(Math.max(turn, -MOST_TURN_RAD), MOST_TURN_RAD);
  hingeRotation(hinge, limited(hinge, angle + step)).toArray(pose.rotations, hinge.joint * 4);
}

/** Turns the outer hinges so that the end is turned in the world as it was, each as near as it can. */
function keepTurn(world: World, hinges: readonly Hinge[], limb: Limb, pose: Pose, kept: Quaternion): void {
  for (const h of limb.keep) {
    const hinge = hinges[h]!;
    const local = world.parentTurn(hinge.joint).invert().multiply(kept);
    hingeRotation(hinge, limited(hinge, hingeAngle(hinge, local))).toArray(pose.rotations, hinge.joint * 4);
    world.update();
  }
}
