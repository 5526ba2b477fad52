//! Performing a text: a pack of words makes frames part by part, which replace plans.
//!
//! ```text
//!      Perform             asks                  frames have come        all but the last are in the buffer
//! ───────────────► Due ───────────► Asked ──────────────────────► Playing ──────────────────────────► Leaving ──► over
//! ```
//!
//! Locomotion goes on until the performance begins, and takes over after its last frames. Frames
//! that have arrived wait in a [`Script`] and enter the buffer as the cursor comes near. [`settle`]
//! decides what a frame calls for.

mod part;
mod script;
mod settle;
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
/// Most past frames that a model of words gets.
pub const MAX_PAST_FRAMES: u32 = 16;
/// Most words that a performance reports as unknown to its pack.
pub const MAX_UNKNOWN_WORDS: usize = 8;

/// A command to perform a text.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PerformCommand {
    /// What to do, as a sentence.
    pub text: Arc<str>,
    /// Name of the pack that makes motion of the text.
    pub pack: Arc<str>,
    /// Past frames that the pack reads; it gets at most [`MAX_PAST_FRAMES`].
    pub past_frames: u32,
    /// Frames to make, at most [`MAX_PERFORMANCE_FRAMES`]. `None`: as many as the model chooses, up
    /// to that.
    pub frames: Option<u32>,
    /// Sampling temperature. `None`: the pack's.
    pub temperature: Option<f32>,
    /// Words of the text that the pack does not know, at most [`MAX_UNKNOWN_WORDS`].
    pub unknown_words: Vec<String>,
}

/// A request for the frames of a performance.
#[derive(Debug, Clone, PartialEq)]
pub struct WordsRequest {
    /// Sequence number of the command.
    pub number: u64,
    /// The text, and how to make motion of it.
    pub command: PerformCommand,
    /// The frames before the performance, in their segment frame: the last is at its origin.
    pub past: Vec<KeyTensors>,
    /// Seed of all random choices.
    pub seed: u64,
    /// Frames until the performance is to take over.
    pub splice_in_frames: u32,
}

/// Why a performance ended.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum PerformanceEnd {
    /// It came to its end.
    Done,
    /// A command or a fall broke it off.
    Interrupted,
    /// The pack made no motion, for this reason.
    Failed(String),
    /// Its frames did not arrive in time.
    Late,
    /// The server was restarted.
    Restarted,
}

impl PerformanceEnd {
    /// All ends in messages and metric labels.
    pub const WORDS: [&'static str; 5] = ["DONE", "INTERRUPTED", "FAILED", "LATE", "RESTARTED"];

    /// The end in messages and metric labels.
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
    /// Sequence number of its command.
    number: u64,
    command: PerformCommand,
    state: PerformanceState,
    /// Frames that have arrived and are not in the buffer yet. Not saved: a restart ends the
    /// performance.
    #[serde(skip)]
    script: Script,
    /// A request that the server has not taken yet.
    #[serde(skip)]
    request: Option<WordsRequest>,
    /// A clock that waits goes no further than this frame before more frames have arrived.
    barrier: Option<i64>,
}

/// How far a performance is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
enum PerformanceState {
    /// To be asked for once no plan on its way can change the frames that it starts from.
    Due,
    /// Asked for, and not begun.
    Asked {
        /// The frame of the request.
        at: i64,
        /// The earliest frame to take over at.
        splice: i64,
    },
    /// Begun: its frames enter the buffer.
    Playing {
        /// The root whose segment frame the frames are relative to.
        origin: GlobalRoot,
    },
    /// All its frames are in the buffer, and locomotion takes over.
    Leaving {
        /// The frame from which locomotion has taken over.
        until: i64,
    },
}

impl Performance {
    fn new(number: u64, command: PerformCommand) -> Self {
        Self {
            number,
            command,
            state: PerformanceState::Due,
            script: Script::default(),
            request: None,
            barrier: None,
        }
    }

    /// The frame at which a clock that waits stops until more frames have arrived.
    pub(super) fn barrier(&self) -> Option<i64> {
        self.barrier
    }

    /// The text, once the performance shows.
    pub(super) fn shown(&self) -> Option<&Arc<str>> {
        match self.state {
            PerformanceState::Due | PerformanceState::Asked { .. } => None,
            PerformanceState::Playing { .. } | PerformanceState::Leaving { .. } => Some(&self.command.text),
        }
    }

    /// The segment frame of its frames while they enter the buffer.
    fn lies(&self) -> Option<SegmentFrame> {
        match self.state {
            PerformanceState::Playing { origin } => Some(SegmentFrame::from_root(origin)),
            PerformanceState::Due | PerformanceState::Asked { .. } | PerformanceState::Leaving { .. } => None,
        }
    }

    /// Whether it waits for frames.
    fn listens(&self) -> bool {
        let begun = matches!(
            self.state,
            PerformanceState::Asked { .. } | PerformanceState::Playing { .. }
        );
        begun && !self.script.is_whole()
    }
}
