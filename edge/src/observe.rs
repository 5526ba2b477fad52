//! The first middleware: gives every request an id and a trace, and counts refused requests.

use std::sync::Arc;

use axum::Router;
use axum::extract::{Request, State};
use axum::middleware::{self, Next};
use axum::response::Response;
use http::{HeaderName, HeaderValue};
use tracing::Instrument as _;
use troupe_base::telemetry::KeyValue;

use super::Front;
use super::clients::Client;
use super::refusals::Refusals;
use troupe_base::telemetry::{RequestContext, RequestId, Telemetry, Traces};

/// The header of a request's id, in requests and answers.
pub(crate) const REQUEST_ID: HeaderName = HeaderName::from_static("x-request-id");

/// State of the middleware.
#[derive(Clone)]
struct Observer {
    telemetry: Telemetry,
    refusals: Refusals,
    front: Front,
}

/// Puts the middleware in front of all routes.
pub fn observed(router: Router, front: Front, telemetry: &Telemetry) -> Router {
    let observer = Observer {
        telemetry: telemetry.clone(),
        refusals: Refusals::new(telemetry),
        front,
    };
    router.layer(middleware::from_fn_with_state(observer, observe))
}

async fn observe(State(observer): State<Observer>, request: Request, next: Next) -> Response {
    let client = request.extensions().get::<Arc<Client>>();
    let address = client.map(|client| client.address());
    let is_rpc = (observer.front.is_rpc)(request.uri().path());
    let traces = observer.telemetry.traces().filter(|_| is_rpc);
    with_id(request, traces, async |request| {
        let response = next.run(request).await;
        if let Some(refusal) = response.extensions().get() {
            observer.refusals.note(*refusal, address);
        }
        response
    })
    .await
}

/// Serves a request under an id, and traces it if `traces` are given.
pub(super) async fn with_id<F>(
    mut request: Request,
    traces: Option<&Traces>,
    serve: impl FnOnce(Request) -> F,
) -> Response
where
    F: Future<Output = Response>,
{
    let given = request.headers().get(REQUEST_ID);
    let id = RequestId::given_or_new(given.map(HeaderValue::as_bytes));
    // Ids only have characters that are allowed in headers, so this does not fail.
    let header = HeaderValue::from_str(id.as_str());
    if let Ok(header) = &header {
        request.headers_mut().insert(REQUEST_ID, header.clone());
    }
    let trace = traces.and_then(|traces| traces.request(request.headers()));
    if let Some(trace) = &trace {
        trace.note(KeyValue::new("request.id", id.to_string()));
    }
    let trace_id = trace.as_ref().map(|trace| tracing::field::display(trace.id()));
    // The highest level, so that log lines of every level carry the span.
    let span = tracing::error_span!("request", %id, trace_id);
    let context = RequestContext { id, trace };
    let mut response = context.scope(serve(request)).instrument(span).await;
    if let Ok(header) = header {
        response.headers_mut().insert(REQUEST_ID, header);
    }
    response
}
