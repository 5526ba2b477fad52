//! Small motions shared by tests.

use std::sync::Arc;

use glam::{Quat, Vec3};

use crate::clip::Clip;
use crate::skeleton::{ContactParams, Joint, Skeleton};

fn joint(name: &str, parent: Option<usize>, offset: [f32; 3]) -> Joint {
    Joint {
        name: name.to_owned(),
        parent,
        offset_m: Vec3::from(offset),
    }
}

/// A pelvis with a spine and two straight legs of 0.9 m, with feet and toes: ankles 7 cm and toes 2
/// cm over the ground.
pub(crate) fn biped() -> Arc<Skeleton> {
    let joints = vec![
        joint("Hips", None, [0.0, 0.0, 0.0]),
        joint("Spine", Some(0), [0.0, 0.4, 0.0]),
        joint("Leg_L", Some(0), [0.1, 0.0, 0.0]),
        joint("Foot_L", Some(2), [0.0, -0.9, 0.0]),
        joint("Toes_L", Some(3), [0.0, -0.05, 0.12]),
        joint("Leg_R", Some(0), [-0.1, 0.0, 0.0]),
        joint("Foot_R", Some(5), [0.0, -0.9, 0.0]),
        joint("Toes_R", Some(6), [0.0, -0.05, 0.12]),
    ];
    let contacts = ContactParams {
        joints: vec![3, 4, 6, 7],
        max_height_m: vec![0.12, 0.06, 0.12, 0.06],
        max_speed_mps: 0.4,
        clearance_m: vec![0.07, 0.02, 0.07, 0.02],
    };
    Arc::new(Skeleton::new(joints, Vec3::X, 0.0, Some(contacts)).unwrap())
}

/// The biped standing in its rest pose, feet at their clearance.
pub(crate) fn stand(frames: usize) -> Clip {
    let skeleton = biped();
    let rotations = vec![Quat::IDENTITY; frames * skeleton.joint_count()];
    Clip::new(skeleton, 30.0, vec![Vec3::new(0.0, 0.97, 0.0); frames], rotations).unwrap()
}

/// The biped on a curve, bobbing and swinging its legs.
pub(crate) fn walk(frames: usize) -> Clip {
    let mut clip = stand(frames);
    for f in 0..frames {
        let t = f as f32 / 30.0;
        clip.root_positions[f] = Vec3::new(0.3 * t.sin(), 0.97 + 0.02 * (12.0 * t).sin(), 1.2 * t);
        let pose = clip.rotations_at_mut(f);
        pose[0] = Quat::from_rotation_y(0.8 * t) * Quat::from_rotation_x(0.05);
        pose[1] = Quat::from_rotation_z(0.1 * (6.0 * t).sin());
        pose[2] = Quat::from_rotation_x(0.5 * (6.0 * t).sin());
        pose[5] = Quat::from_rotation_x(-0.5 * (6.0 * t).sin());
    }
    clip
}

/// One frame of three joints: 90° about Z at the root, 90° about X at the middle.
pub(crate) fn arm() -> Clip {
    let joints = vec![
        joint("a", None, [9.0, 9.0, 9.0]),
        joint("b", Some(0), [1.0, 0.0, 0.0]),
        joint("c", Some(1), [0.0, 2.0, 0.0]),
    ];
    let skeleton = Arc::new(Skeleton::new(joints, Vec3::X, 0.0, None).unwrap());
    let quarter = std::f32::consts::FRAC_PI_2;
    let rotations = vec![
        Quat::from_rotation_z(quarter),
        Quat::from_rotation_x(quarter),
        Quat::IDENTITY,
    ];
    Clip::new(skeleton, 30.0, vec![Vec3::new(0.0, 1.0, 0.0)], rotations).unwrap()
}
