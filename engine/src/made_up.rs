//! Parts of made-up tasks for bodies that move along paths.

use troupe_motion::features::{FEATURES_PER_JOINT, pose_features_from_world};
use troupe_motion::model::{Body, KeyTensors};
use troupe_motion::rotation::yaw;
use troupe_motion::{Quat, Vec3};

/// A path of constant speed (m/s) and turn rate (rad/s).
pub(crate) fn path(frames: usize, speed: f32, turn: f32, fps: f32) -> Box<[[f32; 3]]> {
    let mut point = [0.0_f32; 3];
    let points = (0..frames).map(|_| {
        let now = point;
        let (sin, cos) = now[2].sin_cos();
        point = [
            now[0] + speed * sin / fps,
            now[1] + speed * cos / fps,
            now[2] + turn / fps,
        ];
        now
    });
    points.collect()
}

/// A keyframe: the body in its neutral pose at a point of a path.
pub(crate) fn neutral_key(body: &Body, [x, z, heading]: [f32; 3]) -> KeyTensors {
    let root = Vec3::new(x, body.height_m, z);
    let turn = yaw(heading);
    let rotations: Vec<Quat> = body.neutral.iter().map(|&neutral| turn * neutral).collect();
    let mut positions: Vec<Vec3> = Vec::with_capacity(body.joints());
    for (joint, &bone) in body.rig.skeleton.joints.iter().zip(&body.bones_m) {
        positions.push(
            joint
                .parent
                .map_or(root, |parent| positions[parent] + turn * bone),
        );
    }
    let mut pose = vec![0.0; body.joints() * FEATURES_PER_JOINT];
    pose_features_from_world(root, &positions, &rotations, &mut pose);
    let (sin, cos) = heading.sin_cos();
    KeyTensors {
        local_root: None,
        global_root: Some([root.x, root.y, root.z, cos, sin]),
        pose: Some(pose.into()),
    }
}
