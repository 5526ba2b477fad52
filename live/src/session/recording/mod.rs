//! Recordings of sessions, and their replay.
//!
//! A character is a state machine: the same inputs in the same order give the same frames. A
//! recording holds every input in that order: commands, movements of the cursor, the load, and
//! which plan came when. It does not hold the plans themselves, because the same pack and engine
//! make them again bit for bit. Of every frame it has checksums.
//!
//! | files, bottom up | hold |
//! |---|---|
//! | `digest`, `format` | checksums, and the lines of a recording |
//! | `tape`, `recorder` | the recording of one session, and how a session writes it |
//! | `shelf` | all recordings of a server |
//! | `replay`, `player` | the call that plays one again |

mod digest;
mod format;
mod player;
mod recorder;
mod replay;
mod shelf;
mod tape;

pub use format::RecordingError;
pub(super) use recorder::Recorder;
pub use replay::{MAX_REPLAY_BYTES, MAX_REPLAYS, Replaying};
pub use shelf::MAX_RECORDINGS;
pub(super) use shelf::Shelf;
pub use tape::MAX_RECORDING_BYTES;

#[cfg(test)]
mod tests;
