//! What callers and lanes share: the scheduler, and the work behind its requests. Everything here is done under the
//! lock, and nothing here takes long: what can wait (answers, log lines) goes into the [`Outbox`].

use std::collections::HashMap;
use std::time::{Duration, Instant};

use tokio::sync::oneshot;

use super::driver::{Served, SubmitError};
use super::metrics::{PackMetrics, Rejection};
use super::order::Order;
use super::scheduler::{Action, Cut, CutReason, Event, Limits, Part, Refusal, RequestId, Scheduler};
use troupe_engine::{EngineError, StageTimes};
use troupe_motion::model::{KeyframeTask, Motion};

/// Where a request's answer goes.
pub(super) type Reply = oneshot::Sender<Result<Served, SubmitError>>;
/// What a batch has for the requests that it carried.
pub(super) type Pieces = Vec<(Part, Result<Made, EngineError>)>;

/// What a batch made for a request.
#[derive(Debug, Default)]
pub(super) struct Made {
    /// Of characters in a row.
    pub(super) motions: Vec<Motion>,
    /// Their share of the lane's time.
    pub(super) work: Duration,
}

/// Answers that are to be sent when the lock is free again, for a send wakes somebody.
#[derive(Debug, Default)]
pub(super) struct Outbox(Vec<(Reply, Result<Served, SubmitError>)>);

impl Outbox {
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn send(&mut self) {
        for (reply, answer) in self.0.drain(..) {
            // The caller may have gone meanwhile.
            let _ = reply.send(answer);
        }
    }
}

/// A batch on its way to its lane.
#[derive(Debug)]
pub(super) struct Batch {
    pub(super) items: Vec<KeyframeTask>,
    pub(super) parts: Vec<Part>,
    pub(super) reason: CutReason,
}

/// When a batch ran, and where its time went: all of it, or what there was until some of its answers were there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ran {
    pub(super) started: Instant,
    pub(super) ended: Instant,
    pub(super) times: StageTimes,
    /// Characters of the whole batch.
    pub(super) size: usize,
}

/// A request that has not been answered.
#[derive(Debug)]
struct Job {
    /// What is not yet cut; taken from the front, in step with the scheduler's parts.
    items: std::vec::IntoIter<KeyframeTask>,
    characters: usize,
    arrived: Instant,
    served: Served,
    /// What lanes have made of it, by the first character; lanes may finish in any order.
    pieces: Vec<(usize, Vec<Motion>)>,
    reply: Reply,
}

/// The shared state.
#[derive(Debug)]
pub(super) struct Core {
    scheduler: Scheduler,
    jobs: HashMap<RequestId, Job>,
    next_id: u64,
    /// The batch that each lane is to take.
    slots: Vec<Option<Batch>>,
    /// When free lanes cease to wait for more work, where they do.
    pub(super) wake_at: Option<Instant>,
    /// A lane was woken and has not looked yet.
    pub(super) woken: bool,
    /// Nobody can ask for anything any more.
    pub(super) closed: bool,
    actions: Vec<Action>,
    metrics: PackMetrics,
}

impl Core {
    pub(super) fn new(limits: Limits, metrics: PackMetrics) -> Self {
        Self {
            slots: (0..limits.lanes).map(|_| None).collect(),
            scheduler: Scheduler::new(limits),
            jobs: HashMap::new(),
            next_id: 0,
            wake_at: None,
            woken: false,
            closed: false,
            actions: Vec::new(),
            metrics,
        }
    }

    pub(super) fn scheduler(&self) -> &Scheduler {
        &self.scheduler
    }

    /// Why a call of so many characters is refused before it is put in, where it is.
    pub(super) fn refuse(&mut self, now: Instant, characters: usize) -> Option<Refusal> {
        self.scheduler.refuse(now, characters)
    }

    /// Puts a request in.
    pub(super) fn admit(
        &mut self,
        now: Instant,
        items: Vec<KeyframeTask>,
        order: Order,
        reply: Reply,
        outbox: &mut Outbox,
    ) -> Result<RequestId, SubmitError> {
        if self.scheduler.lanes() == 0 {
            return Err(EngineError::Stopped.into());
        }
        let request = RequestId(self.next_id);
        self.next_id += 1;
        let characters = items.len();
        let job = Job {
            items: items.into_iter(),
            characters,
            arrived: now,
            served: Served::default(),
            pieces: Vec::new(),
            reply,
        };
        self.jobs.insert(request, job);
        let arrived = Event::Arrived {
            request,
            characters,
            order,
        };
        self.step(now, arrived, outbox).map_or(Ok(request), Err)
    }

    /// Forgets a request whose caller has gone; what is with the engine runs to its end.
    pub(super) fn forget(&mut self, now: Instant, request: RequestId) {
        // It has no answer to send: nobody would get it.
        self.step(now, Event::Gone { request }, &mut Outbox::default());
        self.jobs.remove(&request);
    }

    /// Tells the scheduler how long a lane took for a batch of nobody's.
    pub(super) fn tried(&mut self, now: Instant, characters: usize, took: Duration) {
        self.step(now, Event::Tried { characters, took }, &mut Outbox::default());
    }

    /// Tells the scheduler that a lane is free.
    pub(super) fn free(&mut self, now: Instant, lane: usize) {
        self.step(now, Event::LaneFree { lane }, &mut Outbox::default());
    }

    /// Cuts batches for free lanes.
    pub(super) fn settle(&mut self, now: Instant, outbox: &mut Outbox) {
        self.woken = false;
        self.wake_at = None;
        self.step(now, Event::Settled, outbox);
    }

    /// The batch that a lane is to run.
    pub(super) fn take(&mut self, lane: usize) -> Option<Batch> {
        self.slots[lane].take()
    }

    /// Lanes that have a batch to take.
    pub(super) fn called(&self) -> impl Iterator<Item = usize> {
        let slots = self.slots.iter().enumerate();
        slots.filter_map(|(lane, slot)| slot.as_ref().map(|_| lane))
    }

    /// Whether a lane may end.
    pub(super) fn is_over(&self) -> bool {
        self.closed && self.scheduler.pending_requests() == 0
    }

    /// A lane will run no batch any more; `parts` were with it.
    pub(super) fn lose(&mut self, now: Instant, lane: usize, parts: Vec<Part>, outbox: &mut Outbox) {
        let assigned = self.take(lane).map(|batch| batch.parts).unwrap_or_default();
        for part in parts.into_iter().chain(assigned) {
            self.fail(now, part.request, EngineError::Stopped, outbox);
        }
        self.step(now, Event::LaneLost { lane }, outbox);
        if self.scheduler.lanes() == 0 {
            let stranded: Vec<RequestId> = self.jobs.keys().copied().collect();
            for request in stranded {
                self.fail(now, request, EngineError::Stopped, outbox);
            }
        }
    }

    /// Hands what a lane has made of a batch that it still runs to its requests.
    pub(super) fn deliver_early(&mut self, lane: usize, ran: &Ran, pieces: Pieces, outbox: &mut Outbox) {
        let answered = Event::Answered {
            lane,
            characters: pieces.iter().map(|(part, _)| part.characters).sum(),
            callers: pieces.len(),
        };
        self.step(ran.ended, answered, outbox);
        self.deliver(ran, pieces, outbox);
    }

    /// Hands what a batch made to its requests.
    pub(super) fn deliver(&mut self, ran: &Ran, pieces: Pieces, outbox: &mut Outbox) {
        for (part, made) in pieces {
            match made {
                Ok(made) => self.serve(part, made, ran, outbox),
                Err(error) => self.fail(ran.ended, part.request, error, outbox),
            }
        }
    }

    /// Tells the scheduler that a batch has run, and that its lane is free.
    pub(super) fn ended(&mut self, lane: usize, ran: &Ran, outbox: &mut Outbox) {
        let lengths = Event::Ran {
            characters: ran.size,
            alike: ran.times.alike,
        };
        self.step(ran.ended, lengths, outbox);
        self.free(ran.ended, lane);
    }

    /// Notes what a batch made of a request, and answers it where that was the last of it.
    fn serve(&mut self, part: Part, made: Made, ran: &Ran, outbox: &mut Outbox) {
        let Some(job) = self.jobs.get_mut(&part.request) else {
            return;
        };
        let Served {
            started, finished, ..
        } = &mut job.served;
        let begun = ran.started.saturating_duration_since(job.arrived);
        *started = if job.pieces.is_empty() {
            begun
        } else {
            begun.min(*started)
        };
        *finished = ran.ended.saturating_duration_since(job.arrived);
        if part.first == 0 {
            job.served.queued = part.waited;
        }
        job.served.assemble += ran.times.assemble;
        job.served.inference += ran.times.inference();
        job.served.scatter += ran.times.scatter;
        job.served.work += made.work;
        job.served.batch_size = job.served.batch_size.max(ran.size);
        job.pieces.push((part.first, made.motions));
        let done: usize = job.pieces.iter().map(|(_, motions)| motions.len()).sum();
        if done == job.characters
            && let Some(mut job) = self.jobs.remove(&part.request)
        {
            job.served.motions = joined(job.pieces);
            outbox.0.push((job.reply, Ok(job.served)));
        }
    }

    /// Fails a request, and forgets what of it still waits.
    fn fail(&mut self, now: Instant, request: RequestId, error: EngineError, outbox: &mut Outbox) {
        // Its answer comes before that of the event, and is the only one.
        self.answer(request, Err(error.into()), outbox);
        self.step(now, Event::Gone { request }, outbox);
    }

    fn answer(&mut self, request: RequestId, answer: Result<Served, SubmitError>, outbox: &mut Outbox) {
        if let Some(job) = self.jobs.remove(&request) {
            outbox.0.push((job.reply, answer));
        }
    }

    /// Tells the scheduler what happened, and does what it says. Gives the error where it refuses a request.
    fn step(&mut self, now: Instant, event: Event, outbox: &mut Outbox) -> Option<SubmitError> {
        let mut actions = std::mem::take(&mut self.actions);
        self.scheduler.step(now, event, &mut actions);
        let mut refused = None;
        for action in actions.drain(..) {
            match action {
                Action::Cut(cut) => self.hand_out(cut),
                Action::WakeAt(at) => self.wake_at = Some(self.wake_at.map_or(at, |other| other.min(at))),
                Action::Refuse { request, refusal } => {
                    self.metrics.rejected(refusal.into());
                    self.jobs.remove(&request);
                    refused = Some(refusal.into());
                }
                Action::Supersede { request } => {
                    self.metrics.rejected(Rejection::Superseded);
                    self.answer(request, Err(SubmitError::Superseded), outbox);
                }
                Action::Expire { request, waited } => {
                    self.metrics.rejected(Rejection::Expired);
                    self.answer(request, Err(SubmitError::DeadlinePassed { waited }), outbox);
                }
                // One that failed is answered already, and its caller is still there.
                Action::Drop { request, .. } if self.jobs.contains_key(&request) => {
                    self.metrics.rejected(Rejection::ClientGone);
                }
                Action::Drop { .. } => {}
            }
        }
        self.actions = actions;
        refused
    }

    /// Puts a batch together for its lane.
    fn hand_out(&mut self, cut: Cut) {
        let mut items = Vec::with_capacity(cut.characters());
        for part in &cut.parts {
            if let Some(job) = self.jobs.get_mut(&part.request) {
                items.extend(job.items.by_ref().take(part.characters));
            }
        }
        self.slots[cut.lane] = Some(Batch {
            items,
            parts: cut.parts,
            reason: cut.reason,
        });
    }
}

/// All motions in the order of their characters.
fn joined(mut pieces: Vec<(usize, Vec<Motion>)>) -> Vec<Motion> {
    if pieces.len() == 1 {
        return pieces.pop().map(|(_, motions)| motions).unwrap_or_default();
    }
    pieces.sort_unstable_by_key(|(first, _)| *first);
    pieces.into_iter().flat_map(|(_, motions)| motions).collect()
}

impl From<Refusal> for SubmitError {
    fn from(refusal: Refusal) -> Self {
        Self::QueueFull {
            pending_characters: refusal.pending_characters,
            retry_after: refusal.retry_after(),
        }
    }
}

impl From<Refusal> for Rejection {
    fn from(refusal: Refusal) -> Self {
        if refusal.full {
            Self::QueueFull
        } else {
            Self::QueueSlow
        }
    }
}
