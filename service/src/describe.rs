//! `troupe.v1.Motion/Describe`: describes a motion in words or as audio, part by part.

use std::time::Instant;

use troupe_motion::model::{Capability, Telling};
use troupe_proto::v1;

use crate::inbetween::{prepare_describe, write_description};
use crate::streamed::{Pieces, Streamed};
use crate::{Service, ServiceError};

/// A description in progress.
#[derive(Debug)]
#[must_use = "dropping it gives up the request"]
pub struct Description {
    pieces: Pieces,
    into: Telling,
}

impl Streamed for Description {
    type Part = v1::DescribeResponse;

    async fn next(&mut self) -> Option<Result<v1::DescribeResponse, ServiceError>> {
        let piece = self.pieces.next().await?;
        Some(piece.map(|piece| write_description(piece.output, self.into, piece.is_last)))
    }
}

impl Service {
    /// `troupe.v1.Motion/Describe`. The request has a place in the queue when this returns.
    ///
    /// # Errors
    /// [`ServiceError`] if a value is not accepted, if the pack cannot describe motion, or if the
    /// queue is full.
    pub fn describe(&self, request: &v1::DescribeRequest) -> Result<Description, ServiceError> {
        let arrived = Instant::now();
        let loaded = self.pack(&request.pack)?;
        loaded.require(Capability::Describe, "pack")?;
        if !request.others.is_empty() {
            loaded.require(Capability::Agents, "pack")?;
        }
        let (task, into) = prepare_describe(request, &loaded.pack)?;
        Ok(Description {
            pieces: Pieces::ask(&loaded.batcher, task, arrived, self.common.timeout)?,
            into,
        })
    }
}
