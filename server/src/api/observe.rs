//! What every request gets first: an id, in its answer and on its log lines.

use axum::Router;
use axum::extract::Request;
use axum::middleware::{self, Next};
use axum::response::Response;
use http::{HeaderName, HeaderValue};
use tracing::Instrument as _;

use crate::telemetry::{RequestContext, RequestId};

/// The header of a request's id, in requests and answers.
pub(super) const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// Puts this in front of all routes.
pub(super) fn observed(router: Router) -> Router {
    router.layer(middleware::from_fn(|request, next: Next| {
        with_id(request, |request| next.run(request))
    }))
}

/// Serves a request under an id.
pub(super) async fn with_id<F>(mut request: Request, serve: impl FnOnce(Request) -> F) -> Response
where
    F: Future<Output = Response>,
{
    let given = request.headers().get(REQUEST_ID);
    let id = RequestId::given_or_new(given.map(HeaderValue::as_bytes));
    // An id has only signs that a header may have.
    let header = HeaderValue::from_str(id.as_str());
    if let Ok(header) = &header {
        request.headers_mut().insert(REQUEST_ID, header.clone());
    }
    // The highest level, so that lines of every level show it.
    let span = tracing::error_span!("request", %id);
    let context = RequestContext { id };
    let mut response = context.scope(serve(request)).instrument(span).await;
    if let Ok(header) = header {
        response.headers_mut().insert(REQUEST_ID, header);
    }
    response
}
