//! Brings a robot's frames onto its hinges.

use troupe_motion::ik::Leg;
use troupe_motion::model::Rig;
use troupe_motion::robot::Fitted;
use troupe_motion::rotation::align_sign;
use troupe_motion::{Quat, Robot, Skeleton, Vec3};

/// What is reported about a robot's frames.
#[derive(Debug, Default)]
pub struct HingeColumns {
    /// `frames * qpos_len`; empty unless asked for.
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

/// Lets `bend` bend legs in frames as they are shown: for a robot, on its hinges. Only the legs
/// that it bends keep the hinge poses. The other joints stay as they were, so that their error is
/// reported when the frames are shown.
pub(super) fn bend_as_shown(rig: &Rig, rotations: &mut [Quat], bend: impl FnOnce(&mut [Quat])) {
    let Some(robot) = &rig.skeleton.robot else {
        return bend(rotations);
    };
    let joints = rig.dims.joints;
    let mut shown = rotations.to_vec();
    let mut took = Fitted::default();
    for pose in shown.chunks_exact_mut(joints) {
        robot.fit(pose, &mut took);
    }
    let mut bent = shown.clone();
    bend(&mut bent);
    for leg in rig.legs.iter() {
        let limb = limb_of(&rig.skeleton, leg);
        let poses = rotations.chunks_exact_mut(joints);
        for (pose, (bent, shown)) in poses.zip(bent.chunks_exact(joints).zip(shown.chunks_exact(joints))) {
            if limb.iter().any(|&joint| bent[joint] != shown[joint]) {
                limb.iter()
                    .for_each(|&joint| pose[joint] = align_sign(bent[joint], pose[joint]));
            }
        }
    }
}

/// The joints of a leg, from the child of the root to the toes.
fn limb_of(skeleton: &Skeleton, leg: &Leg) -> Vec<usize> {
    let top = |joint: usize| {
        let upwards = std::iter::successors(Some(joint), |&joint| skeleton.joints[joint].parent);
        upwards.take_while(|&joint| joint != 0).last()
    };
    let of_leg = top(leg.upper);
    (1..skeleton.joint_count())
        .filter(|&joint| top(joint) == of_leg)
        .collect()
}
