//! Live characters: the pure state machine of a session, and what runs many of them.
//!
//! A [`Character`] is pure: it knows no clock, no thread and no engine. A [`cell`] holds one behind a lock, the
//! [`Registry`] holds all cells, and [`Sessions`] has the calls. Plans go through the pack's batcher ([`planner`]).

mod act;
#[cfg(test)]
pub(crate) use act::testing as act_testing;
pub mod budget;
mod buffer;
mod calls;
pub mod cell;
mod character;
mod commands;
mod describe;
pub mod drive;
mod encode;
mod event;
mod events;
mod inbox;
mod intent;
mod live;
pub mod load;
mod meet;
mod options;
mod peek;
mod planner;
mod policy;
mod registry;
mod request;
mod step;
pub(crate) mod styles;
#[cfg(test)]
mod testing;
mod time;
mod timeline;
mod types;
pub(crate) mod units;

pub use buffer::CROSSFADE_FRAMES;
pub use calls::{SessionLimits, Sessions};
pub use character::Character;
pub use commands::MAX_COMMANDS;
pub use encode::{BlockWriter, Form};
pub use event::{Activity, CharacterEvent, EventKind, FailReason, HeldObject, KeyframeError};
pub use events::{EventQueue, MAX_WAITING_EVENTS};
pub use inbox::MAX_WAITING_COMMANDS;
pub use intent::{Intent, Refusal, World};
pub use live::finish_live;
pub use meet::Meets;
pub use options::{MAX_ID_CHARS, TTL_RANGE_MS};
pub use registry::Registry;
pub use time::TimeSource;
pub use types::{
    Advance, Arrival, CONTEXT_FRAMES, CharacterOptions, Clock, CommandOutcome, FrameOut, LivePlan, LiveShape,
    Peek, PlanCause, PlanFailed, PlanRecord, PlanRequest, PlanTrace, SUB_FRAMES, Start, Stats, Strain, View,
    WaitingCommand,
};
