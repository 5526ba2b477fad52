//! A live character as a pure state machine: events in, plan requests and frames out.
//!
//! A [`Character`] knows no clock, no thread and no engine.

pub mod behaviour;
pub mod budget;
mod buffer;
mod character;
mod event;
mod inbox;
mod intent;
mod limbs;
pub mod load;
mod performance;
mod pin;
mod plan;
mod planning;
mod policy;
mod rejoin;
pub mod request;
mod shown;
#[cfg(test)]
mod testing;
mod timeline;
mod types;

pub use buffer::CROSSFADE_FRAMES;
pub use character::Character;
pub use event::{Activity, CharacterEvent, EventKind, FailReason, HeldObject, KeyframeError};
pub use inbox::MAX_WAITING_COMMANDS;
pub use intent::{CommandError, Intent, World};
pub use performance::{
    MAX_PAST_FRAMES, MAX_PERFORMANCE_FRAMES, MAX_UNKNOWN_WORDS, OtherSkeleton, PartReader, PerformCommand,
    PerformanceEnd, WordsPart, WordsRequest,
};
pub use pin::Pins;
pub use plan::{finish_live, hold_plan};
pub use rejoin::{LastSeen, MAX_REJOIN_FRAMES, MAX_REJOIN_M, RejoinError};
pub use shown::REACH_LEAD_FRAMES;
pub use types::{
    Advance, Arrival, CONTEXT_FRAMES, CharacterOptions, Clock, CommandOutcome, FrameOut, LivePlan, LiveShape,
    PathItem, Peek, PlanCause, PlanFailed, PlanItem, PlanRecord, PlanRequest, PlanTrace, SUB_FRAMES, Start,
    Stats, Strain, View, WaitingCommand,
};
