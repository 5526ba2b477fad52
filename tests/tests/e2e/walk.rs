//! A walk made of sines, so that tests need no captured motion.

use std::f32::consts::TAU;
use std::sync::Arc;

use troupe_motion::clip::Clip;
use troupe_motion::fk::{local_from_world_rotations, world_transforms};
use troupe_motion::skeleton::Skeleton;
use troupe_motion::{Quat, Vec3};

/// Length, speed and direction of a walk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Walk {
    /// Frames of the clip.
    pub frames: usize,
    /// Frames per second.
    pub fps: f32,
    /// Speed over ground, metres per second.
    pub speed_mps: f32,
    /// Heading at the start, radians.
    pub heading: f32,
    /// Change of heading, radians per second.
    pub turn_rps: f32,
    /// Start on the ground: x and z, metres.
    pub start_m: [f32; 2],
}

impl Default for Walk {
    /// Three seconds at 30 frames per second, straight ahead at 1.2 m/s from the origin.
    fn default() -> Self {
        Self {
            frames: 90,
            fps: 30.0,
            speed_mps: 1.2,
            heading: 0.0,
            turn_rps: 0.0,
            start_m: [0.0, 0.0],
        }
    }
}

/// A stride is two steps.
const STRIDES_PER_SECOND: f32 = 1.0;

impl Walk {
    /// The walk on a skeleton. Joints with the usual names (`UpperLeg_L`, `LowerArm_R`, ...) swing,
    /// others hold still. The lower foot is always on the ground.
    ///
    /// # Panics
    /// If the skeleton is invalid.
    pub fn on(&self, skeleton: &Arc<Skeleton>) -> Clip {
        let rest = rest_rotations(skeleton);
        let joints = skeleton.joint_count();
        let mut rotations = vec![Quat::IDENTITY; self.frames * joints];
        let mut roots = Vec::with_capacity(self.frames);
        let (mut world, mut places) = (rest.clone(), vec![Vec3::ZERO; joints]);
        let mut ground = Vec3::new(self.start_m[0], 0.0, self.start_m[1]);
        for (frame, pose) in rotations.chunks_exact_mut(joints).enumerate() {
            let time = frame as f32 / self.fps;
            let heading = Quat::from_rotation_y(self.heading + self.turn_rps * time);
            let phase = TAU * STRIDES_PER_SECOND * time;
            for ((joint, rest), world) in skeleton.joints.iter().zip(&rest).zip(&mut world) {
                *world = heading * Quat::from_rotation_x(swing(&joint.name, phase)) * *rest;
            }
            local_from_world_rotations(skeleton, &world, pose);
            let mut scratch = world.clone();
            world_transforms(skeleton, Vec3::ZERO, pose, &mut places, &mut scratch);
            roots.push(ground + Vec3::Y * (skeleton.ground_y_m + height_over_ground(skeleton, &places)));
            ground += heading * Vec3::Z * (self.speed_mps / self.fps);
        }
        Clip::new(skeleton.clone(), self.fps, roots, rotations).expect("a walk is a valid clip")
    }
}

/// Rotation of a joint about +X at a phase of the stride, radians.
fn swing(joint: &str, phase: f32) -> f32 {
    let right = joint.ends_with("_R") || joint.contains("Right");
    let phase = if right { phase + TAU / 2.0 } else { phase };
    let thigh = 0.45 * phase.sin();
    if joint.contains("UpperLeg") {
        thigh
    } else if joint.contains("LowerLeg") {
        thigh + 0.35 * (1.0 + (phase + 1.2).sin())
    } else if joint.contains("Foot") || joint.contains("Toes") {
        0.2 * phase.sin()
    } else if joint.contains("UpperArm") {
        -0.3 * phase.sin()
    } else if joint.contains("LowerArm") || joint.contains("Hand") {
        -0.3 * phase.sin() - 0.3
    } else {
        0.02 * phase.sin()
    }
}

/// Height of the root over the ground at which the lowest contact joint rests on it.
fn height_over_ground(skeleton: &Skeleton, places: &[Vec3]) -> f32 {
    let Some(contacts) = &skeleton.contacts else {
        return 1.0;
    };
    let heights = contacts
        .joints
        .iter()
        .zip(&contacts.clearance_m)
        .map(|(&j, clearance)| clearance - places[j].y);
    heights.fold(0.0, f32::max)
}

/// World rotations of a pose that stands upright and faces +Z.
fn rest_rotations(skeleton: &Skeleton) -> Vec<Quat> {
    let mut world = Vec::<Quat>::with_capacity(skeleton.joint_count());
    for (index, joint) in skeleton.joints.iter().enumerate() {
        let parent = joint.parent.map(|p| world[p]);
        let child = skeleton.joints.iter().find(|j| j.parent == Some(index));
        let rotation = match (parent, child) {
            (None, child) => upright(skeleton.left_axis, child.map_or(Vec3::Y, |c| c.offset_m)),
            (Some(parent), Some(child)) if child.offset_m.length() > 1e-4 => {
                let now = (parent * child.offset_m).normalize();
                Quat::from_rotation_arc(now, direction(&joint.name)) * parent
            }
            (Some(parent), _) => parent,
        };
        world.push(rotation);
    }
    world
}

/// The rotation that turns `left` to +X and then brings `up` as near to +Y as it can.
fn upright(left: Vec3, up: Vec3) -> Quat {
    let sideways = Quat::from_rotation_arc(left.normalize(), Vec3::X);
    let up = sideways * up;
    Quat::from_rotation_x(up.z.atan2(up.y)).inverse() * sideways
}

/// Direction of the bone from a joint to its child while standing. +Z is ahead.
fn direction(joint: &str) -> Vec3 {
    let right = joint.ends_with("_R") || joint.contains("Right");
    if joint.contains("Shoulder") {
        if right { Vec3::NEG_X } else { Vec3::X }
    } else if joint.contains("Leg") || joint.contains("Arm") {
        Vec3::NEG_Y
    } else if joint.contains("Foot") {
        Vec3::new(0.0, -0.55, 0.8).normalize()
    } else {
        Vec3::Y
    }
}

#[cfg(test)]
mod tests {
    use troupe_motion::skeleton::{ContactParams, Joint};

    use super::*;

    /// A pelvis with a spine and two legs. Bones lie along ±X, as in captured skeletons.
    fn legs() -> Arc<Skeleton> {
        let joint = |name: &str, parent, offset_m| Joint {
            name: name.to_owned(),
            parent,
            offset_m,
        };
        let joints = vec![
            joint("Hips", None, Vec3::ZERO),
            joint("Spine", Some(0), Vec3::X * 0.2),
            joint("Head", Some(1), Vec3::X * 0.3),
            joint("UpperLeg_L", Some(0), Vec3::Y * -0.1),
            joint("LowerLeg_L", Some(3), Vec3::X * 0.4),
            joint("Foot_L", Some(4), Vec3::X * 0.4),
            joint("UpperLeg_R", Some(0), Vec3::Y * 0.1),
            joint("LowerLeg_R", Some(6), Vec3::X * -0.4),
            joint("Foot_R", Some(7), Vec3::X * -0.4),
        ];
        let contacts = ContactParams {
            joints: vec![5, 8],
            max_height_m: vec![0.15; 2],
            max_speed_mps: 0.4,
            clearance_m: vec![0.1; 2],
        };
        Arc::new(Skeleton::new(joints, Vec3::NEG_Y, 0.0, Some(contacts)).unwrap())
    }

    #[test]
    fn a_walk_goes_ahead_on_its_feet() {
        let walk = Walk {
            heading: 0.7,
            ..Walk::default()
        };
        let clip = walk.on(&legs());
        let motion = troupe_motion::fk::WorldMotion::from_clip(&clip);
        let way = clip.root_positions[89] - clip.root_positions[0];
        assert!((way.x.atan2(way.z) - 0.7).abs() < 1e-3, "{way}");
        assert!((Vec3::new(way.x, 0.0, way.z).length() - 1.2 * 89.0 / 30.0).abs() < 1e-2);
        for frame in 0..90 {
            assert!((clip.root_at(frame).heading - 0.7).abs() < 1e-2);
            let places = motion.positions_at(frame);
            assert!(
                (places[5].y.min(places[8].y) - 0.1).abs() < 1e-3,
                "the lower foot rests"
            );
            assert!(places[2].y > places[0].y + 0.45, "the head is on top");
        }
        // The legs swing.
        let reach = |frame: usize| motion.positions_at(frame)[5].distance(motion.positions_at(frame)[8]);
        assert!((0..90).map(reach).fold(0.0, f32::max) > 0.4);
    }
}
