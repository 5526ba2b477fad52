//! Brings a robot's frames onto its hinges.

use troupe_motion::ik::Leg;
use troupe_motion::model::Rig;
use troupe_motion::robot::{Fitted, HingeRate, HingeRates};
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
    /// How fast the hinges turned on the way to each frame.
    pub rates: RateColumns,
}

/// [`HingeRate`]s by column, an entry for each frame.
#[derive(Debug, Default, PartialEq)]
pub struct RateColumns {
    /// [`HingeRate::speed_ratio`].
    pub speed_ratios: Vec<f32>,
    /// [`HingeRate::fastest`].
    pub fastest: Vec<u32>,
    /// [`HingeRate::acceleration_rad_per_s2`].
    pub accelerations: Vec<f32>,
}

impl RateColumns {
    /// Adds the next frame.
    pub fn push(&mut self, rate: HingeRate) {
        self.speed_ratios.push(rate.speed_ratio);
        self.fastest.push(rate.fastest as u32);
        self.accelerations.push(rate.acceleration_rad_per_s2);
    }

    /// A sentence on the hinge that is farthest beyond its highest speed, and on the number of such
    /// frames. None if there is none. `named` gives the name of a hinge's joint.
    pub fn too_fast<'a>(&self, fps: f32, named: impl Fn(usize) -> &'a String) -> Option<String> {
        let beyond = self.speed_ratios.iter().filter(|ratio| **ratio > 1.0).count();
        let frames = self.speed_ratios.iter().zip(&self.fastest).enumerate();
        let (frame, (ratio, hinge)) = frames.max_by(|a, b| a.1.0.total_cmp(b.1.0))?;
        (beyond > 0).then(|| {
            format!(
                "{} would have to turn at {ratio:.2} times its highest speed after {:.2} s; {beyond} of {} frames are too \
                 fast for a hinge",
                named(*hinge as usize),
                frame as f32 / fps,
                self.speed_ratios.len()
            )
        })
    }
}

/// Brings frames onto the robot's hinges and into their limits. There are `fps` a second, and
/// `rates` knows those that come before them.
pub fn onto_hinges(
    robot: &Robot,
    (roots, rotations): (&[Vec3], &mut [Quat]),
    (rates, fps): (&mut HingeRates, f32),
    wants_qpos: bool,
) -> HingeColumns {
    let (frames, size) = (roots.len(), robot.qpos_len());
    let joints = rotations.len() / frames.max(1);
    let mut columns = HingeColumns {
        qpos: vec![0.0; if wants_qpos { frames * size } else { 0 }],
        residuals: Vec::with_capacity(frames),
        clamped: Vec::with_capacity(frames),
        rates: RateColumns::default(),
    };
    let mut fitted = Fitted::default();
    for (frame, (&root, pose)) in roots.iter().zip(rotations.chunks_exact_mut(joints)).enumerate() {
        robot.fit(pose, &mut fitted);
        columns.residuals.push(fitted.residual_rad);
        columns.clamped.push(fitted.clamped as u32);
        let rate = rates.push(robot, &fitted.angles, fps.recip());
        columns.rates.push(rate);
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
