//! Poses from a few points.

use glam::{Quat, Vec3};

use crate::anatomy::Parts;
use crate::fk::joint_transform;
use crate::skeleton::Skeleton;

use super::limbs::is_below;
use super::{Leg, Posed, Trunk, arm_of, place_end, two_bone};

/// How far the hips move back for balance: metres a radian of bow, and metres a metre of crouch.
const BACK_PER_BOW: f32 = 0.067;
const BACK_PER_CROUCH: f32 = 0.28;
/// Steps in which bows (radians) and crouches (metres) are tried.
const BOW_STEP: f32 = 0.1;
const CROUCH_STEP_M: f32 = 0.05;
/// What a bow (`bow * (1 + bow)`, radians) and a metre of crouch cost, in metres of error. A pose
/// bends to reach a millimetre farther, but not without a reason. Before a bow becomes deep, the
/// knees bend too.
const COST_OF_BOW: f32 = 3e-4;
const COST_OF_CROUCH: f32 = 3e-3;

/// How far a pose may bend to reach its points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReachOptions<'a> {
    /// World position of joint 0. If it is given, the root stays there and does not crouch.
    pub root: Option<Vec3>,
    /// Deepest bow of the trunk's upper end, radians. 1.5 is the deepest in the default pack's
    /// data.
    pub max_bow: f32,
    /// Deepest crouch: how far the root may be lowered, metres.
    pub max_crouch_m: f32,
    /// The parts of a body whose trunk and limbs its shape alone does not show: one with twists
    /// along its bones, or with a root below the pelvis.
    pub parts: Option<&'a Parts>,
}

impl Default for ReachOptions<'_> {
    fn default() -> Self {
        Self {
            root: None,
            max_bow: 1.9,
            max_crouch_m: 0.5,
            parts: None,
        }
    }
}

/// A constructed pose.
#[derive(Clone, Debug, PartialEq)]
pub struct Reached {
    /// World position of joint 0, metres.
    pub root: Vec3,
    /// One rotation a joint, joint 0 in the world and the others parent-relative.
    pub rotations: Vec<Quat>,
    /// Distances to the points in their order, metres; infinite for a point that is not finite, or
    /// whose joint does not exist.
    pub errors_m: Vec<f32>,
    /// Farthest that a leg remained from its foot's place, metres.
    pub short_m: f32,
    /// The bow, radians.
    pub bow: f32,
    /// How far the root was lowered, metres.
    pub crouch_m: f32,
}

impl Reached {
    /// The pose unchanged, for input that cannot be used.
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

    /// The result as a pose.
    pub fn posed(&self) -> Posed<'_> {
        Posed {
            root: self.root,
            rotations: &self.rotations,
        }
    }
}

/// Bends `base` so that some joints come to given points in the world.
///
/// Hands and other ends of limbs ([`arm_of`]) reach by bending the limb; ankles and toes by bending
/// the leg. Feet without a point stay at their place in `base`. If that is not enough, the trunk
/// bows forward with hanging arms, and the root is lowered, as little as necessary; the hips move
/// back for balance. Points of other joints steer bow and crouch, but are not otherwise met. A
/// point of joint 0 sets the root, like `options.root`. If points are out of reach, the pose comes
/// as near as it can, and `errors_m` has the distances. Of two points of one limb the last counts.
///
/// A `base` that is not finite or lacks rotations is returned unchanged, with infinite errors.
pub fn reach_pose(
    skeleton: &Skeleton,
    legs: &[Leg],
    base: Posed<'_>,
    points: &[(usize, Vec3)],
    options: &ReachOptions<'_>,
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
    let stance = Stance::new(skeleton, legs, base, points, options.parts);
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

/// `base` with its root at `root`, bowed forward by `bow` (radians), and its feet in place: a seat,
/// a crouch.
///
/// `errors_m` is empty, and `crouch_m` says how far the root was lowered. Values that are not
/// finite leave `base` unchanged.
pub fn pose_at(skeleton: &Skeleton, legs: &[Leg], base: Posed<'_>, root: Vec3, bow: f32) -> Reached {
    let mut made = Reached::of(base, 0);
    if base.fits(skeleton) && base.is_finite() && root.is_finite() && bow.is_finite() {
        Stance::new(skeleton, legs, base, &[], None).pose(root, bow, &mut made);
        made.crouch_m = base.root.y - root.y;
    }
    made
}

/// What all poses from one base share.
struct Stance<'a> {
    skeleton: &'a Skeleton,
    legs: &'a [Leg],
    base: Posed<'a>,
    points: &'a [(usize, Vec3)],
    trunk: Trunk,
    forward: Vec3,
    /// World position of each leg's foot.
    feet: Vec<Vec3>,
    /// Points that are met by bending a limb.
    reaching: Vec<([usize; 3], Vec3)>,
}

impl<'a> Stance<'a> {
    fn new(
        skeleton: &'a Skeleton,
        legs: &'a [Leg],
        base: Posed<'a>,
        points: &'a [(usize, Vec3)],
        parts: Option<&Parts>,
    ) -> Self {
        let place = |joint: usize| joint_transform(skeleton, base.root, base.rotations, joint).0;
        let is_foot = |leg: &Leg, joint: usize| {
            leg.toe == Some(joint) || (parts.is_some() && is_below(skeleton, joint, leg.foot))
        };
        let mut feet: Vec<Vec3> = legs.iter().map(|leg| place(leg.foot)).collect();
        let mut reaching = Vec::new();
        for &(joint, point) in points.iter().filter(|(_, point)| point.is_finite()) {
            if let Some(nth) = legs.iter().position(|leg| leg.foot == joint) {
                feet[nth] = point;
            } else if let Some(nth) = legs.iter().position(|leg| is_foot(leg, joint)) {
                feet[nth] = point + place(legs[nth].foot) - place(joint);
            } else if let Some(chain) = arm_to(skeleton, parts, joint) {
                reaching.push((chain, point));
            }
        }
        Self {
            skeleton,
            legs,
            base,
            points,
            trunk: parts.map_or_else(|| Trunk::of(skeleton), Trunk::of_parts),
            forward: base.forward(skeleton),
            feet,
            reaching,
        }
    }

    fn root(&self, bow: f32, crouch_m: f32) -> Vec3 {
        let back = BACK_PER_BOW * bow + BACK_PER_CROUCH * crouch_m;
        self.base.root - self.forward * back - Vec3::Y * crouch_m
    }

    /// Makes the pose with a given root and bow, into `made`.
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

/// The limb that brings a joint to a point: the arm that it is the end of, or is below the end of.
fn arm_to(skeleton: &Skeleton, parts: Option<&Parts>, joint: usize) -> Option<[usize; 3]> {
    let mut arms = parts.and_then(|parts| parts.arms.as_ref()).into_iter().flatten();
    let arm = arms.find(|arm| joint == arm.end || is_below(skeleton, joint, arm.end));
    match arm.map(|arm| arm.chain()) {
        Some([upper, middle, _]) => Some([upper, middle, joint]),
        None => arm_of(skeleton, joint),
    }
}
