//! Motion of one body on another.
//!
//! A [`Figure`] is a body in its neutral pose: upright, heading along +Z, limbs hanging down. A
//! joint's *turn* is its rotation from there in the world. The target's joints turn as the source's
//! do; chains of other lengths share the bend. The root moves by the ratio of the legs' lengths.
//! Inverse kinematics brings the feet to the scaled places of the source's feet, at the height of
//! the target's own soles. So a foot that stands in the source stands in the target.

mod build;
mod certificate;
#[cfg(feature = "files")]
#[cfg(test)]
mod certificate_tests;
mod clip;
mod contacts;
mod dolls;
mod feet;
#[cfg(feature = "files")]
#[cfg(test)]
mod feet_tests;
mod figure;
mod figures;
#[cfg(feature = "files")]
#[cfg(test)]
mod ground_tests;
mod hinges;
mod limbs;
mod motions;
mod plan;
#[cfg(feature = "files")]
#[cfg(test)]
mod tests;
mod turns;

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use self::hinges::Hinges;
use self::limbs::{Chain, Hand, Step};
use self::turns::Turns;
use crate::anatomy::Limb;
use crate::ik::place_end;
use crate::root::{heading_of, wrap_angle};
use crate::rotation::yaw;

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
/// Time from pose to pose at first, seconds.
const STEP_S: f32 = 1.0 / 30.0;

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
    #[error("{}", legs(*.source_on_fours))]
    Legs {
        /// Whether the source is the body on four.
        source_on_fours: bool,
    },
    /// Frames or joints that are too many, or do not match.
    #[error(transparent)]
    Clip(#[from] crate::clip::ClipError),
}

fn legs(source_on_fours: bool) -> &'static str {
    match source_on_fours {
        true => {
            "the motion is of a body on four legs, and the character stands on two; allowed: as many legs"
        }
        false => {
            "the motion is of a body on two legs, and the character stands on four; allowed: as many legs"
        }
    }
}

/// Carries poses of one body over to another. After it is made, it allocates nothing.
#[derive(Clone, Debug)]
pub struct Retargeter {
    source: Figure,
    target: Figure,
    turns: Turns,
    steps: Vec<Step>,
    hands: Vec<Hand>,
    memory: Memory,
    /// Time from the last pose to the next, seconds.
    step_s: f32,
    scale: f32,
    /// World transforms of the source's joints that count.
    from: (Vec<Vec3>, Vec<Quat>),
    /// World rotations that the target's joints should have, and the places of those that count.
    to: (Vec<Vec3>, Vec<Quat>),
    hinges: Option<Hinges>,
    /// World rotations of a robot's joints, as its hinges turn them.
    bent: Vec<Quat>,
    /// Farthest that a limb of the last pose remained from its place, metres, and its last joint.
    short: (f32, Option<usize>),
}

/// What of a body is held at places.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Holds {
    /// Places of the source's wrists in the source's world, left and right. The target's wrists
    /// come to the same places in its size ([`Retargeter::scale`]), or as near as the arms reach
    /// ([`Retargeter::short_m`]). Bodies on four have no hands: theirs are left out.
    pub hands: [Option<Vec3>; 2],
    /// How far the hips are held as on a seat, 0 to 1. Free hips are as far above the own soles as
    /// the source's are above its soles, in the target's size. Held ones are as far above the
    /// ground.
    pub hips: f32,
}

/// What the next pose of a motion takes from those before, beside the last pose itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Memory {
    /// Headings of the feet: they change while a foot is in the air. None before the first pose.
    headings: [Option<f32>; MAX_STEPS],
    /// Whether hinges go on from the last pose.
    is_warm: bool,
}

impl Retargeter {
    /// A retargeter from one body to another.
    ///
    /// # Errors
    /// [`RetargetError::Legs`] if only one of the bodies stands on four legs.
    pub fn new(source: Figure, target: Figure) -> Result<Self, RetargetError> {
        if source.parts.on_fours != target.parts.on_fours {
            return Err(RetargetError::Legs {
                source_on_fours: source.parts.on_fours,
            });
        }
        let scale = target.leg_m / source.leg_m;
        let blank = |joints: usize| (vec![Vec3::ZERO; joints], vec![Quat::IDENTITY; joints]);
        let [from, to] = [&source, &target].map(|figure| blank(figure.skeleton.joint_count()));
        let steps = limbs::steps(&source, &target, scale);
        let hands = limbs::hands(&source, &target);
        let ends = steps
            .iter()
            .map(|step| step.limb)
            .chain(hands.iter().map(|hand| hand.limb));
        let hips = target.hips();
        let counts: Vec<usize> = ends.map(|limb| limb.chain[2]).chain(hips).collect();
        Ok(Self {
            turns: Turns::new(&source, &target, &counts),
            steps,
            hands,
            memory: Memory::default(),
            step_s: STEP_S,
            scale,
            from,
            hinges: Hinges::of(&target),
            bent: to.1.clone(),
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

    /// Farthest that a foot or a held hand of the last pose remained from its place, metres.
    pub fn short_m(&self) -> f32 {
        self.short.0
    }

    /// The ankle or wrist of that limb; none if all reach.
    pub fn short_joint(&self) -> Option<usize> {
        self.short.1
    }

    /// Forgets the poses before: the next one begins a motion.
    pub fn reset(&mut self) {
        self.memory = Memory::default();
    }

    /// Sets the time from the last pose to the next, and from each to the one after it, seconds. At
    /// first it is a thirtieth. A pose of the same moment again takes 0.
    pub fn set_step(&mut self, seconds: f32) {
        self.step_s = seconds.max(0.0);
    }

    /// What it keeps of the poses so far.
    pub fn memory(&self) -> Memory {
        self.memory
    }

    /// Goes on where another retargeter of the same bodies was. The next pose goes into the
    /// rotations of that one's last pose.
    pub fn resume(&mut self, memory: Memory) {
        self.memory = memory;
    }

    /// Carries the next pose of a motion over. `root` is the world position of joint 0. Rotations
    /// are those of joint 0 in the world and of the others relative to their parents. `out` has one
    /// for each joint of the target, and keeps the hemispheres that it has. Returns the target's
    /// root.
    ///
    /// # Panics
    /// If `rotations` or `out` is shorter than its skeleton.
    pub fn pose(&mut self, root: Vec3, rotations: &[Quat], out: &mut [Quat]) -> Vec3 {
        self.pose_holding(root, rotations, Holds::default(), out)
    }

    /// As [`Retargeter::pose`], with hands that hold on to something, and hips on a seat.
    ///
    /// # Panics
    /// As [`Retargeter::pose`].
    pub fn pose_holding(&mut self, root: Vec3, rotations: &[Quat], holds: Holds, out: &mut [Quat]) -> Vec3 {
        self.turns
            .world(&self.source.skeleton, root, rotations, &mut self.from);
        let is_robot = self.hinges.is_some();
        self.turns
            .turn(&self.from.1, &mut self.to.1, (!is_robot).then_some(&mut *out));
        if let (Some(hinges), Some(robot)) = (&mut self.hinges, &self.target.skeleton.robot) {
            let (world, neutral) = (&self.from.1, &self.source.neutral);
            let hanging = |joint: usize| world[joint] * (neutral[joint].conjugate() * Vec3::NEG_Y);
            let bones = self.source.parts.arms.as_ref().map(|arms| {
                let bones = |arm: &Limb| [arm.upper[0], arm.lower[0]].map(hanging);
                arms.each_ref().map(bones)
            });
            let bones = bones.unwrap_or([[Vec3::NEG_Y; 2]; 2]);
            let is_warm = std::mem::replace(&mut self.memory.is_warm, true);
            hinges.turn((&self.target, robot), is_warm, &self.to.1, &bones, out);
        }
        let root = self.root(holds.hips, out);
        let count = self.steps.len();
        let mut goals = [Vec3::ZERO; MAX_STEPS];
        for (nth, goal) in goals[..count].iter_mut().enumerate() {
            *goal = self.goal(nth);
        }
        let drop = Vec3::Y * self.drop(&goals[..count]);
        let root = root - drop;
        self.short = (0.0, None);
        for (nth, &goal) in goals[..count].iter().enumerate() {
            let Step {
                limb, aside, toes, ..
            } = self.steps[nth];
            let pole = self.to.1[limb.chain[0]] * aside;
            let ankle = self.place(limb, (root, drop), goal, pole, out);
            if let (Some(toes), Some(ankle)) = (toes, ankle) {
                let height = ankle.y - self.source.skeleton.ground_y_m;
                let local = out[toes.joint];
                out[toes.joint] = toes.bent(height, self.to.1[limb.chain[2]], local);
            }
        }
        for nth in 0..self.hands.len() {
            let Hand { limb, side, behind } = self.hands[nth];
            if let Some(place) = holds.hands[side] {
                // Elbows bend backwards.
                let pole = self.to.1[limb.chain[0]] * behind;
                self.place(limb, (root, drop), self.scaled(place), pole, out);
            }
        }
        if let (Some(hinges), Some(robot)) = (&mut self.hinges, &self.target.skeleton.robot) {
            hinges.fit(robot, out);
        }
        root
    }

    /// Brings the end of a limb to a goal in the world with its wanted rotation. `drop` is how far
    /// the joints' places are above those of a body whose root is at `root`. Returns the place of
    /// an end without hinges.
    fn place(
        &mut self,
        limb: Chain,
        (root, drop): (Vec3, Vec3),
        goal: Vec3,
        pole: Vec3,
        out: &mut [Quat],
    ) -> Option<Vec3> {
        let mut place = None;
        let short = match &self.hinges {
            None => match limb.bend(&self.to, (goal + drop, SOFT_SHARE), pole, out) {
                // A limb that cannot be bent stays as it is.
                None => self.to.0[limb.chain[2]].distance(goal + drop),
                Some((short, end)) => {
                    place = Some(end - drop);
                    short
                }
            },
            Some(_) => {
                let rotation = self.to.1[limb.chain[2]];
                let skeleton = &self.target.skeleton;
                place_end(
                    skeleton,
                    root,
                    out,
                    limb.chain,
                    (goal, SOFT_SHARE),
                    pole,
                    rotation,
                )
            }
        };
        if short > self.short.0 {
            self.short = (short, Some(limb.chain[2]));
        }
        place
    }

    /// The target's root, so that the middle of its hips is at that of the source's, scaled. Finds
    /// the places of its joints. `held` is how far the hips are held.
    fn root(&mut self, held: f32, out: &[Quat]) -> Vec3 {
        match &self.hinges {
            None => self.turns.places(&self.target.skeleton, &mut self.to),
            Some(_) => {
                let (skeleton, places) = (&self.target.skeleton, &mut self.to.0);
                self.turns.places_of(skeleton, out, places, &mut self.bent);
            }
        }
        let middle = |places: &[Vec3], [left, right]: [usize; 2]| 0.5 * (places[left] + places[right]);
        let hips = middle(&self.from.0, self.source.hips());
        let own = middle(&self.to.0, self.target.hips());
        let neutral = |figure: &Figure| figure.places[figure.hips()[0]].y;
        // Heights are scaled from where the soles stand, and those of a seat from the ground.
        let ground = self.source.skeleton.ground_y_m;
        let soles = neutral(&self.target) - self.scale * neutral(&self.source);
        let height = (hips.y - ground) * self.scale + (1.0 - held) * soles;
        let root = Vec3::new(hips.x * self.scale, ground + height, hips.z * self.scale) - own;
        self.turns.shift(root, &mut self.to.0);
        root
    }

    /// A place of the source's world in the target's size.
    fn scaled(&self, place: Vec3) -> Vec3 {
        let ground = Vec3::Y * self.source.skeleton.ground_y_m;
        (place - ground) * self.scale + ground
    }

    /// The place of a foot: the target's ankle.
    fn goal(&mut self, nth: usize) -> Vec3 {
        let step = &self.steps[nth];
        let [ankle, toe] = step.from;
        let ground = self.source.skeleton.ground_y_m;
        let rotation = self.to.1[step.limb.chain[2]];
        let over = |joint: usize| self.from.0[joint].y - ground - self.source.places[joint].y;
        let now = heading_of(rotation * step.still, Vec3::X);
        // A standing foot rolls; what is between the places of the two feet does not turn with it.
        let lifted = over(ankle).min(over(toe)) / (LIFTED_SHARE * self.source.leg_m);
        // As much of the turn is left after a time, in however many steps it goes by.
        let left = (1.0 - lifted.clamp(0.0, 1.0)).powf(self.step_s / STEP_S);
        let facing = match self.memory.headings[nth] {
            None => now,
            Some(before) => before + (1.0 - left) * wrap_angle(now - before),
        };
        self.memory.headings[nth] = Some(facing);
        let facing = yaw(facing);
        let by_ankle = self.scaled(self.from.0[ankle]) + facing * step.ankle_m;
        if toe == ankle {
            return by_ankle;
        }
        let by_toe = self.scaled(self.from.0[toe]) + facing * step.toe_m - rotation * step.foot;
        let room = ROLL_SHARE * self.source.leg_m;
        let toes = (0.5 + 0.5 * (over(ankle) - over(toe)) / room).clamp(0.0, 1.0);
        by_ankle.lerp(by_toe, toes)
    }

    /// How far the root is lowered so that feet near the ground can be reached, metres.
    fn drop(&self, goals: &[Vec3]) -> f32 {
        let mut most = 0.0_f32;
        for (step, goal) in self.steps.iter().zip(goals) {
            let [top, middle, end] = step.limb.chain;
            let [hip, knee, ankle] = [top, middle, end].map(|joint| self.to.0[joint]);
            // Joints along a bone change its length.
            let length_m = match self.hinges {
                Some(_) => step.length_m,
                None => hip.distance(knee) + knee.distance(ankle),
            };
            let down = hip.y - goal.y;
            let across = (goal - hip).with_y(0.0).length();
            // A leg that stands straighter may stay so.
            let reach = ((1.0 - 0.5 * SOFT_SHARE) * length_m).max(hip.distance(ankle));
            let height = goal.y - self.source.skeleton.ground_y_m - self.target.places[end].y;
            let near = 1.0 - (height / (LIFTED_SHARE * step.length_m)).clamp(0.0, 1.0);
            if across < reach {
                let lacking = down - (reach * reach - across * across).sqrt();
                most = most.max(lacking * near);
            }
        }
        most.min(DROP_SHARE * self.target.leg_m)
    }
}
