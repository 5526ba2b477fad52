//! The activity on a connection: open and cancelled calls, and bytes that wait to be sent.

use std::convert::Infallible;
use std::io::{self, IoSlice};
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::task::{Context, Poll, ready};
use std::time::Duration;

use axum::Router;
use axum::body::{Body, HttpBody};
use bytes::Bytes;
use http::{Method, Request, Response, Version};
use http_body::{Frame, SizeHint};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::sync::Notify;
use tokio::time::{Instant, sleep, sleep_until};
use tower::Service;

use super::early::{Begun, Early};
use super::slots::ConnectionSlot;
use crate::clients::{Client, Resets};

/// Time between two checks whether a closing connection is done.
const LOOK_INTERVAL: Duration = Duration::from_millis(50);

/// Longest time in which the body of a refused call is read.
const DISCARD_TIMEOUT: Duration = Duration::from_secs(1);
/// Most bytes of the body of a refused call that are read.
const MAX_DISCARDED_BYTES: usize = 64 << 10;

/// The activity on one connection.
#[derive(Debug)]
pub(super) struct Activity {
    born: Instant,
    /// Number of open calls. A call is open from its request's head to the end of its answer.
    open: AtomicUsize,
    /// Number of open calls whose request has arrived completely, or whose answer has begun.
    serving: AtomicUsize,
    /// Whether bytes wait to be sent because the client does not read them.
    blocked: AtomicBool,
    /// When a call was last open, milliseconds since `born`.
    called_ms: AtomicU64,
    /// When bytes were last sent, milliseconds since `born`.
    sent_ms: AtomicU64,
    /// Whether the connection serves a WebSocket, which is no call.
    upgraded: AtomicBool,
    /// Cancelled calls beside answered ones.
    resets: Resets,
    /// Notified if the connection has to end now.
    cut: Notify,
}

impl Activity {
    /// For a connection that begins now.
    pub(super) fn new() -> Arc<Self> {
        Arc::new(Self {
            born: Instant::now(),
            open: AtomicUsize::new(0),
            serving: AtomicUsize::new(0),
            blocked: AtomicBool::new(false),
            called_ms: AtomicU64::new(0),
            sent_ms: AtomicU64::new(0),
            upgraded: AtomicBool::new(false),
            resets: Resets::of_connection(),
            cut: Notify::new(),
        })
    }

    /// Whether no call was open for `limit`.
    pub(super) fn is_idle(&self, limit: Duration) -> bool {
        self.open.load(Ordering::Acquire) == 0
            && !self.upgraded.load(Ordering::Acquire)
            && self.at(self.called_ms.load(Ordering::Acquire)).elapsed() >= limit
    }

    /// HTTP has ended on the connection. If its place is still taken, a WebSocket uses it.
    pub(super) fn leave_http(&self) {
        self.upgraded.store(true, Ordering::Release);
    }

    /// Ends the connection.
    pub(super) fn cut(&self) {
        self.cut.notify_one();
    }

    /// Waits for [`Activity::cut`].
    pub(super) async fn is_cut(&self) {
        self.cut.notified().await;
    }

    fn now_ms(&self) -> u64 {
        self.born.elapsed().as_millis() as u64
    }

    fn at(&self, ms: u64) -> Instant {
        self.born + Duration::from_millis(ms)
    }

    /// Whether cutting the connection would lose a call.
    pub(super) fn is_serving(&self) -> bool {
        self.serving.load(Ordering::Acquire) > 0 || self.blocked.load(Ordering::Acquire)
    }

    /// Waits until no call has been open for `limit`.
    pub(super) async fn idle(&self, limit: Duration) {
        loop {
            if self.open.load(Ordering::Acquire) > 0 {
                sleep(limit).await;
                continue;
            }
            let end = self.at(self.called_ms.load(Ordering::Acquire)) + limit;
            if Instant::now() >= end {
                return;
            }
            sleep_until(end).await;
        }
    }

    /// Waits until nothing was served or sent for `grace`, counted from now.
    pub(super) async fn quiet(&self, grace: Duration) {
        let begun = Instant::now();
        loop {
            if self.is_serving() {
                sleep(LOOK_INTERVAL).await;
                continue;
            }
            let last_ms = self
                .called_ms
                .load(Ordering::Acquire)
                .max(self.sent_ms.load(Ordering::Acquire));
            let end = begun.max(self.at(last_ms)) + grace;
            if Instant::now() >= end {
                return;
            }
            sleep_until(end).await;
        }
    }
}

/// One call on a connection.
#[derive(Debug)]
struct Call {
    activity: Arc<Activity>,
    client: Arc<Client>,
    serving: AtomicBool,
    /// Whether it ended with its whole answer. Calls of HTTP/1 count as answered, because a client
    /// can only cancel them by the end of the connection.
    answered: AtomicBool,
}

impl Call {
    fn begin(activity: &Arc<Activity>, client: &Arc<Client>, can_be_reset: bool) -> Arc<Self> {
        activity.open.fetch_add(1, Ordering::AcqRel);
        Arc::new(Self {
            activity: activity.clone(),
            client: client.clone(),
            serving: AtomicBool::new(false),
            answered: AtomicBool::new(!can_be_reset),
        })
    }

    /// The answer was sent completely.
    fn answered(&self) {
        self.answered.store(true, Ordering::Release);
    }

    /// The request has arrived completely, so the server can finish the call.
    fn serve(&self) {
        if !self.serving.swap(true, Ordering::AcqRel) {
            self.activity.serving.fetch_add(1, Ordering::AcqRel);
        }
    }
}

impl Drop for Call {
    fn drop(&mut self) {
        let activity = &self.activity;
        activity.called_ms.fetch_max(activity.now_ms(), Ordering::AcqRel);
        if *self.serving.get_mut() {
            activity.serving.fetch_sub(1, Ordering::AcqRel);
        }
        activity.open.fetch_sub(1, Ordering::AcqRel);
        let (answered, now) = (*self.answered.get_mut(), std::time::Instant::now());
        let too_many = activity.resets.ended(answered, now) | self.client.resets().ended(answered, now);
        if too_many && !answered {
            self.client.note_resets();
            activity.cut();
        }
    }
}

/// The routes for one connection. Counts its calls, and gives each request its client as an
/// extension.
#[derive(Clone)]
pub(super) struct Watched {
    router: Router,
    early: Option<Early>,
    activity: Arc<Activity>,
    client: Arc<Client>,
}

impl Watched {
    pub(super) fn new(
        router: Router,
        early: Option<Early>,
        activity: Arc<Activity>,
        client: Arc<Client>,
    ) -> Self {
        Self {
            router,
            early,
            activity,
            client,
        }
    }
}

impl<B> Service<Request<B>> for Watched
where
    B: HttpBody<Data = Bytes> + Send + Unpin + 'static,
    B::Error: Into<axum::BoxError> + Send + Unpin,
{
    type Response = Response<CallBody<Body>>;
    type Error = Infallible;
    type Future = Pin<Box<dyn Future<Output = Result<Self::Response, Infallible>> + Send>>;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
        Service::<Request<B>>::poll_ready(&mut self.router, context)
    }

    fn call(&mut self, request: Request<B>) -> Self::Future {
        let can_be_reset = request.version() == Version::HTTP_2 && request.method() != Method::HEAD;
        let call = Call::begin(&self.activity, &self.client, can_be_reset);
        let (parts, body) = request.into_parts();
        let early = self.early.as_ref();
        let Some(early) = early.filter(|early| early.looks_at(&parts, &self.client)) else {
            let request = Request::from_parts(parts, Begun::unread(body));
            return Box::pin(serve(&mut self.router, request, &self.client, call));
        };
        let (early, client, mut router) = (early.clone(), self.client.clone(), self.router.clone());
        Box::pin(async move {
            let body = Begun::read(body).await;
            if let Some(response) = early.refused(&parts, body.begin(), &client) {
                call.serve();
                discard(body);
                return Ok(response.map(|body| CallBody::of_answer(body, call)));
            }
            serve(&mut router, Request::from_parts(parts, body), &client, call).await
        })
    }
}

/// Has the routes answer a client's call.
fn serve<B>(
    router: &mut Router,
    mut request: Request<B>,
    client: &Arc<Client>,
    call: Arc<Call>,
) -> impl Future<Output = Result<Response<CallBody<Body>>, Infallible>> + Send + use<B>
where
    B: HttpBody<Data = Bytes> + Send + Unpin + 'static,
    B::Error: Into<axum::BoxError>,
{
    request.extensions_mut().insert(client.clone());
    let answer = router.call(request.map(|body| CallBody::of_request(body, call.clone())));
    async move {
        let response = answer.await?;
        call.serve();
        Ok(response.map(|body| CallBody::of_answer(body, call)))
    }
}

/// Reads and drops a body. It waits neither long nor for many bytes, and not in this task.
///
/// A body that is dropped before its end resets its call. What its client sends until it knows
/// counts as an error of the client, and the HTTP library ends connections with many of them.
fn discard<B: HttpBody<Data = Bytes> + Send + Unpin + 'static>(mut body: B) {
    if body.is_end_stream() {
        return;
    }
    let rest = async move {
        let mut left = MAX_DISCARDED_BYTES;
        while left > 0 {
            let frame = std::future::poll_fn(|context| Pin::new(&mut body).poll_frame(context));
            let Some(Ok(frame)) = frame.await else { return };
            left = left.saturating_sub(frame.data_ref().map_or(1, |data| data.len().max(1)));
        }
    };
    tokio::spawn(tokio::time::timeout(DISCARD_TIMEOUT, rest));
}

/// The body of a request or an answer. Keeps its call open.
pub(super) struct CallBody<B> {
    body: B,
    call: Arc<Call>,
    is_answer: bool,
}

impl<B: HttpBody> CallBody<B> {
    fn of_request(body: B, call: Arc<Call>) -> Self {
        if body.is_end_stream() {
            call.serve();
        }
        Self {
            body,
            call,
            is_answer: false,
        }
    }

    fn of_answer(body: B, call: Arc<Call>) -> Self {
        if body.is_end_stream() {
            call.answered();
        }
        Self {
            body,
            call,
            is_answer: true,
        }
    }
}

impl<B: HttpBody + Unpin> HttpBody for CallBody<B> {
    type Data = B::Data;
    type Error = B::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Self::Data>, Self::Error>>> {
        let frame = ready!(Pin::new(&mut self.body).poll_frame(context));
        let is_last = match &frame {
            None => true,
            Some(Ok(frame)) => frame.is_trailers() || self.body.is_end_stream(),
            Some(Err(_)) => self.body.is_end_stream(),
        };
        match (is_last, self.is_answer) {
            (true, true) => self.call.answered(),
            (true, false) => self.call.serve(),
            (false, _) => {}
        }
        Poll::Ready(frame)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

/// A connection's stream of bytes. It holds the connection's slot, because a WebSocket uses the
/// stream longer than HTTP does.
pub(super) struct Held<T> {
    stream: T,
    activity: Arc<Activity>,
    /// Whether a flush is pending. TLS buffers bytes that were written.
    unsent: bool,
    _slot: ConnectionSlot,
}

impl<T> Held<T> {
    pub(super) fn new(stream: T, activity: Arc<Activity>, slot: ConnectionSlot) -> Self {
        Self {
            stream,
            activity,
            unsent: false,
            _slot: slot,
        }
    }

    fn note(&self, sent: Poll<io::Result<usize>>) -> Poll<io::Result<usize>> {
        self.activity.blocked.store(sent.is_pending(), Ordering::Release);
        if sent.is_ready() {
            self.activity
                .sent_ms
                .store(self.activity.now_ms(), Ordering::Release);
        }
        sent
    }
}

impl<T: AsyncRead + Unpin> AsyncRead for Held<T> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(context, buffer)
    }
}

impl<T: AsyncWrite + Unpin> AsyncWrite for Held<T> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let sent = Pin::new(&mut self.stream).poll_write(context, bytes);
        self.note(sent)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        let sent = Pin::new(&mut self.stream).poll_flush(context);
        let unsent = std::mem::replace(&mut self.unsent, sent.is_pending());
        if self.unsent {
            self.activity.blocked.store(true, Ordering::Release);
        } else if unsent {
            let _ = self.note(Poll::Ready(Ok(0)));
        }
        sent
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let sent = Pin::new(&mut self.stream).poll_write_vectored(context, bytes);
        self.note(sent)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clients::{Clients, Share, Shares};
    use troupe_base::telemetry::Telemetry;

    fn client() -> Arc<Client> {
        let share = Share {
            bytes: 1024,
            streams: 1,
            sessions: 1,
        };
        let shares = Shares {
            client: share,
            address: share,
            all: share,
        };
        Clients::new(shares, &Telemetry::new().unwrap()).within()
    }

    #[tokio::test]
    async fn a_connection_that_only_cancels_calls_is_cut() {
        let (activity, client) = (Activity::new(), client());
        let begin = || Call::begin(&activity, &client, true);
        let is_cut = async || {
            let soon = tokio::time::timeout(Duration::from_millis(1), activity.is_cut());
            soon.await.is_ok()
        };
        // All calls of a connection, cancelled at once; and as many as were answered.
        for _ in 0..1024 {
            begin().answered();
        }
        for _ in 0..2 * 1024 {
            drop(begin());
        }
        assert!(!is_cut().await);
        drop(begin());
        assert!(is_cut().await);
    }

    #[tokio::test]
    async fn connections_of_an_address_are_counted_together() {
        let (connections, client) = ([(); 5].map(|()| Activity::new()), client());
        let cancel = |activity: &Arc<Activity>| drop(Call::begin(activity, &client, true));
        let is_cut = async |activity: &Arc<Activity>| {
            let soon = tokio::time::timeout(Duration::from_millis(1), activity.is_cut());
            soon.await.is_ok()
        };
        for _ in 0..819 {
            connections.iter().for_each(cancel);
        }
        cancel(&connections[0]);
        for activity in &connections {
            assert!(!is_cut(activity).await, "4,096 of an address are allowed");
        }
        cancel(&connections[0]);
        assert!(is_cut(&connections[0]).await && !is_cut(&connections[1]).await);
    }

    #[tokio::test(start_paused = true)]
    async fn a_connection_is_idle_some_time_after_its_last_call() {
        let activity = Activity::new();
        let (begun, limit) = (Instant::now(), Duration::from_secs(10));
        let call = Call::begin(&activity, &client(), true);
        assert!(!activity.is_idle(Duration::ZERO));
        let ends = async {
            sleep(Duration::from_secs(25)).await;
            drop(call);
        };
        tokio::join!(activity.idle(limit), ends);
        assert!(activity.is_idle(limit) && !activity.is_idle(limit + Duration::from_secs(1)));
        assert_eq!(begun.elapsed().as_secs(), 35);
    }

    #[tokio::test(start_paused = true)]
    async fn a_call_is_waited_for_once_its_request_is_whole() {
        let activity = Activity::new();
        let (begun, grace) = (Instant::now(), Duration::from_secs(1));
        let half = Call::begin(&activity, &client(), true);
        activity.quiet(grace).await;
        assert_eq!(begun.elapsed().as_secs(), 1, "half a request is not");

        half.serve();
        half.serve();
        let ends = async {
            sleep(Duration::from_secs(7)).await;
            drop(half);
        };
        tokio::join!(activity.quiet(grace), ends);
        assert!(begun.elapsed() >= Duration::from_secs(9), "{:?}", begun.elapsed());
        assert_eq!(
            activity.open.load(Ordering::Relaxed) + activity.serving.load(Ordering::Relaxed),
            0
        );
    }
}
