//! Clients, and limits on what they may use at a time: memory for requests and answers in transfer,
//! streams, and sessions.
//!
//! A client is a key; without keys, a connection. Its usage counts three times: for the client, for
//! the address of its connection, and for all clients together. Each of these has a limit. A server
//! without keys only tells addresses apart: a connection may take all that its address may.

mod debt;
mod identity;
mod metrics;
mod resets;

use std::collections::HashMap;
use std::net::{IpAddr, Ipv4Addr};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::time::{Duration, Instant};

use http::HeaderValue;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use debt::{Debtor, KeyHash};
use metrics::ClientMetrics;
use troupe_base::telemetry::Telemetry;
use troupe_base::turns::{ClientId, Line, Turns};

pub(crate) use debt::Debts;
pub(crate) use resets::Resets;

pub use identity::{Identity, Quota, Recorded, Role};

/// Number of accounts from which unused ones are forgotten.
const MANY_ACCOUNTS: usize = 1024;
/// Bytes of a piece; memory is counted in pieces.
const PIECE: usize = 1024;

/// Limits on usage at a time.
#[derive(Debug, Clone, Copy)]
pub struct Share {
    /// Bytes of requests and answers in transfer.
    pub bytes: usize,
    /// Open streams.
    pub streams: usize,
    /// Open sessions.
    pub sessions: usize,
}

/// The shares of a server's clients.
#[derive(Debug, Clone, Copy)]
pub struct Shares {
    /// For each client.
    pub client: Share,
    /// For all clients of one address together.
    pub address: Share,
    /// For all clients together.
    pub all: Share,
}

/// A limit that was reached.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{} has {what}; allowed at a time: {allowed}", whose.text())]
pub struct Exhausted {
    /// The missing resource, for the message.
    what: &'static str,
    whose: Whose,
    /// The limit, for the message.
    pub allowed: String,
    /// Whether the request is over the limit by itself, so that a retry cannot help.
    pub never: bool,
}

/// The owner of a share.
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

/// Usage of one share.
#[derive(Debug)]
struct Level {
    whose: Whose,
    share: Share,
    quota: Quota,
    memory: Arc<Semaphore>,
    streams: Arc<Semaphore>,
    sessions: Arc<Semaphore>,
    turns: Arc<Line>,
    /// Calls that clients cancelled, for an address.
    resets: Resets,
    /// What clients owe, for an address.
    debts: Debts,
}

impl Level {
    fn new(whose: Whose, share: Share) -> Arc<Self> {
        Self::with_quota(whose, share, Quota::default())
    }

    fn with_quota(whose: Whose, usual: Share, quota: Quota) -> Arc<Self> {
        let share = Share {
            bytes: quota.bytes.unwrap_or(usual.bytes),
            streams: quota.streams.unwrap_or(usual.streams),
            sessions: quota.sessions.unwrap_or(usual.sessions),
        };
        let places = |count: usize| Arc::new(Semaphore::new(count.min(Semaphore::MAX_PERMITS)));
        Arc::new(Self {
            whose,
            share,
            quota,
            memory: places(share.bytes / PIECE),
            streams: places(share.streams),
            sessions: places(share.sessions),
            turns: Line::new(),
            resets: Resets::of_address(),
            debts: Debts::default(),
        })
    }

    /// The limit, for errors, with the option that decides it.
    fn allowed(&self, allowed: String, quota: Option<usize>, option: &str) -> String {
        match (quota, self.whose) {
            (Some(_), _) => format!("{allowed} ({option} of the key)"),
            (None, Whose::All) => format!("{allowed} ({option})"),
            (None, _) => format!("{allowed} (a share of {option})"),
        }
    }

    /// Whether any client, stream or session uses it. Each of them holds its client.
    fn is_used(level: &Arc<Self>) -> bool {
        Arc::strong_count(level) > 1
    }
}

/// All clients of a server.
#[derive(Debug)]
pub struct Clients {
    shares: Shares,
    all: Arc<Level>,
    by_address: Mutex<HashMap<IpAddr, Weak<Level>>>,
    /// By account: each key and each subject of tokens has one.
    by_key: Mutex<HashMap<String, Arc<Level>>>,
    metrics: Arc<ClientMetrics>,
}

impl Clients {
    /// Starts without clients.
    pub fn new(shares: Shares, telemetry: &Telemetry) -> Self {
        Self {
            shares,
            all: Level::new(Whose::All, shares.all),
            by_address: Mutex::default(),
            by_key: Mutex::default(),
            metrics: Arc::new(ClientMetrics::new(telemetry)),
        }
    }

    /// A new client with its own share, which has connected from `address`.
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
            authorization: None,
            metrics: self.metrics.clone(),
        })
    }

    /// The client of an account, on a connection of `connected`. If the account's quota has
    /// changed, its usage is counted from zero again. `authorization` is the header with the key.
    pub(crate) fn with_key(
        &self,
        account: &str,
        quota: Quota,
        authorization: Option<&HeaderValue>,
        connected: &Client,
    ) -> Arc<Client> {
        let mut keys = self.by_key.lock().unwrap_or_else(PoisonError::into_inner);
        let known = keys.get(account).filter(|level| level.quota == quota).cloned();
        let of_key = known.unwrap_or_else(|| {
            if keys.len() >= MANY_ACCOUNTS {
                keys.retain(|_, level| Level::is_used(level));
            }
            let level = Level::with_quota(Whose::Key, self.shares.client, quota);
            keys.insert(account.to_owned(), level.clone());
            level
        });
        let [_, of_address, all] = &connected.levels;
        Arc::new(Client {
            address: connected.address,
            levels: [of_key, of_address.clone(), all.clone()],
            authorization: authorization.cloned(),
            metrics: self.metrics.clone(),
        })
    }

    /// A client without a connection, for a call from within the process.
    pub fn within(&self) -> Arc<Client> {
        self.connected(IpAddr::V4(Ipv4Addr::LOCALHOST))
    }
}

/// One client.
#[derive(Debug)]
pub struct Client {
    /// Of its connection; for IPv6 the /64 network.
    address: IpAddr,
    levels: [Arc<Level>; 3],
    /// The header with its key. None without keys, or for a ticket.
    authorization: Option<HeaderValue>,
    metrics: Arc<ClientMetrics>,
}

impl Client {
    /// The address of its connection; for IPv6 the /64 network.
    pub fn address(&self) -> IpAddr {
        self.address
    }

    /// Identifies the client to the queues. A key shares with nothing, a connection with the others
    /// of its address.
    pub fn id(&self) -> ClientId {
        let [of_client, of_address, _] = &self.levels;
        let own = of_client.turns.id();
        let group = match of_client.whose {
            Whose::Key => own,
            _ => of_address.turns.id(),
        };
        ClientId {
            group,
            own,
            share: of_client.quota.share.unwrap_or(1),
        }
    }

    /// Which of its sessions are recorded. Without keys a client may ask for it.
    pub fn recorded(&self) -> Recorded {
        let [of_client, ..] = &self.levels;
        match of_client.whose {
            Whose::Key => of_client.quota.recorded.unwrap_or(Recorded::Never),
            _ => Recorded::Asked,
        }
    }

    /// The client's fair turns on the server's threads.
    pub fn turns(&self) -> Turns {
        let [of_client, of_address, _] = &self.levels;
        Turns::new(self.id(), [&of_client.turns, &of_address.turns])
    }

    /// Notes that a call of the client was refused because `queue` is full, and may be sent again
    /// after `wait`.
    pub fn owes(&self, queue: &str, wait: Duration) {
        let [of_client, ..] = &self.levels;
        let debtor = match (&self.authorization, of_client.whose) {
            (Some(header), _) => Debtor::Key(KeyHash::of(header), self.id()),
            // Its key came by a ticket, so no header names it.
            (None, Whose::Key) => return,
            (None, _) => Debtor::Address,
        };
        self.debts().add(debtor, queue, Instant::now() + wait);
    }

    /// Who owes something to this queue, or to any if none is given, if a call on the connection
    /// with this header does.
    pub(crate) fn debtor(
        &self,
        authorization: Option<&HeaderValue>,
        queue: Option<&str>,
    ) -> Option<ClientId> {
        self.debts().of(authorization, self.id(), queue, Instant::now())
    }

    /// What the clients of its address owe.
    pub(crate) fn debts(&self) -> &Debts {
        let [_, of_address, _] = &self.levels;
        &of_address.debts
    }

    /// Cancelled calls of all connections of its address.
    pub(crate) fn resets(&self) -> &Resets {
        let [_, of_address, _] = &self.levels;
        &of_address.resets
    }

    /// Counts and logs a connection that is cut because most of its calls were cancelled.
    pub(crate) fn note_resets(&self) {
        self.metrics.reset(self.address);
    }

    /// Takes memory for a request or an answer. Dropping it gives it back.
    ///
    /// # Errors
    /// [`Exhausted`] at once if there is not enough.
    pub fn memory(self: &Arc<Self>, bytes: usize) -> Result<Memory, Exhausted> {
        let mut memory = self.no_memory();
        memory.grow(bytes)?;
        Ok(memory)
    }

    /// Memory of no bytes, which can grow.
    pub(crate) fn no_memory(self: &Arc<Self>) -> Memory {
        Memory {
            client: self.clone(),
            bytes: 0,
            permits: Vec::new(),
        }
    }

    /// Takes a place for a stream. Dropping it gives it back.
    ///
    /// # Errors
    /// [`Exhausted`] at once if none is free.
    pub fn stream(self: &Arc<Self>) -> Result<StreamPlace, Exhausted> {
        let places = |level: &Level| level.streams.clone();
        let permits = self.permits(1, places, |level| {
            let metrics = &self.metrics;
            metrics.refused(&metrics.streams_refused, level.whose, "streams", self.address);
            let most = level.share.streams;
            Exhausted {
                what: "no room for another stream",
                whose: level.whose,
                allowed: level.allowed(format!("{most} streams"), level.quota.streams, "max_streams"),
                never: most == 0,
            }
        })?;
        Ok(StreamPlace {
            _client: self.clone(),
            _permits: permits,
        })
    }

    /// Whether there is room for `count` more sessions.
    pub fn has_room_for(&self, count: usize) -> bool {
        let mut levels = self.levels.iter();
        levels.all(|level| level.sessions.available_permits() >= count)
    }

    /// Takes places for `count` sessions. Dropping one gives it back.
    ///
    /// # Errors
    /// [`Exhausted`] if there is no room for all of them.
    pub fn sessions(self: &Arc<Self>, count: usize) -> Result<SessionPlaces, Exhausted> {
        let places = |level: &Level| level.sessions.clone();
        let permits = self.permits(count, places, |level| {
            let metrics = &self.metrics;
            metrics.refused(&metrics.sessions_refused, level.whose, "sessions", self.address);
            let most = level.share.sessions;
            Exhausted {
                what: "no room for as many sessions",
                whose: level.whose,
                allowed: level.allowed(format!("{most} sessions"), level.quota.sessions, "max_sessions"),
                never: count > most,
            }
        })?;
        Ok(SessionPlaces {
            client: self.clone(),
            permits,
        })
    }

    /// Takes `count` permits of each level, or none.
    fn permits(
        &self,
        count: usize,
        places: impl Fn(&Level) -> Arc<Semaphore>,
        refused: impl Fn(&Level) -> Exhausted,
    ) -> Result<Vec<OwnedSemaphorePermit>, Exhausted> {
        let count = u32::try_from(count).ok();
        let permits = self.levels.iter().map(|level| {
            let permit = count.and_then(|count| places(level).try_acquire_many_owned(count).ok());
            permit.ok_or_else(|| refused(level))
        });
        permits.collect()
    }
}

/// A client's place for a stream.
#[derive(Debug)]
pub struct StreamPlace {
    /// Keeps the client's account alive.
    _client: Arc<Client>,
    _permits: Vec<OwnedSemaphorePermit>,
}

/// A client's places for sessions that are being opened.
#[derive(Debug)]
pub struct SessionPlaces {
    client: Arc<Client>,
    /// One for each level of the client.
    permits: Vec<OwnedSemaphorePermit>,
}

impl SessionPlaces {
    /// Splits off the place of one session. None if no place is left.
    pub fn split(&mut self) -> Option<SessionPlace> {
        let permits = self.permits.iter_mut().map(|permit| permit.split(1));
        Some(SessionPlace {
            _client: self.client.clone(),
            _permits: permits.collect::<Option<_>>()?,
        })
    }
}

/// A client's place for an open session.
#[derive(Debug)]
pub struct SessionPlace {
    /// Keeps the client's account alive.
    _client: Arc<Client>,
    _permits: Vec<OwnedSemaphorePermit>,
}

/// Memory that counts for a client's request or answer.
#[derive(Debug)]
pub struct Memory {
    client: Arc<Client>,
    bytes: usize,
    /// One for each level of the client.
    permits: Vec<OwnedSemaphorePermit>,
}

impl Memory {
    /// Bytes taken so far.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// Takes `more` bytes.
    ///
    /// # Errors
    /// [`Exhausted`] if there is not enough; then nothing changes.
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
                        allowed: level.allowed(
                            format!("{} bytes in transfer", level.share.bytes),
                            level.quota.bytes,
                            "transfer_memory_mib",
                        ),
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
#[path = "clients/tests.rs"]
mod tests;
