//! A worker: the thread that owns a generator and steps it.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Instant;

use tokio::sync::oneshot;
use troupe_engine::EngineError;
use troupe_engine::generator::{Generator, JobId, Progress, StepReport};

use super::shared::Shared;
use super::state::{Orders, Replies, Step};

/// Makes the generator of a worker. Its argument is the worker's number, from 0. It is called once
/// for each worker, in parallel, on the threads that will own the generators.
pub type GeneratorFactory = Arc<dyn Fn(usize) -> Result<Box<dyn Generator>, EngineError> + Send + Sync>;

/// Makes the worker's generator, and steps it until the last batcher is gone and all requests are
/// done.
pub(super) fn run(
    shared: Arc<Shared>,
    number: usize,
    factory: &GeneratorFactory,
    started: oneshot::Sender<Result<(), EngineError>>,
) {
    let generator = match factory(number) {
        Ok(generator) => generator,
        Err(error) => {
            // The send fails if the start was cancelled.
            let _ = started.send(Err(error));
            return;
        }
    };
    if let Some(trial) = generator.trial() {
        shared.tried(trial);
    }
    if started.send(Ok(())).is_err() {
        return;
    }
    let worker = Worker {
        shared,
        number,
        generator,
        held: Vec::new(),
        dropped: Vec::new(),
        replies: Replies::default(),
    };
    worker.serve();
}

/// A running worker. If a panic drops it, its jobs fail, and the other workers continue.
struct Worker {
    shared: Arc<Shared>,
    number: usize,
    generator: Box<dyn Generator>,
    /// Jobs in the generator.
    held: Vec<JobId>,
    /// Jobs that were cancelled since the last step.
    dropped: Vec<JobId>,
    replies: Replies,
}

impl Worker {
    fn serve(mut self) {
        let mut step = None;
        loop {
            let ended = step.as_ref().map(|step: &Step| step.ended);
            let room = (self.generator.free(), self.generator.is_idle());
            let orders = self
                .shared
                .next(self.number, room, step.take(), &self.dropped, &mut self.replies);
            self.dropped.clear();
            let Some(orders) = orders else { return };
            self.follow(orders, ended);
            if !self.generator.is_idle() {
                step = Some(self.step());
            }
        }
    }

    /// Drops cancelled jobs and takes new ones. `ended` is the end of the last step, if the worker
    /// was not idle since.
    fn follow(&mut self, orders: Orders, ended: Option<Instant>) {
        for request in orders.cancelled {
            for id in self.held.extract_if(.., |id| id.request == request.0) {
                self.generator.cancel(id);
                self.dropped.push(id);
            }
        }
        let metrics = &self.shared.metrics;
        if let Some(reason) = orders.reason {
            metrics.dispatched(reason, orders.jobs.len());
            if let Some(ended) = ended {
                metrics.worker_gap(ended.elapsed());
            }
        }
        for slice in orders.slices.iter().filter(|slice| slice.first == 0) {
            metrics.queued(slice.class, slice.waited);
        }
        for (id, task) in orders.jobs {
            self.held.push(id);
            self.generator.admit(id, task);
        }
    }

    fn step(&mut self) -> Step {
        let started = Instant::now();
        let mut progress: Vec<(JobId, Progress)> = Vec::with_capacity(self.held.len());
        let generator = &mut self.generator;
        let result = catch_unwind(AssertUnwindSafe(|| {
            generator.step(&mut |id, became| progress.push((id, became)))
        }))
        .unwrap_or_else(|payload| Err(EngineError::Panicked(panic_message(&*payload))));
        let ended = Instant::now();
        let report = match result {
            Ok(report) => {
                self.shared.metrics.ran(&report);
                report
            }
            Err(error) => {
                tracing::error!(%error, "a batch failed");
                self.generator.clear();
                // A job that gave a part in this step is cleared too, so it also fails.
                let open = self.held.iter().filter(|id| !is_over(&progress, id));
                let failed = open.map(|&id| (id, Progress::Failed(error.clone())));
                let failed: Vec<_> = failed.collect();
                progress.extend(failed);
                StepReport::default()
            }
        };
        self.held.retain(|id| !is_over(&progress, id));
        Step {
            started,
            ended,
            report,
            progress,
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        if std::thread::panicking() {
            // The cancelled jobs have not been reported yet.
            self.held.append(&mut self.dropped);
            self.shared.worker_lost(self.number, &self.held);
        }
    }
}

/// Whether a step has finished a job.
fn is_over(progress: &[(JobId, Progress)], id: &JobId) -> bool {
    let mut became = progress.iter().filter(|(other, _)| other == id);
    became.any(|(_, became)| !matches!(became, Progress::Part(_)))
}

fn panic_message(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("it gave no reason")
        .to_owned()
}
