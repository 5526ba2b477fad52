//! Live characters with the server's clock: a few streams with many characters each.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio::time::Instant;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Streaming;
use troupe_client::KeyedChannel;
use troupe_proto::v1;
use v1::drive_request::Message as Ask;
use v1::drive_response::Message as FromServer;
use v1::sessions_client::SessionsClient;

use super::connect::MOST_ANSWER_BYTES;
use super::frames::{Block, BlockError};
use super::groups::Groups;
use super::route::GroupRoute;
use super::wander::Walker;
use crate::failure::Failure;
use crate::measure::{Answer, Call, Outcome, Recorder};
use crate::plan::{Live, Plan, Share};

/// Maximum number of waiting messages to the server. While the queue is full, characters make no
/// decisions.
const QUEUE: usize = 16;
/// Maximum time for a stream to end after the load.
const GOODBYE: Duration = Duration::from_secs(5);

/// A share of the characters, ready to be attached to streams.
#[derive(Debug)]
pub struct Drive {
    live: Live,
    groups: Groups,
}

impl Drive {
    pub(super) async fn prepare(plan: &Plan, live: &Live, share: Share) -> Result<Self, Failure> {
        Ok(Self {
            live: live.clone(),
            groups: Groups::open(plan, live, share).await?,
        })
    }

    pub(super) async fn carry_out(self, recorder: &Arc<Recorder>) -> Result<(), Failure> {
        self.groups.count(recorder);
        let Groups {
            opened,
            joints,
            groups,
        } = self.groups;
        tokio::time::sleep_until(recorder.clock().start()).await;
        let mut tasks = JoinSet::new();
        for group in groups {
            let stream = Stream::new(&self.live, joints, group.walkers, recorder.clone());
            tasks.spawn(async move { stream.run(group.channel, &group.route).await });
        }
        opened.see_through(tasks, recorder).await
    }
}

/// One stream and its characters.
struct Stream {
    recorder: Arc<Recorder>,
    options: v1::DriveOpen,
    period: Duration,
    joints: usize,
    verify_every: u64,
    walkers: Vec<Walker>,
    /// Index of the walker in each slot of the stream.
    slots: HashMap<u32, usize>,
    /// Estimated time at which tick 0 was due, from the tick with the least delay.
    first_due: Option<Instant>,
    last: Option<(u64, Instant)>,
}

impl Stream {
    fn new(live: &Live, joints: usize, walkers: Vec<Walker>, recorder: Arc<Recorder>) -> Self {
        let encoding = if live.compact {
            v1::Encoding::Compact
        } else {
            v1::Encoding::F32
        };
        Self {
            recorder,
            options: v1::DriveOpen {
                rate_hz: live.rate_hz,
                encoding: encoding.into(),
                ..v1::DriveOpen::default()
            },
            period: Duration::from_secs(1) / live.rate_hz,
            joints,
            verify_every: live.verify_every.into(),
            walkers,
            slots: HashMap::new(),
            first_due: None,
            last: None,
        }
    }

    async fn run(mut self, channel: KeyedChannel, route: &GroupRoute) {
        if let Err(status) = self.follow(channel, route).await {
            self.recorder.fault("STREAM_LOST", status.message());
            let lost = self.walkers.len() as u64;
            self.recorder.live(|live| live.faults += lost);
        }
    }

    async fn follow(&mut self, channel: KeyedChannel, route: &GroupRoute) -> Result<(), tonic::Status> {
        let (asks, queue) = mpsc::channel(QUEUE);
        let session_ids = self.walkers.iter().map(|w| w.id.clone()).collect();
        // The queue is empty, so it has room.
        let _ = asks.try_send(request(Ask::Open(self.options.clone())));
        let _ = asks.try_send(request(Ask::Attach(v1::DriveAttach { session_ids })));
        let mut rpc = SessionsClient::new(channel).max_decoding_message_size(MOST_ANSWER_BYTES);
        let call = route.call(ReceiverStream::new(queue));
        let mut answers = rpc.drive(call).await?.into_inner();
        let end = self.recorder.clock().end();
        while let Ok(message) = tokio::time::timeout_at(end, answers.message()).await {
            let now = Instant::now();
            match message?.and_then(|m| m.message) {
                Some(FromServer::Frames(frames)) => {
                    self.tick(frames, now);
                    self.command(&asks, now);
                }
                Some(FromServer::Attached(attached)) => self.attached(attached),
                Some(FromServer::Left(left)) => self.faults("SESSION_LEFT", left.sessions),
                Some(FromServer::Commands(commands)) => self.refused(commands),
                Some(FromServer::Events(events)) => self.happened(&events, now),
                Some(FromServer::Closing(closing)) => {
                    let why = closing.reason.unwrap_or_default();
                    return Err(tonic::Status::aborted(why.message));
                }
                None => {
                    return Err(tonic::Status::aborted(
                        "the stream ended without a closing message",
                    ));
                }
            }
        }
        drop(asks);
        goodbye(answers).await;
        Ok(())
    }

    fn attached(&mut self, attached: v1::DriveAttached) {
        for of in attached.sessions {
            if let Some(place) = self.walkers.iter().position(|w| w.id == of.session_id) {
                self.slots.insert(of.slot, place);
            }
        }
        self.faults("NOT_ATTACHED", attached.problems);
    }

    /// Counts the events of sentences.
    fn happened(&self, events: &v1::DriveEvents, now: Instant) {
        if !self.recorder.clock().is_measured(now) {
            return;
        }
        let kinds = events
            .sessions
            .iter()
            .flat_map(|of| &of.events)
            .filter_map(|event| event.kind.as_ref());
        self.recorder
            .live(|live| kinds.for_each(|kind| live.performances.note(kind)));
    }

    fn refused(&self, commands: v1::CommandResponse) {
        for result in commands.results {
            if result.status() == v1::CommandStatus::Refused {
                let why = result.problem.unwrap_or_default().message;
                self.recorder.fault("COMMAND_REFUSED", &why);
                self.recorder.live(|live| live.faults += 1);
            }
        }
    }

    fn faults(&mut self, code: &str, problems: Vec<v1::SessionProblem>) {
        for of in problems {
            self.slots.remove(&of.slot);
            self.recorder.fault(code, &of.problem.unwrap_or_default().message);
            self.recorder.live(|live| live.faults += 1);
        }
    }

    fn tick(&mut self, frames: v1::DriveFrames, now: Instant) {
        let number = frames.tick;
        let since_first = self.period * u32::try_from(number).unwrap_or(u32::MAX);
        let first_due = now
            .checked_sub(since_first)
            .map_or(now, |first| self.first_due.map_or(first, |f| f.min(first)));
        self.first_due = Some(first_due);
        let due = first_due + since_first;
        let whole = self.verify_every > 0 && number.is_multiple_of(self.verify_every);
        let (here, bytes) = match self.read(&frames, whole, now) {
            Ok(read) => read,
            Err(why) => return self.recorder.fault("WRONG_FRAMES", &why.to_string()),
        };
        if whole {
            self.recorder.verified(here);
        }
        let answer = Answer {
            characters: u32::try_from(here).unwrap_or(u32::MAX),
            frames: here,
            bytes,
            timing: None,
        };
        let call = Call {
            due,
            sent: due,
            done: now,
            outcome: Outcome::Right(answer),
        };
        self.recorder.came(&call, u64::from(frames.underruns));
        if self.recorder.clock().is_measured(now) {
            self.count(&frames, here, due, now);
        }
        self.last = Some((number, now));
    }

    fn count(&self, frames: &v1::DriveFrames, here: u64, due: Instant, now: Instant) {
        let missing = (self.slots.len() as u64).saturating_sub(here);
        let (period, last) = (self.period, self.last);
        self.recorder.live(|live| {
            live.late_ticks += u64::from(now.saturating_duration_since(due) > period);
            live.missing_frames += missing;
            live.slowed_frames += u64::from(frames.underruns);
            if let Some((number, at)) = last {
                let steps = frames.tick.saturating_sub(number).max(1);
                live.missed_ticks += steps - 1;
                let wanted = period * u32::try_from(steps).unwrap_or(u32::MAX);
                live.jitter.record((now - at).abs_diff(wanted));
            }
        });
    }

    /// Reads the positions of all characters in a tick. Returns the number of characters and the
    /// size of their frames in bytes.
    fn read(
        &mut self,
        frames: &v1::DriveFrames,
        whole: bool,
        now: Instant,
    ) -> Result<(u64, u64), BlockError> {
        let (mut here, mut bytes) = (0, 0);
        let seconds = self.period.as_secs_f32();
        for block in &frames.blocks {
            let block = Block::read(block, self.joints)?;
            if whole {
                block.check()?;
            }
            bytes += block.bytes();
            for (slot, place) in block.places() {
                here += 1;
                let Some(&nth) = self.slots.get(&slot) else {
                    continue;
                };
                if let Some(after) = self.walkers[nth].seen(place, seconds, now)
                    && self.recorder.clock().is_measured(now)
                {
                    self.recorder.live(|live| live.command_to_motion.record(after));
                }
            }
        }
        Ok((here, bytes))
    }

    /// Sends the commands of characters that are due to decide.
    fn command(&mut self, asks: &mpsc::Sender<v1::DriveRequest>, now: Instant) {
        // If the queue is full, they decide at a later tick.
        let Ok(room) = asks.try_reserve() else { return };
        let at = now.saturating_duration_since(self.recorder.clock().start());
        let attached = self.slots.len() == self.walkers.len();
        let commands = self.walkers.iter_mut().filter_map(|w| w.decide(at, now));
        let commands = commands.collect::<Vec<_>>();
        if commands.is_empty() {
            return;
        }
        if attached && self.recorder.clock().is_measured(now) {
            let count = commands.len() as u64;
            self.recorder.live(|live| live.commands += count);
        }
        room.send(request(Ask::Command(v1::CommandRequest { commands })));
    }
}

fn request(message: Ask) -> v1::DriveRequest {
    v1::DriveRequest {
        message: Some(message),
    }
}

/// Waits until the server has released the stream's sessions.
async fn goodbye(mut answers: Streaming<v1::DriveResponse>) {
    let rest = async { while let Ok(Some(_)) = answers.message().await {} };
    // A stream that does not end in time is dropped.
    let _ = tokio::time::timeout(GOODBYE, rest).await;
}
