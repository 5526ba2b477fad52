//! What the crates of the server share. Nothing here knows a pack, a session or a protocol.
//!
//! | module | holds |
//! |---|---|
//! | [`telemetry`] | the registry of metrics, of which each crate owns its handles; request ids and traces |
//! | [`offload`] | CPU work of a request, off the task that received it |
//! | [`turns`] | fair turns at work that many clients share |
//! | [`tenant`] | what a tenant may be called |
//! | [`echo`] | how much of a request an error may repeat |

pub mod echo;
pub mod offload;
pub mod telemetry;
pub mod tenant;
pub mod turns;
