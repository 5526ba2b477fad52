//! The accept loop: HTTP/1.1 and HTTP/2 (prior knowledge, h2c) on one port.

use std::io::{self, Cursor};
use std::net::IpAddr;
use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use http::Request;
use hyper::body::Incoming;
use hyper_util::rt::{TokioExecutor, TokioIo, TokioTimer};
use hyper_util::server::conn::auto::Builder;
use hyper_util::server::graceful::{GracefulShutdown, Watcher};
use hyper_util::service::TowerToHyperService;
use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Notify, Semaphore, watch};
use tower::ServiceExt as _;

use crate::clients::Clients;
use crate::config::Config;

/// How long to pause where the system has no more file handles.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);
/// Bytes that the system holds for a connection before it has sent them.
#[cfg(any(target_os = "android", target_os = "linux"))]
const MAX_UNSENT_BYTES: u32 = 128 << 10;
/// Bytes that an HTTP/2 client may send ahead of what is read, for a call and for all of a connection. HTTP/2's own 64 KiB for both
/// would have a burst of calls come in crumbs; and of each small frame that is not yet read, or that comes for a call which
/// is over, h2 takes a part of half the connection's window, and closes the connection where nothing of it is left. Frames
/// that are read, and large ones, give it back. So that is room for the small frames of 16 thousand calls.
const CALL_WINDOW_BYTES: u32 = 1 << 20;
const CONNECTION_WINDOW_BYTES: u32 = 8 << 20;
/// Calls that a client may have given up before the server has seen them. A client may well give up all that it asks for at once;
/// by default that would end the connection, with all other calls on it, from the 21st on. A limit there must be, for
/// such calls cost a server more than the client (CVE-2023-44487).
const MAX_GIVEN_UP_UNSEEN: usize = 1024;
/// What an HTTP/2 connection begins with (RFC 9113, section 3.4).
const HTTP2_PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

/// Accepts until told to stop, then waits for requests in flight, at most for the configured time. Answers whether all of
/// them finished. At the limit of open connections it does not accept, so that new ones wait in the system's backlog.
pub(super) async fn accept(
    listener: TcpListener,
    router: Router,
    clients: Arc<Clients>,
    config: Config,
    mut stopping: watch::Receiver<bool>,
) -> bool {
    let connections = Connections {
        builder: builder(&config),
        router,
        clients,
        first_bytes_timeout: config.request_timeout(),
    };
    let connections = Arc::new(connections);
    let places = Arc::new(Semaphore::new(config.max_connections));
    let graceful = GracefulShutdown::new();
    let cut = Arc::new(Notify::new());
    loop {
        let next = async {
            // The semaphore is never closed, so there is always a place in the end.
            let place = places.clone().acquire_owned().await.ok();
            (place, listener.accept().await)
        };
        let (place, accepted) = tokio::select! {
            next = next => next,
            () = stopped(&mut stopping) => break,
        };
        let (stream, address) = match accepted {
            Ok(accepted) => accepted,
            Err(error) => {
                tracing::warn!(%error, "cannot accept a connection");
                tokio::time::sleep(ACCEPT_PAUSE).await;
                continue;
            }
        };
        prepare(&stream);
        let (connections, watcher) = (connections.clone(), graceful.watcher());
        let (cut, mut stopping) = (cut.clone(), stopping.clone());
        tokio::spawn(async move {
            let _place = place;
            tokio::select! {
                () = connections.serve(stream, address.ip(), watcher, &mut stopping) => {}
                () = cut.notified() => {}
            }
        });
    }
    drop(listener);
    let open = graceful.count();
    // Connections that stay silent do not notice a graceful shutdown, so the wait has an end.
    let clean = tokio::time::timeout(config.drain_timeout(), graceful.shutdown())
        .await
        .is_ok();
    if !clean {
        tracing::warn!(
            connections = open,
            "not all connections finished in time; cutting the rest"
        );
        cut.notify_waiters();
    }
    clean
}

/// Ends when the server is told to stop. Where the handle is gone it never does: the server runs until the process ends.
async fn stopped(stopping: &mut watch::Receiver<bool>) {
    if stopping.wait_for(|stop| *stop).await.is_err() {
        std::future::pending().await
    }
}

/// How connections are served.
struct Connections {
    builder: Builder<TokioExecutor>,
    router: Router,
    clients: Arc<Clients>,
    first_bytes_timeout: Duration,
}

impl Connections {
    /// Serves one connection to its end.
    async fn serve(
        &self,
        stream: TcpStream,
        address: IpAddr,
        watcher: Watcher,
        stopping: &mut watch::Receiver<bool>,
    ) {
        let begun = tokio::select! {
            begun = tokio::time::timeout(self.first_bytes_timeout, begin(stream)) => begun,
            () = stopped(stopping) => return,
        };
        let stream = match begun {
            Ok(Ok(stream)) => TokioIo::new(stream),
            Ok(Err(error)) => return tracing::debug!(%error, "a connection ended before its first request"),
            Err(_) => return tracing::debug!("a connection did not begin a request in time"),
        };
        let client = self.clients.connected(address);
        let service = self
            .router
            .clone()
            .map_request(move |mut request: Request<Incoming>| {
                request.extensions_mut().insert(client.clone());
                request
            });
        let connection = self
            .builder
            .serve_connection_with_upgrades(stream, TowerToHyperService::new(service));
        if let Err(error) = watcher.watch(connection).await {
            tracing::debug!(error = %error, "a connection ended with an error");
        }
    }
}

/// Reads until it is clear which HTTP version a connection speaks, and gives a stream that begins with what was read.
/// The connection builder decides the same, but without a time limit.
async fn begin(mut stream: TcpStream) -> io::Result<impl AsyncRead + AsyncWrite + Unpin + Send + 'static> {
    let mut first = Vec::with_capacity(HTTP2_PREFACE.len());
    while first.len() < HTTP2_PREFACE.len() && HTTP2_PREFACE.starts_with(&first) {
        let missing = (HTTP2_PREFACE.len() - first.len()) as u64;
        if (&mut stream).take(missing).read_buf(&mut first).await? == 0 {
            break;
        }
    }
    let (read, write) = stream.into_split();
    Ok(tokio::io::join(Cursor::new(first).chain(read), write))
}

fn builder(config: &Config) -> Builder<TokioExecutor> {
    let mut builder = Builder::new(TokioExecutor::new());
    builder
        .http1()
        .timer(TokioTimer::new())
        // For each head of a request, the wait between two requests included. The first bytes have `begin`'s limit.
        .header_read_timeout(config.request_timeout());
    builder
        .http2()
        .timer(TokioTimer::new())
        .initial_stream_window_size(CALL_WINDOW_BYTES)
        .initial_connection_window_size(CONNECTION_WINDOW_BYTES)
        .max_concurrent_streams(config.max_calls_per_connection)
        .max_pending_accept_reset_streams(MAX_GIVEN_UP_UNSEEN)
        .keep_alive_interval(config.keepalive())
        .keep_alive_timeout(config.keepalive());
    builder
}

/// Small answers must not wait for acknowledgements (40 ms stalls), dead peers must be noticed, and what a slow reader has
/// not taken must not pile up in the system: a stream's frames would be seconds old by the time that they are read.
fn prepare(stream: &TcpStream) {
    let keepalive = socket2::TcpKeepalive::new().with_time(Duration::from_secs(60));
    let socket = socket2::SockRef::from(stream);
    let result = stream
        .set_nodelay(true)
        .and_then(|()| socket.set_tcp_keepalive(&keepalive));
    #[cfg(any(target_os = "android", target_os = "linux"))]
    let result = result.and_then(|()| socket.set_tcp_notsent_lowat(MAX_UNSENT_BYTES));
    if let Err(error) = result {
        tracing::debug!(%error, "cannot set socket options");
    }
}
