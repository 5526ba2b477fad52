//! The locked state that callers and workers share: the scheduler, and the tasks and answers of its
//! requests. All of this runs under the lock and is short. Answers are collected in [`Replies`] and
//! sent later.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use tokio::sync::{mpsc, oneshot};
use troupe_engine::EngineError;
use troupe_engine::generator::{JobId, Progress, StepReport};
use troupe_motion::model::{Output, Task};

use super::error::SubmitError;
use super::metrics::{PackMetrics, Rejection};
use super::order::Order;
use super::scheduler::{
    Action, Batch, BatchReason, Event, Finished, Limits, QueueRefusal, Ready, RequestId, RequestSlice,
    Scheduler,
};
use super::served::{Piece, Served, ServedStep};

/// The caller's channel for a whole answer.
type WholeReply = oneshot::Sender<Result<Served, SubmitError>>;

/// The caller's channel for an answer.
#[derive(Debug)]
pub(super) enum Reply {
    /// One message with the whole answer.
    Whole(WholeReply),
    /// A message for each piece.
    Stream(mpsc::Sender<Result<Piece, SubmitError>>),
}

/// Answers to send after the lock is released, because a send wakes a task.
#[derive(Debug, Default)]
pub(super) struct Replies(Vec<(WholeReply, Result<Served, SubmitError>)>);

impl Replies {
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn send(&mut self) {
        for (reply, answer) in self.0.drain(..) {
            // The caller may be gone by now.
            let _ = reply.send(answer);
        }
    }
}

/// A worker's orders for its next step.
#[derive(Debug, Default)]
pub(super) struct Orders {
    /// New jobs.
    pub(super) jobs: Vec<(JobId, Task)>,
    /// The slices of requests that the jobs belong to, for the metrics.
    pub(super) slices: Vec<RequestSlice>,
    /// None if there are no new jobs.
    pub(super) reason: Option<BatchReason>,
    /// Requests whose jobs the worker must drop.
    pub(super) cancelled: Vec<RequestId>,
}

impl Orders {
    pub(super) fn is_empty(&self) -> bool {
        self.jobs.is_empty() && self.cancelled.is_empty()
    }
}

/// A worker's finished step.
#[derive(Debug)]
pub(super) struct Step {
    pub(super) started: Instant,
    pub(super) ended: Instant,
    pub(super) report: StepReport,
    pub(super) progress: Vec<(JobId, Progress)>,
}

/// A request that has not been answered.
#[derive(Debug)]
struct Job {
    /// The waiting tasks. The scheduler's slices take them from the front.
    tasks: std::vec::IntoIter<Task>,
    arrived: Instant,
    served: Served,
    /// The answer so far, by character.
    outputs: Vec<Option<Output>>,
    /// Number of characters whose answer is not whole yet.
    open: usize,
    /// See [`Order::work`].
    work: u32,
    /// Whether a worker has got any of its tasks.
    has_started: bool,
    /// Whether a worker has made any of its answer.
    has_output: bool,
    /// Start and end of the last step whose times `served` includes.
    counted: Option<(Instant, Instant)>,
    reply: Reply,
}

/// The shared state.
#[derive(Debug)]
pub(super) struct State {
    scheduler: Scheduler,
    jobs: HashMap<RequestId, Job>,
    next_id: u64,
    /// Orders by worker, for its next step.
    orders: Vec<Orders>,
    /// Workers to wake.
    wake: Vec<usize>,
    /// Whether the last [`Batcher`](super::Batcher) is gone, so that no more requests can come.
    pub(super) closed: bool,
    actions: Vec<Action>,
    finished: Vec<Finished>,
    metrics: PackMetrics,
}

impl State {
    pub(super) fn new(limits: Limits, metrics: PackMetrics) -> Self {
        Self {
            orders: (0..limits.workers).map(|_| Orders::default()).collect(),
            scheduler: Scheduler::new(limits),
            jobs: HashMap::new(),
            next_id: 0,
            wake: Vec::new(),
            closed: false,
            actions: Vec::new(),
            finished: Vec::new(),
            metrics,
        }
    }

    pub(super) fn scheduler(&self) -> &Scheduler {
        &self.scheduler
    }

    /// Adds a request.
    pub(super) fn admit(
        &mut self,
        now: Instant,
        tasks: Vec<Task>,
        order: Order,
        reply: Reply,
        replies: &mut Replies,
    ) -> Result<RequestId, SubmitError> {
        if self.scheduler.workers() == 0 {
            return Err(EngineError::Stopped.into());
        }
        let request = RequestId(self.next_id);
        self.next_id += 1;
        let characters = tasks.len();
        let job = Job {
            tasks: tasks.into_iter(),
            arrived: now,
            served: Served::default(),
            outputs: std::iter::repeat_with(|| None).take(characters).collect(),
            open: characters,
            work: order.work,
            has_started: false,
            has_output: false,
            counted: None,
            reply,
        };
        self.jobs.insert(request, job);
        let arrived = Event::Arrived {
            request,
            characters,
            order,
        };
        self.step(now, arrived, replies).map_or(Ok(request), Err)
    }

    /// Forgets a request whose caller has gone, and has workers drop its jobs.
    pub(super) fn forget(&mut self, now: Instant, request: RequestId) {
        // The caller is gone, so no answer is sent.
        self.step(now, Event::Gone { request }, &mut Replies::default());
        if self.jobs.remove(&request).is_some_and(|job| job.has_started) {
            self.cancel(request);
        }
    }

    /// Fails all requests, because the workers end.
    pub(super) fn abandon(&mut self) {
        self.jobs.clear();
    }

    /// Orders all busy workers to drop the jobs of a request.
    fn cancel(&mut self, request: RequestId) {
        for (worker, orders) in self.orders.iter_mut().enumerate() {
            if self.scheduler.is_busy(worker) {
                orders.cancelled.push(request);
            }
        }
    }

    /// Gives the scheduler the time of a worker's trial batch.
    pub(super) fn tried(&mut self, now: Instant, work: u64, took: Duration) {
        self.step(now, Event::Tried { work, took }, &mut Replies::default());
    }

    /// A worker is between two steps: delivers the results of the last one, and returns new orders.
    /// `dropped` are the jobs that the worker has dropped since its last call.
    pub(super) fn ready(
        &mut self,
        worker: usize,
        (room, is_idle): (usize, bool),
        step: Option<Step>,
        dropped: &[JobId],
        replies: &mut Replies,
    ) -> Orders {
        let mut finished = std::mem::take(&mut self.finished);
        finished.extend(dropped.iter().map(done));
        let took = step.as_ref().map(|step| step.ended - step.started);
        let now = step.as_ref().map_or_else(Instant::now, |step| step.ended);
        if let Some(step) = step {
            for (id, progress) in step.progress {
                if !matches!(progress, Progress::Part(_)) {
                    finished.push(done(&id));
                }
                self.deliver(id, progress, (step.started, step.ended), &step.report, replies);
            }
        }
        let ready = Ready {
            worker,
            room,
            is_idle,
            took,
            finished: &finished,
        };
        self.step(now, Event::Ready(ready), replies);
        finished.clear();
        self.finished = finished;
        std::mem::take(&mut self.orders[worker])
    }

    /// Workers that the caller must wake.
    pub(super) fn take_wake(&mut self) -> Vec<usize> {
        std::mem::take(&mut self.wake)
    }

    /// Whether an idle worker may end.
    pub(super) fn is_over(&self) -> bool {
        self.closed && self.scheduler.pending_requests() == 0
    }

    /// A worker panicked; `held` are its jobs.
    pub(super) fn lose(&mut self, now: Instant, worker: usize, held: &[JobId], replies: &mut Replies) {
        let ordered = std::mem::take(&mut self.orders[worker]);
        let ordered = ordered.jobs.iter().map(|(id, _)| id);
        let finished: Vec<Finished> = held.iter().chain(ordered).map(done).collect();
        for &Finished { request, .. } in &finished {
            self.fail(now, request, EngineError::Stopped.into(), replies);
        }
        let lost = Event::WorkerLost {
            worker,
            finished: &finished,
        };
        self.step(now, lost, replies);
        if self.scheduler.workers() == 0 {
            let stranded: Vec<RequestId> = self.jobs.keys().copied().collect();
            for request in stranded {
                self.fail(now, request, EngineError::Stopped.into(), replies);
            }
        }
    }

    /// Delivers a step's result for a job. If it was the request's last, sends the answer.
    fn deliver(
        &mut self,
        id: JobId,
        progress: Progress,
        (started, ended): (Instant, Instant),
        report: &StepReport,
        replies: &mut Replies,
    ) {
        let request = RequestId(id.request);
        let Some(job) = self.jobs.get_mut(&request) else {
            return;
        };
        let (output, is_last) = match progress {
            Progress::Part(output) => (output, false),
            Progress::Done(output) => (output, true),
            Progress::Failed(error) => {
                tracing::error!(%error, "a character failed");
                return self.fail(ended, request, error.into(), replies);
            }
        };
        let step = ServedStep {
            started,
            ended,
            jobs: report.jobs,
            rows: report.rows,
            inference: report.inference(),
        };
        let begun = started.saturating_duration_since(job.arrived);
        let served = &mut job.served;
        served.started = match std::mem::replace(&mut job.has_output, true) {
            true => served.started.min(begun),
            false => begun,
        };
        served.finished = ended.saturating_duration_since(job.arrived);
        // A step that gave answers for several characters of the request counts once.
        if job.counted.replace((started, ended)) != Some((started, ended)) {
            served.assemble += report.assemble;
            served.inference += step.inference;
            served.scatter += report.scatter;
            // In a stream each piece carries its step.
            if matches!(job.reply, Reply::Whole(_)) {
                served.steps.push(step);
            }
        }
        served.batch_size = served.batch_size.max(report.jobs);
        if is_last {
            served.work += self.scheduler.time_of(job.work);
            job.open = job.open.saturating_sub(1);
        }
        let character = id.character as usize;
        match &job.reply {
            Reply::Whole(_) => {
                if let Some(slot) = job.outputs.get_mut(character) {
                    append(slot, output);
                }
            }
            Reply::Stream(stream) => {
                let piece = Piece {
                    character,
                    output,
                    is_last,
                    queued: job.served.queued,
                    step,
                };
                if let Err(error) = stream.try_send(Ok(piece)) {
                    return self.stop_reading(ended, request, &error, replies);
                }
            }
        }
        if job.open == 0
            && let Some(mut job) = self.jobs.remove(&request)
            && let Reply::Whole(reply) = job.reply
        {
            job.served.outputs = job.outputs.into_iter().flatten().collect();
            replies.0.push((reply, Ok(job.served)));
        }
    }

    /// The reader of a stream is too slow or gone.
    fn stop_reading<T>(
        &mut self,
        now: Instant,
        request: RequestId,
        error: &mpsc::error::TrySendError<T>,
        replies: &mut Replies,
    ) {
        if matches!(error, mpsc::error::TrySendError::Full(_)) {
            self.metrics.rejected(Rejection::ReaderSlow);
        }
        self.step(now, Event::Gone { request }, replies);
        // The reader sees that the channel ends without a last piece.
        self.jobs.remove(&request);
        self.cancel(request);
    }

    /// Fails a request, and drops its waiting and running jobs.
    fn fail(&mut self, now: Instant, request: RequestId, error: SubmitError, replies: &mut Replies) {
        // This removes the job first, so the event below does not count the caller as gone.
        self.answer(request, error, replies);
        self.step(now, Event::Gone { request }, replies);
        self.cancel(request);
    }

    fn answer(&mut self, request: RequestId, error: SubmitError, replies: &mut Replies) {
        match self.jobs.remove(&request).map(|job| job.reply) {
            Some(Reply::Whole(reply)) => replies.0.push((reply, Err(error))),
            Some(Reply::Stream(stream)) => {
                // If the channel is full, its end tells the reader.
                let _ = stream.try_send(Err(error));
            }
            None => {}
        }
    }

    /// Gives the scheduler an event and carries out its actions. Returns the error if the scheduler
    /// refuses a request.
    fn step(&mut self, now: Instant, event: Event<'_>, replies: &mut Replies) -> Option<SubmitError> {
        let mut actions = std::mem::take(&mut self.actions);
        self.scheduler.step(now, event, &mut actions);
        let mut refused = None;
        for action in actions.drain(..) {
            match action {
                Action::Start(batch) => self.hand_out(batch),
                Action::Wake { worker } => self.wake.push(worker),
                Action::Refuse { request, refusal } => {
                    self.metrics.rejected(refusal.into());
                    self.jobs.remove(&request);
                    refused = Some(refusal.into());
                }
                Action::PushOut { request, refusal } => {
                    self.metrics.rejected(Rejection::PushedOut);
                    let has_started = self.jobs.get(&request).is_some_and(|job| job.has_started);
                    self.answer(request, refusal.into(), replies);
                    if has_started {
                        self.cancel(request);
                    }
                }
                Action::Supersede { request } => {
                    self.metrics.rejected(Rejection::Superseded);
                    self.answer(request, SubmitError::Superseded, replies);
                }
                Action::Expire { request, waited } => {
                    self.metrics.rejected(Rejection::Expired);
                    self.answer(request, SubmitError::DeadlinePassed { waited }, replies);
                }
                // A failed request has been answered already, and its caller is not gone.
                Action::Drop { request, .. } if self.jobs.contains_key(&request) => {
                    self.metrics.rejected(Rejection::ClientGone);
                }
                Action::Drop { .. } => {}
            }
        }
        self.actions = actions;
        refused
    }

    /// Adds a batch to the orders of its worker.
    fn hand_out(&mut self, batch: Batch) {
        let orders = &mut self.orders[batch.worker];
        for slice in &batch.slices {
            let Some(job) = self.jobs.get_mut(&slice.request) else {
                continue;
            };
            if slice.first == 0 {
                job.served.queued = slice.waited;
            }
            job.has_started = true;
            let ids = (slice.first..slice.first + slice.characters).map(|character| JobId {
                request: slice.request.0,
                character: character as u32,
            });
            orders.jobs.extend(ids.zip(job.tasks.by_ref()));
        }
        orders.slices = batch.slices;
        orders.reason = Some(batch.reason);
    }
}

/// A job that has left its worker.
fn done(id: &JobId) -> Finished {
    Finished {
        request: RequestId(id.request),
        characters: 1,
    }
}

/// Appends to a character's answer.
fn append(slot: &mut Option<Output>, output: Output) {
    match slot {
        Some(whole) => whole.append(output),
        None => *slot = Some(output),
    }
}

impl From<QueueRefusal> for Rejection {
    fn from(refusal: QueueRefusal) -> Self {
        if refusal.full {
            Self::QueueFull
        } else {
            Self::QueueSlow
        }
    }
}
