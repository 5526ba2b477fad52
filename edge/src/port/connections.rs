//! The accept loop: HTTP/1.1 and HTTP/2 on one port, with TLS or without (prior knowledge, h2c).

use std::io::{self, Cursor};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use axum::Router;
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use hyper_util::server::conn::auto::Builder;
use hyper_util::service::TowerToHyperService;
use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite};
use tokio::sync::watch;

use super::activity::{Activity, Held, Watched};
use super::early::Early;
use super::listen::Listen;
use super::slots::{ConnectionSlot, ConnectionSlots};
use super::tls::Tls;
use crate::clients::Clients;
use troupe_base::telemetry::Seldom;

/// Pause after a failed accept. Usually the process has no free file handles then.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);
/// Longest time of a TLS handshake.
const HANDSHAKE_TIMEOUT: Duration = Duration::from_secs(10);
/// How long a closing connection may take to complete a request that has begun.
const HALF_REQUEST_GRACE: Duration = Duration::from_secs(1);
/// Longest life of a connection beyond the limit.
const RESERVE_TIMEOUT: Duration = Duration::from_secs(5);
/// How long a connection beyond the limit may be without a call.
const RESERVE_IDLE_TIMEOUT: Duration = Duration::from_millis(500);
/// Unread bytes that an HTTP/2 client may send for one call.
///
/// This and the connection's window are larger than HTTP/2's default of 64 KiB for two reasons.
/// With the default, a burst of calls would arrive in tiny portions. And h2 has a budget of half
/// the connection's window for small frames that are unread or belong to ended calls. It closes
/// the connection if the budget is spent. Frames that are read, and large frames, give the budget
/// back. With 8 MiB it lasts for the small frames of 16 thousand calls.
const CALL_WINDOW_BYTES: u32 = 1 << 20;
/// Unread bytes that an HTTP/2 client may send on a connection.
const CONNECTION_WINDOW_BYTES: u32 = 8 << 20;
/// Calls on a connection that a client may cancel before the server has seen them. A client may
/// well cancel all its calls at once. With the library's default, the 21st would end the connection
/// with all its other calls. There must be a limit, because such calls cost the server more than
/// the client (CVE-2023-44487).
const MAX_CANCELLED_UNSEEN: usize = 1024;
/// Errors of a client on an HTTP/2 connection, such as data on a closed call, to each of which the
/// server answers with a reset. With one more the connection ends. This is the library's default.
const MAX_ERRORS_RESET: usize = 1024;
/// Time for the last bytes of a connection that has to end now.
const CUT_GRACE: Duration = Duration::from_millis(100);
/// Most headers of an HTTP/1 request. With more, the library itself refuses the request with an
/// empty answer. `head.rs` has the lower limit for requests that get a full answer.
const MAX_HEADERS: usize = 512;
/// Most bytes of the headers of an HTTP/2 request, as [`MAX_HEADERS`].
const MAX_HEAD_BYTES: u32 = 64 << 10;
/// The first bytes of an HTTP/2 connection (RFC 9113, section 3.4).
const HTTP2_PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

/// The routes that answer requests.
#[derive(Clone)]
pub struct Routes {
    /// For connections within the limit.
    pub all: Router,
    /// For connections beyond the limit; see [`reserve`](crate::reserve::reserve).
    pub reserve: Router,
    /// For calls of clients that have a debt. None: all calls go to the routes.
    pub early: Option<Early>,
}

/// Limits of each connection.
#[derive(Debug, Clone, Copy)]
pub struct ConnectionLimits {
    /// Longest time to the first bytes of a request, and for the headers of each request.
    pub request: Duration,
    /// Longest time without a call.
    pub idle: Duration,
    /// Time between two HTTP/2 pings, and longest time to the answer to one.
    pub keepalive: Duration,
    /// Longest time to finish open requests when the server stops.
    pub drain: Duration,
    /// Most open calls on an HTTP/2 connection.
    pub max_calls: u32,
}

/// A port's services and limits, for all of its connections.
pub struct Port {
    /// The services.
    pub routes: Routes,
    /// Who is connected.
    pub clients: Arc<Clients>,
    /// The certificate, for a port that speaks only TLS.
    pub tls: Option<Arc<Tls>>,
    /// Times and sizes.
    pub limits: ConnectionLimits,
    /// Slots for connections.
    pub slots: Arc<ConnectionSlots>,
    /// Becomes true when the server stops.
    pub stopping: watch::Receiver<bool>,
}

/// Accepts connections until [`Port::stopping`] is true, then waits for open requests, for at most
/// [`ConnectionLimits::drain`]. Returns whether all of them finished.
pub async fn accept<L: Listen>(mut listener: L, port: Port) -> bool {
    let Port {
        routes,
        clients,
        tls,
        limits,
        slots,
        mut stopping,
    } = port;
    let connections = Arc::new(Connections {
        builder: builder(&limits),
        routes,
        clients,
        tls,
        slots: slots.clone(),
        first_bytes_timeout: limits.request,
        idle_timeout: limits.idle,
        lost: AtomicUsize::new(0),
    });
    let (phase, watcher) = watch::channel(Phase::Open);
    let (mut not_accepted, mut refused) = (Seldom::default(), Seldom::default());
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            () = reached(&mut stopping, |stop| *stop) => break,
        };
        let (stream, from) = match accepted {
            Ok(accepted) => accepted,
            Err(error) => {
                slots.not_accepted();
                if let Some(held_back) = not_accepted.next(Instant::now()) {
                    tracing::warn!(%error, held_back, "cannot accept a connection");
                }
                tokio::time::sleep(ACCEPT_PAUSE).await;
                continue;
            }
        };
        match slots.take(from.ip()) {
            Ok(slot) => {
                let (connections, watcher) = (connections.clone(), watcher.clone());
                tokio::spawn(async move { connections.serve::<L>(stream, slot, watcher).await });
            }
            Err(reason) => {
                if let Some(held_back) = refused.next(Instant::now()) {
                    tracing::warn!(%from, %reason, held_back, "a connection is refused");
                }
            }
        }
    }
    drop(listener);
    drop(watcher);
    phase.send_replace(Phase::Stopping);
    if tokio::time::timeout(limits.drain, phase.closed()).await.is_err() {
        phase.send_replace(Phase::Cut);
        phase.closed().await;
    }
    let lost = connections.lost.load(Ordering::Acquire);
    if lost > 0 {
        tracing::warn!(
            connections = lost,
            "not all requests finished in time; their connections were cut"
        );
    }
    lost == 0
}

/// Waits until the watched value fits `wanted`. If its sender is dropped, waits forever: the server
/// then runs until the process ends.
async fn reached<T>(watched: &mut watch::Receiver<T>, wanted: impl FnMut(&T) -> bool) {
    if watched.wait_for(wanted).await.is_err() {
        std::future::pending().await
    }
}

/// The phases of a server's life, for its connections.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Phase {
    /// Connections serve requests.
    Open,
    /// Connections finish their open requests.
    Stopping,
    /// Connections end at once.
    Cut,
}

/// Serves connections; all of them share it.
struct Connections {
    builder: Builder<TokioExecutor>,
    routes: Routes,
    clients: Arc<Clients>,
    tls: Option<Arc<Tls>>,
    slots: Arc<ConnectionSlots>,
    first_bytes_timeout: Duration,
    idle_timeout: Duration,
    /// Connections that were cut while they served a request.
    lost: AtomicUsize,
}

impl Connections {
    /// Serves one connection to its end.
    async fn serve<L: Listen>(&self, stream: L::Stream, slot: ConnectionSlot, phase: watch::Receiver<Phase>) {
        if !slot.is_reserved() {
            let (first, idle) = (self.first_bytes_timeout, self.idle_timeout);
            return self.serve_within::<L>(stream, slot, phase, first, idle).await;
        }
        // There are only a few slots in the reserve, so each is only lent for a short time.
        let (first, idle) = (RESERVE_TIMEOUT, RESERVE_IDLE_TIMEOUT);
        let serving = self.serve_within::<L>(stream, slot, phase, first, idle);
        if tokio::time::timeout(RESERVE_TIMEOUT, serving).await.is_err() {
            tracing::debug!("a connection beyond the limit took too long");
        }
    }

    async fn serve_within<L: Listen>(
        &self,
        stream: L::Stream,
        slot: ConnectionSlot,
        mut phase: watch::Receiver<Phase>,
        first_bytes_timeout: Duration,
        idle_timeout: Duration,
    ) {
        let Some(tls) = &self.tls else {
            let (read, write) = L::halves(stream);
            let begun = begin(read, write, first_bytes_timeout, slot.activity(), &mut phase).await;
            return self.serve_begun(begun, slot, phase, idle_timeout).await;
        };
        let handshake = tokio::time::timeout(
            HANDSHAKE_TIMEOUT.min(first_bytes_timeout),
            tls.acceptor().accept(stream),
        );
        let handshake = tokio::select! {
            handshake = handshake => handshake,
            () = slot.activity().is_cut() => return,
            () = reached(&mut phase, |phase| *phase >= Phase::Stopping) => return,
        };
        let error = match handshake {
            Ok(Ok(stream)) => {
                let (read, write) = tokio::io::split(stream);
                let activity = slot.activity();
                let begun = begin(read, write, first_bytes_timeout, activity, &mut phase).await;
                return self.serve_begun(begun, slot, phase, idle_timeout).await;
            }
            Ok(Err(error)) => error,
            Err(_) => io::ErrorKind::TimedOut.into(),
        };
        self.slots.handshake_failed();
        tracing::debug!(%error, "a TLS handshake failed");
    }

    /// Serves a connection whose first bytes have arrived.
    async fn serve_begun(
        &self,
        begun: Option<impl AsyncRead + AsyncWrite + Unpin + Send + 'static>,
        slot: ConnectionSlot,
        mut phase: watch::Receiver<Phase>,
        idle_timeout: Duration,
    ) {
        let Some(stream) = begun else { return };
        let activity = slot.activity().clone();
        let router = match slot.is_reserved() {
            true => &self.routes.reserve,
            false => &self.routes.all,
        };
        let client = self.clients.connected(slot.address());
        let service = TowerToHyperService::new(Watched::new(
            router.clone(),
            self.routes.early.clone(),
            activity.clone(),
            client,
        ));
        let stream = TokioIo::new(Held::new(stream, activity.clone(), slot));
        let connection = self.builder.serve_connection_with_upgrades(stream, service);
        tokio::pin!(connection);
        tokio::select! {
            result = &mut connection => {
                activity.leave_http();
                return ended(result);
            }
            () = activity.is_cut() => {
                connection.as_mut().graceful_shutdown();
                if let Ok(result) = tokio::time::timeout(CUT_GRACE, connection).await {
                    ended(result);
                }
                return tracing::debug!("a connection was cut: idle, or most of its calls were cancelled");
            }
            () = activity.idle(idle_timeout) => {}
            () = reached(&mut phase, |phase| *phase >= Phase::Stopping) => {}
        }
        connection.as_mut().graceful_shutdown();
        tokio::select! {
            result = &mut connection => ended(result),
            // No answer is lost: the client is silent, or has sent only a part of a request.
            () = activity.quiet(HALF_REQUEST_GRACE) => tracing::debug!("a silent connection is cut"),
            () = reached(&mut phase, |phase| *phase == Phase::Cut) => {
                if activity.is_serving() {
                    self.lost.fetch_add(1, Ordering::AcqRel);
                }
            }
        }
    }
}

fn ended(result: Result<(), Box<dyn std::error::Error + Send + Sync>>) {
    if let Err(error) = result {
        tracing::debug!(%error, "a connection ended with an error");
    }
}

/// Reads until the connection's HTTP version is known, and returns a stream that begins with the
/// bytes that were read. None if these bytes do not come in time, if the connection has to make
/// room, or if the server stops. The
/// connection builder would read them too, but without a time limit.
async fn begin<R, W>(
    read: R,
    write: W,
    limit: Duration,
    activity: &Activity,
    phase: &mut watch::Receiver<Phase>,
) -> Option<impl AsyncRead + AsyncWrite + Unpin + Send + 'static + use<R, W>>
where
    R: AsyncRead + Unpin + Send + 'static,
    W: AsyncWrite + Unpin + Send + 'static,
{
    let begun = tokio::select! {
        begun = tokio::time::timeout(limit, first_bytes(read)) => begun,
        () = activity.is_cut() => return None,
        () = reached(phase, |phase| *phase >= Phase::Stopping) => return None,
    };
    match begun {
        Ok(Ok(read)) => return Some(tokio::io::join(read, write)),
        Ok(Err(error)) => tracing::debug!(%error, "a connection ended before its first request"),
        Err(_) => tracing::debug!("a connection did not begin a request in time"),
    }
    None
}

async fn first_bytes<R: AsyncRead + Unpin>(mut read: R) -> io::Result<impl AsyncRead + Unpin + use<R>> {
    let mut first = Vec::with_capacity(HTTP2_PREFACE.len());
    while first.len() < HTTP2_PREFACE.len() && HTTP2_PREFACE.starts_with(&first) {
        let missing = (HTTP2_PREFACE.len() - first.len()) as u64;
        if (&mut read).take(missing).read_buf(&mut first).await? == 0 {
            break;
        }
    }
    Ok(Cursor::new(first).chain(read))
}

fn builder(limits: &ConnectionLimits) -> Builder<TokioExecutor> {
    let mut builder = Builder::new(TokioExecutor::new());
    builder
        .http1()
        .timer(TokioTimer::new())
        .max_headers(MAX_HEADERS)
        // For the headers of each request, including the wait between two requests. `begin` limits
        // the time to the first bytes.
        .header_read_timeout(limits.request);
    builder
        .http2()
        .timer(TokioTimer::new())
        .initial_stream_window_size(CALL_WINDOW_BYTES)
        .initial_connection_window_size(CONNECTION_WINDOW_BYTES)
        .max_header_list_size(MAX_HEAD_BYTES)
        .max_concurrent_streams(limits.max_calls)
        .max_pending_accept_reset_streams(MAX_CANCELLED_UNSEEN)
        .max_local_error_reset_streams(MAX_ERRORS_RESET)
        .keep_alive_interval(limits.keepalive)
        .keep_alive_timeout(limits.keepalive);
    builder
}
