//! A PUB socket that a clock polls. It never blocks, and keeps no old poses.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;

use crate::zmtp::{Came, Inbox, NotZmtp, greeting, ready};

/// Longest message of a subscriber, which holds a topic.
const MAX_BYTES: usize = 256;
/// Subscribers of a port. A robot has three.
const MAX_PEERS: usize = 16;
/// Topics of a subscriber.
const MAX_TOPICS: usize = 16;
/// Commands that may wait for a subscriber.
const MAX_WAITING: usize = 64;
/// Bytes that the system may keep for a subscriber that does not read: a few windows.
const SEND_BUFFER: usize = 1 << 16;

/// Binds a port and sends to all who subscribe.
#[derive(Debug)]
pub(crate) struct Publisher {
    listener: TcpListener,
    peers: Vec<Peer>,
}

#[derive(Debug)]
struct Peer {
    stream: TcpStream,
    inbox: Inbox,
    ready: bool,
    topics: Vec<Vec<u8>>,
    /// What is being sent, and the bytes of it that are gone.
    current: Option<(Arc<[u8]>, usize)>,
    waiting: VecDeque<Arc<[u8]>>,
    newest: Option<Arc<[u8]>>,
}

impl Publisher {
    pub(crate) fn bind(address: SocketAddr) -> std::io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        Ok(Self {
            listener,
            peers: Vec::new(),
        })
    }

    /// Number of subscribers of a topic.
    pub(crate) fn subscribers(&self, topic: &[u8]) -> usize {
        self.peers.iter().filter(|peer| peer.wants(topic)).count()
    }

    /// Sends a message, framed, to those who want its topic. Each message arrives unless a peer has
    /// not read for long.
    pub(crate) fn send(&mut self, topic: &[u8], framed: &Arc<[u8]>) {
        for peer in self.peers.iter_mut().filter(|peer| peer.wants(topic)) {
            if peer.waiting.len() < MAX_WAITING {
                peer.waiting.push_back(Arc::clone(framed));
            }
        }
    }

    /// Sends a message, framed, that replaces one that was not sent yet.
    pub(crate) fn send_newest(&mut self, topic: &[u8], framed: &Arc<[u8]>) {
        for peer in self.peers.iter_mut().filter(|peer| peer.wants(topic)) {
            peer.newest = Some(Arc::clone(framed));
        }
    }

    /// Lets subscribers in, reads what they want, and sends what waits.
    pub(crate) fn poll(&mut self) {
        while let Ok((stream, _)) = self.listener.accept() {
            if self.peers.len() < MAX_PEERS
                && let Ok(peer) = Peer::new(stream)
            {
                self.peers.push(peer);
            }
        }
        self.peers.retain_mut(|peer| peer.read() && peer.write());
    }
}

impl Peer {
    fn new(stream: TcpStream) -> std::io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        socket2::SockRef::from(&stream).set_send_buffer_size(SEND_BUFFER)?;
        let hello = [&greeting()[..], &ready("PUB")].concat();
        Ok(Self {
            stream,
            inbox: Inbox::new(MAX_BYTES),
            ready: false,
            topics: Vec::new(),
            current: Some((hello.into(), 0)),
            waiting: VecDeque::new(),
            newest: None,
        })
    }

    fn wants(&self, topic: &[u8]) -> bool {
        self.ready && self.topics.iter().any(|wanted| topic.starts_with(wanted))
    }

    /// Whether the peer is still there.
    fn read(&mut self) -> bool {
        let mut buffer = [0; 1024];
        match self.stream.read(&mut buffer) {
            Ok(0) => return false,
            Ok(count) => self.inbox.push(&buffer[..count]),
            Err(e) if e.kind() == ErrorKind::WouldBlock => return true,
            Err(e) => return e.kind() == ErrorKind::Interrupted,
        }
        self.take().is_ok()
    }

    fn take(&mut self) -> Result<(), NotZmtp> {
        while let Some(came) = self.inbox.next()? {
            match came {
                Came::Ready => self.ready = true,
                Came::Message(body) => match body.split_first() {
                    Some((1, topic)) if self.topics.len() < MAX_TOPICS => self.topics.push(topic.to_vec()),
                    Some((0, topic)) => {
                        if let Some(at) = self.topics.iter().position(|one| one == topic) {
                            self.topics.swap_remove(at);
                        }
                    }
                    _ => return Err(NotZmtp),
                },
            }
        }
        Ok(())
    }

    /// Whether the peer is still there.
    fn write(&mut self) -> bool {
        loop {
            let mut next = || self.waiting.pop_front().or_else(|| self.newest.take());
            let Some((bytes, gone)) = self.current.take().or_else(|| Some((next()?, 0))) else {
                return true;
            };
            match self.stream.write(&bytes[gone..]) {
                Ok(count) if gone + count == bytes.len() => {}
                Ok(count) => self.current = Some((bytes, gone + count)),
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {
                    self.current = Some((bytes, gone));
                    return true;
                }
                Err(_) => return false,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use super::*;
    use crate::zmtp::{message, subscribe};

    fn framed(body: &[u8]) -> Arc<[u8]> {
        message(body).into()
    }

    /// A publisher on a free port, and a peer that has said what it wants.
    fn pair(topics: &[&[u8]]) -> (Publisher, TcpStream) {
        let mut publisher = Publisher::bind(([127, 0, 0, 1], 0).into()).unwrap();
        let mut peer = TcpStream::connect(publisher.listener.local_addr().unwrap()).unwrap();
        peer.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
        peer.write_all(&greeting()).unwrap();
        peer.write_all(&ready("SUB")).unwrap();
        for topic in topics {
            peer.write_all(&subscribe(topic)).unwrap();
        }
        let until = Instant::now() + Duration::from_secs(5);
        while topics.iter().any(|topic| publisher.subscribers(topic) == 0) {
            assert!(Instant::now() < until, "it does not subscribe");
            publisher.poll();
        }
        (publisher, peer)
    }

    /// Bodies of the messages that a peer gets, until they are enough.
    fn bodies(
        peer: &mut TcpStream,
        publisher: &mut Publisher,
        enough: impl Fn(&[Vec<u8>]) -> bool,
    ) -> Vec<Vec<u8>> {
        let (mut inbox, mut bodies) = (Inbox::new(1 << 16), Vec::new());
        let mut buffer = vec![0; 1 << 16];
        while !enough(&bodies) {
            publisher.poll();
            let read = peer.read(&mut buffer).unwrap();
            assert_ne!(read, 0, "the publisher has hung up");
            inbox.push(&buffer[..read]);
            while let Some(came) = inbox.next().unwrap() {
                if let Came::Message(body) = came {
                    bodies.push(body);
                }
            }
        }
        bodies
    }

    #[test]
    fn subscribers_get_their_topics() {
        let (mut publisher, mut peer) = pair(&[b"command", b"pose"]);
        publisher.send(b"planner", &framed(b"planner"));
        publisher.send(b"command", &framed(b"command 1"));
        publisher.send(b"command", &framed(b"command 2"));
        publisher.send_newest(b"pose", &framed(b"pose 1"));
        publisher.send_newest(b"pose", &framed(b"pose 2"));
        let came = bodies(&mut peer, &mut publisher, |bodies| bodies.len() >= 3);
        assert_eq!(came, [&b"command 1"[..], b"command 2", b"pose 2"]);
        peer.write_all(&message(b"\x00pose")).unwrap();
        let until = Instant::now() + Duration::from_secs(5);
        while publisher.subscribers(b"pose") > 0 {
            assert!(Instant::now() < until, "it still subscribes");
            publisher.poll();
        }
        drop(peer);
        while publisher.subscribers(b"command") > 0 {
            assert!(Instant::now() < until, "it is still there");
            publisher.poll();
        }
    }

    #[test]
    fn who_does_not_read_gets_the_newest() {
        let (mut publisher, mut peer) = pair(&[b"pose"]);
        let count = 3000_u32;
        for number in 0..count {
            let body = [&b"pose"[..], &number.to_be_bytes(), &[0; 20_000]].concat();
            publisher.send_newest(b"pose", &framed(&body));
            publisher.poll();
        }
        let number = |body: &Vec<u8>| u32::from_be_bytes(body[4..8].try_into().unwrap());
        let is_last = |bodies: &[Vec<u8>]| bodies.last().map(number) == Some(count - 1);
        let numbers: Vec<u32> = bodies(&mut peer, &mut publisher, is_last)
            .iter()
            .map(number)
            .collect();
        assert!(numbers.is_sorted() && numbers.len() < 1000, "{}", numbers.len());
    }
}
