//! The wire of ZeroMQ: ZMTP 3.0 with the NULL mechanism, as RFC 23 describes it.
//!
//! Sockets of our own, because a robot must never get old motion: of poses that could not be sent
//! in time only the newest is kept. Libraries queue them.

/// Bytes of a greeting.
const GREETING: usize = 64;
const MORE: u8 = 1;
const LONG: u8 = 2;
const COMMAND: u8 = 4;

/// The peer speaks no ZMTP 3, or breaks its rules.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the peer does not speak ZMTP 3 without encryption")]
pub(crate) struct NotZmtp;

/// The first bytes of either side.
pub(crate) fn greeting() -> [u8; GREETING] {
    let mut out = [0; GREETING];
    (out[0], out[8], out[9], out[10]) = (0xff, 1, 0x7f, 3);
    out[12..16].copy_from_slice(b"NULL");
    out
}

/// The command that ends the handshake, with the type of the socket.
pub(crate) fn ready(socket: &str) -> Vec<u8> {
    let mut body = b"\x05READY\x0bSocket-Type".to_vec();
    body.extend((socket.len() as u32).to_be_bytes());
    body.extend(socket.bytes());
    frame(COMMAND, &body)
}

/// A message of one part.
pub(crate) fn message(body: &[u8]) -> Vec<u8> {
    frame(0, body)
}

/// The message with which a SUB socket subscribes to a topic.
pub(crate) fn subscribe(topic: &[u8]) -> Vec<u8> {
    message(&[&[1], topic].concat())
}

fn frame(flags: u8, body: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(body.len() + 9);
    match u8::try_from(body.len()) {
        Ok(length) => out.extend([flags, length]),
        Err(_) => {
            out.push(flags | LONG);
            out.extend((body.len() as u64).to_be_bytes());
        }
    }
    out.extend(body);
    out
}

/// What a peer sent.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Came {
    /// The end of its handshake.
    Ready,
    Message(Vec<u8>),
}

/// Bytes of a peer, cut into messages.
#[derive(Debug)]
pub(crate) struct Inbox {
    bytes: Vec<u8>,
    greeted: bool,
    /// Longest message, bytes.
    limit: usize,
}

impl Inbox {
    pub(crate) fn new(limit: usize) -> Self {
        Self {
            bytes: Vec::new(),
            greeted: false,
            limit,
        }
    }

    pub(crate) fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend(bytes);
    }

    /// The next message, if all of it is there. Parts of one message come one by one.
    pub(crate) fn next(&mut self) -> Result<Option<Came>, NotZmtp> {
        if !self.greeted {
            let Some(greeting) = self.bytes.get(..GREETING) else {
                return Ok(None);
            };
            let null = greeting[12..32].strip_prefix(b"NULL");
            let known = greeting[0] == 0xff && greeting[9] == 0x7f && greeting[10] >= 3;
            if !known || null.is_none_or(|rest| rest.iter().any(|&byte| byte != 0)) {
                return Err(NotZmtp);
            }
            self.bytes.drain(..GREETING);
            self.greeted = true;
        }
        loop {
            let Some((flags, body)) = self.frame()? else {
                return Ok(None);
            };
            match flags & COMMAND != 0 {
                false => return Ok(Some(Came::Message(body))),
                true if body.starts_with(b"\x05READY") => return Ok(Some(Came::Ready)),
                true if body.starts_with(b"\x05ERROR") => return Err(NotZmtp),
                true => {}
            }
        }
    }

    fn frame(&mut self) -> Result<Option<(u8, Vec<u8>)>, NotZmtp> {
        let Some(&flags) = self.bytes.first() else {
            return Ok(None);
        };
        if flags & !(MORE | LONG | COMMAND) != 0 {
            return Err(NotZmtp);
        }
        let (start, length) = match flags & LONG != 0 {
            true => match self.bytes.get(1..9).and_then(|size| size.try_into().ok()) {
                Some(size) => (9, u64::from_be_bytes(size)),
                None => return Ok(None),
            },
            false => match self.bytes.get(1) {
                Some(&size) => (2, u64::from(size)),
                None => return Ok(None),
            },
        };
        if length > self.limit as u64 {
            return Err(NotZmtp);
        }
        let end = start + length as usize;
        let Some(body) = self.bytes.get(start..end) else {
            return Ok(None);
        };
        let body = body.to_vec();
        self.bytes.drain(..end);
        Ok(Some((flags, body)))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_peer_is_read_byte_by_byte() {
        let long = vec![7; 300];
        let bytes = [
            greeting().to_vec(),
            ready("SUB"),
            subscribe(b"pose"),
            message(&long),
        ]
        .concat();
        let mut inbox = Inbox::new(300);
        let mut came = Vec::new();
        for byte in bytes {
            inbox.push(&[byte]);
            while let Some(one) = inbox.next().unwrap() {
                came.push(one);
            }
        }
        let subscription = Came::Message(b"\x01pose".to_vec());
        assert_eq!(came, [Came::Ready, subscription, Came::Message(long)]);
    }

    #[test]
    fn others_are_refused() {
        let mut http = Inbox::new(100);
        http.push(&[b'G'; GREETING]);
        assert_eq!(http.next(), Err(NotZmtp));
        let mut curve = greeting();
        curve[12..17].copy_from_slice(b"CURVE");
        let mut inbox = Inbox::new(100);
        inbox.push(&curve);
        assert_eq!(inbox.next(), Err(NotZmtp));
        let mut large = Inbox::new(100);
        large.push(&greeting());
        large.push(&message(&[0; 101])[..2]);
        assert_eq!(large.next(), Err(NotZmtp));
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
            let mut inbox = Inbox::new(256);
            inbox.push(&greeting());
            inbox.push(&bytes);
            while let Ok(Some(_)) = inbox.next() {}
        }
    }
}
