//! How many sessions and streams there may be, and how long they last.

use std::time::Duration;

/// Limits of sessions and streams.
#[derive(Debug, Clone, Copy)]
pub struct SessionLimits {
    /// Most open sessions.
    pub sessions: usize,
    /// Most sessions of one request.
    pub per_request: usize,
    /// Most sessions on one stream.
    pub per_stream: usize,
    /// Most open streams.
    pub streams: usize,
    /// Time to live of sessions that do not say, milliseconds.
    pub ttl_ms: u32,
    /// How long a stream's reader may take nothing.
    pub stall_timeout: Duration,
}
