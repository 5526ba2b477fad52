//! What the edge must know about the routes.

use axum::response::Response;

use super::error::ApiError;
use super::roles;
use troupe_edge::{EdgeError, Front};

/// Paths of live streams, over HTTP and gRPC.
const STREAMS: [&str; 2] = ["/v1/drive", "/troupe.v1.Sessions/Drive"];
/// The last part of paths with answers in parts, over HTTP and gRPC.
const PARTS: [&str; 6] = ["generate", "describe", "replay", "Generate", "Describe", "Replay"];
/// Prefixes of remote procedures' paths.
const RPCS: [&str; 3] = ["/v1/", "/troupe.v1.", "/generate"];
/// Paths for operators and their tools.
const HEALTH: [&str; 3] = ["/healthz", "/readyz", "/metrics"];
/// Path prefix of gRPC's health service.
pub(super) const GRPC_HEALTH: &str = "/grpc.health.v1.Health/";

/// The routes as the edge sees them.
pub(super) const FRONT: Front = Front {
    needed: roles::needed,
    is_rpc: |path| RPCS.iter().any(|start| path.starts_with(start)),
    is_stream: |path| STREAMS.contains(&path),
    is_lasting: |path| STREAMS.contains(&path) || PARTS.iter().any(|end| path.ends_with(end)),
    is_health: |path| HEALTH.contains(&path) || path.starts_with(GRPC_HEALTH),
    ticketed: STREAMS[0],
    answer,
};

fn answer(error: &EdgeError, grpc: bool) -> Response {
    ApiError::from(error.clone()).in_protocol(grpc)
}
