//! Time limit and metrics of every remote procedure, over gRPC and HTTP.

use std::collections::HashMap;
use std::error::Error as _;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::{Duration, Instant};

use axum::body::Body;
use axum::extract::{MatchedPath, Request, State};
use axum::middleware::Next;
use axum::response::{IntoResponse as _, Response};
use bytes::Bytes;
use http::Method;
use http_body::{Frame, SizeHint};
use http_body_util::LengthLimitError;
use tonic::Status;
use troupe_base::telemetry::KeyValue;
use troupe_proto::rpc::RPCS;
use utoipa::openapi::{OpenApi, PathItem};

use super::ApiLimits;
use super::error::{ApiError, CodeLabel};
use super::metrics::RequestMetrics;
use super::shape::{Shape, Shapes};
use troupe_base::telemetry::{RequestContext, Trace};
use troupe_service::Service;

/// Codes of failures of the server.
const FAULTS: [&str; 3] = ["INTERNAL", "UNAVAILABLE", "UNKNOWN"];

/// The state of the middleware.
#[derive(Clone)]
pub(super) struct Tracker {
    metrics: RequestMetrics,
    timeout: Duration,
    max_message_bytes: usize,
    shapes: Shapes,
}

impl Tracker {
    pub(super) fn new(service: &Service, limits: &ApiLimits) -> Self {
        Self {
            metrics: RequestMetrics::new(service.telemetry()),
            timeout: limits.timeout,
            max_message_bytes: limits.message_bytes,
            shapes: Shapes::new(limits),
        }
    }
}

/// Records the answer when dropped, so a caller who leaves early is counted too.
struct Note<'a> {
    metrics: &'a RequestMetrics,
    rpc: &'static str,
    code: &'static str,
    arrived: Instant,
    trace: Option<Trace>,
}

impl<'a> Note<'a> {
    /// Starts the record of a request for this procedure.
    fn begin(metrics: &'a RequestMetrics, rpc: &'static str) -> Self {
        let trace = RequestContext::current_trace();
        if let Some(trace) = &trace {
            trace.of_rpc(rpc);
        }
        Self {
            metrics,
            rpc,
            code: "CANCELLED",
            arrived: Instant::now(),
            trace,
        }
    }

    /// Passes the answer on. Its trace ends when it is sent.
    fn reply(&self, response: Response) -> Response {
        let Some(trace) = &self.trace else {
            return response;
        };
        let sending = Sending {
            trace: trace.clone(),
            begun: Instant::now(),
        };
        response.map(|body| {
            Body::new(Reply {
                body,
                _sending: sending,
            })
        })
    }
}

impl Drop for Note<'_> {
    fn drop(&mut self) {
        self.metrics.answered(self.rpc, self.code, self.arrived.elapsed());
        if let Some(trace) = &self.trace {
            trace.note(KeyValue::new("code", self.code));
            if FAULTS.contains(&self.code) {
                trace.failed(self.code);
            }
        }
    }
}

/// The body of a traced answer.
struct Reply {
    body: Body,
    _sending: Sending,
}

struct Sending {
    trace: Trace,
    begun: Instant,
}

impl Drop for Sending {
    fn drop(&mut self) {
        self.trace.part("reply", self.begun, Instant::now(), Vec::new());
    }
}

impl http_body::Body for Reply {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        Pin::new(&mut self.body).poll_frame(context)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

/// Runs an HTTP handler within the time limit.
pub(super) async fn http(
    State((tracker, rpcs)): State<(Arc<Tracker>, Arc<HttpRpcs>)>,
    request: Request,
    next: Next,
) -> Response {
    let path = request.extensions().get::<MatchedPath>();
    let rpc = path.map_or("unknown", |path| rpcs.of(request.method(), path.as_str()));
    let mut note = Note::begin(&tracker.metrics, rpc);
    let response = match tokio::time::timeout(tracker.timeout, next.run(request)).await {
        Ok(response) => response,
        Err(_) => ApiError::DeadlineExceeded(tracker.timeout).into_response(),
    };
    note.code = code_of(&response);
    note.reply(response)
}

/// Finds the remote procedure of an HTTP route.
pub(super) struct HttpRpcs(HashMap<String, PathItem>);

impl HttpRpcs {
    /// The procedures of all documented routes.
    pub(super) fn new(document: OpenApi) -> Self {
        Self(document.paths.paths.into_iter().collect())
    }

    /// The procedure's name in metrics.
    fn of(&self, method: &Method, path: &str) -> &'static str {
        let named = || {
            let PathItem {
                get,
                put,
                post,
                delete,
                ..
            } = self.0.get(path)?;
            let exact = match *method {
                Method::PUT => put,
                Method::POST => post,
                Method::DELETE => delete,
                _ => get,
            };
            // A method that the path does not have counts as one that it has.
            let operation = [exact, get, put, post, delete].into_iter().flatten().next()?;
            operation.operation_id.as_deref()
        };
        known(named().unwrap_or_default())
    }
}

/// Operations over HTTP that are in no gRPC service.
const HTTP_ONLY: [&str; 2] = ["MmcpCapabilities", "MmcpGenerate"];

/// The remote procedure of this name.
fn known(name: &str) -> &'static str {
    let mut names = RPCS.iter().map(|rpc| rpc.name).chain(HTTP_ONLY);
    names.find(|known| *known == name).unwrap_or("unknown")
}

/// The procedure that a gRPC path names.
fn grpc_rpc(path: &str) -> &'static str {
    known(path.rsplit('/').next().unwrap_or_default())
}

/// The code of an HTTP answer. Only a success may lack one.
fn code_of(response: &Response) -> &'static str {
    match response.extensions().get::<CodeLabel>() {
        Some(label) => label.0,
        // The switch to a WebSocket counts as an answer.
        None if response.status().is_success() || response.status().is_informational() => "OK",
        None => "UNKNOWN",
    }
}

/// Runs a gRPC handler within the server's time limit, or the caller's if that is shorter. The gRPC
/// library makes statuses of its own for requests that it cannot read. They become statuses of
/// [`ApiError`].
pub(super) async fn grpc(State(tracker): State<Arc<Tracker>>, request: Request, next: Next) -> Response {
    let rpc = grpc_rpc(request.uri().path());
    let asked = request
        .headers()
        .get("grpc-timeout")
        .and_then(|value| grpc_timeout(value.to_str().ok()?));
    let limit = asked.map_or(tracker.timeout, |asked| asked.min(tracker.timeout));
    let mut note = Note::begin(&tracker.metrics, rpc);
    let handled = async {
        // A stream has no end to wait for.
        let shape = tracker.shapes.of(rpc).filter(|_| rpc != "Drive");
        let request = match shape {
            Some(shape) => screened(request, shape, tracker.max_message_bytes).await?,
            None => request,
        };
        Ok(next.run(request).await)
    };
    let response = match tokio::time::timeout(limit, handled).await {
        Ok(Ok(response)) => response,
        Ok(Err(error)) => ApiError::status(&error).into_http(),
        Err(_) => ApiError::DeadlineExceeded(limit).status().into_http(),
    };
    let error = match response.extensions().get::<Status>() {
        Some(status) => ApiError::of_status(status, tracker.max_message_bytes),
        // For an unknown method the library sets the header, but no status.
        None if response.headers().contains_key(Status::GRPC_STATUS) => {
            ApiError::Unimplemented("there is no such method".to_owned())
        }
        None => {
            note.code = "OK";
            return note.reply(response);
        }
    };
    note.code = error.label();
    note.reply(error.status().into_http())
}

/// Reads the single message of a request and checks its shape before decoding.
async fn screened(request: Request, shape: &Shape, limit_bytes: usize) -> Result<Request, ApiError> {
    let (parts, body) = request.into_parts();
    // The frame header comes before the message.
    let frame = axum::body::to_bytes(body, limit_bytes.saturating_add(5))
        .await
        .map_err(|error| {
            let too_large = error
                .source()
                .is_some_and(|source| source.is::<LengthLimitError>());
            match too_large {
                true => ApiError::TooLarge { limit_bytes },
                false => ApiError::Truncated {
                    problem: "it is shorter than announced".to_owned(),
                    limit_bytes,
                },
            }
        })?;
    shape.check_grpc(&frame)?;
    Ok(Request::from_parts(parts, frame.into()))
}

/// Reads the `grpc-timeout` header: at most eight digits and a unit.
fn grpc_timeout(value: &str) -> Option<Duration> {
    let unit = value.chars().last()?;
    let digits = value.strip_suffix(unit)?;
    if digits.is_empty() || digits.len() > 8 || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let amount: u64 = digits.parse().ok()?;
    match unit {
        'H' => Some(Duration::from_secs(amount * 3600)),
        'M' => Some(Duration::from_secs(amount * 60)),
        'S' => Some(Duration::from_secs(amount)),
        'm' => Some(Duration::from_millis(amount)),
        'u' => Some(Duration::from_micros(amount)),
        'n' => Some(Duration::from_nanos(amount)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_success_without_a_code_is_ok() {
        assert_eq!(code_of(&"fine".into_response()), "OK");
        let upgraded = http::StatusCode::SWITCHING_PROTOCOLS.into_response();
        assert_eq!(code_of(&upgraded), "OK");
        assert_eq!(
            code_of(&http::StatusCode::NOT_ACCEPTABLE.into_response()),
            "UNKNOWN"
        );
        let error = ApiError::WrongMethod("PUT".to_owned()).into_response();
        assert_eq!(code_of(&error), "METHOD_NOT_ALLOWED");
    }

    #[test]
    fn grpc_timeouts_follow_the_specification() {
        assert_eq!(grpc_timeout("250m"), Some(Duration::from_millis(250)));
        assert_eq!(grpc_timeout("2H"), Some(Duration::from_secs(7200)));
        assert_eq!(grpc_timeout("99999999n"), Some(Duration::from_nanos(99_999_999)));
        for bad in ["", "m", "5", "5x", "-5m", "123456789m", "5é"] {
            assert_eq!(grpc_timeout(bad), None, "{bad}");
        }
    }
}
