//! Where connections come from: a port of the system, or what a simulation has in its place.

use std::io;
use std::net::SocketAddr;
use std::time::Duration;

use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpStream};

/// Bytes that the system holds for a connection before it has sent them.
#[cfg(any(target_os = "android", target_os = "linux"))]
const MAX_UNSENT_BYTES: u32 = 128 << 10;

/// A port.
pub trait Listen: Send + 'static {
    /// A connection.
    type Stream: AsyncRead + AsyncWrite + Send + Unpin + 'static;
    /// What comes on it.
    type Read: AsyncRead + Send + Unpin + 'static;
    /// What goes on it.
    type Write: AsyncWrite + Send + Unpin + 'static;

    /// The next connection, and where it comes from. Giving up the wait loses none.
    fn accept(&mut self) -> impl Future<Output = io::Result<(Self::Stream, SocketAddr)>> + Send;

    /// Both directions of a connection.
    fn halves(stream: Self::Stream) -> (Self::Read, Self::Write);
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
}

/// Small answers must not wait for acknowledgements (40 ms stalls), dead peers must be noticed, and
/// what a slow reader has not taken must not pile up in the system: a stream's frames would be
/// seconds old by the time that they are read.
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
