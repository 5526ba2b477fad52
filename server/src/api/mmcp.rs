//! The form of errors on the routes of the Motion Model Context Protocol, for errors of every
//! layer.

use axum::Router;
use axum::extract::Request;
use axum::middleware::{self, Next};
use axum::response::Response;

use super::error::ApiError;

/// Paths of the protocol.
const ROUTES: [&str; 2] = ["/capabilities", "/generate"];

/// Whether a path belongs to the protocol.
fn is_route(path: &str) -> bool {
    ROUTES.contains(&path)
}

/// Adds a layer that puts errors into the protocol's form. It must be outside of all layers that
/// reject requests.
pub(super) fn enveloped(router: Router) -> Router {
    router.layer(middleware::from_fn(envelope))
}

async fn envelope(request: Request, next: Next) -> Response {
    let is_route = is_route(request.uri().path());
    let response = next.run(request).await;
    match is_route {
        true => in_envelope(response),
        false => response,
    }
}

/// Puts an error into the protocol's form. Other answers stay as they are.
fn in_envelope(response: Response) -> Response {
    let error = response.extensions().get::<ApiError>().cloned();
    match error {
        Some(error) => error.in_envelope(response),
        None => response,
    }
}
