//! Acting out a sentence: frames that a pack of words makes part by part, instead of plans.
//!
//! ```text
//!      Perform             asks                  frames have come        all but the last are in the buffer
//! ───────────────► Due ───────────► Asked ──────────────────────► Playing ──────────────────────────► Leaving ──► over
//! ```
//!
//! Locomotion goes on until the performance begins, and takes over behind its last frames. Frames
//! that have come wait in a [`Script`] and enter the buffer as the cursor comes near. What is due
//! at a frame is decided in [`stages`].

mod part;
mod script;
mod stages;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use troupe_motion::GlobalRoot;
use troupe_motion::SegmentFrame;
use troupe_motion::model::KeyTensors;

pub use part::{OtherSkeleton, PartReader, WordsPart};
use script::Script;

/// Most frames of a performance: 30 s.
pub const MAX_PERFORMANCE_FRAMES: u32 = 900;
/// Most frames that a model of words is given as the past.
pub const MAX_PAST_FRAMES: u32 = 16;
/// Most words that a performance names as unknown to its pack.
pub const MAX_UNKNOWN_WORDS: usize = 8;

/// What a character is to act out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PerformCommand {
    /// What to do, in words.
    pub text: Arc<str>,
    /// Name of the pack that makes motion of the words.
    pub pack: Arc<str>,
    /// Frames that the pack reads as the past: at most [`MAX_PAST_FRAMES`] are given.
    pub past_frames: u32,
    /// Frames to make, at most [`MAX_PERFORMANCE_FRAMES`]. `None`: as many as the model wants, and
    /// at most those.
    pub frames: Option<u32>,
    /// Sampling temperature. `None`: the pack's.
    pub temperature: Option<f32>,
    /// Words that the pack does not know, at most [`MAX_UNKNOWN_WORDS`].
    pub unknown_words: Vec<String>,
}

/// Words to ask a pack for.
#[derive(Debug, Clone, PartialEq)]
pub struct WordsRequest {
    /// Number of the command.
    pub number: u64,
    /// What to act out.
    pub command: PerformCommand,
    /// The frames that the words go on from, in their segment frame: the last is at its origin.
    pub past: Vec<KeyTensors>,
    /// Seed of all random choices.
    pub seed: u64,
    /// Frames until the words are to take over.
    pub splice_in_frames: u32,
}

/// Why a performance ended.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum PerformanceEnd {
    /// It went through to its end.
    Done,
    /// A command, or a fall, broke it off.
    Interrupted,
    /// The pack gave no motion, for this reason.
    Failed(String),
    /// Its frames did not come in time.
    Late,
    /// The server was started again.
    Restarted,
}

impl PerformanceEnd {
    /// Words of all ends, in messages and metrics.
    pub const WORDS: [&'static str; 5] = ["DONE", "INTERRUPTED", "FAILED", "LATE", "RESTARTED"];

    /// Its word in messages and metrics.
    pub fn word(&self) -> &'static str {
        let place = match self {
            Self::Done => 0,
            Self::Interrupted => 1,
            Self::Failed(_) => 2,
            Self::Late => 3,
            Self::Restarted => 4,
        };
        Self::WORDS[place]
    }
}

/// A performance, from its command to its end.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Performance {
    /// Number of its command.
    number: u64,
    command: PerformCommand,
    stage: Stage,
    /// Frames that have come and are not in the buffer yet. Gone where the process ends, and the
    /// performance with them.
    #[serde(skip)]
    script: Script,
}

/// How far a performance is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
enum Stage {
    /// Words are to be asked for as soon as nothing is on its way that changes the frames that they
    /// go on from.
    Due,
    /// Words were asked for.
    Asked {
        /// At this frame.
        at: i64,
        /// To take over here, or later.
        splice: i64,
    },
    /// Its frames are in the buffer.
    Playing {
        /// The root that its segment frame is that of.
        origin: GlobalRoot,
    },
    /// All its frames are in the buffer, and locomotion takes over from frame `until` on.
    Leaving {
        /// That frame.
        until: i64,
    },
}

impl Performance {
    fn new(number: u64, command: PerformCommand) -> Self {
        Self {
            number,
            command,
            stage: Stage::Due,
            script: Script::default(),
        }
    }

    /// What it acts out, where it is seen.
    pub(super) fn shown(&self) -> Option<&Arc<str>> {
        match self.stage {
            Stage::Due | Stage::Asked { .. } => None,
            Stage::Playing { .. } | Stage::Leaving { .. } => Some(&self.command.text),
        }
    }

    /// Where its frames lie in the world, once it has begun.
    fn lies(&self) -> Option<SegmentFrame> {
        match self.stage {
            Stage::Playing { origin } => Some(SegmentFrame::from_root(origin)),
            Stage::Due | Stage::Asked { .. } | Stage::Leaving { .. } => None,
        }
    }

    /// Whether it waits for words.
    fn listens(&self) -> bool {
        let begun = matches!(self.stage, Stage::Asked { .. } | Stage::Playing { .. });
        begun && !self.script.is_whole()
    }
}
