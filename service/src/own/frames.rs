//! Frames on the pack's skeleton, for the user.

use std::sync::Arc;

use troupe_character::post::RateColumns;
use troupe_live::skeleton::{Dress, Worn};
use troupe_motion::fk::world_transforms;
use troupe_motion::model::SIX_D;
use troupe_motion::robot::{Fitted, HingeRates};
use troupe_motion::rotation::{align_sign, from_wxyz, six_d, to_wxyz};
use troupe_motion::{Quat, Vec3};
use troupe_proto::v1;

use super::pins::Pins;

/// Columns that a request asks for beside roots and rotations.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Columns {
    pub(super) positions: bool,
    pub(super) six_d: bool,
    /// MuJoCo's qpos. Of no use for skeletons without a robot.
    pub(super) qpos: bool,
}

/// Carries the frames of one character over, part by part.
#[derive(Debug)]
pub(super) struct Carrier {
    worn: Arc<Worn>,
    dress: Dress,
    columns: Columns,
    /// Frames so far.
    done: i64,
    /// The last frame's rotations. Empty before the first.
    last: Vec<Quat>,
    rates: HingeRates,
}

/// Frames on the user's skeleton: roots, and rotations of all joints.
#[derive(Debug, Default)]
pub(super) struct Carried {
    pub(super) roots: Vec<Vec3>,
    pub(super) rotations: Vec<Quat>,
}

impl Carried {
    /// Root and rotations of a frame.
    pub(super) fn at(&self, frame: usize) -> Option<(Vec3, &[Quat])> {
        let joints = self.rotations.len() / self.roots.len().max(1);
        let rotations = self.rotations.get(frame * joints..(frame + 1) * joints)?;
        Some((*self.roots.get(frame)?, rotations))
    }
}

impl Carrier {
    pub(super) fn new(worn: &Arc<Worn>, columns: Columns) -> Self {
        Self {
            dress: worn.dress(),
            worn: worn.clone(),
            columns,
            done: 0,
            last: Vec::new(),
            rates: HingeRates::default(),
        }
    }

    /// Carries a pose over that comes before the frames, and returns it.
    pub(super) fn before(&mut self, root: Vec3, rotations: &[Quat]) -> (Vec3, &[Quat]) {
        let root = self.dress.carry(root, rotations);
        (root, self.dress.pose())
    }

    /// Frames so far.
    pub(super) fn done(&self) -> i64 {
        self.done
    }

    /// The next frames, as they are carried over.
    pub(super) fn carry(&mut self, frames: &v1::Frames) -> Carried {
        let count = frames.frame_count as usize;
        let numbers = frames.rotations.len() / count.max(1);
        let mut carried = Carried::default();
        let roots = frames.root_positions.as_chunks::<3>().0;
        let poses = frames.rotations.chunks_exact(numbers.max(1));
        for (&root, pose) in roots.iter().zip(poses) {
            let pose: Vec<Quat> = pose
                .as_chunks::<4>()
                .0
                .iter()
                .map(|&wxyz| from_wxyz(wxyz))
                .collect();
            carried
                .roots
                .push(self.dress.carry(Vec3::from_array(root), &pose));
            carried.rotations.extend_from_slice(self.dress.pose());
        }
        carried
    }

    /// Replaces frames by those that were carried over, put right by `pins`. There are `fps` a
    /// second.
    pub(super) fn write(&mut self, carried: Carried, pins: &Pins, frames: &mut v1::Frames, fps: f32) {
        let Carried {
            mut roots,
            mut rotations,
        } = carried;
        let skeleton = self.worn.skeleton().clone();
        let joints = skeleton.joint_count();
        let (mut fitted, mut rates) = (Fitted::default(), RateColumns::default());
        frames.qpos.clear();
        frames.hinge_residuals.clear();
        frames.clamped_hinges.clear();
        for (root, pose) in roots.iter_mut().zip(rotations.chunks_exact_mut(joints)) {
            pins.settle(&self.worn, self.done, root, pose);
            self.done += 1;
            if let Some(robot) = &skeleton.robot {
                robot.fit(pose, &mut fitted);
                frames.hinge_residuals.push(fitted.residual_rad);
                frames.clamped_hinges.push(fitted.clamped as u32);
                rates.push(self.rates.push(robot, &fitted.angles, fps.recip()));
                if self.columns.qpos {
                    let start = frames.qpos.len();
                    frames.qpos.resize(start + robot.qpos_len(), 0.0);
                    robot.write_qpos(*root, pose[0], &fitted.angles, &mut frames.qpos[start..]);
                }
            }
            for (rotation, &before) in pose.iter_mut().zip(&self.last) {
                *rotation = align_sign(*rotation, before);
            }
            self.last.clear();
            self.last.extend_from_slice(pose);
        }
        frames.hinge_speed_ratios = rates.speed_ratios;
        frames.fastest_hinges = rates.fastest;
        frames.hinge_accelerations = rates.accelerations;
        frames.root_positions = roots.iter().flat_map(Vec3::to_array).collect();
        frames.rotations = rotations.iter().copied().flat_map(to_wxyz).collect();
        self.write_world(&roots, &rotations, frames);
    }

    fn write_world(&self, roots: &[Vec3], rotations: &[Quat], frames: &mut v1::Frames) {
        frames.positions.clear();
        frames.six_d.clear();
        let Columns {
            positions,
            six_d: turned,
            ..
        } = self.columns;
        if !(positions || turned) {
            return;
        }
        let skeleton = self.worn.skeleton();
        let joints = skeleton.joint_count();
        let mut world = (vec![Vec3::ZERO; joints], vec![Quat::IDENTITY; joints]);
        for (&root, pose) in roots.iter().zip(rotations.chunks_exact(joints)) {
            world_transforms(skeleton, root, pose, &mut world.0, &mut world.1);
            if positions {
                frames.positions.extend(world.0.iter().flat_map(Vec3::to_array));
            }
            if turned {
                frames.six_d.reserve(joints * SIX_D);
                frames
                    .six_d
                    .extend(world.1.iter().flat_map(|&rotation| six_d(rotation)));
            }
        }
    }
}

/// Brings the lengths of a judgement to the user's size. Its joints stay those of the pack.
pub(super) fn scaled(found: &mut v1::Feasibility, scale: f32) {
    let lengths = [
        &mut found.root_speed,
        &mut found.root_acceleration,
        &mut found.joint_speed,
        &mut found.joint_acceleration,
        &mut found.below_ground,
        &mut found.off_ground,
        &mut found.root_reach,
        &mut found.pose_reach,
    ];
    for figure in lengths.into_iter().flatten() {
        figure.value *= scale;
        figure.limit *= scale;
    }
}
