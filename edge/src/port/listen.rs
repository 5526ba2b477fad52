//! The source of connections: a TCP port, or a simulated network in tests.

use std::io;
use std::net::SocketAddr;
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinHandle;

use super::connections::{Port, accept};

/// Most unsent bytes of a connection that the system buffers.
#[cfg(any(target_os = "android", target_os = "linux"))]
const MAX_UNSENT_BYTES: u32 = 128 << 10;

/// A listening port.
pub trait Listen: Send + 'static {
    /// A connection, both directions.
    type Stream: AsyncRead + AsyncWrite + Send + Unpin + 'static;
    /// The receiving half of a connection.
    type Read: AsyncRead + Send + Unpin + 'static;
    /// The sending half of a connection.
    type Write: AsyncWrite + Send + Unpin + 'static;

    /// The next connection and its peer's address. Dropping the future loses no connection.
    fn accept(&mut self) -> impl Future<Output = io::Result<(Self::Stream, SocketAddr)>> + Send;

    /// Splits a connection into its two directions.
    fn halves(stream: Self::Stream) -> (Self::Read, Self::Write);

    /// Runs [`accept`] as a task. Each type does this itself: then the code for its connections is
    /// compiled once, with the type, and not in every crate that starts a server.
    fn spawn(self, port: Port) -> JoinHandle<bool>;
}

impl Listen for TcpListener {
    type Stream = TcpStream;
    type Read = OwnedReadHalf;
    type Write = OwnedWriteHalf;

    async fn accept(&mut self) -> io::Result<(TcpStream, SocketAddr)> {
        let (stream, from) = Self::accept(self).await?;
        prepare(&stream);
        Ok((stream, from))
    }

    fn halves(stream: TcpStream) -> (OwnedReadHalf, OwnedWriteHalf) {
        stream.into_split()
    }

    fn spawn(self, port: Port) -> JoinHandle<bool> {
        tokio::spawn(accept(self, port))
    }
}

/// Sets a connection's socket options. Without Nagle's algorithm, small answers do not wait for
/// acknowledgements (40 ms stalls). Keep-alive detects dead peers. A limit on unsent bytes keeps
/// the frames of a slow reader's stream from growing seconds old in the system's buffer.
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
