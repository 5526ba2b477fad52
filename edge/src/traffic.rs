//! Memory of requests and answers in transfer. It counts for their client. An answer that its
//! client does not read is dropped after a while.

use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, Weak};
use std::task::{Context, Poll};
use std::time::{Duration, Instant};

use axum::Router;
use axum::body::Body;
use axum::extract::{Request, State};
use axum::middleware::{self, Next};
use axum::response::Response;
use bytes::{Buf as _, Bytes};
use http_body::{Body as _, Frame, SizeHint};
use tokio_util::task::AbortOnDropHandle;

use super::clients::{Client, Clients, Exhausted, Memory};
use super::{EdgeError, Front, is_grpc};
use troupe_base::telemetry::{Counter, Labels, Metric, Telemetry};

/// Answers up to this size, in bytes, are not counted: an open call takes more.
const UNCOUNTED_BYTES: usize = 1 << 10;
/// Bytes of a piece of an answer.
const PIECE_BYTES: usize = 64 << 10;

const RECEIVED: Metric = Metric::new(
    "troupe_request_body_bytes_total",
    "Bytes of request bodies, without live streams",
);
const SENT: Metric = Metric::new(
    "troupe_answer_body_bytes_total",
    "Bytes of answer bodies, without live streams",
);

/// State of the middleware.
#[derive(Clone)]
struct Traffic {
    clients: Arc<Clients>,
    front: Front,
    /// How long an answer may wait for its reader.
    write_timeout: Duration,
    /// Bytes of request bodies.
    received: Counter,
    /// Bytes of answer bodies.
    sent: Counter,
}

/// Counts the memory of requests and their answers. An answer waits for its reader for at most
/// `write_timeout`.
pub fn counted(
    router: Router,
    front: Front,
    clients: Arc<Clients>,
    write_timeout: Duration,
    telemetry: &Telemetry,
) -> Router {
    let counter = |metric| telemetry.counter(metric, &Labels::default());
    let traffic = Traffic {
        clients,
        front,
        write_timeout,
        received: counter(&RECEIVED),
        sent: counter(&SENT),
    };
    router.layer(middleware::from_fn_with_state(traffic, count))
}

/// Memory that was taken before the answer was made. The answer carries it as an extension.
#[derive(Debug, Clone)]
pub struct Reserved(Arc<Mutex<Option<Memory>>>);

impl Reserved {
    fn new(memory: Memory) -> Self {
        Self(Arc::new(Mutex::new(Some(memory))))
    }

    fn take(&self) -> Option<Memory> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// Copies of the numbers of a `Step` answer that exist at the same time: the message and its bytes.
pub const COPIES_AS_PROTOBUF: usize = 2;
/// As [`COPIES_AS_PROTOBUF`], but a number as text is about three times as long.
pub const COPIES_AS_JSON: usize = 4;

/// Takes the memory for an answer of this size before it is made. None for a small answer.
///
/// # Errors
/// [`Exhausted`] if there is not enough.
pub fn reserve(client: Option<&Arc<Client>>, bytes: usize) -> Result<Option<Reserved>, Exhausted> {
    match client {
        Some(client) if bytes > UNCOUNTED_BYTES => Ok(Some(Reserved::new(client.memory(bytes)?))),
        _ => Ok(None),
    }
}

/// The middleware: counts the memory of a request and its answer.
async fn count(State(traffic): State<Traffic>, mut request: Request, next: Next) -> Response {
    let client = request.extensions().get::<Arc<Client>>().cloned();
    let client = client.unwrap_or_else(|| traffic.clients.within());
    request.extensions_mut().insert(client.clone());
    let grpc = is_grpc(request.headers());
    // The queue shares by client, so calls run in its scope.
    let turns = client.turns();
    if (traffic.front.is_stream)(request.uri().path()) {
        return turns.scope(next.run(request)).await;
    }
    let refused = Arc::new(OnceLock::new());
    let memory = Arc::new(Mutex::new(client.no_memory()));
    let request = request.map(|inner| {
        Body::new(Counted {
            inner,
            memory: Arc::downgrade(&memory),
            refused: refused.clone(),
            received: traffic.received.clone(),
        })
    });
    let response = turns.scope(next.run(request)).await;
    drop(memory);
    if let Some(error) = refused.get() {
        return traffic.front.turn_away_in(&EdgeError::from(error.clone()), grpc);
    }
    match hold(&client, response, &traffic).await {
        Ok(response) => response,
        Err(error) => traffic.front.turn_away_in(&EdgeError::from(error), grpc),
    }
}

/// Counts the memory of an answer until it is sent or dropped.
async fn hold(
    client: &Arc<Client>,
    mut response: Response,
    traffic: &Traffic,
) -> Result<Response, Exhausted> {
    let reserved = response.extensions_mut().remove::<Option<Reserved>>();
    let mut memory = reserved.flatten().and_then(|reserved| reserved.take());
    let size = response.body().size_hint().exact();
    // The connection takes the body only as fast as its client reads, and a gRPC answer that waits
    // in it has no known size. Its first part counts now.
    let first = match size {
        Some(_) => None,
        None => at_once(response.body_mut()).await,
    };
    let made = first.as_ref().and_then(|first| first.as_ref().ok()?.data_ref());
    let made = size.or(made.map(|data| data.len() as u64));
    if memory.is_none()
        && let Some(made) = made.filter(|&made| made > UNCOUNTED_BYTES as u64)
    {
        memory = Some(client.memory(usize::try_from(made).unwrap_or(usize::MAX))?);
    }
    if memory.is_none()
        && let Some(size) = size
    {
        traffic.sent.increment(size);
        return Ok(response);
    }
    Ok(response.map(|inner| {
        let held = Arc::new(Mutex::new(Held {
            answer: Some(inner),
            first,
            piece: Bytes::new(),
            memory,
            waits_since: Some(Instant::now()),
        }));
        let watch = tokio::spawn(watch(Arc::downgrade(&held), traffic.write_timeout));
        Body::new(Outgoing {
            held,
            _watch: AbortOnDropHandle::new(watch),
            client: client.clone(),
            size: size.map(SizeHint::with_exact),
            sent: traffic.sent.clone(),
        })
    }))
}

/// The first part of a body, if it is there.
async fn at_once(body: &mut Body) -> Option<Result<Frame<Bytes>, axum::Error>> {
    let first = std::future::poll_fn(|context| Poll::Ready(Pin::new(&mut *body).poll_frame(context)));
    match first.await {
        Poll::Ready(Some(first)) => Some(first),
        Poll::Ready(None) => {
            // A body must not be polled after its end.
            *body = Body::empty();
            None
        }
        Poll::Pending => None,
    }
}

/// The body of a request, which counts its bytes as they come.
struct Counted {
    inner: Body,
    memory: Weak<Mutex<Memory>>,
    refused: Arc<OnceLock<Exhausted>>,
    received: Counter,
}

impl http_body::Body for Counted {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let polled = Pin::new(&mut self.inner).poll_frame(context);
        if let Poll::Ready(Some(Ok(frame))) = &polled
            && let Some(data) = frame.data_ref()
            && let Some(memory) = self.memory.upgrade()
        {
            self.received.increment(data.len() as u64);
            let grown = lock(&memory).grow(data.len());
            if let Err(error) = grown {
                let message = axum::Error::new(error.clone());
                // The first error is kept.
                let _ = self.refused.set(error);
                return Poll::Ready(Some(Err(message)));
            }
        }
        polled
    }

    fn is_end_stream(&self) -> bool {
        self.inner.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.inner.size_hint()
    }
}

/// An answer that is not sent completely.
struct Held {
    /// None once it was dropped.
    answer: Option<Body>,
    /// The first part, if it was there when the answer began.
    first: Option<Result<Frame<Bytes>, axum::Error>>,
    /// The unsent rest of the last piece.
    piece: Bytes,
    memory: Option<Memory>,
    /// Since when the answer waits for its client; none while the client reads.
    waits_since: Option<Instant>,
}

/// Drops an answer if its client has read nothing of it for `limit`.
async fn watch(held: Weak<Mutex<Held>>, limit: Duration) {
    loop {
        tokio::time::sleep(limit / 4).await;
        let Some(held) = held.upgrade() else {
            return;
        };
        let given_up = {
            let mut held = lock(&held);
            match held.waits_since {
                Some(since) if since.elapsed() >= limit => {
                    held.piece = Bytes::new();
                    held.first = None;
                    Some((held.answer.take(), held.memory.take()))
                }
                _ => None,
            }
        };
        if given_up.is_some() {
            return tracing::debug!("an answer was dropped because its client did not read it");
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The body of an answer, in small pieces.
struct Outgoing {
    held: Arc<Mutex<Held>>,
    /// The task of [`watch`]; ends with the answer.
    _watch: AbortOnDropHandle<()>,
    client: Arc<Client>,
    /// The exact size, if it is known.
    size: Option<SizeHint>,
    sent: Counter,
}

impl http_body::Body for Outgoing {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let this = self.get_mut();
        let mut held = lock(&this.held);
        let held = &mut *held;
        // The client reads, because the connection asks for the next piece.
        held.waits_since = None;
        if !held.piece.has_remaining() {
            let Some(answer) = held.answer.as_mut() else {
                let error = std::io::Error::other("the answer was not read in time");
                return Poll::Ready(Some(Err(axum::Error::new(error))));
            };
            let next = match held.first.take() {
                Some(first) => Some(first),
                None => std::task::ready!(Pin::new(answer).poll_frame(context)),
            };
            let frame = match next {
                Some(Ok(frame)) => frame,
                ended => return Poll::Ready(ended),
            };
            match frame.into_data() {
                Ok(data) => held.piece = data,
                Err(other) => return Poll::Ready(Some(Ok(other))),
            }
            if held.memory.is_none() && held.piece.len() > UNCOUNTED_BYTES {
                held.memory = match this.client.memory(held.piece.len()) {
                    Ok(memory) => Some(memory),
                    Err(error) => {
                        held.answer = None;
                        held.piece = Bytes::new();
                        return Poll::Ready(Some(Err(axum::Error::new(error))));
                    }
                };
            }
        }
        let length = held.piece.len().min(PIECE_BYTES);
        let piece = held.piece.split_to(length);
        held.waits_since = Some(Instant::now());
        this.sent.increment(length as u64);
        Poll::Ready(Some(Ok(Frame::data(piece))))
    }

    fn is_end_stream(&self) -> bool {
        let held = lock(&self.held);
        held.first.is_none()
            && !held.piece.has_remaining()
            && held.answer.as_ref().is_some_and(http_body::Body::is_end_stream)
    }

    fn size_hint(&self) -> SizeHint {
        self.size.unwrap_or_default()
    }
}
