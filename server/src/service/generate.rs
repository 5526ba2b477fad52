//! `troupe.v1.Motion/Generate`.

use std::time::Instant;

use troupe_proto::v1;

use super::{REQUEST_TARGET, Service, ServiceError};
use crate::batch::{Order, Parts};
use crate::inbetween::{PartWriter, prepare_generate};

/// An answer that is being made. Dropping it gives it up.
#[derive(Debug)]
#[must_use = "dropping it gives up the request"]
pub struct Generation {
    parts: Parts,
    writer: PartWriter,
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
        let order = Order::request(arrived + REQUEST_TARGET).expiring(arrived + self.timeout);
        Ok(Generation {
            parts: loaded.batcher.stream(task, order)?,
            writer: PartWriter::new(rig, frame),
        })
    }
}
