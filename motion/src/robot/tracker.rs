//! Motion as trackers of robots read it: BeyondMimic's NumPy archive and SONIC's folder of CSV
//! files.
//!
//! Both have 50 frames a second, ROS axes, quaternions w x y z, and hinges and bodies in Isaac
//! Lab's breadth-first order ([`Robot::breadth_first`](super::Robot::breadth_first)). Bodies are
//! the root and one for each hinge: the link that it turns. Velocities are central differences,
//! one-sided at the ends.

use std::fmt::Write as _;

use glam::{DQuat, DVec3, Quat};

use super::{CsvError, Fitted};
use crate::clip::Clip;
use crate::conventions::Convention;
use crate::fk::world_transforms;
use crate::rotation::align_sign;

/// Frames a second of both layouts.
pub const TRACKER_FPS: f32 = 50.0;

/// Motion of a robot in a tracker's order, `frames` long. Lists are flat and frame-major.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reference {
    /// Number of frames.
    pub frames: usize,
    /// Names of the hinges' joints, in breadth-first order.
    pub joint_names: Vec<String>,
    /// Angles, radians, within their limits.
    pub joint_pos: Vec<f32>,
    /// rad/s.
    pub joint_vel: Vec<f32>,
    /// Names of the bodies' joints: the root, then as [`Reference::joint_names`].
    pub body_names: Vec<String>,
    /// x y z in the world, metres.
    pub body_pos: Vec<f32>,
    /// w x y z in the world.
    pub body_quat: Vec<f32>,
    /// m/s, of the bodies' own origins, in the world.
    pub body_lin_vel: Vec<f32>,
    /// rad/s, in the world.
    pub body_ang_vel: Vec<f32>,
}

/// A robot's clip as trackers read it, at 50 frames a second.
///
/// # Errors
/// [`CsvError::NoRobot`] if the skeleton has no hinges; [`CsvError::Clip`] if it becomes too long.
pub fn reference(clip: &Clip) -> Result<Reference, CsvError> {
    let skeleton = &*clip.skeleton;
    let robot = skeleton.robot.as_ref().ok_or(CsvError::NoRobot)?;
    let clip = clip.resample(TRACKER_FPS)?;
    let (frames, hinges) = (clip.frames(), robot.hinges().len());
    let order = robot.breadth_first();
    let joints: Vec<usize> = std::iter::once(0)
        .chain(order.iter().map(|&hinge| robot.hinges()[hinge].joint))
        .collect();
    let count = joints.len();
    let mut angles = Vec::with_capacity(frames * hinges);
    let mut places = Vec::with_capacity(frames * count);
    let mut turns: Vec<Quat> = Vec::with_capacity(frames * count);
    let mut pose = vec![Quat::IDENTITY; skeleton.joint_count()];
    let mut world = (vec![glam::Vec3::ZERO; pose.len()], pose.clone());
    let mut fitted = Fitted::default();
    for (frame, &root) in clip.root_positions.iter().enumerate() {
        pose.copy_from_slice(clip.rotations_at(frame));
        robot.fit(&mut pose, &mut fitted);
        world_transforms(skeleton, root, &pose, &mut world.0, &mut world.1);
        angles.extend(order.iter().map(|&hinge| fitted.angles[hinge]));
        for &joint in &joints {
            places.push(Convention::Ros.position_from_native(world.0[joint]));
            let turn = Convention::Ros.rotation_from_native(world.1[joint]);
            let before = turns.len().checked_sub(count).map(|before| turns[before]);
            turns.push(before.map_or(turn, |before| align_sign(turn, before)));
        }
    }
    let names = |joints: &[usize]| {
        joints
            .iter()
            .map(|&joint| skeleton.joints[joint].name.clone())
            .collect()
    };
    Ok(Reference {
        frames,
        joint_names: names(&joints[1..]),
        joint_vel: differences(&angles, hinges),
        joint_pos: angles,
        body_names: names(&joints),
        body_lin_vel: differences(
            places
                .iter()
                .flat_map(|p| p.to_array())
                .collect::<Vec<_>>()
                .as_slice(),
            3 * count,
        ),
        body_pos: places.iter().flat_map(|p| p.to_array()).collect(),
        body_ang_vel: turning(&turns, count),
        body_quat: turns.iter().flat_map(|q| crate::rotation::to_wxyz(*q)).collect(),
    })
}

/// Frames between which a velocity is taken: the neighbours, or at an end the frame itself and one
/// neighbour.
fn neighbours(frame: usize, frames: usize) -> (usize, usize) {
    (frame.saturating_sub(1), (frame + 1).min(frames.saturating_sub(1)))
}

/// Changes a second of `width` numbers a frame.
fn differences(numbers: &[f32], width: usize) -> Vec<f32> {
    let frames = numbers.len() / width.max(1);
    let mut out = Vec::with_capacity(numbers.len());
    for frame in 0..frames {
        let (before, after) = neighbours(frame, frames);
        let time_s = (after - before).max(1) as f32 / TRACKER_FPS;
        out.extend(
            (0..width).map(|nth| (numbers[after * width + nth] - numbers[before * width + nth]) / time_s),
        );
    }
    out
}

/// Angular velocities in the world, rad/s.
fn turning(turns: &[Quat], count: usize) -> Vec<f32> {
    let frames = turns.len() / count.max(1);
    let mut out = Vec::with_capacity(3 * turns.len());
    for frame in 0..frames {
        let (before, after) = neighbours(frame, frames);
        let time_s = (after - before).max(1) as f64 / f64::from(TRACKER_FPS);
        for body in 0..count {
            let from: DQuat = turns[before * count + body].as_dquat();
            let to = turns[after * count + body].as_dquat();
            let turn = to * from.conjugate();
            // The short way round.
            let turn = if turn.w < 0.0 { -turn } else { turn };
            let rate: DVec3 = turn.to_scaled_axis() / time_s;
            out.extend(rate.as_vec3().to_array());
        }
    }
    out
}

/// SONIC's files of a motion, by their names: CSV with headers, and `metadata.txt`. They belong
/// into a folder of the motion's name.
pub fn sonic_files(reference: &Reference, name: &str) -> Vec<(&'static str, String)> {
    let (joints, bodies) = (reference.joint_names.len(), reference.body_names.len());
    let joint = |prefix: &str| -> Vec<String> { (0..joints).map(|nth| format!("{prefix}_{nth}")).collect() };
    let body = |suffixes: &[&str]| -> Vec<String> {
        let columns =
            (0..bodies).flat_map(|nth| suffixes.iter().map(move |suffix| format!("body_{nth}_{suffix}")));
        columns.collect()
    };
    let indexes: Vec<String> = (0..bodies).map(|nth| nth.to_string()).collect();
    let metadata = format!(
        "Metadata for: {name}\n{}\n\nBody part indexes:\n[{}]\n\nTotal timesteps: {}\n",
        "=".repeat(30),
        indexes.join(" "),
        reference.frames
    );
    vec![
        ("joint_pos.csv", csv(&joint("joint"), &reference.joint_pos)),
        ("joint_vel.csv", csv(&joint("joint_vel"), &reference.joint_vel)),
        ("body_pos.csv", csv(&body(&["x", "y", "z"]), &reference.body_pos)),
        (
            "body_quat.csv",
            csv(&body(&["w", "x", "y", "z"]), &reference.body_quat),
        ),
        (
            "body_lin_vel.csv",
            csv(&body(&["vel_x", "vel_y", "vel_z"]), &reference.body_lin_vel),
        ),
        (
            "body_ang_vel.csv",
            csv(
                &body(&["angvel_x", "angvel_y", "angvel_z"]),
                &reference.body_ang_vel,
            ),
        ),
        ("metadata.txt", metadata),
    ]
}

fn csv(header: &[String], numbers: &[f32]) -> String {
    let mut text = header.join(",");
    text.push('\n');
    for row in numbers.chunks_exact(header.len().max(1)) {
        for (nth, number) in row.iter().enumerate() {
            let comma = if nth == 0 { "" } else { "," };
            // Writing to a string does not fail.
            let _ = write!(text, "{comma}{number:.6}");
        }
        text.push('\n');
    }
    text
}
