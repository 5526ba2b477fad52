//! Motion between two poses with the feet held: sitting down, standing up, picking something up.
//!
//! It is constructed, without networks: hips on the path of least jerk, joints turned the short
//! way, legs by inverse kinematics. If the feet of the two poses are apart, they step across one
//! after the other.

use std::f32::consts::PI;

use glam::{Quat, Vec3};

use crate::fk::joint_transform;
use crate::ik::{Leg, Motion, Posed, Trunk, cover, excess_height, forward, legs, place_end};
use crate::interpolate::{min_jerk, smoothstep};
use crate::rotation::{angle_between, slerp, slerp_pose};
use crate::skeleton::Skeleton;

/// Feet that differ by less than this slide instead of stepping: metres and radians.
const SAME_PLACE_M: f32 = 0.002;
const SAME_TURN: f32 = 0.02;
/// Height of a step as a share of its length, and its limit, metres.
const LIFT_SHARE: f32 = 0.25;
const MAX_LIFT_M: f32 = 0.08;
/// Start and end of the part of the motion in which feet step, as shares.
const STEPS_FROM: f32 = 0.1;
const STEPS_TO: f32 = 0.9;
/// The root is lowered for a leg that would be longer than this share of its length, at most by the
/// second value, metres.
const LONGEST: f32 = 0.999;
const MAX_DROP_M: f32 = 0.15;
/// Half of the window over which the root's lowering is smoothed, and its distance from both ends
/// at which it is complete, frames.
const DROP_HALF_WINDOW: usize = 3;
const EDGE_FRAMES: usize = 6;

/// No clip that the default pack was trained on has hips lower than this over the ground, metres.
pub const LOW_HIPS_M: f32 = 0.70;
/// The same as a share of the legs' length, for robots: that pack's legs are 0.80 m long.
const LOW_HIPS_SHARE: f32 = LOW_HIPS_M / 0.80;

/// Hips lower than this over the ground belong to a seated or crouching character, which the
/// networks hardly know, metres. It is [`LOW_HIPS_M`] for people, and depends on the legs for
/// robots.
pub fn low_hips_m(skeleton: &Skeleton) -> f32 {
    let legs = match skeleton.robot {
        Some(_) => legs(skeleton),
        None => Vec::new(),
    };
    let shortest = legs.iter().map(|leg| leg.length_m(skeleton));
    (shortest.min_by(f32::total_cmp)).map_or(LOW_HIPS_M, |length| length * LOW_HIPS_SHARE)
}

/// Moves from one pose to another with the feet on the ground.
///
/// Returns `count` frames (at least one), those after `from`. The last is exactly `to`, up to the
/// signs of its quaternions. The root moves straight on the path of least jerk. Feet with the same
/// place in both poses stay there. Others step, the one in front first, and are in contact except
/// during their step. If a leg would be too short, the root is lowered. `lean` bows the trunk
/// forward on the way, by this many radians halfway, with hanging arms.
///
/// If a pose is not finite, all frames are `to`; if one lacks rotations, there are no frames.
/// [`Motion::short_m`] says how far a leg was too short for its foot's place, which can happen with
/// long steps.
pub fn stance_transition(
    skeleton: &Skeleton,
    legs: &[Leg],
    from: Posed<'_>,
    to: Posed<'_>,
    count: usize,
    lean: f32,
) -> Motion {
    if !from.fits(skeleton) || !to.fits(skeleton) {
        return Motion::default();
    }
    let joints = skeleton.joint_count();
    let (count, finite) = (count.max(1), from.is_finite() && to.is_finite());
    let [first, last] = [from, to].map(|posed| &posed.rotations[..joints]);
    let lean = if lean.is_finite() { lean } else { 0.0 };
    let (trunk, steps) = (Trunk::of(skeleton), steps(skeleton, legs, from, to));
    let all = legs.iter().fold(0, |bits, leg| bits | leg.contact_bits());

    let mut motion = Motion::with_capacity(count, joints);
    let mut pose = vec![Quat::IDENTITY; joints];
    let mut needs = Vec::with_capacity(count);
    for frame in 1..count {
        if !finite {
            motion.push(to.root, last, all, first);
            continue;
        }
        let t = frame as f32 / count as f32;
        let way = min_jerk(t);
        let root = from.root.lerp(to.root, way);
        slerp_pose(first, last, way, &mut pose);
        trunk.bow(skeleton, &mut pose, lean * (PI * t).sin().powi(2));
        let (mut contacts, mut need) = (all, 0.0_f32);
        for (leg, step) in legs.iter().zip(&steps) {
            let (hip, foot) = (joint_transform(skeleton, root, &pose, leg.upper).0, step.at(t));
            need = need.max(excess_height(hip, foot.place, leg.length_m(skeleton) * LONGEST));
            if foot.in_the_air {
                contacts &= !leg.contact_bits();
            }
        }
        needs.push(need);
        motion.push(root, &pose, contacts, first);
    }
    motion.push(to.root, last, all, first);
    if finite {
        hold_feet(skeleton, legs, &steps, &needs, &mut motion);
    }
    motion
}

/// Lowers the root smoothly by what the legs need, and brings the feet to their places, in all
/// frames but the last.
fn hold_feet(skeleton: &Skeleton, legs: &[Leg], steps: &[Step], needs: &[f32], motion: &mut Motion) {
    let count = motion.frames();
    for (frame, drop) in (1..count).zip(cover(needs, DROP_HALF_WINDOW)) {
        let t = frame as f32 / count as f32;
        let edge = frame.min(count - frame) as f32 / EDGE_FRAMES as f32;
        let root = &mut motion.roots[frame - 1];
        root.y -= drop.min(MAX_DROP_M) * smoothstep(edge.min(1.0));
        let pose = &mut motion.rotations[(frame - 1) * skeleton.joint_count()..];
        let pole = forward(skeleton, pose);
        for (leg, step) in legs.iter().zip(steps) {
            let foot = step.at(t);
            let (goal, turn) = ((foot.place, 0.0), foot.rotation);
            let short = place_end(skeleton, *root, pose, leg.chain(), goal, pole, turn);
            motion.short_m = motion.short_m.max(short);
        }
    }
}

/// How a foot moves from its place in one pose to its place in the other.
struct Step {
    from: (Vec3, Quat),
    to: (Vec3, Quat),
    /// When it steps, as shares of the motion. `None`: it stands, and slides over a tiny
    /// difference.
    time: Option<(f32, f32)>,
}

struct Foot {
    place: Vec3,
    rotation: Quat,
    in_the_air: bool,
}

impl Step {
    fn at(&self, t: f32) -> Foot {
        let (start, end) = self.time.unwrap_or((0.0, 1.0));
        let phase = ((t - start) / (end - start)).clamp(0.0, 1.0);
        let way = min_jerk(phase);
        let mut place = self.from.0.lerp(self.to.0, way);
        let in_the_air = self.time.is_some() && phase > 0.0 && phase < 1.0;
        if in_the_air {
            let height = (self.from.0.distance(self.to.0) * LIFT_SHARE).min(MAX_LIFT_M);
            place.y += height * (PI * way).sin();
        }
        Foot {
            place,
            rotation: slerp(self.from.1, self.to.1, way),
            in_the_air,
        }
    }

    fn moves(&self) -> bool {
        let turn = angle_between(self.from.1, self.to.1);
        self.from.0.distance(self.to.0) > SAME_PLACE_M || turn > SAME_TURN
    }
}

/// The steps of all feet, one after the other: first the foot that is farthest ahead in the
/// direction of the root.
fn steps(skeleton: &Skeleton, legs: &[Leg], from: Posed<'_>, to: Posed<'_>) -> Vec<Step> {
    let foot = |posed: Posed<'_>, leg: &Leg| joint_transform(skeleton, posed.root, posed.rotations, leg.foot);
    let mut steps: Vec<Step> = legs
        .iter()
        .map(|leg| Step {
            from: foot(from, leg),
            to: foot(to, leg),
            time: None,
        })
        .collect();
    let way = to.root - from.root;
    let ahead = |step: &Step| step.from.0.x * way.x + step.from.0.z * way.z;
    let mut order: Vec<usize> = (0..steps.len()).filter(|&nth| steps[nth].moves()).collect();
    order.sort_by(|&a, &b| ahead(&steps[b]).total_cmp(&ahead(&steps[a])));
    let each = (STEPS_TO - STEPS_FROM) / order.len().max(1) as f32;
    for (turn, &nth) in order.iter().enumerate() {
        let start = STEPS_FROM + each * turn as f32;
        steps[nth].time = Some((start, start + each));
    }
    steps
}

#[cfg(test)]
mod tests;
