//! Small rigs for tests.

use troupe_motion::model::{Dims, Rig};
use troupe_motion::{ContactParams, Joint, Skeleton, Vec3};

/// Sizes of a test rig: segments of 12 to 64 frames, as in the packs that ship.
pub fn dims(skeleton: &Skeleton) -> Dims {
    Dims {
        joints: skeleton.joint_count(),
        contacts: skeleton
            .contacts
            .as_ref()
            .map_or(0, |contacts| contacts.joints.len()),
        heads: 2,
        codes: 5,
        min_tokens: 3,
        max_tokens: 16,
        frames_per_token: 4,
        context_frames: 4,
        max_targets: 4,
        root_choices: 0,
    }
}

/// A rig of this skeleton.
pub fn rig_of(name: &str, skeleton: Skeleton) -> Rig {
    Rig::new(name, 30.0, dims(&skeleton), skeleton)
}

/// Two joints: a pelvis whose left is +X, and a foot below it.
pub fn toy_rig() -> Rig {
    let joint = |name: &str, parent, y| Joint {
        name: name.into(),
        parent,
        offset_m: Vec3::new(0.0, y, 0.0),
    };
    let contacts = ContactParams {
        joints: vec![1],
        max_height_m: vec![0.1],
        max_speed_mps: 0.3,
        clearance_m: vec![0.05],
    };
    let joints = vec![joint("Hips", None, 0.0), joint("Foot", Some(0), -0.8)];
    let skeleton = Skeleton::new(joints, Vec3::X, 0.0, Some(contacts)).unwrap();
    rig_of("toy", skeleton)
}
