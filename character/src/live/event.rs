//! Events of a character, in the native convention.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use super::PerformanceEnd;
use crate::primitives::Instead;
pub use crate::primitives::object::KeyframeError;
use crate::scene::Transform;

/// What a character is doing.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum Activity {
    /// It moves as its command says, or stands.
    #[default]
    Locomotion,
    /// It is on its way to an object.
    Approaching {
        /// Id of the object in the scene.
        instance: Arc<str>,
    },
    /// It goes through the sets of an interaction.
    Interacting {
        /// Id of the object in the scene.
        instance: Arc<str>,
        /// Name of the current set.
        set: String,
    },
    /// It holds the last keyframe of a set.
    Held {
        /// Id of the object in the scene.
        instance: Arc<str>,
        /// Name of the set.
        set: String,
    },
    /// It is in the air, or has just landed.
    Falling,
    /// It performs a text.
    Performing {
        /// The text of the command.
        text: Arc<str>,
    },
}

/// An object in a character's hand.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldObject {
    /// Id of the object in the scene.
    pub instance: Arc<str>,
    /// The object's place in the world at the cursor.
    pub transform: Transform,
    /// Index of the joint in the hand or elsewhere that carries it.
    pub joint: usize,
}

/// Something that happened to a character.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CharacterEvent {
    /// Frame of the timeline.
    pub frame: u64,
    /// The event, with its figures.
    pub kind: EventKind,
}

/// Kinds of events.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum EventKind {
    /// An interaction began: the object is reserved.
    Started {
        /// Id of the object in the scene.
        instance: Arc<str>,
        /// Name of the object's definition.
        definition: String,
        /// Name of the variant that was chosen.
        variant: String,
        /// Name of the approach that was chosen; none if the definition has no approaches.
        approach: Option<String>,
        /// The seed that chose the variant.
        seed: u64,
    },
    /// A set of keyframes began.
    Entered {
        /// Id of the object in the scene.
        instance: Arc<str>,
        /// Name of the set.
        set: String,
    },
    /// A keyframe was reached.
    Reached {
        /// Id of the object in the scene.
        instance: Arc<str>,
        /// Name of the set.
        set: String,
        /// Index of the keyframe in the set, from 0.
        keyframe: u32,
        /// How far off the motion was before it was pinned to the keyframe.
        before: KeyframeError,
        /// How far off it is in the frames that were sent.
        after: KeyframeError,
        /// How many frames before the keyframe's own frame the next motion began: 0 for a hard
        /// keyframe, up to τ for a soft one.
        early_frames: u32,
    },
    /// The object was attached to a socket of the character.
    Attached {
        /// Id of the object in the scene.
        instance: Arc<str>,
        /// Name of the socket.
        socket: String,
    },
    /// The object was put down.
    Released {
        /// Id of the object in the scene.
        instance: Arc<str>,
        /// The object's place in the world now.
        transform: Transform,
    },
    /// An interaction came to its end.
    Done {
        /// Id of the object in the scene.
        instance: Arc<str>,
    },
    /// An interaction could not go on.
    Failed {
        /// Id of the object in the scene.
        instance: Arc<str>,
        /// The reason, for programs.
        reason: FailReason,
        /// The reason for people, with names and numbers.
        message: String,
    },
    /// A command broke an interaction off.
    Interrupted {
        /// Id of the object in the scene.
        instance: Arc<str>,
    },
    /// The ground ended, and the character falls.
    Fell {
        /// Depth of the surface that the character falls to, metres. Always given: a character does
        /// not fall without one.
        height_m: Option<f32>,
    },
    /// A fall ended on a surface.
    Landed {
        /// Height of the fall, metres.
        height_m: f32,
        /// Downward speed on landing, m/s.
        speed_mps: f32,
    },
    /// A performance began.
    Performing {
        /// Sequence number of the command.
        number: u64,
        /// The text of the command.
        text: Arc<str>,
        /// Name of the pack that makes motion of the text.
        pack: Arc<str>,
        /// Words of the text that the pack does not know.
        unknown_words: Vec<String>,
    },
    /// A performance ended, or did not come about.
    Performed {
        /// Sequence number of the command.
        number: u64,
        /// Why it ended.
        end: PerformanceEnd,
    },
    /// A character came to the end of its path.
    Arrived {
        /// Delay against the times of the path, seconds; negative if early.
        late_s: f32,
        /// Distance from the last point of the path, metres.
        off_m: f32,
    },
    /// A command asks for more than the style can do.
    Bounded {
        /// Speed over the ground that the command asks for, m/s.
        wanted_mps: f32,
        /// Speed that the character has instead, m/s.
        speed_mps: f32,
        /// Heading that the character has instead, radians. None if the command gives no heading,
        /// or the character takes it.
        facing: Option<f32>,
    },
}

/// Events of a character until the server takes them, in the order of their frames.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct EventLog {
    events: Vec<CharacterEvent>,
    /// Frame of the newest event.
    last_frame: u64,
    /// Frame of the last [`EventKind::Bounded`]; none since a command that the style can follow.
    bounded_at: Option<u64>,
}

impl EventLog {
    /// Adds an event. One of a frame before the newest event's counts as of that frame: for example
    /// a keyframe reached while a later set had begun.
    pub(super) fn push(&mut self, frame: i64, kind: EventKind) {
        self.last_frame = self.last_frame.max(frame.max(0) as u64);
        self.events.push(CharacterEvent {
            frame: self.last_frame,
            kind,
        });
    }

    /// Notes what the character does instead of a command that its style cannot follow. While
    /// commands change, that makes at most one event in `pause_frames`.
    pub(super) fn push_bounded(&mut self, frame: i64, pause_frames: u64, instead: Option<Instead>) {
        let Some(instead) = instead else {
            self.bounded_at = None;
            return;
        };
        let now = frame.max(0) as u64;
        if self.bounded_at.is_none_or(|at| at + pause_frames <= now) {
            self.bounded_at = Some(now);
            let Instead {
                wanted_mps,
                speed_mps,
                facing,
            } = instead;
            self.push(
                frame,
                EventKind::Bounded {
                    wanted_mps,
                    speed_mps,
                    facing,
                },
            );
        }
    }

    /// Moves all events to the end of `into`.
    pub(super) fn take(&mut self, into: &mut Vec<CharacterEvent>) {
        into.append(&mut self.events);
    }
}

/// Why an interaction could not go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum FailReason {
    /// The character did not reach the place to start from in time.
    NotReached,
    /// Something stands in the way.
    Blocked,
    /// Another character had the object when the interaction was to begin.
    Taken,
    /// The object moved too late to follow it.
    Moved,
    /// The object was removed from the scene.
    Removed,
    /// There is no place to put the object down.
    NoPlace,
    /// A joint cannot reach its point of a keyframe.
    OutOfReach,
    /// The networks made no motion.
    NoPlan,
}

impl FailReason {
    /// Every reason once.
    pub const ALL: [Self; 8] = [
        Self::NotReached,
        Self::Blocked,
        Self::Taken,
        Self::Moved,
        Self::Removed,
        Self::NoPlace,
        Self::OutOfReach,
        Self::NoPlan,
    ];

    /// The reason in messages and metric labels.
    pub fn word(self) -> &'static str {
        match self {
            Self::NotReached => "NOT_REACHED",
            Self::Blocked => "BLOCKED",
            Self::Taken => "TAKEN",
            Self::Moved => "MOVED",
            Self::Removed => "REMOVED",
            Self::NoPlace => "NO_PLACE",
            Self::OutOfReach => "OUT_OF_REACH",
            Self::NoPlan => "NO_PLAN",
        }
    }
}
