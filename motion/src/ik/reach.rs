//! Poses from a few points.

use glam::{Quat, Vec3};

use crate::fk::joint_transform;
use crate::skeleton::Skeleton;

use super::{Leg, Posed, Trunk, arm_of, place_end, two_bone};

/// How far hips go back for balance: metres a radian of bow and metres a metre of crouch.
const BACK_PER_BOW: f32 = 0.067;
const BACK_PER_CROUCH: f32 = 0.28;
/// Steps in which bows (radians) and crouches (metres) are tried.
const BOW_STEP: f32 = 0.1;
const CROUCH_STEP_M: f32 = 0.05;
/// What a bow (`bow * (1 + bow)`, radians) and a metre of crouch cost in metres of error: a pose is
/// bent for a reach of a millimetre, but not for nothing, and before a bow becomes deep the knees
/// bend too.
const COST_OF_BOW: f32 = 3e-4;
const COST_OF_CROUCH: f32 = 3e-3;

/// How far a pose may be bent to reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReachOptions {
    /// Where joint 0 is; given, it stays there, and there is no crouch.
    pub root: Option<Vec3>,
    /// The deepest bow, radians, that the trunk's upper end makes. 1.5 is the deepest in the
    /// default pack's data.
    pub max_bow: f32,
    /// The deepest crouch, metres that the root comes down.
    pub max_crouch_m: f32,
}

impl Default for ReachOptions {
    fn default() -> Self {
        Self {
            root: None,
            max_bow: 1.9,
            max_crouch_m: 0.5,
        }
    }
}

/// A pose that was made.
#[derive(Clone, Debug, PartialEq)]
pub struct Reached {
    /// World position of joint 0, metres.
    pub root: Vec3,
    /// One rotation a joint, joint 0 in the world and the others parent-relative.
    pub rotations: Vec<Quat>,
    /// How far each point is missed, metres, in their order; infinite for a point that is not
    /// finite or no joint's.
    pub errors_m: Vec<f32>,
    /// The farthest that a leg falls short of its foot's place, metres.
    pub short_m: f32,
    /// The bow, radians.
    pub bow: f32,
    /// How far the root came down, metres.
    pub crouch_m: f32,
}

impl Reached {
    /// The pose as it was, for input that nothing can be made of.
    fn of(base: Posed<'_>, points: usize) -> Self {
        Self {
            root: base.root,
            rotations: base.rotations.to_vec(),
            errors_m: vec![f32::INFINITY; points],
            short_m: 0.0,
            bow: 0.0,
            crouch_m: 0.0,
        }
    }

    /// The pose, to go on with.
    pub fn posed(&self) -> Posed<'_> {
        Posed {
            root: self.root,
            rotations: &self.rotations,
        }
    }
}

/// Bends `base` so that some joints come to given points in the world.
///
/// Hands and other ends of limbs ([`arm_of`]) reach by bending the limb, feet and toes by the leg;
/// feet that are no points stay where `base` has them. Where that is not enough, the trunk bows
/// forward, arms hanging, and the root comes down, as little as will do, hips going back for
/// balance. Points of other joints steer bow and crouch but are not met otherwise; a point of joint
/// 0 is where the root is, as `options.root` is. Out of reach the pose comes as near as it can and
/// `errors_m` tells how near. The last of two points of one limb counts.
///
/// A `base` that is not finite or lacks rotations comes back as it is, with all errors infinite.
pub fn reach_pose(
    skeleton: &Skeleton,
    legs: &[Leg],
    base: Posed<'_>,
    points: &[(usize, Vec3)],
    options: &ReachOptions,
) -> Reached {
    if !base.fits(skeleton) || !base.is_finite() {
        return Reached::of(base, points.len());
    }
    let fixed_root = points
        .iter()
        .rev()
        .find(|(joint, point)| *joint == 0 && point.is_finite());
    let fixed_root = fixed_root
        .map(|point| point.1)
        .or(options.root.filter(|root| root.is_finite()));
    let stance = Stance::new(skeleton, legs, base, points);
    let steps = |most: f32, step: f32| (most.clamp(0.0, 3.0) / step + 1e-3).floor() as usize;
    let crouches = match fixed_root {
        Some(_) => 0,
        None => steps(options.max_crouch_m, CROUCH_STEP_M),
    };
    let bows = steps(options.max_bow, BOW_STEP);
    let mut best = None;
    let mut best_cost = f32::INFINITY;
    let mut made = Reached::of(base, points.len());
    for crouch in 0..=crouches {
        for bow in 0..=bows {
            let (bow, crouch_m) = (bow as f32 * BOW_STEP, crouch as f32 * CROUCH_STEP_M);
            let posture = bow * (1.0 + bow) * COST_OF_BOW + crouch_m * COST_OF_CROUCH;
            if posture >= best_cost {
                break;
            }
            let root = fixed_root.unwrap_or_else(|| stance.root(bow, crouch_m));
            stance.pose(root, bow, &mut made);
            made.crouch_m = crouch_m;
            let errors = made.errors_m.iter().filter(|error| error.is_finite());
            let cost = posture + errors.sum::<f32>() + made.short_m;
            if cost < best_cost {
                best_cost = cost;
                best.get_or_insert_with(|| made.clone()).clone_from(&made);
            }
        }
    }
    best.unwrap_or(made)
}

/// `base` with its root at `root`, bowed forward by `bow` (radians), and its feet where they were:
/// a seat, a crouch.
///
/// `errors_m` is empty and `crouch_m` tells how far the root came down. What is not finite leaves
/// `base` as it is.
pub fn pose_at(skeleton: &Skeleton, legs: &[Leg], base: Posed<'_>, root: Vec3, bow: f32) -> Reached {
    let mut made = Reached::of(base, 0);
    if base.fits(skeleton) && base.is_finite() && root.is_finite() && bow.is_finite() {
        Stance::new(skeleton, legs, base, &[]).pose(root, bow, &mut made);
        made.crouch_m = base.root.y - root.y;
    }
    made
}

/// What poses from one base have in common.
struct Stance<'a> {
    skeleton: &'a Skeleton,
    legs: &'a [Leg],
    base: Posed<'a>,
    points: &'a [(usize, Vec3)],
    trunk: Trunk,
    forward: Vec3,
    /// Where each leg's foot stands.
    feet: Vec<Vec3>,
    /// Points that are met by bending a limb.
    reaching: Vec<([usize; 3], Vec3)>,
}

impl<'a> Stance<'a> {
    fn new(skeleton: &'a Skeleton, legs: &'a [Leg], base: Posed<'a>, points: &'a [(usize, Vec3)]) -> Self {
        let place = |joint: usize| joint_transform(skeleton, base.root, base.rotations, joint).0;
        let mut feet: Vec<Vec3> = legs.iter().map(|leg| place(leg.foot)).collect();
        let mut reaching = Vec::new();
        for &(joint, point) in points.iter().filter(|(_, point)| point.is_finite()) {
            if let Some(nth) = legs.iter().position(|leg| leg.foot == joint) {
                feet[nth] = point;
            } else if let Some(nth) = legs.iter().position(|leg| leg.toe == Some(joint)) {
                feet[nth] = point + place(legs[nth].foot) - place(joint);
            } else if let Some(chain) = arm_of(skeleton, joint) {
                reaching.push((chain, point));
            }
        }
        Self {
            skeleton,
            legs,
            base,
            points,
            trunk: Trunk::of(skeleton),
            forward: base.forward(skeleton),
            feet,
            reaching,
        }
    }

    fn root(&self, bow: f32, crouch_m: f32) -> Vec3 {
        let back = BACK_PER_BOW * bow + BACK_PER_CROUCH * crouch_m;
        self.base.root - self.forward * back - Vec3::Y * crouch_m
    }

    /// The pose with a given root and bow, into `made`.
    fn pose(&self, root: Vec3, angle: f32, made: &mut Reached) {
        let (skeleton, rotations) = (self.skeleton, &mut made.rotations);
        rotations.copy_from_slice(self.base.rotations);
        self.trunk.bow(skeleton, rotations, angle);
        made.short_m = 0.0;
        for (leg, &foot) in self.legs.iter().zip(&self.feet) {
            // Feet keep their rotations in the world.
            let turned = joint_transform(skeleton, root, self.base.rotations, leg.foot).1;
            let goal = (foot, 0.0);
            let short = place_end(skeleton, root, rotations, leg.chain(), goal, self.forward, turned);
            made.short_m = made.short_m.max(short);
        }
        for &(chain, point) in &self.reaching {
            two_bone(skeleton, root, rotations, chain, point, Vec3::NEG_Y, false);
        }
        (made.root, made.bow) = (root, angle);
        made.errors_m.clear();
        made.errors_m.extend(self.points.iter().map(|&(joint, point)| {
            if joint < skeleton.joint_count() && point.is_finite() {
                joint_transform(skeleton, root, rotations, joint)
                    .0
                    .distance(point)
            } else {
                f32::INFINITY
            }
        }));
    }
}
