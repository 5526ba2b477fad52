//! Limits of the number and the lifetime of sessions and streams.

use std::time::Duration;

/// Limits of sessions and streams.
#[derive(Debug, Clone, Copy)]
pub struct SessionLimits {
    /// Maximum number of open sessions.
    pub sessions: usize,
    /// Maximum number of sessions in one request.
    pub per_request: usize,
    /// Maximum number of sessions on one stream.
    pub per_stream: usize,
    /// Maximum number of open streams.
    pub streams: usize,
    /// Default time to live of sessions, milliseconds.
    pub ttl_ms: u32,
    /// A stream is closed after its reader has taken no message for this long.
    pub stall_timeout: Duration,
}
