//! World rotations of the target's joints by those of the source's.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Quat, Vec3};

use super::figure::Figure;
use super::plan::{Bend, Roll, Turn, plan};
use crate::root::heading_of;
use crate::rotation::{align_sign, slerp, yaw};
use crate::skeleton::Skeleton;

/// How far knees may bend the wrong way, radians.
const BACKWARDS: f32 = 0.03;

/// How a joint of the target turns, with all that does not change between poses.
#[derive(Clone, Copy, Debug)]
enum Driven {
    /// As a joint of the source: its rotation in the world times a constant.
    As(usize, Quat),
    /// As the heading of a joint of the source: its inverse in the neutral pose, and the own
    /// rotation there.
    Heading(usize, [Quat; 2]),
    /// Between two joints of the source: the share of the second.
    Between([(usize, Quat); 2], f32),
    Bent(Bent),
    Rolled(Rolled),
    /// It keeps its rotation relative to its parent.
    Held(Quat),
}

/// A knee.
#[derive(Clone, Copy, Debug)]
struct Bent {
    bend: Bend,
    /// What the source's rotation in the world is multiplied by.
    turn: Quat,
    /// Inverses of the neutral rotations of the target's joint above, and of the joint.
    still: [Quat; 2],
}

impl Bent {
    /// Rotation in the world. `wanted` are those of the target's joints above.
    fn rotation(&self, from: &[Quat], wanted: &[Quat]) -> Quat {
        let rotation = from[self.bend.from] * self.turn;
        let upper = wanted[self.bend.upper] * self.still[0];
        let lower = upper.conjugate() * (rotation * (self.still[1] * Vec3::NEG_Y));
        let ahead = -lower.z;
        if ahead >= -BACKWARDS * lower.y.abs() {
            return rotation;
        }
        let angle = ahead.atan2(-lower.y);
        // Beyond a right angle it is folded too far.
        let most = if angle < -FRAC_PI_2 { -PI } else { -BACKWARDS };
        let back = Quat::from_rotation_x(most - angle);
        upper * back * upper.conjugate() * rotation
    }
}

/// A twist.
#[derive(Clone, Copy, Debug)]
struct Rolled {
    roll: Roll,
    /// Inverses of the source's neutral rotations.
    still: [Quat; 2],
    /// The inverse of the neutral rotation of the joint that the bone begins with, and the neutral
    /// rotation of the twist.
    own: [Quat; 2],
}

impl Rolled {
    /// Rotation in the world. `wanted` are those of the target's joints above.
    fn rotation(&self, from: &[Quat], wanted: &[Quat]) -> Quat {
        let [bone, next] = [0, 1].map(|nth: usize| from[self.roll.from[nth]] * self.still[nth]);
        // Bones hang in the neutral pose, so their line is the vertical.
        let [_, y, _, w] = (bone.conjugate() * next).to_array();
        // Opposite quaternions are the same turn: the shorter way.
        let roll = 2.0 * (y * w.signum()).atan2(w.abs());
        let turned = Quat::from_rotation_y(roll * self.roll.share);
        wanted[self.roll.own] * self.own[0] * turned * self.own[1]
    }
}

/// The joints of a pair of bodies, parents first.
#[derive(Clone, Debug)]
pub(super) struct Turns {
    /// Joints of the source that count: those that drive joints or feet, and all above them.
    source: Box<[usize]>,
    /// One for each joint of the target, with its parent and whether its rotation in the world
    /// counts: it is driven, or is above a joint that is or has a place.
    target: Box<[(Driven, Option<usize>, bool)]>,
    /// Joints of the target whose places count.
    placed: Box<[usize]>,
}

impl Turns {
    /// `counts` are joints of the target whose places count.
    pub(super) fn new(source: &Figure, target: &Figure, counts: &[usize]) -> Self {
        let turns = plan(source, target);
        let fixed = |from: usize, joint: usize| {
            let turn = source.neutral[from].conjugate() * target.neutral[joint];
            (from, turn.normalize())
        };
        let parent = |joint: usize| target.skeleton.joints[joint].parent;
        let driven = |(joint, turn): (usize, &Turn)| match (*turn, parent(joint)) {
            (Turn::Between(one, other, share), _) if one != other && share > 0.0 => {
                Driven::Between([fixed(one, joint), fixed(other, joint)], share)
            }
            (Turn::Between(one, ..), _) => {
                let (from, turn) = fixed(one, joint);
                Driven::As(from, turn)
            }
            (Turn::Heading(from), _) => {
                Driven::Heading(from, [source.neutral[from].conjugate(), target.neutral[joint]])
            }
            (Turn::Bent(bend), _) => Driven::Bent(Bent {
                bend,
                turn: fixed(bend.from, joint).1,
                still: [bend.upper, joint].map(|joint| target.neutral[joint].conjugate()),
            }),
            (Turn::Rolled(roll), _) => Driven::Rolled(Rolled {
                roll,
                still: roll.from.map(|joint| source.neutral[joint].conjugate()),
                own: [target.neutral[roll.own].conjugate(), target.neutral[joint]],
            }),
            (Turn::Along, above) => {
                let above = above.map_or(Quat::IDENTITY, |above| target.neutral[above]);
                Driven::Held((above.conjugate() * target.neutral[joint]).normalize())
            }
        };
        let driven: Vec<Driven> = turns.iter().enumerate().map(driven).collect();
        let is_driven = (0..driven.len()).filter(|&joint| !matches!(driven[joint], Driven::Held(_)));
        let placed = with_parents(&target.skeleton, counts.iter().copied());
        // All of a robot's rotations are goals of its hinges.
        let needed = match &target.skeleton.robot {
            Some(_) => (0..driven.len()).collect(),
            None => with_parents(&target.skeleton, is_driven.chain(counts.iter().copied())),
        };
        let drivers = driven.iter().flat_map(|driven| match *driven {
            Driven::As(from, _) | Driven::Heading(from, _) => vec![from],
            Driven::Between([one, other], _) => vec![one.0, other.0],
            Driven::Bent(bent) => vec![bent.bend.from],
            Driven::Rolled(rolled) => rolled.roll.from.to_vec(),
            Driven::Held(_) => Vec::new(),
        });
        let limbs = source.parts.legs.iter().chain(source.parts.arms.iter().flatten());
        let ends =
            limbs.flat_map(|limb| [Some(limb.end), limb.toe, Some(limb.lower[0]), Some(limb.upper[0])]);
        Self {
            source: with_parents(&source.skeleton, drivers.chain(ends.flatten()).chain([0])).into(),
            target: driven
                .iter()
                .enumerate()
                .map(|(joint, driven)| (*driven, parent(joint), needed.binary_search(&joint).is_ok()))
                .collect(),
            placed: placed.into(),
        }
    }

    /// World transforms of the source's joints that count.
    pub(super) fn world(
        &self,
        skeleton: &Skeleton,
        root: Vec3,
        local: &[Quat],
        (places, world): &mut (Vec<Vec3>, Vec<Quat>),
    ) {
        for &joint in &self.source {
            let described = &skeleton.joints[joint];
            (places[joint], world[joint]) = match described.parent {
                None => (root, local[joint]),
                Some(above) => (
                    places[above] + world[above] * described.offset_m,
                    world[above] * local[joint],
                ),
            };
        }
    }

    /// World rotations of the target's joints, `wanted`, by those of the source's. The pose gets
    /// the rotations relative to their parents, and keeps its hemispheres.
    pub(super) fn turn(&self, from: &[Quat], wanted: &mut [Quat], mut pose: Option<&mut [Quat]>) {
        for (joint, &(driven, parent, counts)) in self.target.iter().enumerate() {
            let rotation = match driven {
                Driven::Held(local) => {
                    if let Some(pose) = &mut pose {
                        pose[joint] = align_sign(local, pose[joint]);
                    }
                    if counts {
                        wanted[joint] = parent.map_or(local, |above| wanted[above] * local);
                    }
                    continue;
                }
                Driven::As(one, turn) => from[one] * turn,
                Driven::Heading(one, [still, own]) => yaw(heading_of(from[one] * still, Vec3::X)) * own,
                Driven::Bent(bent) => bent.rotation(from, wanted),
                Driven::Rolled(rolled) => rolled.rotation(from, wanted),
                Driven::Between([(one, turn), (other, next)], share) => {
                    slerp(from[one] * turn, from[other] * next, share)
                }
            };
            let rotation = rotation.normalize();
            wanted[joint] = rotation;
            if let Some(pose) = &mut pose {
                let local = parent.map_or(rotation, |above| wanted[above].conjugate() * rotation);
                pose[joint] = align_sign(local, pose[joint]);
            }
        }
    }

    /// Places of the target's joints that count, with joint 0 in the origin.
    pub(super) fn places(&self, skeleton: &Skeleton, (places, world): &mut (Vec<Vec3>, Vec<Quat>)) {
        for &joint in &self.placed {
            let described = &skeleton.joints[joint];
            places[joint] = described.parent.map_or(Vec3::ZERO, |above| {
                places[above] + world[above] * described.offset_m
            });
        }
    }

    /// The same for a pose that is not as wanted. `world` takes its rotations.
    pub(super) fn places_of(
        &self,
        skeleton: &Skeleton,
        pose: &[Quat],
        places: &mut [Vec3],
        world: &mut [Quat],
    ) {
        for &joint in &self.placed {
            let described = &skeleton.joints[joint];
            (places[joint], world[joint]) = match described.parent {
                None => (Vec3::ZERO, pose[joint]),
                Some(above) => (
                    places[above] + world[above] * described.offset_m,
                    world[above] * pose[joint],
                ),
            };
        }
    }

    /// Moves the places that count.
    pub(super) fn shift(&self, by: Vec3, places: &mut [Vec3]) {
        self.placed.iter().for_each(|&joint| places[joint] += by);
    }
}

/// Joints and all above them, in order.
fn with_parents(skeleton: &Skeleton, joints: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut counts = vec![false; skeleton.joint_count()];
    for joint in joints {
        let mut at = Some(joint);
        while let Some(joint) = at.filter(|&joint| !counts[joint]) {
            counts[joint] = true;
            at = skeleton.joints[joint].parent;
        }
    }
    (0..counts.len()).filter(|&joint| counts[joint]).collect()
}
