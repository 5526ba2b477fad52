//! Code that the server's crates share. Nothing here depends on packs, sessions or protocols.
//!
//! | module | holds |
//! |---|---|
//! | [`telemetry`] | the registry of metrics (each crate owns its handles), request ids and traces |
//! | [`offload`] | moves a request's CPU work to the blocking pool |
//! | [`turns`] | fair turns for clients that share the runtime's threads |
//! | [`tenant`] | allowed names of tenants |
//! | [`echo`] | how much of a request an error may repeat |

pub mod echo;
pub mod offload;
pub mod telemetry;
pub mod tenant;
pub mod turns;
