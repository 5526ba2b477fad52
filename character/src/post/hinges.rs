//! Brings a robot's frames onto its hinges.

use troupe_motion::robot::Fitted;
use troupe_motion::{Quat, Robot, Vec3};

/// What is told of a robot's frames.
#[derive(Debug, Default)]
pub struct HingeColumns {
    /// `frames * qpos_len`, where asked for.
    pub qpos: Vec<f32>,
    /// [`Fitted::residual_rad`] of each frame.
    pub residuals: Vec<f32>,
    /// [`Fitted::clamped`] of each frame.
    pub clamped: Vec<u32>,
}

/// Brings frames onto the robot's hinges and into their limits.
pub fn onto_hinges(robot: &Robot, roots: &[Vec3], rotations: &mut [Quat], wants_qpos: bool) -> HingeColumns {
    let (frames, size) = (roots.len(), robot.qpos_len());
    let joints = rotations.len() / frames.max(1);
    let mut columns = HingeColumns {
        qpos: vec![0.0; if wants_qpos { frames * size } else { 0 }],
        residuals: Vec::with_capacity(frames),
        clamped: Vec::with_capacity(frames),
    };
    let mut fitted = Fitted::default();
    for (frame, (&root, pose)) in roots.iter().zip(rotations.chunks_exact_mut(joints)).enumerate() {
        robot.fit(pose, &mut fitted);
        columns.residuals.push(fitted.residual_rad);
        columns.clamped.push(fitted.clamped as u32);
        if wants_qpos {
            let row = &mut columns.qpos[frame * size..(frame + 1) * size];
            robot.write_qpos(root, pose[0], &fitted.angles, row);
        }
    }
    columns
}
