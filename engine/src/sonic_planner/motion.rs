//! From the graph's frames to motion.

use troupe_motion::contacts::detect;
use troupe_motion::fk::{WorldMotion, world_transforms};
use troupe_motion::model::{Body, Motion};
use troupe_motion::root::heading_of;
use troupe_motion::rotation::six_d;
use troupe_motion::{Quat, Robot, Vec3};

use super::QPOS;

/// The motion of frames of [`QPOS`] numbers. Feet that are low and slow are in contact.
pub(super) fn motion(body: &Body, robot: &Robot, qpos: &[f32], fps: f32) -> Motion {
    let skeleton = &body.rig.skeleton;
    let (joints, frames) = (body.joints(), qpos.len() / QPOS);
    let mut world = WorldMotion {
        joints,
        positions: vec![Vec3::ZERO; frames * joints],
        rotations: vec![Quat::IDENTITY; frames * joints],
    };
    let mut local = vec![Quat::IDENTITY; joints];
    let mut motion = Motion::default();
    let places = world.positions.chunks_exact_mut(joints);
    let turns = world.rotations.chunks_exact_mut(joints);
    for ((frame, positions), rotations) in qpos.chunks_exact(QPOS).zip(places).zip(turns) {
        let (root, rotation, angles) = robot.read_qpos(frame);
        robot.pose(rotation.normalize(), angles, &mut local);
        world_transforms(skeleton, root, &local, positions, rotations);
        let (sin, cos) = heading_of(rotations[0], skeleton.left_axis).sin_cos();
        motion.root.extend([root.x, root.y, root.z, cos, sin]);
        motion
            .rotations
            .extend(rotations.iter().flat_map(|&rotation| six_d(rotation)));
    }
    if let Some(params) = &skeleton.contacts {
        let found = detect(&world, params, skeleton.ground_y_m, fps);
        motion.contacts = found
            .into_iter()
            .map(|down| if down { 1.0 } else { 0.0 })
            .collect();
    }
    motion
}
