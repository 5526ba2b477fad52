//! Watches all that servers do with leases, and knows by itself who has each.
//!
//! It learns only what servers sent and what Redis answered, with times of the simulation's clock.
//! From that it finds two owners of a session, a token that does not rise, and a write that counts
//! although another server has the lease.

use std::collections::BTreeMap;
use std::time::Duration;

/// Redis has the clock of the machine, which may be set a little in a test.
const SLACK: Duration = Duration::from_secs(2);
/// Most faults that are kept. One that matters causes many.
const FAULTS: usize = 20;

/// When a request was sent, and when its answer had come. Redis did it in between.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment {
    pub(super) sent: Duration,
    pub(super) answered: Duration,
}

/// The newest lease of a session.
#[derive(Debug, Clone)]
pub(super) struct Lease {
    pub(super) owner: usize,
    pub(super) token: u64,
    /// As `rank` in Redis.
    rank: u64,
    /// Its end is between `ends.sent` and `ends.answered`.
    ends: Moment,
    /// As it was last written by an owner.
    record: Option<Vec<u8>>,
    /// When the request with this record was sent.
    written: Duration,
    /// `false`: Redis was emptied since.
    is_known: bool,
}

/// What servers did with leases.
pub(super) struct Witness {
    lease: Duration,
    leases: BTreeMap<usize, Lease>,
    faults: Vec<String>,
    /// Number of leases that servers got.
    pub(super) granted: usize,
    /// Number of writes and renewals that counted.
    pub(super) kept: usize,
    /// Number of claims that Redis refused, because another server has the lease.
    pub(super) refused: usize,
}

impl Witness {
    /// `lease` is the length of a lease.
    pub(super) fn new(lease: Duration) -> Self {
        Self {
            lease,
            leases: BTreeMap::new(),
            faults: Vec::new(),
            granted: 0,
            kept: 0,
            refused: 0,
        }
    }

    /// All that must not be, from the first on.
    pub(super) fn faults(&self) -> &[String] {
        &self.faults
    }

    pub(super) fn leases(&self) -> &BTreeMap<usize, Lease> {
        &self.leases
    }

    /// Time since the record of a session was written.
    pub(super) fn age(&self, session: usize, now: Duration) -> Duration {
        now.saturating_sub(self.leases[&session].written)
    }

    fn check(&mut self, session: usize, is_so: bool, fault: impl FnOnce() -> String) {
        if !is_so && self.faults.len() < FAULTS {
            self.faults.push(format!("session {session}: {}", fault()));
        }
    }

    fn ends(&self, at: Moment) -> Moment {
        Moment {
            sent: at.sent + self.lease,
            answered: at.answered + self.lease,
        }
    }

    /// A server has claimed a session, and got this record.
    pub(super) fn claimed(
        &mut self,
        session: usize,
        owner: usize,
        token: u64,
        at: Moment,
        record: Option<Vec<u8>>,
    ) {
        if let Some(last) = self.leases.get(&session).cloned() {
            self.check_token(session, &last, token);
            if last.is_known {
                self.check(session, at.answered + SLACK >= last.ends.sent, || {
                    format!(
                        "{owner} claimed it at {:?}, and {last:?} has not ended",
                        at.answered
                    )
                });
            }
            let wanted = last.record.as_ref().filter(|_| last.is_known);
            self.check(session, record.as_ref() == wanted, || {
                format!("{owner} got {record:?} after {last:?}")
            });
        }
        self.grant(session, owner, (token, token), at, record);
    }

    /// A server has taken its lease again, with a write or a renewal: Redis knew nothing of it, or
    /// of an older one.
    pub(super) fn took_again(
        &mut self,
        session: usize,
        owner: usize,
        (token, rank): (u64, u64),
        at: Moment,
        record: Option<Vec<u8>>,
    ) {
        if let Some(last) = self.leases.get(&session).cloned() {
            self.check_token(session, &last, token);
            self.check(session, !last.is_known || rank > last.rank, || {
                format!("{owner} with the rank {rank} took it again from {last:?}")
            });
        }
        self.grant(session, owner, (token, rank), at, record);
    }

    fn grant(
        &mut self,
        session: usize,
        owner: usize,
        (token, rank): (u64, u64),
        at: Moment,
        record: Option<Vec<u8>>,
    ) {
        self.granted += 1;
        let lease = Lease {
            owner,
            token,
            rank,
            ends: self.ends(at),
            record,
            written: at.sent,
            is_known: true,
        };
        self.leases.insert(session, lease);
    }

    fn check_token(&mut self, session: usize, last: &Lease, token: u64) {
        self.check(session, token > last.token, || {
            format!("the token {token} does not rise after {last:?}")
        });
    }

    /// A server has written or renewed, and that counts.
    pub(super) fn kept(
        &mut self,
        session: usize,
        owner: usize,
        token: u64,
        at: Moment,
        record: Option<Vec<u8>>,
    ) {
        self.kept += 1;
        let ends = self.ends(at);
        let Some(lease) = self.leases.get_mut(&session) else {
            self.check(session, false, || format!("{owner} wrote without a lease"));
            return;
        };
        let is_owner = lease.is_known && lease.owner == owner && lease.token == token;
        let last = lease.clone();
        lease.ends = ends;
        if record.is_some() {
            (lease.record, lease.written) = (record, at.sent);
        }
        self.check(session, is_owner, || {
            format!("a write of {owner} with the token {token} counts, and {last:?} has the lease")
        });
    }

    /// Redis has refused a claim of `asker`, because `owner` has a lease.
    pub(super) fn refused(&mut self, session: usize, asker: usize, owner: usize, at: Moment) {
        self.refused += 1;
        let last = self.leases.get(&session).cloned();
        let holds = last.as_ref().is_some_and(|last| {
            last.is_known && last.owner == owner && at.sent <= last.ends.answered + SLACK
        });
        self.check(session, holds, || {
            format!("{asker} was sent to {owner} at {:?}, after {last:?}", at.sent)
        });
    }

    /// Redis has said that there is no record.
    pub(super) fn unknown(&mut self, session: usize, asker: usize) {
        let last = self.leases.get(&session).cloned();
        let has_record = last
            .as_ref()
            .is_some_and(|last| last.is_known && last.record.is_some());
        self.check(session, !has_record, || {
            format!("{asker} found no record after {last:?}")
        });
    }

    /// Redis has refused a write or a renewal.
    pub(super) fn lost(&mut self, session: usize, server: usize, owner: Option<usize>) {
        let last = self.leases.get(&session).cloned();
        let is_others = last
            .as_ref()
            .is_some_and(|last| last.is_known && last.owner != server && Some(last.owner) == owner);
        self.check(session, is_others, || {
            format!("{server} lost it to {owner:?}, after {last:?}")
        });
    }

    /// A server has given its lease up.
    pub(super) fn released(&mut self, session: usize, owner: usize, at: Moment) {
        if let Some(lease) = self.leases.get_mut(&session)
            && lease.owner == owner
        {
            lease.ends = at;
        }
    }

    /// Redis has lost everything.
    pub(super) fn emptied(&mut self) {
        self.leases.values_mut().for_each(|lease| lease.is_known = false);
    }

    /// Redis has this owner, token and record.
    pub(super) fn stored(
        &mut self,
        session: usize,
        owner: Option<usize>,
        token: u64,
        record: Option<Vec<u8>>,
    ) {
        let last = self.leases.get(&session).cloned();
        let is_so = last.as_ref().is_some_and(|last| {
            last.is_known && Some(last.owner) == owner && last.token == token && last.record == record
        });
        self.check(session, is_so, || {
            format!("Redis has {owner:?} with {token} and {record:?}, and not {last:?}")
        });
    }
}
