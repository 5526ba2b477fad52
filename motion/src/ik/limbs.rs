//! Finds legs and arms, from contact joints and the lengths of bones.
//!
//! A robot has a joint for every hinge, several of them within a hand's breadth where a person has
//! one. Its limbs are the chains of hinges below the trunk. The middle joint of a limb is the one
//! that leaves two long bones.

use std::ops::Range;

use glam::{Quat, Vec3};

use crate::fk::transforms_down_to;
use crate::robot::Robot;
use crate::skeleton::Skeleton;

use super::two_bone::SHORTEST_BONE_M;

/// Most legs that are found: a spider's.
pub const MAX_LEGS: usize = MOST_CONTACTS;

/// The shorter bone of a leg is at least this share of the longer.
const LEAST_LEG_RATIO: f32 = 0.4;
/// The shorter bone of an arm is at least this share of the longer.
const LEAST_ARM_RATIO: f32 = 0.4;
/// A frame's contacts have one byte.
const MOST_CONTACTS: usize = 8;

/// A leg: hip, knee, foot, and its contact joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    /// Index of the hip, which turns the thigh.
    pub upper: usize,
    /// Index of the knee.
    pub lower: usize,
    /// Index of the ankle, the parent of the foot.
    pub foot: usize,
    /// The contact joint below the ankle, if there is one.
    pub toe: Option<usize>,
    /// The bits of a frame's contacts for the ankle and for the toe.
    pub contacts: [Option<usize>; 2],
    /// Heights of ankle and toe over the ground when they stand on it, metres; 0 for one that is
    /// not a contact joint.
    pub clearance_m: [f32; 2],
}

impl Leg {
    /// Hip, knee and ankle, for [`super::two_bone`].
    pub fn chain(&self) -> [usize; 3] {
        [self.upper, self.lower, self.foot]
    }

    /// The bits of a frame's contacts that belong to this leg.
    pub fn contact_bits(&self) -> u8 {
        self.contacts
            .iter()
            .flatten()
            .fold(0, |bits, &bit| bits | 1 << bit)
    }

    /// Length of thigh and shin together, metres. For a robot: as far as the hinge of its knee
    /// stretches them.
    pub fn length_m(&self, skeleton: &Skeleton) -> f32 {
        match &skeleton.robot {
            Some(robot) => stretched((skeleton, robot), self.chain()),
            None => bone(skeleton, self.lower) + bone(skeleton, self.foot),
        }
    }

    /// Whether ankle or toe is in contact. A leg without contact joints never stands.
    pub(crate) fn stands(&self, contacts: u8) -> bool {
        contacts & self.contact_bits() != 0
    }
}

/// World positions of a leg's hip, ankle and toe, frame by frame. Without a toe, the ankle comes
/// twice.
pub(crate) struct LegTrack {
    pub(crate) hips: Vec<Vec3>,
    pub(crate) feet: Vec<Vec3>,
    pub(crate) toes: Vec<Vec3>,
}

impl LegTrack {
    /// The track in the frames `window` of a motion.
    pub(crate) fn of(
        skeleton: &Skeleton,
        leg: &Leg,
        window: &Range<usize>,
        roots: &[Vec3],
        rotations: &[Quat],
    ) -> Self {
        let [hips, feet, toes] = [0; 3].map(|_| vec![Vec3::ZERO; window.len()]);
        let mut track = Self { hips, feet, toes };
        // The toe is below the ankle, and the ankle below the hip.
        let lowest = leg.toe.unwrap_or(leg.foot);
        for (index, frame) in window.clone().enumerate() {
            let mut note = |joint, position, _| {
                if joint == leg.upper {
                    track.hips[index] = position;
                }
                if joint == leg.foot {
                    track.feet[index] = position;
                }
                if joint == lowest {
                    track.toes[index] = position;
                }
            };
            let pose = &rotations[frame * skeleton.joint_count()..];
            transforms_down_to(skeleton, roots[frame], pose, lowest, &mut note);
        }
        track
    }
}

/// The legs of a skeleton, in the order of its contact joints, at most [`MAX_LEGS`].
///
/// On the way from the lowest contact joint of a limb up to the pelvis, thigh and shin are the two
/// consecutive bones whose shorter one is longest. There are none without contact joints, or
/// without two consecutive bones of similar length: a skeleton without knees. Only the first eight
/// contact joints count, because a frame's contacts have one byte.
pub fn legs(skeleton: &Skeleton) -> Vec<Leg> {
    let mut legs: Vec<Leg> = Vec::new();
    let Some(contacts) = &skeleton.contacts else {
        return legs;
    };
    let joints = &contacts.joints[..contacts.len().min(MOST_CONTACTS)];
    for &lowest in joints {
        if joints.iter().any(|&other| is_below(skeleton, other, lowest)) {
            continue;
        }
        let path: Vec<usize> = upwards(skeleton, lowest).collect();
        let Some(chain) = limb(skeleton, &path, LEAST_LEG_RATIO) else {
            continue;
        };
        let bit = |joint| joints.iter().position(|&j| j == joint);
        let toe = Some(lowest).filter(|&joint| joint != chain[2]);
        match legs.iter_mut().find(|leg| leg.foot == chain[2]) {
            // Heel and toes below one ankle: in the order of the pack.
            Some(leg) if leg.contacts[0].is_none() => {
                leg.contacts = [leg.contacts[1], bit(lowest)];
                leg.toe = toe;
            }
            Some(_) => {}
            None => legs.push(Leg {
                upper: chain[0],
                lower: chain[1],
                foot: chain[2],
                toe,
                contacts: [bit(chain[2]), toe.and_then(bit)],
                clearance_m: [0.0; 2],
            }),
        }
    }
    for leg in &mut legs {
        leg.clearance_m = leg
            .contacts
            .map(|bit| bit.map_or(0.0, |bit| contacts.clearance_m[bit]));
    }
    legs.truncate(MAX_LEGS);
    legs
}

/// The arms of a skeleton: limbs of two bones below the trunk that are not legs. Each as upper,
/// middle and end joint, in the order of joints.
pub fn arms(skeleton: &Skeleton) -> Vec<[usize; 3]> {
    let legs = legs(skeleton);
    let mut arms: Vec<[usize; 3]> = Vec::new();
    for leaf in (1..skeleton.joint_count()).filter(|&joint| is_leaf(skeleton, joint)) {
        let path: Vec<usize> = upwards(skeleton, leaf).collect();
        let of_leg = legs.iter().any(|leg| path.contains(&leg.upper));
        if let Some(chain) = limb(skeleton, &path, LEAST_ARM_RATIO)
            && !of_leg
            && arm_of(skeleton, chain[2]).is_some()
            && !arms.contains(&chain)
        {
            arms.push(chain);
        }
    }
    arms
}

/// The trunk of a body with two arms or more, and its arms.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Torso {
    /// From the root joint to the nearest joint that all arms hang on.
    pub trunk: [usize; 2],
    /// See [`arms`].
    pub arms: Vec<[usize; 3]>,
}

impl Torso {
    /// The torso of a skeleton; none if it has fewer than two arms.
    pub fn of(skeleton: &Skeleton) -> Option<Self> {
        let arms = arms(skeleton);
        let [first, _, ..] = arms[..] else {
            return None;
        };
        let parent = |joint: usize| skeleton.joints[joint].parent;
        // A clavicle is a child of the trunk's end.
        let top = std::iter::successors(parent(first[0]), |&joint| parent(joint))
            .find(|&above| arms.iter().all(|arm| is_below(skeleton, arm[0], above)))?;
        Some(Self {
            trunk: [0, top],
            arms,
        })
    }
}

/// The limb of two bones that ends in `joint`, if it can be bent without moving other limbs:
/// `joint`, its parent and its grandparent. The grandparent is not the pelvis, the bones between
/// them have some length, and only single joints (twists) branch off. A foot has such a limb too,
/// the leg. For a robot: the chain of hinges that `joint` ends or is fixed to.
pub fn arm_of(skeleton: &Skeleton, joint: usize) -> Option<[usize; 3]> {
    if let Some(robot) = &skeleton.robot {
        skeleton.joints.get(joint)?;
        let path: Vec<usize> = upwards(skeleton, joint).collect();
        let [upper, middle, _] = hinged_limb((skeleton, robot), &path, LEAST_ARM_RATIO)?;
        return (joint > middle).then_some([upper, middle, joint]);
    }
    let middle = skeleton.joints.get(joint)?.parent?;
    let upper = skeleton.joints[middle].parent?;
    skeleton.joints[upper].parent?;
    let alone = |parent: usize, child: usize| {
        let children =
            (parent + 1..skeleton.joint_count()).filter(|&j| skeleton.joints[j].parent == Some(parent));
        children
            .filter(|&j| j != child)
            .all(|other| is_leaf(skeleton, other))
    };
    let long = |joint| bone(skeleton, joint) >= SHORTEST_BONE_M;
    (long(middle) && long(joint) && alone(upper, middle) && alone(middle, joint))
        .then_some([upper, middle, joint])
}

/// The joints of the trunk, from the pelvis to the parent of the arms. Only the pelvis without
/// arms.
pub(super) fn spine(skeleton: &Skeleton) -> Vec<usize> {
    let mut spine = vec![0];
    let arms = arms(skeleton);
    if let [first, rest @ ..] = &arms[..] {
        let mut above: Vec<usize> = upwards(skeleton, first[0]).skip(1).collect();
        above.retain(|&joint| rest.iter().all(|arm| is_below(skeleton, arm[0], joint)));
        spine.extend(above.iter().rev());
    }
    spine
}

/// Whether `joint` is a descendant of `other`.
pub(crate) fn is_below(skeleton: &Skeleton, joint: usize, other: usize) -> bool {
    upwards(skeleton, joint).skip(1).any(|j| j == other) || (other == 0 && joint != 0)
}

/// `joint` and its ancestors, without the pelvis.
fn upwards(skeleton: &Skeleton, joint: usize) -> impl Iterator<Item = usize> + '_ {
    std::iter::successors(Some(joint), |&j| skeleton.joints[j].parent).filter(|&j| j != 0)
}

/// Upper, middle and end joint of the limb on a path upwards.
fn limb(skeleton: &Skeleton, path: &[usize], least_ratio: f32) -> Option<[usize; 3]> {
    match &skeleton.robot {
        Some(robot) => hinged_limb((skeleton, robot), path, least_ratio),
        None => longest_pair(skeleton, path, least_ratio),
    }
}

/// The limb of hinges on a path upwards, up to where other limbs branch off the trunk: its
/// uppermost hinge, its last, and the hinge between them that leaves the longest shorter bone.
fn hinged_limb(
    (skeleton, robot): (&Skeleton, &Robot),
    path: &[usize],
    least_ratio: f32,
) -> Option<[usize; 3]> {
    let has_hinge = |&joint: &usize| robot.hinge_of(joint).is_some();
    let alone = |joint: usize| {
        let parent = skeleton.joints[joint].parent;
        let beside =
            (1..skeleton.joint_count()).filter(|&j| j != joint && skeleton.joints[j].parent == parent);
        // What is fixed to a bone also branches off it.
        beside.into_iter().all(|j| is_leaf(skeleton, j) && !has_hinge(&j))
    };
    let within = path.iter().take_while(|&&joint| alone(joint)).count();
    // The first that has siblings belongs to the trunk.
    let limb = &path[..(within + 1).min(path.len())];
    let upper = limb.iter().rev().copied().find(has_hinge)?;
    let end = limb.iter().copied().find(has_hinge)?;
    let length = |a: usize, b: usize| at_rest((skeleton, robot), a, b).0.length();
    let bones = |middle: usize| [length(upper, middle), length(middle, end)];
    let shorter = |middle: usize| bones(middle)[0].min(bones(middle)[1]);
    let between = limb
        .iter()
        .copied()
        .filter(|&joint| has_hinge(&joint) && upper < joint && joint < end);
    let middle = between.max_by(|&a, &b| shorter(a).total_cmp(&shorter(b)))?;
    let [first, second] = bones(middle);
    let (shorter, longer) = (first.min(second), first.max(second));
    (shorter >= SHORTEST_BONE_M && shorter >= least_ratio * longer).then_some([upper, middle, end])
}

/// Farthest that the middle hinge of a limb brings its end from its upper joint, metres, with the
/// other hinges at 0.
fn stretched(of: (&Skeleton, &Robot), [upper, middle, end]: [usize; 3]) -> f32 {
    let ((knee, turned), (foot, _)) = (at_rest(of, upper, middle), at_rest(of, upper, end));
    let Some(hinge) = of.1.hinge_of(middle) else {
        return foot.length();
    };
    let axis = turned * of.1.hinges()[hinge].axis;
    longest(knee, foot - knee, axis)
}

/// Reach of two bones, if the second turns about an axis on the first. A hinge that is not square
/// to both never makes them straight.
pub(super) fn longest(first: Vec3, second: Vec3, axis: Vec3) -> f32 {
    let along = |bone: Vec3| bone.dot(axis);
    let across = |bone: Vec3| (bone - axis * along(bone)).length();
    (along(first) + along(second)).hypot(across(first) + across(second))
}

/// Position and rotation of a joint relative to one above it, with all hinges between them at 0, or
/// as near to 0 as they can be.
fn at_rest((skeleton, robot): (&Skeleton, &Robot), upper: usize, lower: usize) -> (Vec3, Quat) {
    let (mut place, mut rotation) = (Vec3::ZERO, Quat::IDENTITY);
    for joint in upwards(skeleton, lower).take_while(|&joint| joint != upper) {
        let turned = robot.hinge_of(joint).map_or(Quat::IDENTITY, |hinge| {
            let hinge = &robot.hinges()[hinge];
            hinge.rotation(hinge.limited(0.0))
        });
        (place, rotation) = (
            skeleton.joints[joint].offset_m + turned * place,
            turned * rotation,
        );
    }
    (place, rotation)
}

/// Upper, middle and end joint of the two consecutive bones whose shorter one is longest, on a path
/// upwards.
fn longest_pair(skeleton: &Skeleton, path: &[usize], least_ratio: f32) -> Option<[usize; 3]> {
    let shorter = |chain: &&[usize]| bone(skeleton, chain[0]).min(bone(skeleton, chain[1]));
    let chain = path.windows(3).max_by(|a, b| shorter(a).total_cmp(&shorter(b)))?;
    let longer = bone(skeleton, chain[0]).max(bone(skeleton, chain[1]));
    let shorter = shorter(&chain);
    (shorter >= SHORTEST_BONE_M && shorter >= least_ratio * longer).then(|| [chain[2], chain[1], chain[0]])
}

fn bone(skeleton: &Skeleton, joint: usize) -> f32 {
    skeleton.joints[joint].offset_m.length()
}

fn is_leaf(skeleton: &Skeleton, joint: usize) -> bool {
    skeleton.joints.iter().all(|j| j.parent != Some(joint))
}
