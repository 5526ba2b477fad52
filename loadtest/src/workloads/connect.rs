//! Connections to the server.

use troupe_client::{ConnectOptions, KeyedChannel, channel};

use crate::failure::Failure;
use crate::plan::Plan;

/// Maximum size of an answer, bytes.
pub(super) const MOST_ANSWER_BYTES: usize = 256 << 20;
/// HTTP/2 windows. They are large, so that answers do not wait for window updates.
const STREAM_WINDOW_BYTES: u32 = 4 << 20;
const CONNECTION_WINDOW_BYTES: u32 = 64 << 20;

/// Opens the connections of a plan. Requests have a time limit of their own, so that of a
/// connection is twice as long.
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
