//! Records in Redis, which several servers share. A server has a lease of each record that it
//! writes, and no two servers have one at the same time.
//!
//! | part | does |
//! |---|---|
//! | [`Leases`] | takes leases for calls that make or restore sessions |
//! | [`SharedRecords`] | writes records and renews leases, four times a second |
//! | `script` | what Redis does with leases, each in one step |
//! | [`UploadLog`] | the uploads of all servers |
//! | `link` | the connection, and the address |
//!
//! docs/decisions/leases.md and docs/decisions/uploads.md say why.

mod link;
mod script;
mod uploads;

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::{Change, Changes, Kind, Lost, RecordStore, RecordsError, Tended};
use link::Link;
use script::{Answer, Hold, Mine, Times, claim, filling, hold, look};
use troupe_base::telemetry::{Counter, Labels, Metric, Telemetry};

pub use link::Place;
pub use script::Want;
pub use uploads::{Changes as UploadChanges, UploadLog, Version, Write};

const LEASES: Metric = Metric::new(
    "troupe_store_leases_total",
    "Leases of sessions and scenes in a shared store, by what became of them: taken, refused, lost or forgotten",
);

/// Times of leases. Tests have shorter ones.
#[derive(Debug, Clone, Copy)]
pub struct Terms {
    /// Length of a lease: how long a client waits at most until another server takes over from one
    /// that died. A round of the keeper that hangs for less than this costs nothing.
    pub lease: Duration,
    /// Age from which on a lease is renewed: a third, so that two renewals may fail.
    pub renew: Duration,
    /// Time for which a token outlives its lease. A server that was cut off for longer never takes
    /// a lease again that Redis does not know.
    pub remember: Duration,
    /// Time from a claim to the session that it is for.
    pub settle: Duration,
    /// Time in which servers write everything again after the store was emptied.
    pub fill: Duration,
}

impl Default for Terms {
    fn default() -> Self {
        Self {
            lease: Duration::from_millis(1200),
            renew: Duration::from_millis(400),
            remember: Duration::from_secs(3600),
            settle: Duration::from_secs(10),
            fill: Duration::from_secs(3),
        }
    }
}

/// A lease that this server has, as far as it knows.
#[derive(Debug, Clone, Copy)]
struct Held {
    token: u64,
    rank: u64,
    /// As the record was last written.
    keep: Option<Duration>,
    /// When the last request was sent that was successful.
    renewed: Instant,
    /// When a call last asked for it.
    asked: Instant,
    /// Whether its record is being removed.
    leaving: bool,
}

type Key = (Kind, String);

/// The answer to a claim.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Claim {
    /// This server had the lease already.
    Had,
    /// This server has the lease from now on, and the record, if there is one.
    Taken(Option<Vec<u8>>),
    /// [`Want::New`] of something that has a record, and no server has its lease.
    Exists,
    /// [`Want::Known`] of something without a record.
    Unknown,
    /// [`Want::Known`] of something without a record, in a store that was empty just now. Its
    /// server may be about to write it again.
    Filling,
    /// Another server has the lease.
    Elsewhere {
        /// Its address.
        owner: String,
        /// Time until its lease ends, if it is not renewed.
        ends_in: Duration,
    },
}

/// The leases of a server.
#[derive(Debug)]
pub struct Leases {
    address: String,
    terms: Terms,
    held: Mutex<HashMap<Key, Held>>,
    /// One call at a time: two for the same name must not both ask.
    claims: Mutex<Link>,
    /// Number of requests about leases that this server has.
    requests: AtomicU64,
    counters: Counters,
}

#[derive(Debug)]
struct Counters {
    taken: Counter,
    refused: Counter,
    lost: Counter,
    forgotten: Counter,
}

impl Counters {
    fn new(telemetry: &Telemetry) -> Self {
        let counter = |result| telemetry.counter(&LEASES, &Labels::default().with("result", result));
        Self {
            taken: counter("taken"),
            refused: counter("refused"),
            lost: counter("lost"),
            forgotten: counter("forgotten"),
        }
    }
}

fn key_of(kind: Kind, name: &str) -> String {
    match kind {
        Kind::Session => format!("troupe:session:{name}"),
        Kind::Scene => format!("troupe:scene:{name}"),
    }
}

fn millis(time: Duration) -> u64 {
    u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
}

impl Leases {
    fn held(&self) -> MutexGuard<'_, HashMap<Key, Held>> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn times(&self) -> Times {
        Times {
            lease: millis(self.terms.lease),
            remember: millis(self.terms.remember),
        }
    }

    /// Whether this server has a lease, as far as it knows, of something that a call is about to
    /// change. If so, it keeps the lease for a while.
    pub fn keeps(&self, kind: Kind, name: &str) -> bool {
        let mut held = self.held();
        let held = held
            .get_mut(&(kind, name.to_owned()))
            .filter(|held| !held.leaving);
        held.map(|held| held.asked = Instant::now()).is_some()
    }

    /// Whether this server has a lease, as far as it knows.
    pub fn has(&self, kind: Kind, name: &str) -> bool {
        let held = self.held();
        held.get(&(kind, name.to_owned()))
            .is_some_and(|held| !held.leaving)
    }

    /// Takes leases, and gives an answer for each in the same order. This blocks.
    ///
    /// # Errors
    /// [`RecordsError::Shared`] if the store does not answer.
    pub fn claim(&self, asked: &[(Kind, String, Want)]) -> Result<Vec<Claim>, RecordsError> {
        let mut link = self.claims.lock().unwrap_or_else(PoisonError::into_inner);
        let sent = Instant::now();
        let mut claims: Vec<Option<Claim>> = Vec::with_capacity(asked.len());
        let mut scripts = Vec::new();
        for (kind, name, want) in asked {
            let mut all = self.held();
            match all.get_mut(&(*kind, name.clone())) {
                None => {
                    scripts.push(claim(&key_of(*kind, name), &self.address, *want, self.times()));
                    claims.push(None);
                }
                // It has just been closed.
                Some(held) if held.leaving && *want == Want::Known => claims.push(Some(Claim::Unknown)),
                Some(held) if held.leaving => claims.push(Some(Claim::Elsewhere {
                    owner: self.address.clone(),
                    ends_in: self.terms.lease,
                })),
                Some(held) => {
                    held.asked = sent;
                    claims.push(Some(Claim::Had));
                }
            }
        }
        let answers = link.run(scripts)?;
        let is_filling = answers.contains(&Answer::Unknown) && self.is_filling(&mut link);
        let mut answers = answers.into_iter();
        let done = claims
            .into_iter()
            .zip(asked)
            .map(|(claim, (kind, name, _))| match claim {
                Some(claim) => claim,
                None => match self.took((*kind, name.clone()), answers.next(), sent) {
                    Claim::Unknown if is_filling => Claim::Filling,
                    claim => claim,
                },
            });
        Ok(done.collect())
    }

    /// Whether the store was empty a moment ago. If it does not say, what it has said counts.
    fn is_filling(&self, link: &mut Link) -> bool {
        let answers = link.run(vec![filling(millis(self.terms.fill))]);
        answers.is_ok_and(|answers| answers.contains(&Answer::Filling))
    }

    fn took(&self, key: Key, answer: Option<Answer>, sent: Instant) -> Claim {
        match answer {
            Some(Answer::Taken { token, record, keep }) => {
                let held = Held {
                    token,
                    rank: token,
                    keep: keep.map(Duration::from_millis),
                    renewed: sent,
                    asked: sent,
                    leaving: false,
                };
                self.held().insert(key, held);
                self.counters.taken.increment(1);
                Claim::Taken(record)
            }
            Some(Answer::Lost { owner, ends_in_ms }) => {
                self.counters.refused.increment(1);
                Claim::Elsewhere {
                    owner,
                    ends_in: Duration::from_millis(ends_in_ms),
                }
            }
            Some(Answer::Exists) => Claim::Exists,
            Some(Answer::Unknown | Answer::Kept | Answer::Filling) | None => Claim::Unknown,
        }
    }

    /// Gives up leases whose claims have led to nothing. Their records stay. If the store does not
    /// answer, the leases end by themselves. This blocks.
    pub fn release(&self, names: &[(Kind, String)]) {
        let mut link = self.claims.lock().unwrap_or_else(PoisonError::into_inner);
        let sent = Instant::now();
        let mut scripts = Vec::new();
        for (kind, name) in names {
            if let Some(held) = self.held().remove(&(*kind, name.clone())) {
                scripts.push(self.script(*kind, name, &held, Hold::Release, sent));
            }
        }
        if let Err(error) = link.run(scripts) {
            tracing::debug!(%error, "leases are not given up, and end by themselves");
        }
    }

    /// The other server that has a lease, and the time until it ends. Nothing changes. This blocks.
    ///
    /// # Errors
    /// [`RecordsError::Shared`] if the store does not answer.
    pub fn other_owner(&self, kind: Kind, name: &str) -> Result<Option<(String, Duration)>, RecordsError> {
        if self.has(kind, name) {
            return Ok(None);
        }
        let mut link = self.claims.lock().unwrap_or_else(PoisonError::into_inner);
        let answer = link.run(vec![look(&key_of(kind, name))])?.into_iter().next();
        Ok(match answer {
            // A lease of this server is one from before it was started again.
            Some(Answer::Lost { owner, ends_in_ms }) if owner != self.address => {
                Some((owner, Duration::from_millis(ends_in_ms)))
            }
            _ => None,
        })
    }

    fn script(&self, kind: Kind, name: &str, held: &Held, what: Hold<'_>, now: Instant) -> redis::Cmd {
        let mine = Mine {
            token: held.token,
            rank: held.rank,
            may_take: now.saturating_duration_since(held.renewed) < self.terms.remember,
            keep: held.keep.map(millis),
            number: self.requests.fetch_add(1, Ordering::Relaxed),
        };
        hold(&key_of(kind, name), &self.address, mine, what, self.times())
    }

    /// Notes the answer to a script that wrote or renewed.
    fn note(&self, key: Key, keep: Option<Duration>, answer: Answer, sent: Instant, tended: &mut Tended) {
        let mut all = self.held();
        match answer {
            Answer::Lost { owner, ends_in_ms } => {
                all.remove(&key);
                drop(all);
                self.counters.lost.increment(1);
                tended.lost.push(Lost {
                    kind: key.0,
                    name: key.1,
                    owner,
                    ends_in: Duration::from_millis(ends_in_ms),
                });
            }
            answer => {
                let Some(held) = all.get_mut(&key) else { return };
                (held.renewed, held.keep) = (sent, keep);
                if let Answer::Taken { token, .. } = answer {
                    held.token = token;
                    drop(all);
                    self.counters.forgotten.increment(1);
                    tended.forgotten.push(key);
                }
            }
        }
    }
}

/// The records of servers that share a store. Each server's keeper has its own.
#[derive(Debug)]
pub struct SharedRecords {
    place: Place,
    leases: Arc<Leases>,
    link: Link,
}

impl SharedRecords {
    /// Records at `place`. `address` is how others reach this server. Nothing is connected yet.
    pub fn new(place: &Place, address: String, terms: Terms, telemetry: &Telemetry) -> Self {
        let leases = Leases {
            address,
            terms,
            held: Mutex::default(),
            claims: Mutex::new(Link::new(place.clone())),
            requests: AtomicU64::new(1),
            counters: Counters::new(telemetry),
        };
        Self {
            place: place.clone(),
            leases: Arc::new(leases),
            link: Link::new(place.clone()),
        }
    }

    /// The lease to write or remove a record with. `None`: it must not.
    fn lease_for(&self, change: &Change, begun: Instant) -> Option<Held> {
        let mut all = self.leases.held();
        let held = all.get_mut(&(change.kind, change.name.clone()))?;
        if change.record.is_some() {
            held.keep = change.keep;
        } else if held.asked > begun {
            // A call has made a new session of this name since.
            return None;
        } else {
            held.leaving = true;
        }
        Some(*held)
    }
}

impl RecordStore for SharedRecords {
    fn all(&mut self, _kind: Kind) -> Result<Vec<(String, Vec<u8>)>, RecordsError> {
        Ok(Vec::new())
    }

    fn write(&mut self, changes: &Changes) -> Result<Tended, RecordsError> {
        let (sent, mut tended) = (Instant::now(), Tended::default());
        let (mut written, mut scripts) = (Vec::new(), Vec::new());
        for change in &changes.list {
            let Some(held) = self.lease_for(change, changes.begun) else {
                // Removed already, or lost.
                if change.record.is_some() {
                    tended.lost.push(lost_before(change));
                }
                continue;
            };
            let what = change.record.as_deref().map_or(Hold::Remove, Hold::Write);
            scripts.push(self.leases.script(change.kind, &change.name, &held, what, sent));
            written.push(change);
        }
        let answers = self.link.run(scripts)?;
        for (change, answer) in written.into_iter().zip(answers) {
            let key = (change.kind, change.name.clone());
            match change.record {
                Some(_) => self.leases.note(key, change.keep, answer, sent, &mut tended),
                // If it was lost, there is nothing to remove.
                None => drop(self.leases.held().remove(&key)),
            }
        }
        // They have just been written.
        tended.forgotten.clear();
        Ok(tended)
    }

    fn tend(&mut self, open: &dyn Fn(Kind, &str) -> bool) -> Result<Tended, RecordsError> {
        let (now, terms) = (Instant::now(), self.leases.terms);
        let all: Vec<(Key, Held)> = {
            let held = self.leases.held();
            let due = held.iter().filter(|(_, held)| !held.leaving);
            due.map(|(key, held)| (key.clone(), *held)).collect()
        };
        let (mut renewed, mut closed, mut scripts) = (Vec::new(), Vec::new(), Vec::new());
        for (key, held) in all {
            let is_open = open(key.0, &key.1) || now.saturating_duration_since(held.asked) < terms.settle;
            let is_due = now.saturating_duration_since(held.renewed) >= terms.renew;
            if is_open && is_due {
                scripts.push(self.leases.script(key.0, &key.1, &held, Hold::Renew, now));
                renewed.push((key, held.keep));
            } else if !is_open {
                closed.push((key, held.asked));
            }
        }
        // So that the store knows since when it has been there.
        scripts.push(filling(millis(terms.fill)));
        let mut tended = Tended::default();
        for ((key, keep), answer) in renewed.into_iter().zip(self.link.run(scripts)?) {
            self.leases.note(key, keep, answer, now, &mut tended);
        }
        // A call may have asked for some since.
        let held = self.leases.held();
        closed.retain(|(key, asked)| held.get(key).is_some_and(|held| held.asked == *asked));
        drop(held);
        let given_up: Vec<Key> = closed.into_iter().map(|(key, _)| key).collect();
        self.leases.release(&given_up);
        Ok(tended)
    }

    fn give_up(&mut self, kind: Kind, name: &str) {
        self.leases.release(&[(kind, name.to_owned())]);
    }

    fn leave(&mut self) {
        let all: Vec<Key> = self.leases.held().keys().cloned().collect();
        self.leases.release(&all);
    }

    fn owns(&self, kind: Kind, name: &str) -> bool {
        self.leases.has(kind, name)
    }

    fn leases(&self) -> Option<Arc<Leases>> {
        Some(self.leases.clone())
    }

    fn uploads(&self) -> Option<UploadLog> {
        Some(UploadLog::new(self.place.clone()))
    }
}

fn lost_before(change: &Change) -> Lost {
    Lost {
        kind: change.kind,
        name: change.name.clone(),
        owner: String::new(),
        ends_in: Duration::ZERO,
    }
}

#[cfg(test)]
mod simulation;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;
