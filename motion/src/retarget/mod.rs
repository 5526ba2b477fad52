//! Motion of one body on another.
//!
//! A [`Figure`] is a body in its neutral pose: upright, heading along +Z, limbs hanging down. A
//! joint's *turn* is its rotation from there in the world. The target's joints turn as the source's
//! do; chains of other lengths share the bend. The root moves by the ratio of the legs' lengths.
//! Inverse kinematics brings the feet to the scaled places of the source's feet, at the height of
//! the target's own soles. So a foot that stands in the source stands in the target.

mod certificate;
#[cfg(feature = "files")]
#[cfg(test)]
mod certificate_tests;
mod clip;
mod dolls;
mod feet;
mod figure;
mod figures;
mod hinges;
mod motions;
mod plan;
#[cfg(feature = "files")]
#[cfg(test)]
mod tests;

use glam::{Quat, Vec3};

use self::hinges::Hinges;
use self::plan::{Turn, plan};
use crate::anatomy::Limb;
use crate::fk::world_transforms;
use crate::ik::place_end;
use crate::root::{heading_of, wrap_angle};
use crate::rotation::{align_sign, slerp, yaw};

pub use certificate::{Certificate, Trial};
pub use clip::retarget;
pub use figure::Figure;
pub use figures::{Figures, WorstJoints};

/// Share of a leg's length over which it eases towards full reach.
const SOFT_SHARE: f32 = 0.02;
/// Height difference of heel and toe, by the leg's length, over which a foot passes from one to the
/// other.
const ROLL_SHARE: f32 = 0.04;
/// A foot that is higher over the ground than this share of the leg's length is in the air.
const LIFTED_SHARE: f32 = 0.1;
/// Farthest that the root is lowered, by the leg's length.
const DROP_SHARE: f32 = 0.1;
/// Most feet.
const MAX_STEPS: usize = 4;

/// Why motion cannot be carried over.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RetargetError {
    /// The parts of a body are not found, or a correction of them is wrong.
    #[error("{0}")]
    Parts(String),
    /// The rest pose is no stance.
    #[error("the rest pose is no stance: {0}; allowed: upright, arms hanging or to the sides")]
    NoStance(String),
    /// A body on two legs and one on four.
    #[error("one body stands on two legs and the other on four")]
    Legs,
    /// Frames or joints that are too many, or do not match.
    #[error(transparent)]
    Clip(#[from] crate::clip::ClipError),
}

/// A leg of the target and the places that it takes from the source.
#[derive(Clone, Copy, Debug)]
struct Step {
    /// Hip, knee and ankle of the target.
    chain: [usize; 3],
    /// Length of the target's leg, metres.
    length_m: f32,
    /// The inverse of the ankle's rotation in the neutral pose.
    still: Quat,
    /// Ankle and toe of the source: the ankle twice without toes.
    from: [usize; 2],
    /// In the neutral pose, from the source's scaled ankle to the target's.
    ankle_m: Vec3,
    /// The same of the toes.
    toe_m: Vec3,
    /// From the target's ankle to its toe in the ankle's own frame of reference.
    foot: Vec3,
}

/// Carries poses of one body over to another. After it is made, it allocates nothing.
#[derive(Clone, Debug)]
pub struct Retargeter {
    source: Figure,
    target: Figure,
    turns: Box<[Turn]>,
    steps: Vec<Step>,
    /// Headings of the feet: they change while a foot is in the air. None before the first pose.
    headings: [Option<f32>; MAX_STEPS],
    scale: f32,
    /// World transforms of the source's and the target's joints.
    from: (Vec<Vec3>, Vec<Quat>),
    to: (Vec<Vec3>, Vec<Quat>),
    /// World rotations that the target's joints should have.
    wanted: Vec<Quat>,
    hinges: Option<Hinges>,
    /// Farthest that a leg of the last pose remained from its foot's place, metres, and its ankle.
    short: (f32, Option<usize>),
}

impl Retargeter {
    /// A retargeter from one body to another.
    ///
    /// # Errors
    /// [`RetargetError::Legs`] if only one of the bodies stands on four legs.
    pub fn new(source: Figure, target: Figure) -> Result<Self, RetargetError> {
        if source.parts.on_fours != target.parts.on_fours {
            return Err(RetargetError::Legs);
        }
        let scale = target.leg_m / source.leg_m;
        let blank = |joints: usize| (vec![Vec3::ZERO; joints], vec![Quat::IDENTITY; joints]);
        let [from, to] = [&source, &target].map(|figure| blank(figure.skeleton.joint_count()));
        Ok(Self {
            turns: plan(&source, &target),
            steps: steps(&source, &target, scale),
            headings: [None; MAX_STEPS],
            scale,
            from,
            wanted: to.1.clone(),
            hinges: Hinges::of(&target),
            to,
            short: (0.0, None),
            source,
            target,
        })
    }

    /// The source's and the target's body.
    pub fn figures(&self) -> [&Figure; 2] {
        [&self.source, &self.target]
    }

    /// Length of the target's legs by that of the source's: what lengths are multiplied by.
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// Farthest that a leg of the last pose remained from its foot's place, metres.
    pub fn short_m(&self) -> f32 {
        self.short.0
    }

    /// The ankle of that leg; none if all legs reach.
    pub fn short_joint(&self) -> Option<usize> {
        self.short.1
    }

    /// Forgets the poses before: the next one begins a motion.
    pub fn reset(&mut self) {
        self.headings = [None; MAX_STEPS];
        if let Some(hinges) = &mut self.hinges {
            hinges.reset();
        }
    }

    /// Carries the next pose of a motion over. `root` is the world position of joint 0. Rotations
    /// are those of joint 0 in the world and of the others relative to their parents. `out` has one
    /// for each joint of the target, and keeps the hemispheres that it has. Returns the target's
    /// root.
    ///
    /// # Panics
    /// If `rotations` or `out` is shorter than its skeleton.
    pub fn pose(&mut self, root: Vec3, rotations: &[Quat], out: &mut [Quat]) -> Vec3 {
        let (places, world) = (&mut self.from.0, &mut self.from.1);
        world_transforms(&self.source.skeleton, root, rotations, places, world);
        self.turn(out);
        if let (Some(hinges), Some(robot)) = (&mut self.hinges, &self.target.skeleton.robot) {
            let (world, neutral) = (&self.from.1, &self.source.neutral);
            let hanging = |joint: usize| world[joint] * (neutral[joint].conjugate() * Vec3::NEG_Y);
            let bones = self.source.parts.arms.as_ref().map(|arms| {
                let bones = |arm: &Limb| [arm.upper[0], arm.lower[0]].map(hanging);
                arms.each_ref().map(bones)
            });
            let bones = bones.unwrap_or([[Vec3::NEG_Y; 2]; 2]);
            hinges.turn(&self.target, robot, &self.wanted, &bones, out);
        }
        let root = self.root(out);
        let count = self.steps.len();
        let mut goals = [Vec3::ZERO; MAX_STEPS];
        for (nth, goal) in goals[..count].iter_mut().enumerate() {
            *goal = self.goal(nth);
        }
        let root = root - Vec3::Y * self.drop(&goals[..count]);
        self.short = (0.0, None);
        for (step, &goal) in self.steps.iter().zip(&goals) {
            let rotation = self.wanted[step.chain[2]];
            let pole = yaw(heading_of(rotation * step.still, Vec3::X)) * Vec3::Z;
            let skeleton = &self.target.skeleton;
            let short = place_end(
                skeleton,
                root,
                out,
                step.chain,
                (goal, SOFT_SHARE),
                pole,
                rotation,
            );
            if short > self.short.0 {
                self.short = (short, Some(step.chain[2]));
            }
        }
        if let (Some(hinges), Some(robot)) = (&mut self.hinges, &self.target.skeleton.robot) {
            hinges.fit(robot, out);
        }
        root
    }

    /// Turns the target's joints. A robot's keep their rotations: only the wanted ones are found.
    fn turn(&mut self, out: &mut [Quat]) {
        let world = &self.from.1;
        let turn_of = |joint: usize| world[joint] * self.source.neutral[joint].conjugate();
        let joints = self.target.skeleton.joints.iter().enumerate();
        for ((joint, described), turn) in joints.zip(&self.turns) {
            let neutral = self.target.neutral[joint];
            let above = described
                .parent
                .map(|parent| (self.wanted[parent], self.target.neutral[parent]));
            let rotation = match (*turn, above) {
                (Turn::Between(one, other, share), _) if one != other && share > 0.0 => {
                    slerp(turn_of(one), turn_of(other), share) * neutral
                }
                (Turn::Between(one, ..), _) => turn_of(one) * neutral,
                (Turn::Along, Some((above, still))) => above * (still.conjugate() * neutral),
                (Turn::Along, None) => neutral,
            };
            let rotation = rotation.normalize();
            self.wanted[joint] = rotation;
            if self.hinges.is_none() {
                let local = above.map_or(rotation, |(above, _)| above.conjugate() * rotation);
                out[joint] = align_sign(local, out[joint]);
            }
        }
    }

    /// The target's root, so that the middle of its hips is at that of the source's, scaled.
    fn root(&mut self, out: &[Quat]) -> Vec3 {
        let (places, world) = (&mut self.to.0, &mut self.to.1);
        world_transforms(&self.target.skeleton, Vec3::ZERO, out, places, world);
        let middle = |places: &[Vec3], [left, right]: [usize; 2]| 0.5 * (places[left] + places[right]);
        let hips = middle(&self.from.0, self.source.hips());
        let own = middle(places, self.target.hips());
        let neutral = |figure: &Figure| figure.places[figure.hips()[0]].y;
        // Heights are scaled from where the soles stand.
        let ground = self.source.skeleton.ground_y_m;
        let height = (hips.y - ground - neutral(&self.source)) * self.scale + neutral(&self.target);
        let root = Vec3::new(hips.x * self.scale, ground + height, hips.z * self.scale) - own;
        places.iter_mut().for_each(|place| *place += root);
        root
    }

    /// The place of a foot: the target's ankle.
    fn goal(&mut self, nth: usize) -> Vec3 {
        let step = self.steps[nth];
        let [ankle, toe] = step.from;
        let ground = self.source.skeleton.ground_y_m;
        let scaled = |joint: usize| (self.from.0[joint] - Vec3::Y * ground) * self.scale + Vec3::Y * ground;
        let rotation = self.wanted[step.chain[2]];
        let over = |joint: usize| self.from.0[joint].y - ground - self.source.places[joint].y;
        let now = heading_of(rotation * step.still, Vec3::X);
        // A standing foot rolls; what is between the places of the two feet does not turn with it.
        let lifted = over(ankle).min(over(toe)) / (LIFTED_SHARE * self.source.leg_m);
        let facing = match self.headings[nth] {
            None => now,
            Some(before) => before + lifted.clamp(0.0, 1.0) * wrap_angle(now - before),
        };
        self.headings[nth] = Some(facing);
        let facing = yaw(facing);
        let by_ankle = scaled(ankle) + facing * step.ankle_m;
        if toe == ankle {
            return by_ankle;
        }
        let by_toe = scaled(toe) + facing * step.toe_m - rotation * step.foot;
        let room = ROLL_SHARE * self.source.leg_m;
        let toes = (0.5 + 0.5 * (over(ankle) - over(toe)) / room).clamp(0.0, 1.0);
        by_ankle.lerp(by_toe, toes)
    }

    /// How far the root is lowered so that feet near the ground can be reached, metres.
    fn drop(&self, goals: &[Vec3]) -> f32 {
        let mut most = 0.0_f32;
        for (step, goal) in self.steps.iter().zip(goals) {
            let hip = self.to.0[step.chain[0]];
            let down = hip.y - goal.y;
            let across = (goal - hip).with_y(0.0).length();
            let reach = (1.0 - 0.5 * SOFT_SHARE) * step.length_m;
            let height = goal.y - self.source.skeleton.ground_y_m - self.target.places[step.chain[2]].y;
            let near = 1.0 - (height / (LIFTED_SHARE * step.length_m)).clamp(0.0, 1.0);
            if across < reach {
                let lacking = down - (reach * reach - across * across).sqrt();
                most = most.max(lacking * near);
            }
        }
        most.min(DROP_SHARE * self.target.leg_m)
    }
}

fn steps(source: &Figure, target: &Figure, scale: f32) -> Vec<Step> {
    let mut limbs: Vec<_> = source.parts.legs.iter().zip(&target.parts.legs).collect();
    if let (true, Some(from), Some(to)) = (source.parts.on_fours, &source.parts.arms, &target.parts.arms) {
        limbs.extend(from.iter().zip(to));
    }
    let step = |(from, to): (&Limb, &Limb)| {
        let toes = from.toe.zip(to.toe);
        let (toe, own) = toes.unwrap_or((from.end, to.end));
        let apart = |a: usize, b: usize| target.places[b] - scale * source.places[a];
        Step {
            chain: to.chain(),
            length_m: length_m(target, to.chain()),
            still: target.neutral[to.end].conjugate(),
            from: [from.end, toe],
            ankle_m: apart(from.end, to.end),
            toe_m: apart(toe, own),
            foot: target.neutral[to.end].conjugate() * target.between(to.end, own),
        }
    };
    limbs.into_iter().map(step).collect()
}

/// Length of a leg's bones.
fn length_m(figure: &Figure, [upper, middle, end]: [usize; 3]) -> f32 {
    figure.between(upper, middle).length() + figure.between(middle, end).length()
}
