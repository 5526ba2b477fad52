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
use super::listen::Listen;
use super::slots::{ConnectionSlot, ConnectionSlots};
use super::tls::Tls;
use crate::clients::Clients;
use troupe_base::telemetry::Seldom;

/// How long to pause where the system has no more file handles.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);
/// How long a TLS handshake may take at most.
const HANDSHAKE_TIMEOUT: Duration = Duration::from_secs(10);
/// How long a connection that closes may still take to complete a request.
const HALF_REQUEST_GRACE: Duration = Duration::from_secs(1);
/// How long a connection beyond the limit may take, in all and between two calls.
const RESERVE_TIMEOUT: Duration = Duration::from_secs(5);
const RESERVE_IDLE_TIMEOUT: Duration = Duration::from_millis(500);
/// Bytes that an HTTP/2 client may send ahead of what is read, for a call and for all of a
/// connection. HTTP/2's own 64 KiB for both would have a burst of calls come in crumbs; and of each
/// small frame that is not yet read, or that comes for a call which is over, h2 takes a part of
/// half the connection's window, and closes the connection where nothing of it is left. Frames that
/// are read, and large ones, give it back. So that is room for the small frames of 16 thousand
/// calls.
const CALL_WINDOW_BYTES: u32 = 1 << 20;
const CONNECTION_WINDOW_BYTES: u32 = 8 << 20;
/// Calls that a client may have given up before the server has seen them. A client may well give up
/// all that it asks for at once; by default that would end the connection, with all other calls on
/// it, from the 21st on. A limit there must be, for such calls cost a server more than the client
/// (CVE-2023-44487).
const MAX_GIVEN_UP_UNSEEN: usize = 1024;
/// Headers of a request beyond which the library itself refuses it, with an empty answer: how many
/// there may be over HTTP/1, and their bytes over HTTP/2. `head.rs` has the limit for requests
/// that get a full answer.
const MAX_HEADERS: usize = 512;
const MAX_HEAD_BYTES: u32 = 64 << 10;
/// What an HTTP/2 connection begins with (RFC 9113, section 3.4).
const HTTP2_PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

/// What connections get an answer from.
#[derive(Debug, Clone)]
pub struct Routes {
    /// All routes.
    pub all: Router,
    /// Those of connections beyond the limit.
    pub reserve: Router,
}

/// How long connections may take, and how much each may ask for at a time.
#[derive(Debug, Clone, Copy)]
pub struct ConnectionLimits {
    /// To begin a request, and for each head of one.
    pub request: Duration,
    /// Without a call.
    pub idle: Duration,
    /// Between two signs of life over HTTP/2, and for the answer to one.
    pub keepalive: Duration,
    /// To finish what has begun when the server stops.
    pub drain: Duration,
    /// Most calls that are open on a connection of HTTP/2.
    pub max_calls: u32,
}

/// Accepts until told to stop, then waits for requests in flight, at most for the configured time.
/// Answers whether all of them finished.
pub async fn accept<L: Listen>(
    mut listener: L,
    routes: Routes,
    clients: Arc<Clients>,
    tls: Option<Arc<Tls>>,
    limits: ConnectionLimits,
    slots: Arc<ConnectionSlots>,
    mut stopping: watch::Receiver<bool>,
) -> bool {
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

/// Ends when what is watched fits `wanted`. Where nobody can change it any more it never does: the
/// server runs until the process ends.
async fn reached<T>(watched: &mut watch::Receiver<T>, wanted: impl FnMut(&T) -> bool) {
    if watched.wait_for(wanted).await.is_err() {
        std::future::pending().await
    }
}

/// What connections are to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Phase {
    /// Serve.
    Open,
    /// Finish what has begun.
    Stopping,
    /// End at once.
    Cut,
}

/// How connections are served.
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
        // Whoever has one of these few slots leaves it soon.
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
            let begun = begin(read, write, first_bytes_timeout, &mut phase).await;
            return self.serve_begun(begun, slot, phase, idle_timeout).await;
        };
        let handshake = tokio::time::timeout(
            HANDSHAKE_TIMEOUT.min(first_bytes_timeout),
            tls.acceptor().accept(stream),
        );
        let handshake = tokio::select! {
            handshake = handshake => handshake,
            () = reached(&mut phase, |phase| *phase >= Phase::Stopping) => return,
        };
        let error = match handshake {
            Ok(Ok(stream)) => {
                let (read, write) = tokio::io::split(stream);
                let begun = begin(read, write, first_bytes_timeout, &mut phase).await;
                return self.serve_begun(begun, slot, phase, idle_timeout).await;
            }
            Ok(Err(error)) => error,
            Err(_) => io::ErrorKind::TimedOut.into(),
        };
        self.slots.handshake_failed();
        tracing::debug!(%error, "a TLS handshake failed");
    }

    /// Serves a connection whose first bytes are here.
    async fn serve_begun(
        &self,
        begun: Option<impl AsyncRead + AsyncWrite + Unpin + Send + 'static>,
        slot: ConnectionSlot,
        mut phase: watch::Receiver<Phase>,
        idle_timeout: Duration,
    ) {
        let Some(stream) = begun else { return };
        let activity = Activity::new();
        let router = match slot.is_reserved() {
            true => &self.routes.reserve,
            false => &self.routes.all,
        };
        let client = self.clients.connected(slot.address());
        let service = TowerToHyperService::new(Watched::new(router.clone(), activity.clone(), client));
        let stream = TokioIo::new(Held::new(stream, activity.clone(), slot));
        let connection = self.builder.serve_connection_with_upgrades(stream, service);
        tokio::pin!(connection);
        tokio::select! {
            result = &mut connection => return ended(result),
            () = activity.idle(idle_timeout) => {}
            () = reached(&mut phase, |phase| *phase >= Phase::Stopping) => {}
        }
        connection.as_mut().graceful_shutdown();
        tokio::select! {
            result = &mut connection => ended(result),
            // It has nothing that is worth a wait: it is silent, or it sent half a request.
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

/// Reads until it is clear which HTTP version a connection speaks, and gives a stream that begins
/// with what was read. None where that does not come in time, or the server stops. The connection
/// builder decides the same, but without a time limit.
async fn begin<R, W>(
    read: R,
    write: W,
    limit: Duration,
    phase: &mut watch::Receiver<Phase>,
) -> Option<impl AsyncRead + AsyncWrite + Unpin + Send + 'static + use<R, W>>
where
    R: AsyncRead + Unpin + Send + 'static,
    W: AsyncWrite + Unpin + Send + 'static,
{
    let begun = tokio::select! {
        begun = tokio::time::timeout(limit, first_bytes(read)) => begun,
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
        // For each head of a request, the wait between two requests included. The first bytes have
        // `begin`'s limit.
        .header_read_timeout(limits.request);
    builder
        .http2()
        .timer(TokioTimer::new())
        .initial_stream_window_size(CALL_WINDOW_BYTES)
        .initial_connection_window_size(CONNECTION_WINDOW_BYTES)
        .max_header_list_size(MAX_HEAD_BYTES)
        .max_concurrent_streams(limits.max_calls)
        .max_pending_accept_reset_streams(MAX_GIVEN_UP_UNSEEN)
        .keep_alive_interval(limits.keepalive)
        .keep_alive_timeout(limits.keepalive);
    builder
}
