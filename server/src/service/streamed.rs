//! Answers that come part by part while they are made.

use std::time::{Duration, Instant};

use serde::Serialize;
use troupe_motion::model::Task;

use super::{REQUEST_TARGET, ServiceError};
use troupe_base::telemetry::{RequestContext, Trace};
use troupe_batch::{AnswerStream, Batcher, Order, Piece, trace_queue, trace_step};

/// An answer on its way, whose parts are messages.
pub trait Streamed: Send + 'static {
    /// A part.
    type Part: Serialize + Send + 'static;

    /// The next part; none after the last, and none after an error.
    fn next(&mut self) -> impl Future<Output = Option<Result<Self::Part, ServiceError>>> + Send;
}

/// What a generator makes for one answer, as it comes. Each step is noted in the request's trace.
#[derive(Debug)]
#[must_use = "dropping it gives up the request"]
pub(super) struct Pieces {
    stream: AnswerStream,
    trace: Option<Trace>,
    /// When it came to the batcher, until there is a piece.
    asked: Option<Instant>,
}

impl Pieces {
    /// Asks for what a task makes, for a request that arrived then. It has a place in the queue
    /// when this returns.
    ///
    /// # Errors
    /// [`ServiceError`] where there is no place.
    pub(super) fn ask(
        batcher: &Batcher,
        task: Task,
        arrived: Instant,
        timeout: Duration,
    ) -> Result<Self, ServiceError> {
        Ok(Self {
            asked: Some(Instant::now()),
            trace: RequestContext::current_trace(),
            stream: batcher.stream(task, order(arrived, timeout))?,
        })
    }

    /// Asks for what goes on from there.
    ///
    /// # Errors
    /// As [`ask`](Self::ask).
    pub(super) fn ask_on(
        &mut self,
        batcher: &Batcher,
        task: Task,
        timeout: Duration,
    ) -> Result<(), ServiceError> {
        let asked = Instant::now();
        self.asked = Some(asked);
        self.stream = batcher.stream(task, order(asked, timeout))?;
        Ok(())
    }

    /// The next piece; none after the last.
    pub(super) async fn next(&mut self) -> Option<Result<Piece, ServiceError>> {
        let piece = match self.stream.next().await? {
            Ok(piece) => piece,
            Err(error) => return Some(Err(error.into())),
        };
        if let Some(trace) = &self.trace {
            if let Some(asked) = self.asked.take() {
                trace_queue(trace, asked, piece.queued);
            }
            trace_step(trace, &piece.step);
        }
        Some(Ok(piece))
    }
}

fn order(asked: Instant, timeout: Duration) -> Order {
    Order::request(asked + REQUEST_TARGET).expiring(asked + timeout)
}
