//! How a character goes on after a restart of its server: from what was saved, and from what its
//! client saw since then.

use troupe_motion::robot::Fitted;
use troupe_motion::{Quat, Vec3};

use super::buffer::Seam;
use super::{Character, Clock, PerformanceEnd};

/// Most frames that a client may have seen beyond the saved one.
pub const MAX_REJOIN_FRAMES: u64 = 90;
/// Farthest that a client may have seen a character from its saved place, metres.
pub const MAX_REJOIN_M: f32 = 5.0;

/// The last frame that a client saw of a character.
#[derive(Debug, Clone, PartialEq)]
pub struct LastSeen {
    /// Number of the frame on the character's timeline.
    pub frame: u64,
    /// The pose that was shown: root position, and a rotation for each joint, the first in the
    /// world.
    pub pose: Option<(Vec3, Vec<Quat>)>,
}

/// Why a character cannot go on from what its client saw.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RejoinError {
    /// The client cannot have seen this frame.
    #[error("is {seen}, and the character is at frame {frame}")]
    Frame {
        /// The client's frame.
        seen: u64,
        /// The character's frame.
        frame: u64,
    },
    /// The client cannot have seen this place.
    #[error("is {metres:.1} m from where the character is")]
    Place {
        /// Distance between the two places, metres.
        metres: f32,
    },
}

impl Character {
    /// Prepares a character that was just read from its bytes: it asks again for the plans that it
    /// waited for.
    ///
    /// # Errors
    /// What of the saved character makes no sense.
    pub(crate) fn wake(&mut self) -> Result<(), String> {
        if let Some(number) = self.timeline.wake(self.rig.skeleton.joint_count())? {
            self.forgo(number);
        }
        // Frames of a performance that were on their way are lost.
        let frame = self.timeline.frame();
        self.stop_performing(frame, PerformanceEnd::Restarted);
        Ok(())
    }

    /// Takes it that a plan will not arrive, without counting it as failed.
    fn forgo(&mut self, number: u64) {
        if let Some((behaviour, mut parts)) = self.acting() {
            behaviour.lost(number, &mut parts);
        }
    }

    /// Goes on from the last frame that a client saw: the frames after it continue its pose. A
    /// character that is at that frame or beyond stays as it is. The limits are
    /// [`MAX_REJOIN_FRAMES`] and [`MAX_REJOIN_M`].
    ///
    /// # Errors
    /// [`RejoinError`]; then nothing has changed.
    pub fn rejoin(&mut self, seen: &LastSeen) -> Result<(), RejoinError> {
        let frame = self.frame();
        if seen.frame > frame + MAX_REJOIN_FRAMES {
            return Err(RejoinError::Frame {
                seen: seen.frame,
                frame,
            });
        }
        if seen.frame <= frame {
            return Ok(());
        }
        if let Some((root, _)) = &seen.pose {
            let metres = self.view().root.position.with_y(0.0).distance(root.with_y(0.0));
            if metres > MAX_REJOIN_M {
                return Err(RejoinError::Place { metres });
            }
        }
        let sub_frames = self.timeline.reach_for(seen.frame as i64);
        self.advance(sub_frames, Clock::Runs);
        if let Some((root, rotations)) = &seen.pose {
            self.meet(*root, rotations);
        }
        Ok(())
    }

    /// Shows the frame at the cursor as `root` and `rotations`, and lets the frames after it return
    /// to what they were.
    fn meet(&mut self, root: Vec3, rotations: &[Quat]) {
        let mut shown = Vec::new();
        let (at, _) = self.shown(self.timeline.cursor(), &mut shown, &mut Fitted::default());
        self.timeline.rejoin(&Seam {
            moved: root - at,
            turned: (rotations.iter().zip(&shown))
                .map(|(seen, shown)| *seen * shown.inverse())
                .collect(),
        });
        // A plan that was asked for on the way would start from the frames before the change.
        self.planning.forget_request();
        if let Ok(Some(number)) = self.timeline.wake(rotations.len()) {
            self.forgo(number);
        }
    }
}
