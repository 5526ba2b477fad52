//! How feet stand flat on the ground, and what of a foot is beyond the joint of its toes.

use std::f32::consts::TAU;

use glam::{Quat, Vec3};

use super::figure::Figure;
use crate::anatomy::{Limb, Parts, places};
use crate::clip::Clip;
use crate::fk::WorldMotion;
use crate::interpolate::smoothstep;
use crate::rotation::{align_sign, yaw};
use crate::skeleton::Skeleton;

/// Ankle and toe of a flat foot are within this of their lowest places, by the length of the shin.
const FLAT_SHARE: f32 = 0.04;
/// Share of the lowest heights that is left out: jumps and faults of the recording.
const LOWEST_SHARE: f32 = 0.02;
/// Length of toes whose joint is the last one, by the way over the ground from the ankle to it.
const TOES_SHARE: f32 = 0.4;
/// Farthest that toes are bent up, radians.
const MOST_BEND: f32 = 1.4;
/// Toes along the axis that they bend about are not bent, by how far they are off it.
const NO_TURN: f32 = 1e-3;
/// Toes that point backwards are bent less, and not at all once a bend lowers them by this share of
/// their length a radian: they lie on their backs.
const BACKWARDS: f32 = 0.5;

/// Turns the feet of a neutral pose as they stand flat in the clip. A foot that never does keeps
/// its rotations. Returns the mean height of the toes over the ground while they are flat, metres,
/// if one is.
pub(super) fn stand(clip: &Clip, parts: &Parts, neutral: &mut [Quat]) -> Option<f32> {
    let world = WorldMotion::from_clip(clip);
    let mut heights = Vec::new();
    for leg in &parts.legs {
        let frames = flat(clip, &world, leg);
        let toe = leg.toe.unwrap_or(leg.end);
        let height = |&frame: &usize| world.positions_at(frame)[toe].y - clip.skeleton.ground_y_m;
        if frames.is_empty() {
            continue;
        }
        heights.push(frames.iter().map(height).sum::<f32>() / frames.len() as f32);
        for joint in foot(&clip.skeleton, leg.end) {
            let mut sum = Quat::from_xyzw(0.0, 0.0, 0.0, 0.0);
            for &frame in &frames {
                let heading = clip.root_at(frame).heading;
                let rotation = yaw(-heading) * world.rotations_at(frame)[joint];
                sum = sum + align_sign(rotation, sum);
            }
            if sum.length() > 1e-3 {
                neutral[joint] = sum.normalize();
            }
        }
    }
    (!heights.is_empty()).then(|| heights.iter().sum::<f32>() / heights.len() as f32)
}

/// The frames of a clip in which a foot is flat.
fn flat(clip: &Clip, world: &WorldMotion, leg: &Limb) -> Vec<usize> {
    let toe = leg.toe.unwrap_or(leg.end);
    let lowest = |joint: usize| {
        let heights = (0..world.frames()).map(|frame| world.positions_at(frame)[joint].y);
        let mut sorted: Vec<f32> = heights.collect();
        sorted.sort_by(f32::total_cmp);
        let lowest = sorted.get((LOWEST_SHARE * sorted.len() as f32) as usize);
        lowest.copied().unwrap_or(f32::NEG_INFINITY)
    };
    let room = FLAT_SHARE * clip.skeleton.joints[leg.end].offset_m.length();
    let most = [leg.end, toe].map(|joint| (joint, lowest(joint) + room));
    let is_flat = |&frame: &usize| {
        let places = world.positions_at(frame);
        most.iter().all(|&(joint, most)| places[joint].y <= most)
    };
    (0..world.frames()).filter(is_flat).collect()
}

/// Pitches the feet of a neutral pose so that ankles and toes are as high over each other as the
/// skeleton's contacts say. The mean pose of a body's motion shows feet that are half in the air.
pub(super) fn level(skeleton: &Skeleton, parts: &Parts, neutral: &mut [Quat]) {
    let Some(contacts) = &skeleton.contacts else {
        return;
    };
    let height = |joint: usize| {
        let at = contacts.joints.iter().position(|&contact| contact == joint)?;
        Some(contacts.clearance_m[at])
    };
    for leg in &parts.legs {
        let heights = leg
            .toe
            .and_then(|toe| Some((toe, height(toe)? - height(leg.end)?)));
        let Some((toe, rise_m)) = heights else {
            continue;
        };
        let places = places(skeleton, neutral);
        let now = places[toe] - places[leg.end];
        let (sin, ahead) = (rise_m / now.length(), now.with_y(0.0).try_normalize());
        let Some(ahead) = ahead.filter(|_| sin.abs() < 1.0) else {
            continue;
        };
        let level = ahead * (1.0 - sin * sin).sqrt() + Vec3::Y * sin;
        let turn = Quat::from_rotation_arc(now.normalize(), level);
        for joint in foot(skeleton, leg.end) {
            neutral[joint] = (turn * neutral[joint]).normalize();
        }
    }
}

/// An ankle and all that hangs on it.
fn foot(skeleton: &Skeleton, ankle: usize) -> Vec<usize> {
    let mut below = vec![ankle];
    for joint in ankle + 1..skeleton.joint_count() {
        let parent = skeleton.joints[joint].parent;
        if parent.is_some_and(|parent| below.contains(&parent)) {
            below.push(joint);
        }
    }
    below
}

/// Points of a foot beyond its ankle and its toes' joint: each as a joint, and the way from there
/// in the joint's own frame of reference, metres.
pub(super) fn points(figure: &Figure, leg: &Limb) -> Vec<(usize, Vec3)> {
    let joints = foot(&figure.skeleton, leg.end).into_iter().skip(1);
    let others = joints.filter(|&joint| Some(joint) != leg.toe);
    let mut points: Vec<_> = others.map(|joint| (joint, Vec3::ZERO)).collect();
    points.extend(bare_tip(figure, leg));
    points
}

/// The tip of toes that no joint marks. Toes lie flat, at the height of their joint.
fn bare_tip(figure: &Figure, leg: &Limb) -> Option<(usize, Vec3)> {
    let toe = leg.toe?;
    let is_last = foot(&figure.skeleton, toe).len() == 1;
    let ahead = TOES_SHARE * figure.between(leg.end, toe).with_y(0.0);
    let is_free = figure.skeleton.robot.is_none() && !figure.parts.on_fours;
    (is_last && is_free).then(|| (toe, figure.neutral[toe].conjugate() * ahead))
}

/// Toes of the target, which bend up rather than go into the ground.
#[derive(Clone, Copy, Debug)]
pub(super) struct Toes {
    pub(super) joint: usize,
    /// From the ankle to their joint in the ankle's own frame of reference.
    foot: Vec3,
    /// From their joint to their tip in its own frame of reference.
    tip: Vec3,
    /// Heights of joint and tip over the ground in the neutral pose, metres.
    heights: [f32; 2],
    /// The axis about which they bend up, in the ankle's own frame of reference.
    axis: Vec3,
}

impl Toes {
    /// The toes of a leg on a body on two, whose toes' joint hangs on the ankle and is no hinge.
    pub(super) fn of(figure: &Figure, leg: &Limb) -> Option<Self> {
        let skeleton = &figure.skeleton;
        let is_free = skeleton.robot.is_none() && !figure.parts.on_fours;
        let hangs = |&toe: &usize| skeleton.joints[toe].parent == Some(leg.end);
        let joint = leg.toe.filter(|_| is_free).filter(hangs)?;
        // The farthest point is the tip.
        let below = foot(skeleton, joint).into_iter().skip(1);
        let far = |&tip: &usize| figure.between(leg.end, tip).with_y(0.0).length();
        let tip = below.max_by(|a, b| far(a).total_cmp(&far(b)));
        let own = |to: Vec3| figure.neutral[joint].conjugate() * to;
        let tip = tip.map(|tip| own(figure.between(joint, tip)));
        let tip = tip.or_else(|| Some(bare_tip(figure, leg)?.1))?;
        let ankle = figure.neutral[leg.end].conjugate();
        let height = figure.places[joint].y;
        Some(Self {
            joint,
            foot: ankle * figure.between(leg.end, joint),
            tip,
            heights: [height, height + (figure.neutral[joint] * tip).y],
            axis: ankle * Vec3::NEG_X,
        })
    }

    /// The rotation of the toes relative to the ankle, which is `local` without the ground. The
    /// ankle is at a height over the ground, with a rotation in the world. The tip goes into the
    /// ground no deeper than the joint does.
    pub(super) fn bent(&self, height: f32, ankle: Quat, local: Quat) -> Quat {
        let tip = ankle * (local * self.tip);
        let joint = height + (ankle * self.foot).y;
        let wanted = self.heights[1] - joint.max(self.heights[0]);
        if tip.y >= wanted {
            return local;
        }
        // Height of the tip over its joint by the angle: still + most * cos(angle - highest).
        let axis = ankle * self.axis;
        let still = axis.y * axis.dot(tip);
        let (now, rises) = (tip.y - still, axis.cross(tip).y);
        if now.hypot(rises) < NO_TURN * tip.length() {
            return local;
        }
        let highest = rises.atan2(now).rem_euclid(TAU);
        let most = now.hypot(rises);
        let angle = highest - ((wanted - still) / most).clamp(-1.0, 1.0).acos();
        let share = smoothstep((1.0 + rises / (BACKWARDS * most)).clamp(0.0, 1.0));
        Quat::from_axis_angle(self.axis, share * angle.clamp(0.0, MOST_BEND)) * local
    }
}
