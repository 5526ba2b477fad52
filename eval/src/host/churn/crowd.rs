//! Live characters that come and go, on the streams of one client each.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tokio::sync::{mpsc, watch};
use troupe_client::{
    Client, ClientError, Drive, DriveEvent, DriveOptions, Locomotion, Pack, Session, SessionOptions,
};
use troupe_motion::Vec3;

use crate::figures::ms;

/// Life of a session, seconds.
const LIFE_S: std::ops::Range<f32> = 10.0..60.0;
/// Time between two commands of a character, seconds.
const COMMAND_EVERY_S: std::ops::Range<f32> = 1.25..3.75;
/// Speeds of commands, m/s.
const SPEED_MPS: std::ops::Range<f32> = 0.0..1.6;
/// Side of the square in which sessions begin, metres.
const SQUARE_M: f32 = 30.0;
/// Time from one tick to the next.
const PERIOD: Duration = Duration::from_nanos(1_000_000_000 / 30);

/// Measurements since the last row.
#[derive(Debug, Default)]
pub struct Seen {
    /// Lateness of ticks, ms, counted from the earliest tick of their stream.
    pub late_ms: Vec<f64>,
    /// Latencies of InBetween, ms.
    pub call_ms: Vec<f64>,
    pub opened: u64,
    pub closed: u64,
    /// Ticks that the server did not send.
    pub dropped: u64,
    pub faults: Vec<String>,
}

/// [`Seen`], shared by all tasks.
#[derive(Debug, Clone, Default)]
pub struct Shared(Arc<Mutex<Seen>>);

impl Shared {
    pub fn note(&self, what: impl FnOnce(&mut Seen)) {
        what(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }

    pub fn fault(&self, what: String) {
        self.note(|seen| seen.faults.push(what));
    }

    pub fn take(&self) -> Seen {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// A character on the stream.
#[derive(Debug)]
struct Member {
    ends: Instant,
    leaves: bool,
    next_command: Instant,
}

/// One stream with a constant number of characters, which come and go.
pub struct ChurningCrowd {
    client: Client,
    pack: Pack,
    drive: Drive,
    wanted: usize,
    /// Sessions on the stream or being opened.
    here: usize,
    members: HashMap<String, Member>,
    random: ChaCha8Rng,
    begun: bool,
    shared: Shared,
    first_due: Option<Instant>,
    dropped: u64,
}

impl ChurningCrowd {
    /// Opens a stream. All choices follow from the seed.
    pub async fn open(url: &str, wanted: usize, seed: u64, shared: Shared) -> Result<Self, ClientError> {
        let client = Client::connect(url).await?;
        let pack = client.pack("").await?;
        let options = DriveOptions {
            every_tick: true,
            reconnect: None,
            ..DriveOptions::default()
        };
        Ok(Self {
            drive: client.drive(options).await?,
            client,
            pack,
            wanted,
            here: 0,
            members: HashMap::new(),
            random: ChaCha8Rng::seed_from_u64(seed),
            begun: false,
            shared,
            first_due: None,
            dropped: 0,
        })
    }

    /// Keeps the stream full until `stop` changes.
    pub async fn live(mut self, mut stop: watch::Receiver<bool>) {
        let (opened, mut openings) = mpsc::channel(64);
        loop {
            self.fill(&opened);
            let turn = async {
                self.command();
                self.send_away().await?;
                tokio::select! {
                    update = self.drive.next() => {
                        let Some(update) = update? else { return Ok(Turn::Ended) };
                        let now = Instant::now();
                        let tick = update.tick.map(|tick| (tick.number(), tick.dropped(), now));
                        Ok(Turn::Came(tick, update.events))
                    }
                    Some(sessions) = openings.recv() => Ok(Turn::Opened(sessions)),
                    _ = stop.changed() => Ok(Turn::Ended),
                }
            };
            let turn: Result<Turn, ClientError> = turn.await;
            let done = match turn {
                Ok(Turn::Came(tick, events)) => {
                    if let Some((number, dropped, at)) = tick {
                        self.tick(number, dropped, at);
                    }
                    events.into_iter().for_each(|event| self.event(event));
                    Ok(())
                }
                Ok(Turn::Opened(sessions)) => self.join(sessions).await,
                Ok(Turn::Ended) => return,
                Err(error) => Err(error),
            };
            if let Err(error) = done {
                return self
                    .shared
                    .fault(format!("a stream of {} sessions: {error}", self.here));
            }
        }
    }

    /// Has sessions opened instead of those that left, while the stream goes on.
    fn fill(&mut self, opened: &mpsc::Sender<Vec<Session>>) {
        let missing = self.wanted - self.here;
        if missing == 0 {
            return;
        }
        self.here += missing;
        let options: Vec<_> = (0..missing).map(|_| self.options()).collect();
        let (client, pack) = (self.client.clone(), self.pack.clone());
        let (shared, opened) = (self.shared.clone(), opened.clone());
        tokio::spawn(async move {
            match client.open_sessions(&pack, &options).await {
                Ok(sessions) => {
                    shared.note(|seen| seen.opened += sessions.len() as u64);
                    // The stream may have ended meanwhile.
                    let _ = opened.send(sessions).await;
                }
                Err(error) => shared.fault(format!("{} sessions: {error}", options.len())),
            }
        });
    }

    fn options(&mut self) -> SessionOptions {
        let mut coordinate = || (self.random.random::<f32>() - 0.5) * SQUARE_M;
        let place = Vec3::new(coordinate(), 0.0, coordinate());
        SessionOptions::new().seed(self.random.random()).at(place, 0.0)
    }

    async fn join(&mut self, sessions: Vec<Session>) -> Result<(), ClientError> {
        let now = Instant::now();
        for session in &sessions {
            let life_s = self.random.random_range(LIFE_S);
            // The first sessions begin at random ages.
            let passed = if self.begun {
                0.0
            } else {
                self.random.random::<f32>()
            };
            let ends = now + Duration::from_secs_f32(life_s * (1.0 - passed));
            let member = Member {
                ends,
                leaves: false,
                next_command: now,
            };
            self.members.insert(session.id().to_owned(), member);
        }
        self.begun = true;
        self.drive.attach(sessions).await
    }

    /// Takes characters off the stream whose time is over.
    async fn send_away(&mut self) -> Result<(), ClientError> {
        let now = Instant::now();
        let over = self
            .members
            .iter_mut()
            .filter(|(_, one)| !one.leaves && one.ends <= now);
        let ids: Vec<String> = over
            .map(|(id, one)| {
                one.leaves = true;
                id.clone()
            })
            .collect();
        self.drive.detach(ids).await
    }

    /// Gives the commands that are due.
    fn command(&mut self) {
        let now = Instant::now();
        for (id, member) in &mut self.members {
            if member.leaves || member.next_command > now {
                continue;
            }
            let wait = self.random.random_range(COMMAND_EVERY_S);
            member.next_command = now + Duration::from_secs_f32(wait);
            let heading: f32 = self.random.random_range(-3.0..3.0);
            let speed = self.random.random_range(SPEED_MPS);
            if let Some(intent) = self.drive.intent_mut(id) {
                *intent = Locomotion::walk(Vec3::new(heading.sin(), 0.0, heading.cos()) * speed);
            }
        }
    }

    fn tick(&mut self, number: u64, dropped: u64, at: Instant) {
        let since = PERIOD * u32::try_from(number).unwrap_or(u32::MAX);
        let first = at.checked_sub(since).unwrap_or(at);
        let first = self.first_due.map_or(first, |due| due.min(first));
        self.first_due = Some(first);
        let new = dropped - self.dropped;
        self.dropped = dropped;
        self.shared.note(|seen| {
            seen.late_ms.push(ms(at.saturating_duration_since(first + since)));
            seen.dropped += new;
        });
    }

    fn event(&mut self, event: DriveEvent) {
        match event {
            DriveEvent::Left { id, problem, .. } => {
                let left = self.members.remove(&id);
                self.here -= 1;
                if left.is_none_or(|one| !one.leaves) {
                    self.shared.fault(format!("{id} left: {problem:?}"));
                }
                self.close(id);
            }
            DriveEvent::NotAttached { id, problem, .. } => {
                self.members.remove(&id);
                self.here -= 1;
                self.shared.fault(format!("{id} is not attached: {problem:?}"));
                self.close(id);
            }
            DriveEvent::Refused { session, problem } => {
                self.shared
                    .fault(format!("{session} refused a command: {problem:?}"));
            }
            DriveEvent::Attached { .. } | DriveEvent::Resumed { .. } | DriveEvent::Happened { .. } => {}
        }
    }

    fn close(&self, id: String) {
        let (client, shared) = (self.client.clone(), self.shared.clone());
        tokio::spawn(async move {
            match client.close_sessions([id]).await {
                Ok(closed) => shared.note(|seen| seen.closed += closed as u64),
                Err(error) => shared.fault(format!("closing: {error}")),
            }
        });
    }
}

/// What one turn of the loop got.
enum Turn {
    /// A tick (its number, the ticks dropped so far, and when it came), and events.
    Came(Option<(u64, u64, Instant)>, Vec<DriveEvent>),
    Opened(Vec<Session>),
    Ended,
}
