//! A clip: frames of root positions and rotations on a skeleton.

use std::ops::Range;
use std::sync::Arc;

use glam::{Quat, Vec3};

use crate::root::GlobalRoot;
use crate::rotation::slerp_pose;
use crate::skeleton::Skeleton;

/// Longest clip that [`Clip::resample`] makes, frames.
pub const MAX_FRAMES: usize = 1 << 22;

/// Most rotations (frames times joints) of a clip made by resampling or from a file: 1 GiB of them.
pub const MAX_ROTATIONS: usize = 1 << 26;

/// Motion on a skeleton.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip {
    /// The skeleton, shared between clips.
    pub skeleton: Arc<Skeleton>,
    /// Frames a second.
    pub fps: f32,
    /// World position of joint 0 in each frame, metres.
    pub root_positions: Vec<Vec3>,
    /// `frames * joints` rotations: joint 0 in the world, others relative to their parents.
    pub rotations: Vec<Quat>,
}

/// Why a clip was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ClipError {
    /// The rate is not finite and positive.
    #[error("the frame rate must be finite and positive, not {0}")]
    Rate(f32),
    /// The clip has no frames.
    #[error("a clip needs at least one frame")]
    Empty,
    /// One frame does not make a loop.
    #[error("a loop needs at least two frames")]
    OneFrame,
    /// The rotations do not fit the frames and joints.
    #[error("{found} rotations for {frames} frames of {joints} joints")]
    RotationCount {
        /// Number of rotations.
        found: usize,
        /// Number of root positions.
        frames: usize,
        /// Number of joints.
        joints: usize,
    },
    /// A value is NaN or infinite, or a rotation not of unit length within 0.001.
    #[error("frame {frame} has a value that is not finite or a rotation that is not of unit length")]
    Value {
        /// First frame with such a value.
        frame: usize,
    },
    /// A range that is empty or reaches past the end.
    #[error("frames {start}..{end} are not in a clip of {frames} frames")]
    Range {
        /// First frame.
        start: usize,
        /// One past the last.
        end: usize,
        /// Frames of the clip.
        frames: usize,
    },
    /// Resampling would make more than [`MAX_FRAMES`] or [`MAX_ROTATIONS`].
    #[error("resampling to {0} fps would make too many frames")]
    TooLong(f32),
}

impl Clip {
    /// Checks and builds a clip: at least one frame, all values finite, rotations of unit length
    /// within 0.001 (they are then normalised).
    ///
    /// # Errors
    /// [`ClipError`] with the first frame that is wrong.
    pub fn new(
        skeleton: Arc<Skeleton>,
        fps: f32,
        root_positions: Vec<Vec3>,
        mut rotations: Vec<Quat>,
    ) -> Result<Self, ClipError> {
        if !(fps.is_finite() && fps > 0.0) {
            return Err(ClipError::Rate(fps));
        }
        let (frames, joints) = (root_positions.len(), skeleton.joint_count());
        if frames == 0 {
            return Err(ClipError::Empty);
        }
        if rotations.len() != frames * joints {
            return Err(ClipError::RotationCount {
                found: rotations.len(),
                frames,
                joints,
            });
        }
        for (frame, (root, pose)) in root_positions
            .iter()
            .zip(rotations.chunks_exact_mut(joints))
            .enumerate()
        {
            // Written so that NaN fails too.
            if !(root.is_finite() && pose.iter().all(|q| (q.length() - 1.0).abs() <= 1e-3)) {
                return Err(ClipError::Value { frame });
            }
            pose.iter_mut().for_each(|q| *q = q.normalize());
        }
        Ok(Self {
            skeleton,
            fps,
            root_positions,
            rotations,
        })
    }

    /// Number of frames.
    #[inline]
    pub fn frames(&self) -> usize {
        self.root_positions.len()
    }

    /// Time from the first frame to the last, seconds.
    pub fn duration_s(&self) -> f32 {
        self.frames().saturating_sub(1) as f32 / self.fps
    }

    /// The pose of one frame, one quaternion a joint.
    ///
    /// # Panics
    /// If `frame` is out of range.
    #[inline]
    pub fn rotations_at(&self, frame: usize) -> &[Quat] {
        let joints = self.skeleton.joint_count();
        &self.rotations[frame * joints..(frame + 1) * joints]
    }

    /// The pose of one frame, to be changed.
    ///
    /// # Panics
    /// If `frame` is out of range.
    #[inline]
    pub fn rotations_at_mut(&mut self, frame: usize) -> &mut [Quat] {
        let joints = self.skeleton.joint_count();
        &mut self.rotations[frame * joints..(frame + 1) * joints]
    }

    /// Global root of one frame; the heading is the pelvis' ([`crate::root::heading_of`]).
    ///
    /// # Panics
    /// If `frame` is out of range.
    pub fn root_at(&self, frame: usize) -> GlobalRoot {
        GlobalRoot::of_pose(
            self.root_positions[frame],
            self.rotations_at(frame)[0],
            self.skeleton.left_axis,
        )
    }

    /// Global roots of all frames.
    pub fn roots(&self) -> Vec<GlobalRoot> {
        (0..self.frames()).map(|f| self.root_at(f)).collect()
    }

    /// The frames of `range` as a separate clip.
    ///
    /// # Errors
    /// [`ClipError::Range`] if the range is empty, or reaches past the end.
    pub fn slice(&self, range: Range<usize>) -> Result<Self, ClipError> {
        let frames = self.frames();
        if range.is_empty() || range.end > frames {
            return Err(ClipError::Range {
                start: range.start,
                end: range.end,
                frames,
            });
        }
        let joints = self.skeleton.joint_count();
        Ok(Self {
            skeleton: Arc::clone(&self.skeleton),
            fps: self.fps,
            root_positions: self.root_positions[range.clone()].to_vec(),
            rotations: self.rotations[range.start * joints..range.end * joints].to_vec(),
        })
    }

    /// The clip at another rate: linear root, slerp rotations. The first frame stays; the last is
    /// the last one within the clip.
    ///
    /// # Errors
    /// [`ClipError::Rate`] or [`ClipError::TooLong`].
    pub fn resample(&self, fps: f32) -> Result<Self, ClipError> {
        if !(fps.is_finite() && fps > 0.0) {
            return Err(ClipError::Rate(fps));
        }
        if fps == self.fps || self.frames() == 0 {
            return Ok(Self { fps, ..self.clone() });
        }
        let step = f64::from(self.fps) / f64::from(fps);
        let last = self.frames() - 1;
        // A tolerance of a ten-thousandth of a frame, so that exact ratios keep their last frame
        // despite rounding.
        let count = ((last as f64 + 1e-4) / step).floor() + 1.0;
        let joints = self.skeleton.joint_count();
        if count > MAX_FRAMES.min(MAX_ROTATIONS / joints) as f64 {
            return Err(ClipError::TooLong(fps));
        }
        let count = count as usize;
        let mut root_positions = Vec::with_capacity(count);
        let mut rotations = vec![Quat::IDENTITY; count * joints];
        for (i, out) in rotations.chunks_exact_mut(joints).enumerate() {
            let at = i as f64 * step;
            let from = (at.floor() as usize).min(last);
            let to = (from + 1).min(last);
            let t = (at - from as f64) as f32;
            root_positions.push(self.root_positions[from].lerp(self.root_positions[to], t));
            match t == 0.0 {
                // Exactly, which an interpolation by nothing is not.
                true => out.copy_from_slice(self.rotations_at(from)),
                false => slerp_pose(self.rotations_at(from), self.rotations_at(to), t, out),
            }
        }
        Ok(Self {
            skeleton: Arc::clone(&self.skeleton),
            fps,
            root_positions,
            rotations,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rotation::angle_between;
    use crate::skeleton::Joint;
    use crate::testing::{biped, stand, walk};

    #[test]
    fn wrong_parts_are_refused() {
        let build = |fps, roots: Vec<Vec3>, q: Vec<Quat>| Clip::new(biped(), fps, roots, q).map(|_| ());
        let one = || (vec![Vec3::ZERO], vec![Quat::IDENTITY; 8]);
        let (p, q) = one();
        assert_eq!(build(0.0, p, q), Err(ClipError::Rate(0.0)));
        assert_eq!(build(30.0, vec![], vec![]), Err(ClipError::Empty));
        let (p, _) = one();
        let count = ClipError::RotationCount {
            found: 7,
            frames: 1,
            joints: 8,
        };
        assert_eq!(build(30.0, p, vec![Quat::IDENTITY; 7]), Err(count));
        let (_, q) = one();
        assert_eq!(
            build(30.0, vec![Vec3::NAN], q),
            Err(ClipError::Value { frame: 0 })
        );
        for bad in [
            Quat::from_xyzw(0.0, 0.0, 0.0, 1.1),
            Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0),
        ] {
            let mut q = vec![Quat::IDENTITY; 16];
            q[12] = bad;
            assert_eq!(
                build(30.0, vec![Vec3::ZERO; 2], q),
                Err(ClipError::Value { frame: 1 })
            );
        }
        let nearly = Clip::new(
            biped(),
            30.0,
            vec![Vec3::ZERO],
            vec![Quat::from_xyzw(0.0, 0.0, 0.0, 1.0009); 8],
        );
        assert!(
            nearly
                .unwrap()
                .rotations
                .iter()
                .all(|q| (q.length() - 1.0).abs() < 1e-6)
        );
    }

    #[test]
    fn slices_keep_their_frames() {
        let clip = walk(10);
        let part = clip.slice(3..7).unwrap();
        assert_eq!(part.frames(), 4);
        assert_eq!(part.root_positions[0], clip.root_positions[3]);
        assert_eq!(part.rotations_at(3), clip.rotations_at(6));
        for range in [7..11, 5..5, 10..11] {
            assert!(matches!(
                clip.slice(range),
                Err(ClipError::Range { frames: 10, .. })
            ));
        }
    }

    #[test]
    fn resampling_by_hand() {
        // Root at x = frame, a turn of 0.1 rad a frame, at 60 fps.
        let mut clip = stand(5);
        clip.fps = 60.0;
        for f in 0..5 {
            clip.root_positions[f].x = f as f32;
            clip.rotations_at_mut(f)[0] = Quat::from_rotation_y(0.1 * f as f32);
        }
        let half = clip.resample(30.0).unwrap();
        assert_eq!((half.frames(), half.fps), (3, 30.0));
        assert_eq!(
            half.root_positions.iter().map(|p| p.x).collect::<Vec<_>>(),
            [0.0, 2.0, 4.0]
        );
        let double = clip.resample(120.0).unwrap();
        assert_eq!(double.frames(), 9);
        assert!((double.root_positions[3].x - 1.5).abs() < 1e-6);
        assert!(angle_between(double.rotations_at(3)[0], Quat::from_rotation_y(0.15)) < 1e-5);
        // 50 fps out of 60: the last frame that fits is at 3.6 frames of the old.
        let odd = clip.resample(50.0).unwrap();
        assert_eq!(odd.frames(), 4);
        assert!((odd.root_positions[3].x - 3.6).abs() < 1e-5);
        assert_eq!(clip.resample(f32::NAN).map(|c| c.frames()).ok(), None);
        assert_eq!(clip.resample(1e9), Err(ClipError::TooLong(1e9)));
        // Few enough frames for a few joints, but not for this many.
        let joint = |n: usize| Joint {
            name: n.to_string(),
            parent: n.checked_sub(1),
            offset_m: Vec3::ZERO,
        };
        let many = Skeleton::new((0..512).map(joint).collect(), Vec3::X, 0.0, None).unwrap();
        let slow = Clip::new(
            Arc::new(many),
            1.0,
            vec![Vec3::ZERO; 2],
            vec![Quat::IDENTITY; 1024],
        )
        .unwrap();
        assert_eq!(slow.resample(2e5), Err(ClipError::TooLong(2e5)));
        assert_eq!(clip.resample(60.0).unwrap(), clip);
    }

    #[test]
    fn roots_have_the_pelvis_heading() {
        let roots = walk(31).roots();
        assert!(
            (roots[30].heading - 0.8).abs() < 1e-3,
            "0.8 rad after a second: {}",
            roots[30].heading
        );
        assert!((walk(31).duration_s() - 1.0).abs() < 1e-6);
    }
}
