//! Limits the size of a request's headers.
//!
//! The HTTP library has limits too (`port/connections.rs`), but it refuses with an empty answer. So
//! its limits are higher than this one.

use axum::Router;
use axum::extract::{Request, State};
use axum::middleware::{self, Next};
use axum::response::Response;

use super::{EdgeError, Front, MAX_HEAD_BYTES};

/// Bytes that each header counts in addition to its name and value, as in HTTP/2 (RFC 9113, section
/// 6.5.2).
const HEADER_BYTES: usize = 32;

/// Refuses requests with too large headers in front of all routes.
pub fn limited(router: Router, front: Front) -> Router {
    router.layer(middleware::from_fn_with_state(front, check))
}

async fn check(State(front): State<Front>, request: Request, next: Next) -> Response {
    let found_bytes = head_bytes(&request);
    match found_bytes <= MAX_HEAD_BYTES {
        true => next.run(request).await,
        false => front.turn_away(&EdgeError::HeadersTooLarge { found_bytes }, request.headers()),
    }
}

fn head_bytes(request: &Request) -> usize {
    let path = request
        .uri()
        .path_and_query()
        .map_or(0, |path| path.as_str().len());
    let headers = request
        .headers()
        .iter()
        .map(|(name, value)| name.as_str().len() + value.len() + HEADER_BYTES);
    path + headers.sum::<usize>()
}
