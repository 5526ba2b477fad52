//! Ends answers that take long when the credential of their caller ends.

use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};

use axum::body::{Body, HttpBody};
use axum::response::Response;
use bytes::Bytes;
use http_body::{Frame, SizeHint};
use tokio_util::task::AbortOnDropHandle;

use super::admitted::Admitted;
use super::credentials::Credentials;
use super::{EdgeError, Front};

/// How long a caller is admitted: until its key is removed or its token expires.
#[derive(Clone)]
pub struct Lease {
    credentials: Arc<Credentials>,
    holder: Admitted,
}

impl Lease {
    pub(super) fn new(credentials: Arc<Credentials>, holder: Admitted) -> Self {
        Self { credentials, holder }
    }

    /// Waits until the caller is no longer admitted, and says why.
    pub async fn ended(&self) -> EdgeError {
        self.credentials.ended(&self.holder).await
    }

    /// Ends the body of an answer with the lease: over gRPC by a status in the trailers, over HTTP
    /// by the error as a last line. The body is dropped even if its client does not read.
    pub(super) fn limit(self, response: Response, front: Front, grpc: bool) -> Response {
        if response.body().is_end_stream() {
            return response;
        }
        response.map(|inner| {
            let state = Arc::new(Mutex::new(State {
                inner: Some(inner),
                farewell: None,
                reader: None,
            }));
            let shared = state.clone();
            let end = tokio::spawn(async move {
                let error = self.ended().await;
                tracing::debug!(key = %self.holder.identity.name, %error, "a stream ends");
                let farewell = front.turn_away_in(&error, grpc);
                let (inner, reader) = {
                    let mut state = lock(&shared);
                    state.farewell = Some(match grpc {
                        true => Farewell::Trailers(farewell),
                        false => Farewell::Body(farewell.into_body()),
                    });
                    (state.inner.take(), state.reader.take())
                };
                // Outside the lock, because this may end a whole stream.
                drop(inner);
                if let Some(reader) = reader {
                    reader.wake();
                }
            });
            Body::new(Limited {
                state,
                _end: AbortOnDropHandle::new(end),
            })
        })
    }
}

/// The last part of an answer whose lease has ended.
enum Farewell {
    Trailers(Response),
    Body(Body),
    Done,
}

struct State {
    /// None once the lease has ended.
    inner: Option<Body>,
    farewell: Option<Farewell>,
    /// The task that waits for the next part.
    reader: Option<Waker>,
}

fn lock(state: &Mutex<State>) -> MutexGuard<'_, State> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The body of an answer until its lease ends.
struct Limited {
    state: Arc<Mutex<State>>,
    /// The task that waits for the end of the lease.
    _end: AbortOnDropHandle<()>,
}

impl HttpBody for Limited {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let mut state = lock(&self.state);
        if let Some(inner) = &mut state.inner {
            let polled = Pin::new(inner).poll_frame(context);
            if polled.is_pending() {
                state.reader = Some(context.waker().clone());
            }
            return polled;
        }
        match state.farewell.replace(Farewell::Done) {
            Some(Farewell::Trailers(response)) => {
                let (mut parts, _) = response.into_parts();
                parts.headers.remove(http::header::CONTENT_TYPE);
                Poll::Ready(Some(Ok(Frame::trailers(parts.headers))))
            }
            Some(Farewell::Body(mut body)) => {
                let polled = Pin::new(&mut body).poll_frame(context);
                state.farewell = Some(Farewell::Body(body));
                polled
            }
            Some(Farewell::Done) | None => Poll::Ready(None),
        }
    }

    fn is_end_stream(&self) -> bool {
        let state = lock(&self.state);
        state.inner.as_ref().is_some_and(HttpBody::is_end_stream)
    }

    fn size_hint(&self) -> SizeHint {
        SizeHint::default()
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use axum::response::IntoResponse as _;
    use http::{HeaderMap, HeaderValue};
    use tokio::time::timeout;

    use super::*;
    use crate::clients::Role;
    use crate::keys::{self, Keys};

    const FRONT: Front = Front {
        needed: |_, _| Some(Role::Drive),
        is_rpc: |_| false,
        is_stream: |_| false,
        is_lasting: |_| true,
        is_health: |_| false,
        ticketed: "/v1/drive",
        answer: |error, grpc| {
            let mut headers = HeaderMap::new();
            headers.insert("grpc-status", HeaderValue::from_static("16"));
            match grpc {
                true => (headers, "").into_response(),
                false => error.to_string().into_response(),
            }
        },
    };

    /// A body of one part that never ends.
    struct Endless {
        first: Option<Bytes>,
        _alive: Arc<()>,
    }

    impl HttpBody for Endless {
        type Data = Bytes;
        type Error = axum::Error;

        fn poll_frame(
            mut self: Pin<&mut Self>,
            _: &mut Context<'_>,
        ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
            match self.first.take() {
                Some(first) => Poll::Ready(Some(Ok(Frame::data(first)))),
                None => Poll::Pending,
            }
        }
    }

    async fn next(body: &mut Body) -> Option<Frame<Bytes>> {
        let frame = std::future::poll_fn(|context| Pin::new(&mut *body).poll_frame(context));
        frame.await.map(Result::unwrap)
    }

    #[tokio::test(start_paused = true)]
    async fn an_answer_ends_with_the_credential_of_its_caller() {
        let file = keys::entry("a", Role::Drive, "a") + &keys::entry("b", Role::Drive, "b");
        let rest = Keys::read(&keys::entry("b", Role::Drive, "b")).unwrap();
        for grpc in [true, false] {
            let credentials = Credentials::new(Keys::read(&file).unwrap(), Keys::default(), None);
            let credentials = Arc::new(credentials);
            let lease = Lease::new(credentials.clone(), credentials.admit("a").unwrap());
            let alive = Arc::new(());
            let endless = Endless {
                first: Some(Bytes::from_static(b"part")),
                _alive: alive.clone(),
            };
            let response = lease.limit(Response::new(Body::new(endless)), FRONT, grpc);
            let mut body = response.into_body();
            assert_eq!(next(&mut body).await.unwrap().into_data().unwrap(), "part");
            let short = Duration::from_secs(5);
            assert!(timeout(short, next(&mut body)).await.is_err(), "it goes on");
            credentials.replace_keys(rest.clone());
            tokio::time::sleep(Duration::from_millis(1)).await;
            assert_eq!(
                Arc::strong_count(&alive),
                1,
                "the stream ends although its client does not read"
            );
            let last = next(&mut body).await.unwrap();
            match grpc {
                true => assert_eq!(last.into_trailers().unwrap()["grpc-status"], "16"),
                false => assert!(last.into_data().unwrap().starts_with(b"the key was removed")),
            }
            assert!(next(&mut body).await.is_none());
        }
    }
}
