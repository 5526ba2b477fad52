//! Clients, and limits on what they may use at a time: memory for requests and answers in transfer,
//! streams, and sessions.
//!
//! A client is a key; without keys, a connection. Its usage counts three times: for the client, for
//! the address of its connection, and for all clients together. Each of these has a limit.

mod identity;

use std::collections::{HashMap, HashSet};
use std::net::{IpAddr, Ipv4Addr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::Instant;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use troupe_base::telemetry::{Counter, Gauge, Labels, Metric, Seldom, Telemetry};
use troupe_base::turns::{ClientId, Line, Turns};

pub use identity::{Identity, Quota, Role};

const TRANSFER: Metric = Metric::new(
    "troupe_transfer_memory_bytes",
    "Memory of requests and answers in transfer",
);
const REFUSED: Metric = Metric::new(
    "troupe_client_refusals_total",
    "Requests of clients that were refused at a limit, by kind (memory, streams, sessions) and by owner \
     of the limit (client, key, address, all)",
);

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
    turns: Arc<Line>,
    sessions: Mutex<OwnSessions>,
}

/// Sessions that count for a quota.
#[derive(Debug, Default)]
struct OwnSessions {
    ids: HashSet<String>,
    /// Number of sessions that are being opened.
    coming: usize,
}

impl Level {
    fn new(whose: Whose, share: Share) -> Arc<Self> {
        Self::with_quota(whose, share, Quota::default())
    }

    fn with_quota(whose: Whose, usual: Share, quota: Quota) -> Arc<Self> {
        let share = Share {
            bytes: quota.bytes.unwrap_or(usual.bytes),
            streams: quota.streams.unwrap_or(usual.streams),
        };
        Arc::new(Self {
            whose,
            share,
            quota,
            sessions: Mutex::default(),
            memory: Arc::new(Semaphore::new((share.bytes / PIECE).min(Semaphore::MAX_PERMITS))),
            streams: Arc::new(Semaphore::new(share.streams.min(Semaphore::MAX_PERMITS))),
            turns: Line::new(),
        })
    }

    fn sessions(&self) -> MutexGuard<'_, OwnSessions> {
        self.sessions.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The limit, for errors: with the name of the key's option if the key sets it.
    fn allowed(&self, allowed: String, quota: Option<usize>, name: &str) -> String {
        match quota {
            Some(_) => format!("{allowed} ({name} of the key)"),
            None => allowed,
        }
    }

    /// Whether any client or session uses it.
    fn is_used(level: &Arc<Self>) -> bool {
        let sessions = level.sessions();
        Arc::strong_count(level) > 1 || sessions.coming > 0 || !sessions.ids.is_empty()
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

/// The metrics of all clients.
#[derive(Debug)]
struct ClientMetrics {
    transfer: Gauge,
    /// By owner of the limit, in the order of [`Whose::EACH`].
    memory_refused: [Counter; 4],
    streams_refused: [Counter; 4],
    sessions_refused: Counter,
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
            sessions_refused: {
                let labels = Labels::default().with("kind", "sessions");
                telemetry.counter(&REFUSED, &labels.with("whose", Whose::Key.label()))
            },
            refusals: Mutex::default(),
        }
    }

    /// Counts and logs a refusal of a client at `address`.
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
            metrics: self.metrics.clone(),
        })
    }

    /// The client of an account, on a connection of `connected`. If the account's quota has
    /// changed, its usage is counted from zero again.
    pub(crate) fn with_key(&self, account: &str, quota: Quota, connected: &Client) -> Arc<Client> {
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
    metrics: Arc<ClientMetrics>,
}

impl Client {
    /// The address of its connection; for IPv6 the /64 network.
    pub fn address(&self) -> IpAddr {
        self.address
    }

    /// The client's fair turns on the server's threads.
    pub fn turns(&self) -> Turns {
        let [of_client, of_address, _] = &self.levels;
        let own = of_client.turns.id();
        let group = match of_client.whose {
            Whose::Key => own,
            _ => of_address.turns.id(),
        };
        Turns::new(ClientId { group, own }, [&of_client.turns, &of_address.turns])
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
        let mut permits = Vec::with_capacity(self.levels.len());
        for level in &self.levels {
            let permit = level.streams.clone().try_acquire_owned().map_err(|_| {
                let metrics = &self.metrics;
                metrics.refused(&metrics.streams_refused, level.whose, "streams", self.address);
                Exhausted {
                    what: "no room for another stream",
                    whose: level.whose,
                    allowed: level.allowed(
                        format!("{} streams", level.share.streams),
                        level.quota.streams,
                        "max_streams",
                    ),
                    never: level.share.streams == 0,
                }
            })?;
            permits.push(permit);
        }
        Ok(StreamPlace {
            _client: self.clone(),
            _permits: permits,
        })
    }

    /// Reserves `count` sessions of the client's quota; none if it has no such quota. Sessions that
    /// `is_open` does not find any more no longer count.
    ///
    /// # Errors
    /// [`Exhausted`] if there is no room for all of them.
    pub fn sessions(
        self: &Arc<Self>,
        count: usize,
        is_open: impl Fn(&str) -> bool,
    ) -> Result<Option<SessionPlaces>, Exhausted> {
        let [level, ..] = &self.levels;
        let Some(most) = level.quota.sessions else {
            return Ok(None);
        };
        let mut own = level.sessions();
        if own.ids.len() + own.coming + count > most {
            own.ids.retain(|id| is_open(id));
        }
        if own.ids.len() + own.coming + count > most {
            self.metrics.sessions_refused.increment(1);
            return Err(Exhausted {
                what: "no room for as many sessions",
                whose: level.whose,
                allowed: level.allowed(format!("{most} sessions"), Some(most), "max_sessions"),
                never: count > most,
            });
        }
        own.coming += count;
        drop(own);
        Ok(Some(SessionPlaces {
            client: self.clone(),
            count,
        }))
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
    count: usize,
}

impl SessionPlaces {
    /// The sessions are open. They count until they are closed.
    pub fn keep<'a>(self, ids: impl IntoIterator<Item = &'a str>) {
        let [level, ..] = &self.client.levels;
        level.sessions().ids.extend(ids.into_iter().map(str::to_owned));
    }
}

impl Drop for SessionPlaces {
    fn drop(&mut self) {
        let [level, ..] = &self.client.levels;
        level.sessions().coming -= self.count;
    }
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
