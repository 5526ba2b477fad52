//! Connections to the server.

use troupe_client::{ConnectOptions, KeyedChannel, channel};

use crate::failure::Failure;
use crate::plan::Plan;

/// Largest answer that is taken, bytes.
pub(super) const MOST_ANSWER_BYTES: usize = 256 << 20;
/// HTTP/2 windows: large enough that no answer waits for leave to be sent.
const STREAM_WINDOW_BYTES: u32 = 4 << 20;
const CONNECTION_WINDOW_BYTES: u32 = 64 << 20;

/// As many connections as the plan has. Requests time out by themselves, within the limit that
/// connections have.
pub(super) async fn channels(plan: &Plan) -> Result<Vec<KeyedChannel>, Failure> {
    let options = ConnectOptions {
        request_timeout: plan.timeout() * 2,
        ..plan.access.options()
    };
    let mut channels = Vec::new();
    for _ in 0..plan.connections.max(1) {
        let tuned = channel(&plan.server, &options, |endpoint| {
            endpoint
                .initial_stream_window_size(STREAM_WINDOW_BYTES)
                .initial_connection_window_size(CONNECTION_WINDOW_BYTES)
        });
        channels.push(tuned.await?);
    }
    Ok(channels)
}
