//! A port in memory, and clients that speak HTTP over it byte by byte.

use std::io;
use std::net::SocketAddr;

use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, DuplexStream, ReadHalf, WriteHalf, duplex, split};
use tokio::sync::mpsc;
use tokio::task::JoinHandle;

use troupe_edge::port::{self, Listen};

/// Bytes that wait in a connection.
const BUFFER: usize = 64 << 10;

/// The server's end of a port.
pub(super) struct Port(mpsc::UnboundedReceiver<DuplexStream>);

/// The clients' end of it.
#[derive(Clone)]
pub(super) struct Dial(mpsc::UnboundedSender<DuplexStream>);

pub(super) fn port() -> (Dial, Port) {
    let (dial, port) = mpsc::unbounded_channel();
    (Dial(dial), Port(port))
}

impl Dial {
    /// A connection. None: the port is closed.
    pub(super) fn connect(&self) -> Option<DuplexStream> {
        let (mine, theirs) = duplex(BUFFER);
        self.0.send(theirs).ok().map(|()| mine)
    }
}

impl Listen for Port {
    type Stream = DuplexStream;
    type Read = ReadHalf<DuplexStream>;
    type Write = WriteHalf<DuplexStream>;

    async fn accept(&mut self) -> io::Result<(DuplexStream, SocketAddr)> {
        match self.0.recv().await {
            Some(stream) => Ok((stream, SocketAddr::from(([127, 0, 0, 1], 1)))),
            None => std::future::pending().await,
        }
    }

    fn halves(stream: DuplexStream) -> (Self::Read, Self::Write) {
        split(stream)
    }

    fn spawn(self, port: port::Port) -> JoinHandle<bool> {
        tokio::spawn(port::accept(self, port))
    }
}

/// A request as it is sent.
pub(super) fn request(method: &str, path: &str, body: &str) -> Vec<u8> {
    let length = body.len();
    format!(
        "{method} {path} HTTP/1.1\r\nhost: localhost\r\ncontent-type: application/json\r\ncontent-length: {length}\r\n\r\n{body}"
    )
    .into_bytes()
}

/// What a request led to.
#[derive(Debug)]
pub(super) enum Answer {
    /// It was answered.
    Whole(u16, Vec<u8>),
    /// The connection ended before it.
    None,
    /// The connection ended in the middle of it.
    Torn,
}

/// A connection of a client.
pub(super) struct Http {
    stream: DuplexStream,
    read: Vec<u8>,
}

impl Http {
    pub(super) fn new(stream: DuplexStream) -> Self {
        Self {
            stream,
            read: Vec::new(),
        }
    }

    /// Sends bytes; what the server does not take is lost.
    pub(super) async fn send(&mut self, bytes: &[u8]) {
        let _ = self.stream.write_all(bytes).await;
    }

    /// The answer to one request.
    pub(super) async fn answer(&mut self) -> Answer {
        loop {
            if let Some((status, body, length)) = parse(&self.read) {
                self.read.drain(..length);
                return Answer::Whole(status, body);
            }
            match self.stream.read_buf(&mut self.read).await {
                Ok(1..) => {}
                _ if self.read.is_empty() => return Answer::None,
                _ => return Answer::Torn,
            }
        }
    }

    /// Bytes that belong to no answer.
    pub(super) fn rest(&self) -> &[u8] {
        &self.read
    }
}

/// Status and body of a whole answer, and its length.
fn parse(bytes: &[u8]) -> Option<(u16, Vec<u8>, usize)> {
    let head_end = find(bytes, b"\r\n\r\n")? + 4;
    let head = String::from_utf8_lossy(&bytes[..head_end]).to_ascii_lowercase();
    let status = head.split(' ').nth(1)?.parse().ok()?;
    let field = |name: &str| head.lines().find_map(|line| line.strip_prefix(name));
    if let Some(length) = field("content-length: ") {
        let end = head_end + length.parse::<usize>().unwrap();
        let body = bytes.get(head_end..end)?;
        return Some((status, body.to_vec(), end));
    }
    assert!(field("transfer-encoding: chunked").is_some(), "{head}");
    let (mut body, mut at) = (Vec::new(), head_end);
    loop {
        let line = find(&bytes[at..], b"\r\n")?;
        let size = std::str::from_utf8(&bytes[at..at + line]).unwrap();
        let size = usize::from_str_radix(size, 16).unwrap();
        let from = at + line + 2;
        body.extend_from_slice(bytes.get(from..from + size)?);
        at = from + size + 2;
        bytes.get(..at)?;
        if size == 0 {
            return Some((status, body, at));
        }
    }
}

fn find(bytes: &[u8], what: &[u8]) -> Option<usize> {
    bytes.windows(what.len()).position(|window| window == what)
}
