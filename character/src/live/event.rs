//! What happens to a character, in the native convention.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use super::PerformanceEnd;
pub use crate::primitives::object::KeyframeError;
use crate::scene::Transform;

/// What a character is about.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum Activity {
    /// It moves as its command says.
    #[default]
    Locomotion,
    /// It is on its way to an object.
    Approaching {
        /// The object.
        instance: Arc<str>,
    },
    /// It goes through the sets of an interaction.
    Interacting {
        /// The object.
        instance: Arc<str>,
        /// The set that it is in.
        set: String,
    },
    /// It holds a set's last keyframe.
    Held {
        /// The object.
        instance: Arc<str>,
        /// The set.
        set: String,
    },
    /// It is in the air, or has just landed.
    Falling,
    /// It acts out words.
    Performing {
        /// What it acts out.
        text: Arc<str>,
    },
}

/// An object in a character's hand.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldObject {
    /// The object.
    pub instance: Arc<str>,
    /// Where it is in the world at the cursor.
    pub transform: Transform,
}

/// Something that happened to a character.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CharacterEvent {
    /// The frame of the timeline at which it did.
    pub frame: u64,
    /// What happened.
    pub kind: EventKind,
}

/// What can happen to a character.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum EventKind {
    /// An interaction began: the object is reserved.
    Started {
        /// The object.
        instance: Arc<str>,
        /// Name of its definition.
        definition: String,
        /// The variant that was chosen.
        variant: String,
        /// The approach that was chosen; none where the definition has none.
        approach: Option<String>,
        /// What the variant was chosen by.
        seed: u64,
    },
    /// A set of keyframes began.
    Entered {
        /// The object.
        instance: Arc<str>,
        /// The set.
        set: String,
    },
    /// A keyframe was reached.
    Reached {
        /// The object.
        instance: Arc<str>,
        /// The set.
        set: String,
        /// Index of the keyframe in it.
        keyframe: u32,
        /// How far off the motion was before it was drawn to the keyframe.
        before: KeyframeError,
        /// How far off it is in the frames that were sent.
        after: KeyframeError,
        /// How many frames before the keyframe's own frame what follows began: 0 for a hard
        /// keyframe, up to τ for a soft one.
        early_frames: u32,
    },
    /// The object went to a socket.
    Attached {
        /// The object.
        instance: Arc<str>,
        /// The socket.
        socket: String,
    },
    /// The object was put down.
    Released {
        /// The object.
        instance: Arc<str>,
        /// Where it is now.
        transform: Transform,
    },
    /// An interaction went through to its end.
    Done {
        /// The object.
        instance: Arc<str>,
    },
    /// An interaction could not go on.
    Failed {
        /// The object.
        instance: Arc<str>,
        /// Why.
        reason: FailReason,
        /// The same for people, with names and numbers.
        message: String,
    },
    /// A command broke an interaction off.
    Interrupted {
        /// The object.
        instance: Arc<str>,
    },
    /// The ground ended.
    Fell {
        /// How far down the surface is that it falls to, metres. Always given: without one nobody
        /// falls.
        height_m: Option<f32>,
    },
    /// A fall ended on a surface.
    Landed {
        /// How far it fell, metres.
        height_m: f32,
        /// Speed downward at the touch, m/s.
        speed_mps: f32,
    },
    /// It began to act out words.
    Performing {
        /// Number of the command.
        number: u64,
        /// What it acts out.
        text: Arc<str>,
        /// The pack that makes motion of the words.
        pack: Arc<str>,
        /// Words that the pack does not know.
        unknown_words: Vec<String>,
    },
    /// A performance ended, or came to nothing.
    Performed {
        /// Number of the command.
        number: u64,
        /// Why.
        end: PerformanceEnd,
    },
    /// A path came to its end.
    Arrived {
        /// How much later than its times, seconds.
        late_s: f32,
        /// How far from its last point, metres.
        off_m: f32,
    },
    /// A command asks for more than the style can do.
    Bounded {
        /// Speed over the ground that was asked for, m/s.
        wanted_mps: f32,
        /// Speed that it has instead, m/s.
        speed_mps: f32,
        /// Where it faces instead, radians; none where it faces as it was told, or was told
        /// nothing.
        facing: Option<f32>,
    },
}

/// Why an interaction could not go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum FailReason {
    /// The place to start from was not reached in time.
    NotReached,
    /// Something came in the way.
    Blocked,
    /// Somebody else had the object when the interaction was to begin.
    Taken,
    /// The object was moved too late to follow it.
    Moved,
    /// The object was taken out of the scene.
    Removed,
    /// There is no place to put the object down.
    NoPlace,
    /// A keyframe has a joint where it cannot come to.
    OutOfReach,
    /// The networks gave no motion.
    NoPlan,
}

impl FailReason {
    /// All of them.
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

    /// Its word in messages and metrics.
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
