//! Refuses calls of clients with a debt by the beginning of the request, before the rest of it is
//! read or anything decoded.

use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::body::HttpBody;
use axum::response::Response;
use bytes::Bytes;
use http::request::Parts;
use http::{HeaderMap, HeaderValue, Method, header};
use http_body::{Frame, SizeHint};
use troupe_base::turns::ClientId;

use crate::clients::Client;
use crate::observe::REQUEST_ID;
use troupe_base::telemetry::RequestId;

/// How long the beginning of a body may take. Then the call goes on, and the usual limits of time
/// hold.
const BEGIN_TIMEOUT: Duration = Duration::from_millis(100);

/// The head of a call.
#[derive(Debug, Clone, Copy)]
pub struct Head<'a> {
    /// POST for every remote procedure.
    pub method: &'a Method,
    /// Its path, without the query.
    pub path: &'a str,
    /// With the credential, and over gRPC the content type.
    pub headers: &'a HeaderMap,
}

impl<'a> Head<'a> {
    fn new(parts: &'a Parts) -> Self {
        Self {
            method: &parts.method,
            path: parts.uri.path(),
            headers: &parts.headers,
        }
    }
}

/// Refuses calls whose queue still has no room.
pub trait Refuse: Send + Sync {
    /// Whether calls with this head can be refused.
    fn can_refuse(&self, head: Head<'_>) -> bool;

    /// The answer to a call that is refused. None: the call goes on. `begin` is the beginning of
    /// its body; `debtor` says who owes something to a queue, or to any, if the caller does.
    fn refused(
        &self,
        head: Head<'_>,
        begin: &[u8],
        debtor: &dyn Fn(Option<&str>) -> Option<ClientId>,
    ) -> Option<Response>;
}

/// The refusal of calls whose clients have a debt.
#[derive(Clone)]
pub struct Early(Arc<dyn Refuse>);

impl Early {
    /// Refuses what `refuse` does.
    pub fn new(refuse: impl Refuse + 'static) -> Self {
        Self(Arc::new(refuse))
    }

    /// Whether a call must begin before it is known if it goes on.
    pub(super) fn looks_at(&self, parts: &Parts, client: &Client) -> bool {
        !client.debts().is_empty() && self.0.can_refuse(Head::new(parts))
    }

    /// The answer to a call that is refused. Only its header has the request's id.
    pub(super) fn refused(&self, parts: &Parts, begin: &[u8], client: &Client) -> Option<Response> {
        let authorization = parts.headers.get(header::AUTHORIZATION);
        let debtor = |queue: Option<&str>| client.debtor(authorization, queue);
        let mut response = self.0.refused(Head::new(parts), begin, &debtor)?;
        let given = parts.headers.get(REQUEST_ID).map(HeaderValue::as_bytes);
        if let Ok(id) = HeaderValue::from_str(RequestId::given_or_new(given).as_str()) {
            response.headers_mut().insert(REQUEST_ID, id);
        }
        Some(response)
    }
}

/// A body whose first frame may have been read.
pub(super) struct Begun<B: HttpBody> {
    first: Option<Result<Frame<B::Data>, B::Error>>,
    rest: B,
}

impl<B: HttpBody<Data = Bytes> + Unpin> Begun<B> {
    /// None of it is read.
    pub(super) fn unread(rest: B) -> Self {
        Self { first: None, rest }
    }

    /// Waits for the first frame, for a short time.
    pub(super) async fn read(mut rest: B) -> Self {
        let first = std::future::poll_fn(|context| Pin::new(&mut rest).poll_frame(context));
        let first = tokio::time::timeout(BEGIN_TIMEOUT, first).await;
        Self {
            first: first.ok().flatten(),
            rest,
        }
    }

    /// The bytes that have been read.
    pub(super) fn begin(&self) -> &[u8] {
        match &self.first {
            Some(Ok(frame)) => frame.data_ref().map_or(&[], |data| data),
            _ => &[],
        }
    }
}

impl<B: HttpBody<Data = Bytes> + Unpin> HttpBody for Begun<B>
where
    B::Error: Unpin,
{
    type Data = Bytes;
    type Error = B::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, B::Error>>> {
        match self.first.take() {
            Some(first) => Poll::Ready(Some(first)),
            None => Pin::new(&mut self.rest).poll_frame(context),
        }
    }

    fn is_end_stream(&self) -> bool {
        self.first.is_none() && self.rest.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        let (read, rest) = (self.begin().len() as u64, self.rest.size_hint());
        let mut hint = SizeHint::new();
        hint.set_lower(rest.lower() + read);
        if let Some(upper) = rest.upper() {
            hint.set_upper(upper + read);
        }
        hint
    }
}

#[cfg(test)]
mod tests {
    use axum::body::{Body, to_bytes};

    use super::*;

    #[tokio::test]
    async fn a_body_is_the_same_after_its_beginning_is_read() {
        for text in ["", "a whole body"] {
            let body = Begun::read(Body::from(text)).await;
            assert_eq!(body.begin(), text.as_bytes());
            assert_eq!(body.size_hint().exact(), Some(text.len() as u64));
            assert_eq!(body.is_end_stream(), text.is_empty());
            assert_eq!(to_bytes(Body::new(body), 1000).await.unwrap(), text);
        }
    }

    #[tokio::test]
    async fn all_frames_of_a_body_are_kept() {
        let frames = ["the beginning", " and", " the rest"];
        let sent = frames.map(Ok::<_, std::io::Error>);
        let body = Body::from_stream(futures_util::stream::iter(sent));
        let body = Begun::read(body).await;
        assert_eq!(body.begin(), b"the beginning");
        assert_eq!(to_bytes(Body::new(body), 1000).await.unwrap(), frames.concat());
        let failed = futures_util::stream::iter([Err::<&str, _>(std::io::Error::other("gone"))]);
        let body = Begun::read(Body::from_stream(failed)).await;
        assert!(body.begin().is_empty() && to_bytes(Body::new(body), 1000).await.is_err());
    }

    #[tokio::test(start_paused = true)]
    async fn a_body_that_does_not_begin_is_left_to_the_usual_limits() {
        let silent = Body::from_stream(futures_util::stream::pending::<Result<Bytes, std::io::Error>>());
        let body = Begun::read(silent).await;
        assert!(body.begin().is_empty() && !body.is_end_stream());
    }
}
