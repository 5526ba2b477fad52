//! Connections to the server.

use tonic::transport::{Channel, Endpoint};

use crate::failure::Failure;
use crate::plan::Plan;

/// Largest answer that is taken, bytes.
pub(super) const MOST_ANSWER_BYTES: usize = 256 << 20;
/// HTTP/2 windows: large enough that no answer waits for leave to be sent.
const STREAM_WINDOW_BYTES: u32 = 4 << 20;
const CONNECTION_WINDOW_BYTES: u32 = 64 << 20;

/// As many connections as the plan has. Requests time out by themselves, so these have no limit of their own.
pub(super) async fn channels(plan: &Plan) -> Result<Vec<Channel>, Failure> {
    let endpoint = Endpoint::from_shared(plan.server.clone())
        .map_err(|e| Failure::Input(format!("{:?} is no server address: {e}", plan.server)))?
        .tcp_nodelay(true)
        .connect_timeout(std::time::Duration::from_secs(5))
        .initial_stream_window_size(STREAM_WINDOW_BYTES)
        .initial_connection_window_size(CONNECTION_WINDOW_BYTES);
    let mut channels = Vec::new();
    for _ in 0..plan.connections.max(1) {
        let channel = endpoint.connect().await.map_err(|e| unreachable(plan, &e))?;
        channels.push(channel);
    }
    Ok(channels)
}

/// That no server answers, and the deepest reason.
fn unreachable(plan: &Plan, error: &dyn std::error::Error) -> Failure {
    let mut cause = error;
    while let Some(deeper) = cause.source() {
        cause = deeper;
    }
    Failure::Unreachable(format!("no server answers at {}: {cause}", plan.server))
}
