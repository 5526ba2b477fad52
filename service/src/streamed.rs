//! Answers that are sent part by part while they are made.

use std::time::{Duration, Instant};

use serde::Serialize;
use troupe_motion::model::{Task, USUAL_WORK};

use crate::{REQUEST_TARGET, ServiceError};
use troupe_base::telemetry::{RequestContext, Trace};
use troupe_base::turns::{ClientId, Turns};
use troupe_batch::{AnswerStream, Batcher, Order, Piece, trace_queue, trace_step};

/// An answer in progress. Its parts are messages.
pub trait Streamed: Send + 'static {
    /// The message type of a part.
    type Part: Serialize + Send + 'static;

    /// The next part. None after the last part and after an error.
    fn next(&mut self) -> impl Future<Output = Option<Result<Self::Part, ServiceError>>> + Send;
}

/// The pieces that a generator makes for one answer. The request's trace records each step.
#[derive(Debug)]
#[must_use = "dropping it gives up the request"]
pub(crate) struct Pieces {
    stream: AnswerStream,
    trace: Option<Trace>,
    /// Time when the task was given to the batcher. None after its first piece.
    asked: Option<Instant>,
    /// The client whose request it is.
    client: ClientId,
}

impl Pieces {
    /// Queues a task for a request that arrived at `arrived`. The task has a place in the queue
    /// when this returns.
    ///
    /// # Errors
    /// [`ServiceError`] if the queue is full.
    pub(crate) fn ask(
        batcher: &Batcher,
        task: Task,
        arrived: Instant,
        timeout: Duration,
    ) -> Result<Self, ServiceError> {
        let client = Turns::current().client();
        Ok(Self {
            asked: Some(Instant::now()),
            trace: RequestContext::current_trace(),
            stream: batcher.stream(task, order(arrived, timeout, client))?,
            client,
        })
    }

    /// Queues a task that continues the answer.
    ///
    /// # Errors
    /// As [`ask`](Self::ask).
    pub(crate) fn ask_on(
        &mut self,
        batcher: &Batcher,
        task: Task,
        timeout: Duration,
    ) -> Result<(), ServiceError> {
        let asked = Instant::now();
        self.asked = Some(asked);
        self.stream = batcher.stream(task, order(asked, timeout, self.client))?;
        Ok(())
    }

    /// The next piece. None after the last piece.
    pub(crate) async fn next(&mut self) -> Option<Result<Piece, ServiceError>> {
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

/// The place in the queue of a client's request, whose work is not known yet.
pub(crate) fn order(asked: Instant, timeout: Duration, client: ClientId) -> Order {
    let order = Order {
        work: USUAL_WORK,
        ..Order::request(asked + REQUEST_TARGET)
    };
    order.expiring(asked + timeout).of(client)
}
