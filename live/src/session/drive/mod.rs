//! Server-clocked frames. Each stream has one task, which ticks its sessions and handles the
//! messages of its client.
//!
//! The task ends when the client ends the stream or disconnects, reads nothing for too long or
//! sends an invalid message, or when the server shuts down. In every case its sessions become free.

mod hear;
pub(super) mod roster;
mod watching;

use std::sync::Arc;
use std::time::{Duration, Instant};

use futures_util::{Stream, StreamExt as _};
use tokio::sync::{OwnedSemaphorePermit, watch};
use tokio::time::{Interval, MissedTickBehavior};
use troupe_proto::v1;
use troupe_proto::v1::drive_request::Message as Ask;

use super::encode::Form;
use super::sessions::Sessions;
use super::stream::{Audience, Closing, Departure, Outbox, Said, Tick};
use super::{SessionError, step};
use crate::wire::units;
use hear::{command, drained};
use roster::Roster;
use troupe_character::{FieldError, Path};
use watching::Watching;

/// After missed ticks, characters catch up on at most this much time. They lose the rest, because a
/// walking character would otherwise jump.
const MAX_CATCH_UP: Duration = Duration::from_millis(200);

/// The right to have one stream open. Dropping it makes room for another stream.
#[derive(Debug)]
pub struct StreamPermit {
    _permit: OwnedSemaphorePermit,
    sessions: Arc<Sessions>,
}

impl Sessions {
    /// Reserves room for a stream.
    ///
    /// # Errors
    /// [`SessionError::TooManyStreams`] if there is no room, [`SessionError::ShuttingDown`] while
    /// the server shuts down.
    pub fn open_stream(self: &Arc<Self>) -> Result<StreamPermit, SessionError> {
        if *self.draining().borrow() {
            return Err(SessionError::ShuttingDown);
        }
        match self.places().clone().try_acquire_owned() {
            Ok(permit) => Ok(StreamPermit::new(permit, self.clone())),
            Err(_) => Err(SessionError::TooManyStreams {
                limit: self.limits().streams,
            }),
        }
    }

    fn roster(&self, close_at_end: bool, audience: &Arc<Audience>) -> Roster {
        let (registry, time) = (self.registry().clone(), self.time().clone());
        let limit = self.limits().per_stream;
        Roster::new(registry, time, limit, close_at_end, audience)
    }
}

impl StreamPermit {
    fn new(permit: OwnedSemaphorePermit, sessions: Arc<Sessions>) -> Self {
        sessions.streams_changed(0);
        Self {
            _permit: permit,
            sessions,
        }
    }

    /// The tenant's sessions, which the stream may attach.
    pub fn sessions(&self) -> &Arc<Sessions> {
        &self.sessions
    }

    /// Runs a stream to its end. `inbound` yields the client's messages, or the problem of one that
    /// cannot be read. It ends when the client ends the stream.
    pub async fn run<I>(&self, inbound: &mut I, outbox: Outbox)
    where
        I: Stream<Item = Result<v1::DriveRequest, v1::Problem>> + Unpin,
    {
        let mut draining = self.sessions.draining();
        let closing = match self.opened(inbound, &outbox, &mut draining).await {
            Ok(open) if !open.watch.is_empty() => match Watching::join(&self.sessions, &open, &outbox) {
                Ok(mut watching) => watching.run(inbound, &outbox, &mut draining).await,
                Err(error) => error.into(),
            },
            Ok(open) => match Driving::new(&self.sessions, &open) {
                Ok(mut stream) => stream.run(inbound, &outbox, &mut draining).await,
                Err(error) => error.into(),
            },
            Err(closing) => closing,
        };
        tracing::debug!(?closing, "a stream ends");
        outbox.close(closing);
    }

    /// Waits for the first message, which must be `open`.
    async fn opened<I>(
        &self,
        inbound: &mut I,
        outbox: &Outbox,
        draining: &mut watch::Receiver<bool>,
    ) -> Result<v1::DriveOpen, Closing>
    where
        I: Stream<Item = Result<v1::DriveRequest, v1::Problem>> + Unpin,
    {
        let limit = self.sessions.limits().stall_timeout;
        let first = tokio::select! {
            () = outbox.reader_gone() => return Err(Closing::Gone),
            () = drained(draining) => return Err(Closing::Draining),
            first = tokio::time::timeout(limit, inbound.next()) => first,
        };
        let wanted = "open as the first message";
        let path = Path::root();
        match first {
            Ok(Some(Ok(v1::DriveRequest {
                message: Some(Ask::Open(open)),
            }))) => Ok(open),
            Ok(Some(Ok(_))) => Err(path.field("message").error("is not open", wanted).into()),
            Ok(Some(Err(problem))) => Err(Closing::Unreadable(problem)),
            Ok(None) => Err(Closing::ClientDone),
            Err(_) => {
                let message = format!("did not come within {} ms", limit.as_millis());
                Err(path.field("message").error(message, wanted).into())
            }
        }
    }
}

impl Drop for StreamPermit {
    fn drop(&mut self) {
        // The semaphore's permit is dropped after this, so it does not count as free yet.
        self.sessions.streams_changed(1);
    }
}

/// An open stream that drives sessions.
struct Driving {
    sessions: Arc<Sessions>,
    roster: Roster,
    audience: Arc<Audience>,
    form: Form,
    sub_frames: u32,
    ticker: Ticker,
    dropped_ticks: u64,
}

impl Driving {
    fn new(sessions: &Arc<Sessions>, open: &v1::DriveOpen) -> Result<Self, FieldError> {
        let root = Path::root();
        let path = root.field("open");
        let sub_frames = step::sub_frames(&path, open.rate_hz)?;
        let rate_hz = if open.rate_hz == 0 { 30 } else { open.rate_hz };
        let audience = Arc::default();
        Ok(Self {
            roster: sessions.roster(open.close_sessions, &audience),
            audience,
            sessions: sessions.clone(),
            form: Form::of(&path, open.encoding, open.return_positions, open.return_six_d)?,
            sub_frames,
            ticker: Ticker::new(rate_hz),
            dropped_ticks: 0,
        })
    }

    async fn run<I>(
        &mut self,
        inbound: &mut I,
        outbox: &Outbox,
        draining: &mut watch::Receiver<bool>,
    ) -> Closing
    where
        I: Stream<Item = Result<v1::DriveRequest, v1::Problem>> + Unpin,
    {
        loop {
            tokio::select! {
                // Ticks come before messages, so a flood of messages cannot stop the clock.
                biased;
                () = outbox.reader_gone() => return Closing::Gone,
                () = drained(draining) => return Closing::Draining,
                tick = self.ticker.next() => {
                    let limit = self.sessions.limits().stall_timeout;
                    if outbox.stalled(Instant::now()) >= limit {
                        return Closing::SlowReader(limit);
                    }
                    self.tick(tick, outbox).await;
                }
                asked = inbound.next(), if outbox.has_room() => {
                    let answered = match asked {
                        None => return Closing::ClientDone,
                        Some(Err(problem)) => return Closing::Unreadable(problem),
                        Some(Ok(asked)) => self.hear(asked).await,
                    };
                    match answered {
                        Ok(Some(answer)) => self.say(answer, outbox),
                        Ok(None) => {}
                        Err(closing) => return closing,
                    }
                }
            }
        }
    }

    /// Sends a message to the client. Watchers get it too if it is about the sessions.
    fn say(&self, said: Said, outbox: &Outbox) {
        let message = outbox.message(said);
        self.audience.pass_on(&message);
        outbox.post(message);
    }

    /// Handles a message of the client and returns the answer, if any.
    async fn hear(&mut self, asked: v1::DriveRequest) -> Result<Option<Said>, Closing> {
        let root = Path::root();
        let most = self.sessions.limits().per_stream;
        match asked.message {
            Some(Ask::Attach(v1::DriveAttach { session_ids })) => {
                let path = root.field("attach");
                units::length(&path.field("session_ids"), session_ids.len(), 1, most)?;
                self.sessions.bring(&session_ids).await;
                Ok(Some(Said::Attached(
                    self.roster.attach(&session_ids, self.form).await,
                )))
            }
            Some(Ask::Detach(v1::DriveDetach { session_ids })) => {
                let path = root.field("detach");
                units::length(&path.field("session_ids"), session_ids.len(), 1, most)?;
                Ok(left(self.roster.detach(&session_ids)))
            }
            Some(Ask::Command(request)) => Ok(command(&self.sessions, &request).await?),
            Some(Ask::Open(_)) => Err(root
                .field("message")
                .error("is a second open", "attach, detach or command")
                .into()),
            None => Err(root
                .field("message")
                .error("is missing", "attach, detach or command")
                .into()),
        }
    }

    /// Advances the characters by a tick and by the ticks that were missed before it.
    async fn tick(&mut self, tick: TickNumber, outbox: &Outbox) {
        if let Some(gone) = left(self.roster.ended()) {
            self.say(gone, outbox);
        }
        if tick.missed > 0 {
            self.dropped_ticks += tick.missed;
            for (pack, count) in self.roster.counts() {
                pack.metrics.dropped(count as u64 * tick.missed);
            }
        }
        self.roster.read_load();
        if self.roster.is_empty() {
            return;
        }
        let ticks = 1 + tick.missed.min(self.ticker.most_missed()) as u32;
        // Without room in the outbox, events wait in the sessions, which keep a limited number.
        let mut happened = outbox.has_room().then(Vec::new);
        let (mut frames, counts) = self
            .roster
            .tick(self.sub_frames * ticks, self.form, happened.as_mut())
            .await;
        if let Some(sessions) = happened.filter(|happened| !happened.is_empty()) {
            self.say(Said::Events(sessions), outbox);
        }
        frames.tick = tick.number;
        frames.dropped_ticks = self.dropped_ticks;
        let tick = Tick::new(frames, counts);
        self.audience.send(&tick);
        if outbox.send(tick) {
            self.dropped_ticks += 1;
        }
    }
}

impl Drop for Driving {
    fn drop(&mut self) {
        self.audience.end();
    }
}

fn left(sessions: Vec<Departure>) -> Option<Said> {
    (!sessions.is_empty()).then_some(Said::Left(sessions))
}

/// The number of a tick of a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct TickNumber {
    /// Counts all ticks from 0, including missed ones.
    number: u64,
    /// Ticks between the one before and this one, missed because the server was busy.
    missed: u64,
}

/// Waits for ticks and counts them.
struct Ticker {
    interval: Interval,
    start: tokio::time::Instant,
    rate_hz: u32,
    next: u64,
}

impl Ticker {
    fn new(rate_hz: u32) -> Self {
        let period = Duration::from_secs(1) / rate_hz;
        let start = tokio::time::Instant::now();
        let mut interval = tokio::time::interval_at(start, period);
        interval.set_missed_tick_behavior(MissedTickBehavior::Skip);
        Self {
            interval,
            start,
            rate_hz,
            next: 0,
        }
    }

    /// Waits for the next tick.
    async fn next(&mut self) -> TickNumber {
        let at = self.interval.tick().await;
        self.count(at - self.start)
    }

    /// The tick that was due at time `since` after the first.
    fn count(&mut self, since: Duration) -> TickNumber {
        let due = (since.as_secs_f64() * f64::from(self.rate_hz)).round() as u64;
        let number = due.max(self.next);
        let missed = number - self.next;
        self.next = number + 1;
        TickNumber { number, missed }
    }

    /// Maximum number of missed ticks on which characters catch up.
    fn most_missed(&self) -> u64 {
        MAX_CATCH_UP.as_millis() as u64 * u64::from(self.rate_hz) / 1000
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test(start_paused = true)]
    async fn ticks_are_counted_with_those_that_were_missed() {
        for rate_hz in [30, 50, 60] {
            let mut ticker = Ticker::new(rate_hz);
            for number in 0..10 {
                let tick = ticker.next().await;
                assert_eq!(tick, TickNumber { number, missed: 0 });
            }
            // The server is busy for six and a half periods.
            tokio::time::advance(Duration::from_secs(13) / (2 * rate_hz)).await;
            let late = ticker.next().await;
            assert_eq!(
                late,
                TickNumber {
                    number: 10,
                    missed: 0
                }
            );
            let next = ticker.next().await;
            assert_eq!((next.number, next.missed), (16, 5), "at {rate_hz} Hz");
            assert_eq!(ticker.next().await.missed, 0);
        }
    }

    #[test]
    fn long_streams_do_not_drift() {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_time()
            .build()
            .unwrap();
        let _guard = runtime.enter();
        let mut ticker = Ticker::new(30);
        // The interval's period is a third of a nanosecond short; after a day that is a
        // millisecond.
        let period = Duration::from_secs(1) / 30;
        for number in 0..30 * 3600 * 24u32 {
            let tick = ticker.count(period * number);
            assert_eq!((tick.number, tick.missed), (u64::from(number), 0));
        }
    }
}
