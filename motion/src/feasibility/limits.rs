//! Checked limits, by joint.

use glam::{Quat, Vec3};

use super::Figure;
use super::doc::{BendDoc, LimitsDoc, LimitsError, check_lists, check_numbers};
use crate::rotation::from_wxyz;
use crate::skeleton::Skeleton;

/// The extremes of the motion that a pack was trained on.
#[derive(Debug, Clone, PartialEq)]
pub struct Limits {
    doc: LimitsDoc,
    /// One a joint; the root has none.
    bends: Box<[Option<Bend>]>,
}

/// How a joint bends in the data: a box around its usual rotation relative to its parent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bend {
    /// The inverse of the usual rotation.
    usual_inverse: Quat,
    /// The box of the vector part of `usual⁻¹ · rotation`, of the sign whose real part is not
    /// negative.
    low: Vec3,
    high: Vec3,
}

/// How far a character gets in a number of frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reach {
    /// Distance of the root over the ground from where its velocity leads, metres.
    pub root_m: f32,
    /// Turn of the pelvis about any axis, radians.
    pub turn_rad: f32,
    /// Mean distance that the joints move, metres.
    pub pose_m: f32,
}

impl Limits {
    /// Checks a table, and finds its joints in the skeleton.
    ///
    /// # Errors
    /// [`LimitsError`] for the first value out of its range.
    pub fn new(doc: &LimitsDoc, skeleton: &Skeleton) -> Result<Self, LimitsError> {
        check_numbers(doc)?;
        check_lists(doc)?;
        let mut bends = vec![None; skeleton.joint_count()].into_boxed_slice();
        for (index, bend) in doc.bends.iter().enumerate() {
            let joint = skeleton.joints.iter().position(|joint| joint.name == bend.joint);
            match joint {
                Some(joint) if joint > 0 && bends[joint].is_none() => bends[joint] = Some(Bend::new(bend)),
                _ => {
                    let field = format!("limits.bends[{index}].joint");
                    let allowed = "each joint of the skeleton that has a parent, once";
                    return Err(LimitsError::new(field, format!("{:?}", bend.joint), allowed));
                }
            }
        }
        Ok(Self {
            doc: doc.clone(),
            bends,
        })
    }

    /// The limit of a figure. For a reach it is the largest; [`Limits::reach`] has them by frames.
    /// Infinite for the figures of hinges, each of which has its own.
    pub fn of(&self, figure: Figure) -> f32 {
        let doc = &self.doc;
        let farthest = |list: &[f32]| list.last().copied().unwrap_or_default();
        match figure {
            Figure::RootSpeed => doc.root_speed_mps,
            Figure::RootAcceleration => doc.root_acceleration_mps2,
            Figure::Turning => doc.turning_rad_per_s,
            Figure::JointSpeed => doc.joint_speed_mps,
            Figure::JointAcceleration => doc.joint_acceleration_mps2,
            Figure::BelowGround => doc.below_ground_m,
            Figure::OffGround => doc.off_ground_m,
            Figure::Tilt => doc.tilt_rad,
            Figure::Bend => doc.bend_rad,
            Figure::RootReach => farthest(&doc.root_reach_m),
            Figure::TurnReach => farthest(&doc.turn_reach_rad),
            Figure::PoseReach => farthest(&doc.pose_reach_m),
            Figure::HingeSpeed | Figure::HingeAcceleration => f32::INFINITY,
        }
    }

    /// How far a character gets in `frames` frames, from the last context frame to a target.
    pub fn reach(&self, frames: usize) -> Reach {
        let times = &self.doc.reach_frames;
        let after = times.partition_point(|&time| (time as usize) < frames);
        let of = |list: &[f32]| match (after.checked_sub(1), list.get(after)) {
            (None, _) => list.first().copied().unwrap_or_default(),
            (Some(before), None) => list[before],
            (Some(before), Some(&next)) => {
                let (from, to) = (times[before] as f32, times[after] as f32);
                list[before] + (next - list[before]) * (frames as f32 - from) / (to - from)
            }
        };
        Reach {
            root_m: of(&self.doc.root_reach_m),
            turn_rad: of(&self.doc.turn_reach_rad),
            pose_m: of(&self.doc.pose_reach_m),
        }
    }

    /// The world's usual up direction in the pelvis' frame of reference.
    pub(super) fn upright(&self) -> Vec3 {
        self.doc.upright
    }

    /// The range of a joint; none for the root.
    pub(super) fn bend(&self, joint: usize) -> Option<&Bend> {
        self.bends[joint].as_ref()
    }
}

impl Bend {
    fn new(doc: &BendDoc) -> Self {
        Self {
            usual_inverse: from_wxyz(doc.usual).normalize().inverse(),
            low: doc.low,
            high: doc.high,
        }
    }

    /// How far a rotation relative to the parent exceeds the box, radians: the worst axis.
    #[inline]
    pub(super) fn beyond_rad(&self, rotation: Quat) -> f32 {
        let turned = self.usual_inverse * rotation;
        let part = turned.xyz() * if turned.w < 0.0 { -1.0 } else { 1.0 };
        let nearest = part.clamp(self.low, self.high);
        if part == nearest {
            return 0.0;
        }
        let half = |part: Vec3| part.to_array().map(|v| v.clamp(-1.0, 1.0).asin());
        let pairs = half(part).into_iter().zip(half(nearest));
        pairs.fold(0.0, |worst, (found, near)| worst.max(2.0 * (found - near).abs()))
    }
}
