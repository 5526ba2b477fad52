//! Servers, clients and a router around a real store.
//!
//! Each simulated server has the real [`SharedRecords`]. What is around it in a server is modelled:
//! its keeper's rounds (`session/keep`), its answer to a client (`session/share`), and a client
//! that goes where an error sends it.
//!
//! All servers use the same two connections. A server gets them for one call, and gives them back.
//! The address that it has itself is a port without a listener, so a server that is cut off
//! gets the error of a store that is not there.

mod failures;

use std::collections::{BTreeSet, HashMap, HashSet};
use std::mem::swap;
use std::sync::PoisonError;
use std::time::{Duration, Instant};

use troupe_base::telemetry::Telemetry;

use super::super::testing::{Redis, free_port};
use super::super::{Claim, Held, Link, Place, SharedRecords, Terms, Want, key_of};
use super::ring::Ring;
use super::witness::{Moment, Witness};
use crate::records::{Changes, Kind, RecordStore as _, Tended};

/// The terms of servers are longer by this, so that the time of the test itself does not count.
/// Its clock is moved instead.
const SCALE: u32 = 10_000;
/// Time from one round of a server's keeper to the next, and between two calls of a client.
pub(super) const ROUND: Duration = Duration::from_millis(250 * SCALE as u64);
/// Servers have their rounds in turns, and clients make their calls in turns.
pub(super) const STEPS_OF_ROUND: usize = 5;
pub(super) const STEP: Duration = Duration::from_millis(50 * SCALE as u64);
/// Time for which a record counts after its lease.
const KEEP: Duration = Duration::from_secs(3600 * SCALE as u64);
/// Calls that a client makes before it waits: to a dead server, to another, and to the one that
/// this names.
const CALLS: usize = 4;

/// Moves the clock of Redis for all leases: their ends are nearer. Keys stay for ten thousand
/// hours after that, so their own end does not matter here.
const ADVANCE: &str = r"
for _, key in ipairs(redis.call('KEYS', 'troupe:session:*')) do
  redis.call('HINCRBY', key, 'until', -ARGV[1])
end
";

/// A server's times, as the simulation has them.
pub(super) fn terms() -> Terms {
    let usual = Terms::default();
    Terms {
        lease: usual.lease * SCALE,
        renew: usual.renew * SCALE,
        remember: usual.remember * SCALE,
        settle: usual.settle * SCALE,
        // A client that finds no session ends an experiment.
        fill: Duration::ZERO,
    }
}

pub(super) fn in_leases(time: Duration) -> f64 {
    time.as_secs_f64() / terms().lease.as_secs_f64()
}

/// A session on a server.
struct State {
    /// Rises with each change.
    version: u64,
    is_unwritten: bool,
}

struct Server {
    records: SharedRecords,
    /// The sessions that it serves.
    sessions: HashMap<usize, State>,
    is_alive: bool,
    /// Whether it does not reach the store.
    is_cut_off: bool,
    /// Whether the router sends to it.
    is_routed: bool,
}

impl Server {
    fn held(&self) -> HashMap<usize, Held> {
        let held = self.records.leases.held();
        held.iter()
            .map(|((_, name), held)| (number_in(name), *held))
            .collect()
    }
}

/// A client with one session.
#[derive(Clone, Default)]
struct Client {
    /// The server of its open stream.
    stream: Option<usize>,
    /// The server that an error named.
    named: Option<usize>,
    /// When its stream broke, if no server has had its session since.
    waits_since: Option<Duration>,
}

/// A server's answer to a client.
pub(super) enum Said {
    Here,
    Elsewhere(usize),
    Unknown,
    NoStore,
}

pub(super) struct Cluster {
    redis: Redis,
    store: redis::Connection,
    nowhere: Place,
    telemetry: Telemetry,
    claims: Link,
    keeper: Link,
    ring: Ring,
    servers: Vec<Server>,
    clients: Vec<Client>,
    begun: Instant,
    moved: Duration,
    steps: usize,
    pub(super) witness: Witness,
    /// Times that clients had no server with their sessions.
    pub(super) waits: Vec<Duration>,
    /// Number of writes and renewals that Redis refused.
    pub(super) fenced: usize,
    /// Number of rounds that failed, because the store did not answer.
    pub(super) failed_rounds: usize,
    /// Sessions that a server said do not exist.
    pub(super) gone: BTreeSet<usize>,
}

/// A quarter of the characters walk: they change all the time.
pub(super) fn walks(session: usize) -> bool {
    session.is_multiple_of(4)
}

fn name(session: usize) -> String {
    format!("npc-{session}")
}

fn address(server: usize) -> String {
    format!("troupe-{server}:8080")
}

/// The number in a name or address.
fn number_in(text: &str) -> usize {
    let digits: String = text.chars().skip_while(|c| !c.is_ascii_digit()).collect();
    let digits = digits.split(':').next().unwrap();
    digits.parse().unwrap()
}

fn record(session: usize, version: u64, server: usize) -> Vec<u8> {
    format!("{version} of {session} at {server}").into_bytes()
}

fn version_of(record: &[u8]) -> u64 {
    let text = str::from_utf8(record).unwrap();
    text.split(' ').next().unwrap().parse().unwrap()
}

impl Cluster {
    /// `None` if there is no program for the store. All sessions are open and written.
    pub(super) fn start(servers: usize, sessions: usize) -> Option<Self> {
        let redis = Redis::start()?;
        let place = |port| -> Place { format!("redis://127.0.0.1:{port}").parse().unwrap() };
        let (here, nowhere) = (place(redis.port), place(free_port()));
        let client = redis::Client::open(format!("redis://127.0.0.1:{}", redis.port)).unwrap();
        let mut cluster = Self {
            store: client.get_connection().unwrap(),
            redis,
            nowhere,
            telemetry: Telemetry::new().unwrap(),
            claims: Link::new(here.clone()),
            keeper: Link::new(here),
            ring: Ring::new(servers),
            servers: Vec::new(),
            clients: vec![Client::default(); sessions],
            begun: Instant::now(),
            moved: Duration::ZERO,
            steps: 0,
            witness: Witness::new(terms().lease),
            waits: Vec::new(),
            fenced: 0,
            failed_rounds: 0,
            gone: BTreeSet::new(),
        };
        for number in 0..servers {
            let server = cluster.new_server(number);
            cluster.servers.push(server);
        }
        cluster.open_all();
        // Each server has a round, and each client a call.
        cluster.run(STEPS_OF_ROUND);
        Some(cluster)
    }

    fn new_server(&self, number: usize) -> Server {
        Server {
            records: SharedRecords::new(&self.nowhere, address(number), terms(), &self.telemetry),
            sessions: HashMap::new(),
            is_alive: true,
            is_cut_off: false,
            is_routed: true,
        }
    }

    /// Each client opens its session at the server that the router chooses.
    fn open_all(&mut self) {
        let mut of_servers = vec![Vec::new(); self.servers.len()];
        for session in 0..self.clients.len() {
            let server = self.route(session).unwrap();
            self.clients[session].stream = Some(server);
            of_servers[server].push(session);
        }
        for (server, sessions) in of_servers.into_iter().enumerate() {
            let asked: Vec<_> = sessions
                .iter()
                .map(|&session| (Kind::Session, name(session), Want::New))
                .collect();
            let (claims, at) = self.lend(server, |records| records.leases.claim(&asked));
            for (session, claim) in sessions.into_iter().zip(claims.unwrap()) {
                assert_eq!(claim, Claim::Taken(None));
                self.took(server, session, None, at);
            }
        }
    }

    fn took(&mut self, server: usize, session: usize, record: Option<Vec<u8>>, at: Moment) {
        let token = self.servers[server].records.leases.held()[&(Kind::Session, name(session))].token;
        let state = State {
            version: record.as_deref().map_or(0, version_of),
            is_unwritten: true,
        };
        self.servers[server].sessions.insert(session, state);
        self.witness.claimed(session, server, token, at, record);
    }

    /// Time of the simulation.
    pub(super) fn now(&self) -> Duration {
        self.begun.elapsed() + self.moved
    }

    /// Moves the clocks of the store and of all servers.
    fn advance(&mut self, by: Duration) {
        let by_ms = u64::try_from(by.as_millis()).unwrap();
        redis::cmd("EVAL")
            .arg(ADVANCE)
            .arg(0)
            .arg(by_ms)
            .exec(&mut self.store)
            .unwrap();
        for server in &self.servers {
            for held in server.records.leases.held().values_mut() {
                held.renewed -= by;
                held.asked -= by;
            }
        }
        self.moved += by;
    }

    /// Has a server do something with its records, over the shared connections.
    fn lend<T>(&mut self, server: usize, work: impl FnOnce(&mut SharedRecords) -> T) -> (T, Moment) {
        let sent = self.now();
        let is_cut_off = self.servers[server].is_cut_off;
        if !is_cut_off {
            self.swap_links(server);
        }
        let done = work(&mut self.servers[server].records);
        if !is_cut_off {
            self.swap_links(server);
        }
        let answered = self.now();
        (done, Moment { sent, answered })
    }

    fn swap_links(&mut self, server: usize) {
        let records = &mut self.servers[server].records;
        swap(&mut records.link, &mut self.keeper);
        let mut claims = records
            .leases
            .claims
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        swap(&mut *claims, &mut self.claims);
    }

    /// The server to which the router sends a client.
    fn route(&self, session: usize) -> Option<usize> {
        let is_routed = |server: usize| self.servers[server].is_routed;
        let named = self.clients[session].named.filter(|&server| is_routed(server));
        named.or_else(|| self.ring.route(&name(session), is_routed))
    }

    /// A fifth of a round: clients call, and servers write.
    pub(super) fn step(&mut self) {
        self.advance(STEP);
        self.steps += 1;
        let turn = self.steps % STEPS_OF_ROUND;
        for session in (turn..self.clients.len()).step_by(STEPS_OF_ROUND) {
            self.call(session);
        }
        for server in (turn..self.servers.len()).step_by(STEPS_OF_ROUND) {
            self.round(server);
        }
    }

    pub(super) fn run(&mut self, steps: usize) {
        (0..steps).for_each(|_| self.step());
    }

    /// A client's call: on its stream, or by the router.
    fn call(&mut self, session: usize) {
        let stream = self.clients[session].stream;
        if stream.is_some_and(|server| self.servers[server].sessions.contains_key(&session)) {
            return;
        }
        self.clients[session].stream = None;
        for _ in 0..CALLS {
            let Some(server) = self.route(session) else { return };
            if !self.servers[server].is_alive {
                // The router notices by the connection that fails.
                self.servers[server].is_routed = false;
                self.clients[session].named = None;
                continue;
            }
            match self.ask(server, session) {
                Said::Here => {
                    let now = self.now();
                    let client = &mut self.clients[session];
                    client.stream = Some(server);
                    self.waits
                        .extend(client.waits_since.take().map(|since| now - since));
                    return;
                }
                Said::Elsewhere(owner) => {
                    if self.clients[session].named.replace(owner) == Some(owner) {
                        return;
                    }
                }
                Said::Unknown | Said::NoStore => return,
            }
        }
    }

    /// Asks a server for a session. It takes the session over if it can.
    pub(super) fn ask(&mut self, server: usize, session: usize) -> Said {
        if self.servers[server].sessions.contains_key(&session) {
            return Said::Here;
        }
        let asked = [(Kind::Session, name(session), Want::Known)];
        let (claims, at) = self.lend(server, |records| records.leases.claim(&asked));
        let Ok(mut claims) = claims else {
            return Said::NoStore;
        };
        match claims.remove(0) {
            Claim::Taken(record) => {
                self.took(server, session, record, at);
                Said::Here
            }
            Claim::Elsewhere { owner, ends_in } => {
                assert!(ends_in <= terms().lease, "{ends_in:?}");
                let owner = number_in(&owner);
                self.witness.refused(session, server, owner, at);
                Said::Elsewhere(owner)
            }
            Claim::Unknown => {
                self.witness.unknown(session, server);
                self.gone.insert(session);
                Said::Unknown
            }
            other => panic!("{other:?} for session {session} at {server}"),
        }
    }

    /// A round of a server's keeper: it writes what has changed, and renews the other leases.
    pub(super) fn round(&mut self, number: usize) {
        let server = &mut self.servers[number];
        if !server.is_alive {
            return;
        }
        let (mut changes, mut records) = (Changes::default(), HashMap::new());
        for (&session, state) in &mut server.sessions {
            if walks(session) {
                state.version += 1;
                state.is_unwritten = true;
            }
            if state.is_unwritten {
                let record = record(session, state.version, number);
                changes.put_for(KEEP, Kind::Session, name(session), record.clone());
                records.insert(session, record);
            }
        }
        let open: HashSet<usize> = server.sessions.keys().copied().collect();
        let before = server.held();
        let (written, at) = self.lend(number, |store| store.write(&changes));
        let Ok(written) = written else {
            self.failed_rounds += 1;
            return;
        };
        self.settle(number, &written, &before, at, records);
        let before = self.servers[number].held();
        let is_open = |_: Kind, name: &str| open.contains(&number_in(name));
        let (tended, at) = self.lend(number, |store| store.tend(&is_open));
        match tended {
            Ok(tended) => self.settle(number, &tended, &before, at, HashMap::new()),
            Err(_) => self.failed_rounds += 1,
        }
    }

    /// Does what the keeper does after a round, and tells the witness what Redis did.
    fn settle(
        &mut self,
        number: usize,
        tended: &Tended,
        before: &HashMap<usize, Held>,
        at: Moment,
        mut records: HashMap<usize, Vec<u8>>,
    ) {
        let server = &mut self.servers[number];
        for lost in &tended.lost {
            let session = number_in(&lost.name);
            server.sessions.remove(&session);
            self.fenced += 1;
            let owner = Some(&lost.owner).filter(|owner| !owner.is_empty());
            self.witness
                .lost(session, number, owner.map(|owner| number_in(owner)));
        }
        for (session, held) in server.held() {
            let Some(last) = before.get(&session).filter(|last| last.renewed != held.renewed) else {
                continue;
            };
            let record = records.remove(&session);
            if record.is_some()
                && let Some(state) = server.sessions.get_mut(&session)
            {
                state.is_unwritten = false;
            }
            if held.token == last.token {
                self.witness.kept(session, number, held.token, at, record);
            } else {
                let tokens = (held.token, held.rank);
                self.witness.took_again(session, number, tokens, at, record);
            }
        }
        for (_, name) in &tended.forgotten {
            if let Some(state) = server.sessions.get_mut(&number_in(name)) {
                state.is_unwritten = true;
            }
        }
    }
}
