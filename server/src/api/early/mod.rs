//! Refuses calls to queues without room before they are read, if their client comes back too early.
//! One answer serves all such calls of a moment.

mod named;

use std::borrow::Cow;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use axum::body::{Body, Bytes, to_bytes};
use axum::response::Response;
use futures_util::FutureExt as _;
use http::{HeaderMap, Method, StatusCode, header};
use troupe_base::turns::ClientId;
use troupe_batch::SubmitError;
use troupe_edge::clients::Client;
use troupe_edge::is_grpc;
use troupe_edge::port::{Early, Head, Refuse};
use troupe_service::{Service, ServiceError};

use super::error::ApiError;
use super::metrics::RequestMetrics;
use crate::mmcp::Failure;

/// Calls that wait in a pack's queue, by their paths.
const CALLS: [(&str, Asked); 7] = [
    ("/troupe.v1.Motion/InBetween", Asked::new("InBetween", Form::Grpc)),
    ("/v1/inbetween", Asked::new("InBetween", Form::Json)),
    ("/troupe.v1.Motion/Generate", Asked::new("Generate", Form::Grpc)),
    ("/v1/generate", Asked::new("Generate", Form::Json)),
    ("/troupe.v1.Motion/Describe", Asked::new("Describe", Form::Grpc)),
    ("/v1/describe", Asked::new("Describe", Form::Json)),
    ("/generate", Asked::new("MmcpGenerate", Form::Mmcp)),
];

/// What a call asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Asked {
    /// The procedure in metrics.
    rpc: &'static str,
    form: Form,
}

/// The form of requests and answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    Grpc,
    Json,
    Mmcp,
}

impl Asked {
    const fn new(rpc: &'static str, form: Form) -> Self {
        Self { rpc, form }
    }

    /// What a call with this head asks for, if its body can be read from the beginning.
    fn of(head: Head<'_>) -> Option<Self> {
        let (_, asked) = CALLS.into_iter().find(|(path, _)| *path == head.path)?;
        let can_be_read = match asked.form {
            Form::Grpc => is_grpc(head.headers),
            Form::Json | Form::Mmcp => {
                head.method == Method::POST && !head.headers.contains_key(header::CONTENT_ENCODING)
            }
        };
        can_be_read.then_some(asked)
    }

    /// The pack that a call is for, as far as the beginning of its body says.
    fn pack(self, begin: &[u8]) -> Option<Cow<'_, str>> {
        match self.form {
            Form::Grpc => named::in_grpc(begin),
            Form::Json => named::in_json(begin, "pack"),
            Form::Mmcp => named::in_json(begin, "model"),
        }
    }

    fn error(self, error: ServiceError) -> ApiError {
        match self.form {
            Form::Grpc | Form::Json => error.into(),
            Form::Mmcp => Failure::from(error).into(),
        }
    }
}

/// How long an answer is used again. Its hint when to come back is as old.
const REUSE: Duration = Duration::from_millis(20);
/// Answers that are kept to be used again.
const MOST_PREPARED: usize = 16;

/// An answer that is used again.
#[derive(Debug)]
struct Prepared {
    made: Instant,
    queue: Box<str>,
    /// The hint when to come back is for these clients.
    group: u64,
    form: Form,
    status: StatusCode,
    headers: HeaderMap,
    body: Bytes,
}

impl Prepared {
    fn new(error: &ApiError, queue: &str, group: u64, form: Form) -> Self {
        let answer = error.in_protocol(form == Form::Grpc);
        let (parts, body) = match form {
            Form::Mmcp => error.in_envelope(answer),
            Form::Grpc | Form::Json => answer,
        }
        .into_parts();
        // The body of an error is in memory, so it can be read at once.
        let body = to_bytes(body, usize::MAX).now_or_never();
        Self {
            made: Instant::now(),
            queue: queue.into(),
            group,
            form,
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

/// Refusals of calls that have only begun.
struct Refusals {
    service: Arc<Service>,
    metrics: RequestMetrics,
    /// The newest answers.
    prepared: Mutex<Vec<Prepared>>,
}

impl Refuse for Refusals {
    fn can_refuse(&self, head: Head<'_>) -> bool {
        // The guard answers the calls of web pages, in a form that they can read.
        !head.headers.contains_key(header::ORIGIN) && Asked::of(head).is_some()
    }

    fn refused(
        &self,
        head: Head<'_>,
        begin: &[u8],
        debtor: &dyn Fn(Option<&str>) -> Option<ClientId>,
    ) -> Option<Response> {
        let begun = Instant::now();
        let asked = Asked::of(head)?;
        let any = debtor(None)?;
        let named = asked.pack(begin);
        let queue = named.as_deref().map(queue_of);
        let (client, error) = match queue {
            Some(queue) => {
                let client = debtor(Some(queue))?;
                (client, self.service.refusal_of(queue, client)?)
            }
            // It may be for any pack.
            None => (any, self.service.refusal_of_all(any)?),
        };
        let queue = queue.unwrap_or_default();
        let mut prepared = self.prepared.lock().unwrap_or_else(PoisonError::into_inner);
        prepared.retain(|answer| begun.duration_since(answer.made) < REUSE);
        let fits = |answer: &&Prepared| {
            *answer.queue == *queue && answer.group == client.group && answer.form == asked.form
        };
        let response = match prepared.iter().find(fits) {
            Some(answer) => answer.response(),
            None => {
                let new = Prepared::new(&asked.error(error), queue, client.group, asked.form);
                let response = new.response();
                if prepared.len() < MOST_PREPARED {
                    prepared.push(new);
                }
                response
            }
        };
        drop(prepared);
        self.metrics
            .answered(asked.rpc, "RESOURCE_EXHAUSTED", begun.elapsed());
        Some(response)
    }
}

/// The refusal of calls to queues that have no room.
pub(super) fn refusals(service: &Arc<Service>) -> Early {
    Early::new(Refusals {
        service: service.clone(),
        metrics: RequestMetrics::new(service.telemetry()),
        prepared: Mutex::default(),
    })
}

/// The pack of a queue, by the name of a pack or of a model of MMCP, which may end with a body's.
fn queue_of(named: &str) -> &str {
    named.split_once('/').map_or(named, |(pack, _)| pack)
}

/// Notes that a client has a debt if the queue of `pack` refused its call with `error`.
pub(super) fn note(client: Option<&Arc<Client>>, pack: &str, error: Option<&ServiceError>) {
    if let (Some(client), Some(ServiceError::Batch(SubmitError::QueueFull { retry_after, .. }))) =
        (client, error)
    {
        client.owes(queue_of(pack), *retry_after);
    }
}
