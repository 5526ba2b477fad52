//! A target with hinges: its limbs turn as far as they can.

use glam::{Mat3, Quat, Vec3};

use super::figure::Figure;
use crate::anatomy::{Limb, Parts};
use crate::fk::joint_transform;
use crate::ik::turn_hinges;
use crate::interpolate::smoothstep;
use crate::robot::{Fitted, Robot};
use crate::rotation::{align_sign, slerp};
use crate::skeleton::Skeleton;

/// Sine of the elbow's bend from which its plane begins to count, and from which it counts alone.
const BENT: (f32, f32) = (0.05, 0.3);

/// Least cosine between a hinge that twists an arm and the arm.
const TWISTS: f32 = 0.8;

/// The hinges of a robot, from the trunk outwards.
#[derive(Clone, Debug)]
pub(super) struct Hinges {
    /// First and last joint of each group. The last has the wanted rotation.
    groups: Vec<(usize, usize)>,
    arms: Vec<Arm>,
    fitted: Fitted,
}

/// An arm whose elbow is a hinge.
#[derive(Clone, Debug)]
struct Arm {
    /// The arm's place among the body's arms: 0 left, 1 right.
    side: usize,
    /// First and last hinge of the shoulder.
    shoulder: (usize, usize),
    elbow: usize,
    /// First and last joint of the wrist.
    wrist: (usize, usize),
    /// In the upper arm's own frame of reference: its line, and the axis about which the elbow
    /// bends.
    upper: (Vec3, Vec3),
    /// The same in the forearm's.
    lower: (Vec3, Vec3),
}

/// Directions of an upper arm and a forearm in the world, unit length.
pub(super) type ArmBones = [Vec3; 2];

impl Hinges {
    /// The groups of a robot; none for other bodies.
    pub(super) fn of(figure: &Figure) -> Option<Self> {
        let robot = figure.skeleton.robot.as_ref()?;
        let parts = &figure.parts;
        let mut groups = Vec::new();
        if let [_, first, ..] = parts.trunk[..] {
            groups.push((first, parts.trunk[parts.trunk.len() - 1]));
        }
        for leg in &parts.legs {
            groups.push((leg.top, leg.upper[0]));
            groups.push((leg.lower[0], leg.lower[0]));
        }
        let arms = parts.arms.iter().flatten().enumerate();
        // A first fit takes the memory of all later ones.
        let mut fitted = Fitted::default();
        robot.fit(&mut figure.neutral.clone(), &mut fitted);
        Some(Self {
            groups,
            arms: arms
                .filter_map(|(side, arm)| Arm::of(figure, robot, side, arm))
                .collect(),
            fitted,
        })
    }

    /// Turns the hinges of a pose towards wanted rotations in the world, one a joint, and the arms
    /// towards the directions of their bones. If they are warm, they go on from the pose.
    pub(super) fn turn(
        &mut self,
        (figure, robot): (&Figure, &Robot),
        is_warm: bool,
        wanted: &[Quat],
        bones: &[ArmBones; 2],
        out: &mut [Quat],
    ) {
        if !is_warm {
            self.fitted.angles.clear();
            self.fitted.angles.resize(robot.hinges().len(), 0.0);
            robot.pose(wanted[0], &self.fitted.angles, out);
        }
        out[0] = wanted[0];
        let of = (&*figure.skeleton, robot);
        for &group in &self.groups {
            turn_group(of, out, group, wanted[group.1]);
        }
        for arm in &self.arms {
            let bones = bones[arm.side];
            let [upper, lower] = arm.bent([wanted[arm.shoulder.1], wanted[arm.elbow]], bones);
            turn_group(of, out, arm.shoulder, upper);
            turn_group(of, out, (arm.elbow, arm.elbow), lower);
            turn_group(of, out, arm.wrist, wanted[arm.wrist.1]);
        }
    }

    /// Brings a pose onto the hinges, and what follows them.
    pub(super) fn fit(&mut self, robot: &Robot, out: &mut [Quat]) {
        robot.fit(out, &mut self.fitted);
    }
}

/// Turns the hinges from one joint down to another towards a rotation in the world. The best angle
/// of a single hinge needs no search.
fn turn_group(of: (&Skeleton, &Robot), out: &mut [Quat], (top, end): (usize, usize), wanted: Quat) {
    let (skeleton, robot) = of;
    let above = skeleton.joints[end].parent;
    match (robot.hinge_of(end), above) {
        (Some(hinge), Some(above)) if top == end && robot.mimics().is_empty() => {
            let hinge = &robot.hinges()[hinge];
            let (_, above) = joint_transform(skeleton, Vec3::ZERO, out, above);
            let angle = hinge.limited(hinge.angle_of(above.conjugate() * wanted));
            out[end] = align_sign(hinge.rotation(angle), out[end]);
        }
        _ => turn_hinges(of, out, (top, end), wanted),
    }
}

/// The line of an upper arm: the axis of its last hinge if that twists the arm, whose other hinges
/// stand beside the line.
fn along(robot: &Robot, upper: usize, bone: Vec3) -> Vec3 {
    let hinge = robot.hinge_of(upper).map(|hinge| robot.hinges()[hinge].axis);
    match hinge.map(|axis| axis * axis.dot(bone).signum()) {
        Some(axis) if axis.dot(bone) >= TWISTS => axis,
        _ => bone,
    }
}

impl Arm {
    fn of(figure: &Figure, robot: &Robot, side: usize, limb: &Limb) -> Option<Self> {
        let (upper, elbow) = (limb.upper[0], limb.lower[0]);
        let hinge = &robot.hinges()[robot.hinge_of(elbow)?];
        let below = limb.lower.get(1).copied().unwrap_or(limb.end);
        // The lines of the bones hang in the neutral pose.
        let [bone, lower] = [upper, elbow].map(|joint| figure.neutral[joint].conjugate() * Vec3::NEG_Y);
        let axis = hinge.rest * hinge.axis;
        // The axis about which the forearm bends away from the upper arm's line.
        let middle = hinge.rotation(0.5 * (hinge.lower_rad + hinge.upper_rad));
        let bends = bone.cross(middle * lower).dot(axis).signum();
        let across = |axis: Vec3, bone: Vec3| (bends * (axis - bone * axis.dot(bone))).try_normalize();
        Some(Self {
            side,
            shoulder: (limb.top, upper),
            elbow,
            wrist: (below, limb.end),
            upper: (bone, across(axis, bone)?),
            lower: (lower, across(hinge.axis, lower)?),
        })
    }

    /// The rotations of upper arm and forearm with which the elbow bends in the plane of the bones:
    /// the wanted ones for a straight arm, whose bones have none.
    fn bent(&self, wanted: [Quat; 2], bones: ArmBones) -> [Quat; 2] {
        let across = bones[0].cross(bones[1]);
        let share = smoothstep(((across.length() - BENT.0) / (BENT.1 - BENT.0)).clamp(0.0, 1.0));
        let Some(axis) = across.try_normalize().filter(|_| share > 0.0) else {
            return wanted;
        };
        let frame = |bone: Vec3, axis: Vec3| Mat3::from_cols(bone, axis, bone.cross(axis));
        let turned = |wanted: Quat, (own, about): (Vec3, Vec3), bone: Vec3| {
            let turn = frame(bone, axis) * frame(own, about).transpose();
            slerp(wanted, Quat::from_mat3(&turn).normalize(), share)
        };
        [
            turned(wanted[0], self.upper, bones[0]),
            turned(wanted[1], self.lower, bones[1]),
        ]
    }
}

/// The neutral pose of a robot on two legs: the lines of its limbs' bones hang. It is no pose that
/// its hinges can take.
pub(super) fn hang(robot: &Robot, parts: &Parts, pose: &[Quat], places: &[Vec3]) -> Vec<Quat> {
    let mut out = pose.to_vec();
    let legs = parts.legs.iter().map(|leg| (leg, false));
    let arms = parts.arms.iter().flatten().map(|arm| (arm, true));
    for (limb, is_arm) in legs.chain(arms) {
        let (upper, elbow) = (limb.upper[0], limb.lower[0]);
        let line = |from: usize, to: usize| (places[to] - places[from]).normalize_or_zero();
        let own = pose[upper].conjugate() * line(if is_arm { limb.top } else { upper }, elbow);
        let bones = [pose[upper] * along(robot, upper, own), line(elbow, limb.end)];
        let [first, second] = bones.map(|bone| Quat::from_rotation_arc(bone, Vec3::NEG_Y));
        out[upper] = first * pose[upper];
        for &joint in &limb.lower {
            out[joint] = second * pose[joint];
        }
        // Feet stay flat; hands go along.
        if is_arm {
            out[limb.end] = second * pose[limb.end];
        }
    }
    out
}
