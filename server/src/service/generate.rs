//! `troupe.v1.Motion/Generate`.

use std::time::Instant;

use troupe_proto::v1;

use super::{REQUEST_TARGET, Service, ServiceError};
use crate::batch::{Order, Parts, trace_queue, trace_step};
use crate::inbetween::{PartWriter, prepare_generate};
use crate::telemetry::{RequestContext, Trace};

/// An answer that is being made. Dropping it gives it up.
#[derive(Debug)]
#[must_use = "dropping it gives up the request"]
pub struct Generation {
    parts: Parts,
    writer: PartWriter,
    /// Its trace, where it has one, and when it came to the batcher, until there is a part.
    trace: Option<Trace>,
    asked: Option<Instant>,
}

impl Generation {
    /// The next part; none after the last.
    ///
    /// # Errors
    /// [`ServiceError`], after which nothing comes.
    pub async fn next(&mut self) -> Option<Result<v1::GenerateResponse, ServiceError>> {
        let piece = match self.parts.next().await? {
            Ok(piece) => piece,
            Err(error) => return Some(Err(error.into())),
        };
        if let Some(trace) = &self.trace {
            if let Some(asked) = self.asked.take() {
                trace_queue(trace, asked, piece.queued);
            }
            trace_step(trace, &piece.step);
        }
        Some(
            self.writer
                .write(piece.output, piece.is_last)
                .map_err(ServiceError::from),
        )
    }
}

impl Service {
    /// `troupe.v1.Motion/Generate`. Has a place in the queue when it returns.
    ///
    /// # Errors
    /// [`ServiceError`] for a value that is not accepted, a pack that cannot do it, and where there is no place.
    pub fn generate(&self, request: &v1::GenerateRequest) -> Result<Generation, ServiceError> {
        let arrived = Instant::now();
        let loaded = self.table()?.find("pack", &request.pack)?;
        let rig = loaded.pack.rig.clone();
        let (task, frame) = prepare_generate(request, &rig)?;
        loaded.require(task.needs(), "pack")?;
        let order = Order::request(arrived + REQUEST_TARGET).expiring(arrived + self.common.timeout);
        Ok(Generation {
            asked: Some(Instant::now()),
            trace: RequestContext::current_trace(),
            parts: loaded.batcher.stream(task, order)?,
            writer: PartWriter::new(rig, frame),
        })
    }
}
