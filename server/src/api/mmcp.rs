//! What the routes of the Motion Model Context Protocol have of their own: the form of errors,
//! wherever they come from.

use axum::Router;
use axum::extract::Request;
use axum::middleware::{self, Next};
use axum::response::Response;

use super::error::ApiError;

/// Its routes.
const ROUTES: [&str; 2] = ["/capabilities", "/generate"];

/// Whether a path is one of the protocol's.
fn is_route(path: &str) -> bool {
    ROUTES.contains(&path)
}

/// Puts this in front of all that may refuse a request.
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

/// An error in the protocol's form; other answers as they are.
fn in_envelope(response: Response) -> Response {
    let error = response.extensions().get::<ApiError>().cloned();
    match error {
        Some(error) => error.in_envelope(response),
        None => response,
    }
}
