//! A character that goes on after its server was gone: what it woke up with, and what its client
//! saw meanwhile.

use troupe_motion::robot::Fitted;
use troupe_motion::{Quat, Vec3};

use super::super::buffer::Seam;
use super::super::{Clock, PerformanceEnd};
use super::Character;

/// Most frames that a client may have seen beyond what a character remembers.
pub const MAX_REJOIN_FRAMES: u64 = 90;
/// How far from there a character may have been seen, metres.
pub const MAX_REJOIN_M: f32 = 5.0;

/// The last frame that a client saw of a character.
#[derive(Debug, Clone, PartialEq)]
pub struct LastSeen {
    /// Its number.
    pub frame: u64,
    /// How the character was shown in it: root position, and a rotation for each joint, the first
    /// in the world.
    pub pose: Option<(Vec3, Vec<Quat>)>,
}

/// Why a character does not go on from what was seen.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RejoinError {
    /// It cannot have been seen.
    #[error("is {seen}, and the character is at frame {frame}")]
    Frame {
        /// What was seen.
        seen: u64,
        /// Where it is.
        frame: u64,
    },
    /// It was seen elsewhere.
    #[error("is {metres:.1} m from where the character is")]
    Place {
        /// How far off.
        metres: f32,
    },
}

impl Character {
    /// Makes a character that was just read from its bytes one that works: it asks for the plans
    /// again that it waited for.
    ///
    /// # Errors
    /// What of it makes no sense.
    pub(crate) fn wake(&mut self) -> Result<(), String> {
        if let Some(number) = self.timeline.wake(self.rig.skeleton.joint_count())? {
            self.forgo(number);
        }
        // Words that were on their way are gone.
        let frame = self.timeline.frame();
        self.stop_performing(frame, PerformanceEnd::Restarted);
        Ok(())
    }

    /// A plan that was asked for will not come, and is not counted as one that failed.
    fn forgo(&mut self, number: u64) {
        if let Some((act, mut body)) = self.acting() {
            act.lost(number, &mut body);
        }
    }

    /// Goes on from the last frame that a client saw: frames behind it follow from its pose. A
    /// character that is there already, or beyond, stays as it is. Its client may have seen as much
    /// more as [`MAX_REJOIN_FRAMES`] and [`MAX_REJOIN_M`] say.
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

    /// Has the frame at the cursor be shown as `root` and `rotations`, and those behind it go over
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
        // A plan that was asked for on the way would start from the frames as they were.
        self.outbox = None;
        self.asked = None;
        if let Ok(Some(number)) = self.timeline.wake(rotations.len()) {
            self.forgo(number);
        }
    }
}
