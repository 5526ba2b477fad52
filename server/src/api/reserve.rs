//! What is answered on connections beyond the limit: whether the server is well.

use axum::Router;
use axum::extract::Request;
use axum::middleware::{self, Next};
use axum::response::Response;
use http::{HeaderValue, Version, header};

use super::error::ApiError;
use super::mmcp;
use super::observe::with_id;

/// Paths that operators and their tools ask.
const HEALTH: [&str; 3] = ["/healthz", "/readyz", "/metrics"];
/// gRPC's health service.
pub(super) const GRPC_HEALTH: &str = "/grpc.health.v1.Health/";

/// `router` for connections beyond the limit: health checks and metrics are answered, all else is
/// refused, and the connection is closed.
pub fn reserve(router: Router) -> Router {
    router.layer(middleware::from_fn(answer))
}

async fn answer(request: Request, next: Next) -> Response {
    let path = request.uri().path();
    let is_mmcp = mmcp::is_route(path);
    let version = request.version();
    let mut response = match HEALTH.contains(&path) || path.starts_with(GRPC_HEALTH) {
        true => next.run(request).await,
        false => {
            with_id(request, None, async |request| {
                ApiError::NoConnection.in_kind(request.headers())
            })
            .await
        }
    };
    if is_mmcp {
        response = mmcp::in_envelope(response);
    }
    // HTTP/2 has no such header; its connections are closed when they are idle.
    if version < Version::HTTP_2 {
        response
            .headers_mut()
            .insert(header::CONNECTION, HeaderValue::from_static("close"));
    }
    response
}
