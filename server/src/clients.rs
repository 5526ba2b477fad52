//! Who asks, and how much of the server it may have at a time: memory for requests and answers on their way, and streams.
//!
//! A client is a key; without keys, a connection. What it takes counts for the client, for the address of its connection, and for all
//! together, and each has a limit.

use std::collections::HashMap;
use std::net::{IpAddr, Ipv4Addr};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::Instant;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::telemetry::{Counter, Gauge, Labels, Metric, Seldom, Telemetry};

const TRANSFER: Metric = Metric::new(
    "troupe_transfer_memory_bytes",
    "Memory of requests and answers on their way",
);
const REFUSED: Metric = Metric::new(
    "troupe_client_refusals_total",
    "What clients were refused because of a limit, by kind (memory, streams) and whose limit it was (client, key, address, all)",
);

/// Memory is counted in such pieces, bytes.
const PIECE: usize = 1024;

/// What somebody may have at a time.
#[derive(Debug, Clone, Copy)]
pub struct Share {
    /// Bytes of requests and answers on their way.
    pub bytes: usize,
    /// Streams.
    pub streams: usize,
}

/// The shares of a server's clients.
#[derive(Debug, Clone, Copy)]
pub struct Shares {
    /// Of one client.
    pub client: Share,
    /// Of all clients of one address.
    pub address: Share,
    /// Of all clients.
    pub all: Share,
}

/// A limit that was reached.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{} has {what}; allowed at a time: {allowed}", whose.text())]
pub struct Exhausted {
    /// What there is too much of.
    what: &'static str,
    /// Whose limit it is.
    whose: Whose,
    /// The limit.
    pub allowed: String,
    /// Whether it would be refused even with nothing else on its way.
    pub never: bool,
}

/// Whose a share is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Whose {
    Client,
    Key,
    Address,
    All,
}

impl Whose {
    const EACH: [Self; 4] = [Self::Client, Self::Key, Self::Address, Self::All];

    /// In errors.
    fn text(self) -> &'static str {
        match self {
            Self::Client => "this client",
            Self::Key => "this key",
            Self::Address => "this address",
            Self::All => "all clients together",
        }
    }

    /// In metrics.
    fn label(self) -> &'static str {
        match self {
            Self::Client => "client",
            Self::Key => "key",
            Self::Address => "address",
            Self::All => "all",
        }
    }
}

/// What is left of one share.
#[derive(Debug)]
struct Level {
    whose: Whose,
    share: Share,
    memory: Arc<Semaphore>,
    streams: Arc<Semaphore>,
}

impl Level {
    fn new(whose: Whose, share: Share) -> Arc<Self> {
        Arc::new(Self {
            whose,
            share,
            memory: Arc::new(Semaphore::new((share.bytes / PIECE).min(Semaphore::MAX_PERMITS))),
            streams: Arc::new(Semaphore::new(share.streams.min(Semaphore::MAX_PERMITS))),
        })
    }
}

/// All clients of a server.
#[derive(Debug)]
pub struct Clients {
    shares: Shares,
    all: Arc<Level>,
    by_address: Mutex<HashMap<IpAddr, Weak<Level>>>,
    /// As many as there are keys.
    by_key: Mutex<HashMap<String, Arc<Level>>>,
    metrics: Arc<ClientMetrics>,
}

/// The metrics of all clients.
#[derive(Debug)]
struct ClientMetrics {
    transfer: Gauge,
    /// By whose limit it was, as [`Whose::EACH`].
    memory_refused: [Counter; 4],
    streams_refused: [Counter; 4],
    refusals: Mutex<Seldom>,
}

impl ClientMetrics {
    fn new(telemetry: &Telemetry) -> Self {
        let refused = |kind: &'static str| {
            Whose::EACH.map(|whose| {
                let labels = Labels::default().with("kind", kind).with("whose", whose.label());
                telemetry.counter(&REFUSED, &labels)
            })
        };
        Self {
            transfer: telemetry.gauge(&TRANSFER, &Labels::default()),
            memory_refused: refused("memory"),
            streams_refused: refused("streams"),
            refusals: Mutex::default(),
        }
    }

    /// A client at `address` was refused.
    fn refused(&self, by_whose: &[Counter; 4], whose: Whose, kind: &'static str, address: IpAddr) {
        by_whose[whose as usize].increment(1);
        let next = self
            .refusals
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .next(Instant::now());
        if let Some(held_back) = next {
            let whose = whose.label();
            tracing::warn!(kind, whose, %address, held_back, "a limit of clients is reached");
        }
    }
}

impl Clients {
    /// No clients yet.
    pub fn new(shares: Shares, telemetry: &Telemetry) -> Self {
        Self {
            shares,
            all: Level::new(Whose::All, shares.all),
            by_address: Mutex::default(),
            by_key: Mutex::default(),
            metrics: Arc::new(ClientMetrics::new(telemetry)),
        }
    }

    /// A client that has just connected from `address`.
    pub fn connected(&self, address: IpAddr) -> Arc<Client> {
        let mut addresses = self.by_address.lock().unwrap_or_else(PoisonError::into_inner);
        let known = addresses.get(&address).and_then(Weak::upgrade);
        let of_address = known.unwrap_or_else(|| {
            addresses.retain(|_, level| level.strong_count() > 0);
            let level = Level::new(Whose::Address, self.shares.address);
            addresses.insert(address, Arc::downgrade(&level));
            level
        });
        Arc::new(Client {
            address,
            levels: [
                Level::new(Whose::Client, self.shares.client),
                of_address,
                self.all.clone(),
            ],
            metrics: self.metrics.clone(),
        })
    }

    /// The client whose key has this name, on a connection of `connected`.
    pub fn with_key(&self, name: &str, connected: &Client) -> Arc<Client> {
        let mut keys = self.by_key.lock().unwrap_or_else(PoisonError::into_inner);
        let of_key = match keys.get(name) {
            Some(level) => level.clone(),
            None => {
                let level = Level::new(Whose::Key, self.shares.client);
                keys.insert(name.to_owned(), level.clone());
                level
            }
        };
        let [_, of_address, all] = &connected.levels;
        Arc::new(Client {
            address: connected.address,
            levels: [of_key, of_address.clone(), all.clone()],
            metrics: self.metrics.clone(),
        })
    }

    /// A client that came without a connection: a call from within the process.
    pub fn within(&self) -> Arc<Client> {
        self.connected(IpAddr::V4(Ipv4Addr::LOCALHOST))
    }
}

/// One client.
#[derive(Debug)]
pub struct Client {
    /// Of its connection; of IPv6 the network.
    address: IpAddr,
    levels: [Arc<Level>; 3],
    metrics: Arc<ClientMetrics>,
}

impl Client {
    /// The address of its connection; of IPv6 the network.
    pub fn address(&self) -> IpAddr {
        self.address
    }

    /// Memory for a request or an answer, until it is dropped.
    ///
    /// # Errors
    /// [`Exhausted`] at once where there is not as much.
    pub fn memory(self: &Arc<Self>, bytes: usize) -> Result<Memory, Exhausted> {
        let mut memory = self.no_memory();
        memory.grow(bytes)?;
        Ok(memory)
    }

    /// Memory that grows from nothing.
    pub fn no_memory(self: &Arc<Self>) -> Memory {
        Memory {
            client: self.clone(),
            bytes: 0,
            permits: Vec::new(),
        }
    }

    /// A place for a stream, until it is dropped.
    ///
    /// # Errors
    /// [`Exhausted`] at once where there is none.
    pub fn stream(&self) -> Result<StreamPlace, Exhausted> {
        let mut permits = Vec::with_capacity(self.levels.len());
        for level in &self.levels {
            let permit = level.streams.clone().try_acquire_owned().map_err(|_| {
                let metrics = &self.metrics;
                metrics.refused(&metrics.streams_refused, level.whose, "streams", self.address);
                Exhausted {
                    what: "no room for another stream",
                    whose: level.whose,
                    allowed: format!("{} streams", level.share.streams),
                    never: level.share.streams == 0,
                }
            })?;
            permits.push(permit);
        }
        Ok(StreamPlace { _permits: permits })
    }
}

/// A client's place for a stream.
#[derive(Debug)]
pub struct StreamPlace {
    _permits: Vec<OwnedSemaphorePermit>,
}

/// Memory that a client has for a request or an answer.
#[derive(Debug)]
pub struct Memory {
    client: Arc<Client>,
    bytes: usize,
    /// By level.
    permits: Vec<OwnedSemaphorePermit>,
}

impl Memory {
    /// Bytes of it.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// Takes more.
    ///
    /// # Errors
    /// [`Exhausted`] where there is not as much; then it is as before.
    pub fn grow(&mut self, more: usize) -> Result<(), Exhausted> {
        let pieces = |bytes: usize| bytes.div_ceil(PIECE);
        let wanted = pieces(self.bytes.saturating_add(more)) - pieces(self.bytes);
        let mut fresh = Vec::with_capacity(self.client.levels.len());
        for level in &self.client.levels {
            let permit = u32::try_from(wanted)
                .ok()
                .and_then(|wanted| level.memory.clone().try_acquire_many_owned(wanted).ok());
            match permit {
                Some(permit) => fresh.push(permit),
                None => {
                    let Client { metrics, address, .. } = &*self.client;
                    metrics.refused(&metrics.memory_refused, level.whose, "memory", *address);
                    return Err(Exhausted {
                        what: "no memory left for this request and its answer",
                        whose: level.whose,
                        allowed: format!("{} bytes on their way", level.share.bytes),
                        never: self.bytes.saturating_add(more) > level.share.bytes,
                    });
                }
            }
        }
        match self.permits.is_empty() {
            true => self.permits = fresh,
            false => self
                .permits
                .iter_mut()
                .zip(fresh)
                .for_each(|(held, fresh)| held.merge(fresh)),
        }
        self.bytes += more;
        self.client.metrics.transfer.increment(more as f64);
        Ok(())
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        self.client.metrics.transfer.decrement(self.bytes as f64);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clients() -> Clients {
        let share = |bytes, streams| Share { bytes, streams };
        let shares = Shares {
            client: share(10 << 10, 2),
            address: share(15 << 10, 3),
            all: share(20 << 10, 4),
        };
        Clients::new(shares, &Telemetry::new().unwrap())
    }

    fn address(last: u8) -> IpAddr {
        IpAddr::from([10, 0, 0, last])
    }

    #[test]
    fn each_level_has_a_limit_and_gets_back_what_is_dropped() {
        let clients = clients();
        let (a, b, c) = (
            clients.connected(address(1)),
            clients.connected(address(1)),
            clients.connected(address(2)),
        );
        let first = a.memory(8 << 10).unwrap();
        let error = a.memory(4 << 10).unwrap_err();
        assert!(
            error.to_string().starts_with("this client has no memory"),
            "{error}"
        );
        assert!(!error.never && a.memory(11 << 10).unwrap_err().never);
        let second = b.memory(7 << 10).unwrap();
        let error = b.memory(1 << 10).unwrap_err();
        assert!(error.to_string().starts_with("this address"), "{error}");
        let third = c.memory(5 << 10).unwrap();
        let error = c.memory(1 << 10).unwrap_err();
        assert!(error.to_string().starts_with("all clients together"), "{error}");
        drop((first, second, third));
        assert!(a.memory(10 << 10).is_ok());
    }

    #[test]
    fn memory_grows_by_pieces_and_a_refusal_changes_nothing() {
        let clients = clients();
        let client = clients.connected(address(1));
        let mut memory = client.memory(1).unwrap();
        memory.grow(1023).unwrap();
        memory.grow(9 << 10).unwrap();
        memory.grow(1).unwrap_err();
        assert_eq!(memory.bytes(), 10 << 10);
        drop(memory);
        assert!(client.memory(10 << 10).is_ok());
    }

    #[test]
    fn a_key_has_one_share_on_all_its_connections() {
        let clients = clients();
        let connections: Vec<_> = (1..4).map(|last| clients.connected(address(last))).collect();
        let one = clients.with_key("one", &connections[0]);
        let again = clients.with_key("one", &connections[1]);
        let other = clients.with_key("other", &connections[2]);
        let _held = one.memory(6 << 10).unwrap();
        let error = again.memory(6 << 10).unwrap_err();
        assert!(error.to_string().starts_with("this key"), "{error}");
        assert!(other.memory(6 << 10).is_ok());
        // What the key has does not count for the connection beside it.
        assert!(connections[0].memory(9 << 10).is_ok());
    }

    #[test]
    fn streams_of_one_client_leave_room_for_others() {
        let clients = clients();
        let client = clients.connected(address(1));
        let held: Vec<_> = (0..2).map(|_| client.stream().unwrap()).collect();
        assert!(client.stream().is_err());
        assert!(clients.connected(address(1)).stream().is_ok());
        assert!(clients.connected(address(2)).stream().is_ok());
        drop(held);
        assert!(client.stream().is_ok());
    }
}
