//! Connections beyond the limit: only health checks and metrics are answered there.

use axum::Router;
use axum::extract::{Request, State};
use axum::middleware::{self, Next};
use axum::response::Response;
use http::{HeaderValue, Version, header};

use super::observe::with_id;
use super::{EdgeError, Front};

/// `router` for connections beyond the limit. It answers health checks and metrics, refuses all
/// other requests, and closes the connection.
pub fn reserve(router: Router, front: Front) -> Router {
    router.layer(middleware::from_fn_with_state(front, answer))
}

async fn answer(State(front): State<Front>, request: Request, next: Next) -> Response {
    let version = request.version();
    let mut response = match (front.is_health)(request.uri().path()) {
        true => next.run(request).await,
        false => {
            with_id(request, None, async |request| {
                front.turn_away(&EdgeError::NoConnection, request.headers())
            })
            .await
        }
    };
    // HTTP/2 has no such header. Its connections are closed when they are idle.
    if version < Version::HTTP_2 {
        response
            .headers_mut()
            .insert(header::CONNECTION, HeaderValue::from_static("close"));
    }
    response
}
