//! Refuses calls of InBetween at their head, if their client comes back too early and no pack has
//! room for it. One answer serves all such calls of a moment.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use axum::body::{Body, Bytes, to_bytes};
use axum::response::Response;
use futures_util::FutureExt as _;
use http::{HeaderMap, Method, StatusCode};
use troupe_batch::SubmitError;
use troupe_edge::clients::{Client, Debt};
use troupe_edge::is_grpc;
use troupe_edge::port::{Early, Head};
use troupe_proto::v1;
use troupe_service::{Service, ServiceError};

use super::error::ApiError;
use super::metrics::RequestMetrics;

/// The procedure in metrics.
const RPC: &str = "InBetween";
const GRPC_PATH: &str = "/troupe.v1.Motion/InBetween";
const HTTP_PATH: &str = "/v1/inbetween";
/// How long an answer is used again. Its hint when to come back is as old.
const REUSE: Duration = Duration::from_millis(20);

/// An answer that is used again.
#[derive(Debug)]
struct Prepared {
    made: Instant,
    queue: Arc<str>,
    /// The hint when to come back is for these clients.
    group: u64,
    status: StatusCode,
    headers: HeaderMap,
    body: Bytes,
}

impl Prepared {
    fn new(error: &ApiError, queue: &Arc<str>, group: u64, grpc: bool) -> Self {
        let (parts, body) = error.in_protocol(grpc).into_parts();
        // The body of an error is in memory, so it can be read at once.
        let body = to_bytes(body, usize::MAX).now_or_never();
        Self {
            made: Instant::now(),
            queue: queue.clone(),
            group,
            status: parts.status,
            headers: parts.headers,
            body: body.and_then(Result::ok).unwrap_or_default(),
        }
    }

    fn response(&self) -> Response {
        let mut response = Response::new(match self.body.is_empty() {
            true => Body::empty(),
            false => Body::from(self.body.clone()),
        });
        *response.status_mut() = self.status;
        *response.headers_mut() = self.headers.clone();
        response
    }
}

/// Refusals at the head of calls.
struct Refusals {
    service: Arc<Service>,
    metrics: RequestMetrics,
    /// The last answers, over HTTP and over gRPC.
    prepared: [Mutex<Option<Prepared>>; 2],
}

impl Refusals {
    fn refuse(&self, debt: &Debt, head: Head<'_>) -> Option<Response> {
        let grpc = match head.path {
            GRPC_PATH => is_grpc(head.headers),
            HTTP_PATH if head.method == Method::POST => false,
            _ => return None,
        };
        let asked = Instant::now();
        let error = self.service.refusal_of(&debt.queue, debt.client)?;
        let mut last = self.prepared[usize::from(grpc)]
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let group = debt.client.group;
        let fits = |last: &Prepared| {
            last.queue == debt.queue && last.group == group && asked.duration_since(last.made) < REUSE
        };
        if !last.as_ref().is_some_and(fits) {
            *last = Some(Prepared::new(&ApiError::from(error), &debt.queue, group, grpc));
        }
        let response = last.as_ref().map(Prepared::response);
        drop(last);
        self.metrics.answered(RPC, "RESOURCE_EXHAUSTED", asked.elapsed());
        response
    }
}

/// The refusal of calls to queues that have no room.
pub(super) fn refusals(service: &Arc<Service>) -> Early {
    let refusals = Refusals {
        service: service.clone(),
        metrics: RequestMetrics::new(service.telemetry()),
        prepared: Default::default(),
    };
    Early::new(move |debt, head| refusals.refuse(debt, head))
}

/// `troupe.v1.Motion/InBetween`. A client whose call the queue refuses has a debt.
///
/// # Errors
/// [`ServiceError`], for the whole request.
pub(super) async fn in_between(
    service: &Service,
    client: Option<&Arc<Client>>,
    request: v1::InBetweenRequest,
) -> Result<v1::InBetweenResponse, ServiceError> {
    let pack = request.pack.clone();
    let answer = service.in_between(request).await;
    if let (Err(ServiceError::Batch(SubmitError::QueueFull { retry_after, .. })), Some(client)) =
        (&answer, client)
    {
        client.owes(&pack, *retry_after);
    }
    answer
}
