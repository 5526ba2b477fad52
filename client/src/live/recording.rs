//! Collects live frames into a clip.

use std::sync::Arc;

use glam::{Quat, Vec3};
use troupe_motion::clip::{Clip, ClipError};
use troupe_motion::conventions::Convention;
use troupe_motion::skeleton::Skeleton;

use super::frames::Frame;
use super::options::Rate;
use super::session::Session;
use crate::pack::Pack;

/// Live frames of one character, collected for a file such as BVH or glb.
///
/// ```no_run
/// # async fn example(mut session: troupe_client::Session) -> Result<(), Box<dyn std::error::Error>> {
/// use troupe_client::Recording;
/// use troupe_motion::bvh::{BvhFile, BvhWriteOptions, write};
///
/// let mut recording = Recording::of(&session);
/// for _ in 0..90 {
///     session.step(1).await?.iter().for_each(|frame| recording.push(frame));
/// }
/// let clip = recording.into_clip()?;
/// std::fs::write("take.bvh", write(&BvhFile::from_clip(&clip, &BvhWriteOptions::default())?))?;
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone)]
pub struct Recording {
    skeleton: Arc<Skeleton>,
    convention: Convention,
    rate: Rate,
    roots: Vec<Vec3>,
    rotations: Vec<Quat>,
}

impl Recording {
    /// An empty recording of frames at a rate in a convention.
    pub fn new(pack: &Pack, convention: Convention, rate: Rate) -> Self {
        Self {
            skeleton: pack.skeleton().clone(),
            convention,
            rate,
            roots: Vec::new(),
            rotations: Vec::new(),
        }
    }

    /// An empty recording of a session's frames.
    pub fn of(session: &Session) -> Self {
        Self::new(session.pack(), session.convention(), session.frame_options().rate)
    }

    /// Adds a frame. It is kept in the native convention.
    ///
    /// # Panics
    /// If the frame has another number of joints than the pack.
    pub fn push(&mut self, frame: Frame<'_>) {
        assert_eq!(
            frame.rotations.len(),
            self.skeleton.joint_count(),
            "a frame of another pack"
        );
        let of = self.convention;
        self.roots.push(of.position_to_native(frame.root));
        let rotations = frame.rotations.iter();
        self.rotations
            .extend(rotations.map(|&q| of.rotation_to_native(q)));
    }

    /// Number of frames so far.
    pub fn len(&self) -> usize {
        self.roots.len()
    }

    /// Whether it has no frame yet.
    pub fn is_empty(&self) -> bool {
        self.roots.is_empty()
    }

    /// The frames as a clip: native convention, metres, at their rate.
    ///
    /// # Errors
    /// [`ClipError::Empty`] without a frame, and [`ClipError::Value`] if a frame is no pose.
    pub fn into_clip(self) -> Result<Clip, ClipError> {
        Clip::new(self.skeleton, self.rate.hz() as f32, self.roots, self.rotations)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::Contacts;

    fn pack() -> Pack {
        Pack::try_from(crate::pack::tests::message()).unwrap()
    }

    #[test]
    fn frames_of_any_convention_become_a_native_clip() {
        for convention in Convention::ALL {
            let mut recording = Recording::new(&pack(), convention, Rate::Hz60);
            for i in 0..3 {
                let place = Vec3::new(0.1 * i as f32, 0.9, 0.2);
                let turn = Quat::from_rotation_y(0.3 * i as f32);
                recording.push(Frame {
                    root: convention.position_from_native(place),
                    rotations: &[convention.rotation_from_native(turn); 2],
                    contacts: Contacts::default(),
                    positions: &[],
                    qpos: &[],
                });
            }
            let clip = recording.into_clip().unwrap();
            assert_eq!((clip.frames(), clip.fps), (3, 60.0));
            assert!(clip.root_positions[2].abs_diff_eq(Vec3::new(0.2, 0.9, 0.2), 1e-5));
            assert!((clip.root_at(2).heading - 0.6).abs() < 1e-4, "{convention:?}");
        }
    }

    #[test]
    fn an_empty_recording_is_no_clip() {
        let recording = Recording::new(&pack(), Convention::Native, Rate::Hz30);
        assert!(recording.is_empty());
        assert_eq!(recording.into_clip(), Err(ClipError::Empty));
    }
}
