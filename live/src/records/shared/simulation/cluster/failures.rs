//! Failures of the simulated servers and their store, and how all of them are compared with it.

use std::collections::HashMap;

use super::{Client, Cluster, Kind, key_of, name, number_in};
use crate::records::RecordStore as _;

/// A session in the store: owner, token and record.
type Stored = (Option<String>, Option<u64>, Option<Vec<u8>>);

impl Cluster {
    /// Servers die. The streams of their clients break.
    pub(in super::super) fn kill(&mut self, servers: &[usize]) {
        for &server in servers {
            self.servers[server].is_alive = false;
            self.servers[server].sessions.clear();
        }
        self.reconnect(servers);
    }

    /// Servers stop: they get nothing new, write all, give their leases up, and close.
    pub(in super::super) fn stop(&mut self, servers: &[usize]) {
        for &server in servers {
            self.servers[server].is_routed = false;
        }
        for &number in servers {
            self.round(number);
            let ((), at) = self.lend(number, |records| records.leave());
            let server = &mut self.servers[number];
            server.is_alive = false;
            for (session, _) in server.sessions.drain() {
                self.witness.released(session, number, at);
            }
        }
        self.reconnect(servers);
    }

    /// Servers start again. They know nothing of the time before.
    pub(in super::super) fn start_again(&mut self, servers: &[usize]) {
        for &server in servers {
            self.servers[server] = self.new_server(server);
        }
    }

    /// Servers do not reach the store any more.
    pub(in super::super) fn cut_off(&mut self, servers: &[usize]) {
        for &server in servers {
            self.servers[server].is_cut_off = true;
        }
    }

    /// The router does not reach servers any more, which go on.
    pub(in super::super) fn cut_off_from_router(&mut self, servers: &[usize]) {
        for &server in servers {
            self.servers[server].is_routed = false;
        }
        self.reconnect(servers);
    }

    /// The network is whole again.
    pub(in super::super) fn bring_back(&mut self, servers: &[usize]) {
        for &server in servers {
            self.servers[server].is_cut_off = false;
            self.servers[server].is_routed = true;
        }
    }

    /// The store loses everything.
    pub(in super::super) fn empty_the_store(&mut self) {
        self.redis.ask::<()>(&["FLUSHALL"]);
        self.witness.emptied();
    }

    /// Sets fields of a session in the store, which no server does.
    pub(in super::super) fn tamper(&mut self, session: usize, fields: &[(&str, &str)]) {
        let key = key_of(Kind::Session, &name(session));
        redis::cmd("HSET")
            .arg(key)
            .arg(fields)
            .exec(&mut self.store)
            .unwrap();
    }

    /// Streams at these servers break, and their clients try at once to go on.
    fn reconnect(&mut self, servers: &[usize]) {
        let now = self.now();
        let is_broken = |client: &Client| client.stream.is_some_and(|server| servers.contains(&server));
        let broken: Vec<usize> = (0..self.clients.len())
            .filter(|&session| is_broken(&self.clients[session]))
            .collect();
        for &session in &broken {
            self.clients[session].stream = None;
            self.clients[session].waits_since = Some(now);
        }
        for session in broken {
            self.call(session);
        }
    }

    /// Number of clients whose sessions no server has had since their streams broke.
    pub(in super::super) fn waiting(&self) -> usize {
        let waits = |client: &&Client| client.waits_since.is_some();
        self.clients.iter().filter(waits).count()
    }

    /// The owner of each session, as the witness knows it.
    pub(in super::super) fn owners(&self) -> Vec<usize> {
        self.witness.leases().values().map(|lease| lease.owner).collect()
    }

    /// Number of sessions on each server.
    pub(in super::super) fn loads(&self) -> Vec<usize> {
        self.servers.iter().map(|server| server.sessions.len()).collect()
    }

    /// The server to which the router sends a new client of a session if all servers but some are
    /// there.
    pub(in super::super) fn place(&self, session: usize, without: &[usize]) -> usize {
        let is_there = |server| !without.contains(&server);
        self.ring.route(&name(session), is_there).unwrap()
    }

    /// Compares all sessions but those that are gone with the store. One server has each, and
    /// knows its token.
    ///
    /// # Panics
    /// If anything is not as it must be, now or before.
    pub(in super::super) fn audit(&mut self) {
        let sessions: Vec<usize> = (0..self.clients.len())
            .filter(|session| !self.gone.contains(session))
            .collect();
        let mut pipe = redis::pipe();
        for &session in &sessions {
            let key = key_of(Kind::Session, &name(session));
            pipe.cmd("HMGET").arg(key).arg(&["owner", "token", "record"]);
        }
        let stored: Vec<Stored> = pipe.query(&mut self.store).unwrap();
        let mut holders: HashMap<usize, Vec<(usize, u64)>> = HashMap::new();
        for (number, server) in self
            .servers
            .iter()
            .enumerate()
            .filter(|(_, server)| server.is_alive)
        {
            for (session, held) in server.held() {
                assert!(server.sessions.contains_key(&session), "{session} at {number}");
                holders.entry(session).or_default().push((number, held.token));
            }
        }
        for (session, (owner, token, record)) in sessions.into_iter().zip(stored) {
            let (owner, token) = (owner.as_deref().map(number_in), token.unwrap_or_default());
            self.witness.stored(session, owner, token, record);
            let holders = holders.remove(&session).unwrap_or_default();
            assert_eq!(
                holders,
                [(owner.unwrap_or(usize::MAX), token)],
                "session {session}"
            );
        }
        assert!(holders.is_empty(), "{holders:?}");
        assert!(self.witness.faults().is_empty(), "{:#?}", self.witness.faults());
    }
}
