//! `troupe.v1.Motion/Generate`: an answer part by part, as the generator makes it.

use std::time::{Duration, Instant};

use troupe_character::post::check_finite;
use troupe_motion::SegmentFrame;
use troupe_motion::model::{Capability, Output};
use troupe_proto::v1;
use troupe_proto::v1::generate_request::Goal;

use super::{REQUEST_TARGET, Service, ServiceError};
use crate::batch::{Batcher, Order, Parts, Piece, trace_queue, trace_step};
use crate::inbetween::{
    PartWriter, PathPlan, check_words, most_past, no_temperature, prepare_generate, refuse_frames,
};
use crate::telemetry::{RequestContext, Trace};

/// An answer on its way.
#[derive(Debug)]
#[must_use = "dropping it gives up the request"]
pub struct Generation {
    parts: Parts,
    writer: PartWriter,
    /// Of a motion along a path, what is still to be made.
    path: Option<PathWay>,
    /// What the model was asked for that it may not do well, until there is a part.
    notes: Vec<String>,
    /// Its trace, where it has one, and when it came to the batcher, until there is a part.
    trace: Option<Trace>,
    asked: Option<Instant>,
}

/// A motion along a path, which is made window by window: each goes on from the one before.
#[derive(Debug)]
struct PathWay {
    plan: PathPlan,
    /// Where the segment of the window lies that is being made.
    frame: SegmentFrame,
    batcher: Batcher,
    timeout: Duration,
    /// Whether frames that are not feasible end the answer.
    strict: bool,
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
        let written = match &mut self.path {
            None => (self.writer.write(piece.output, piece.is_last)).map_err(ServiceError::from),
            Some(_) => self.written_window(piece),
        };
        Some(written.map(|part| v1::GenerateResponse {
            notes: std::mem::take(&mut self.notes),
            ..part
        }))
    }

    /// The message of a window, and the next window on its way.
    fn written_window(&mut self, piece: Piece) -> Result<v1::GenerateResponse, ServiceError> {
        let (Some(way), Output::Motion(motion)) = (&mut self.path, &piece.output) else {
            return Ok(self.writer.write(piece.output, piece.is_last)?);
        };
        // What is not finite must not become the past of the next.
        check_finite(motion)?;
        self.writer.move_to(way.frame);
        let (fresh, is_last) = way.plan.take(motion, &way.frame);
        let part = self.writer.write(Output::Motion(fresh), is_last)?;
        if let Some(found) = part.feasibility.as_ref().filter(|_| way.strict) {
            refuse_frames(found)?;
        }
        if let Some((task, frame)) = way.plan.next() {
            way.frame = frame;
            let asked = Instant::now();
            self.asked = Some(asked);
            self.parts = way.batcher.stream(task.into(), order(asked, way.timeout))?;
        }
        Ok(part)
    }
}

fn order(asked: Instant, timeout: Duration) -> Order {
    Order::request(asked + REQUEST_TARGET).expiring(asked + timeout)
}

impl Service {
    /// `troupe.v1.Motion/Generate`. Has a place in the queue when it returns.
    ///
    /// # Errors
    /// [`ServiceError`] for a value that is not accepted, a pack that cannot do it, and where there is no place.
    pub fn generate(&self, request: &v1::GenerateRequest) -> Result<Generation, ServiceError> {
        let arrived = Instant::now();
        let loaded = self.table()?.find("pack", &request.pack)?;
        let timeout = self.common.timeout;
        let (mut path, mut judge) = (None, None);
        let (task, rig, frame, notes) = match &request.goal {
            Some(Goal::Path(goal)) => {
                loaded.require(Capability::Path, "pack")?;
                no_temperature(request)?;
                let mut plan = PathPlan::new(goal, &request.past, request.seed, &loaded.pack)?;
                if goal.strict {
                    plan.refuse()?;
                }
                judge = plan.judge();
                let (task, frame) = plan.next().ok_or(ServiceError::Starting)?;
                let rig = plan.body.rig.clone();
                let notes = std::mem::take(&mut plan.notes);
                path = Some(PathWay {
                    plan,
                    frame,
                    batcher: loaded.batcher.clone(),
                    timeout,
                    strict: goal.strict,
                });
                (task.into(), rig, frame, notes)
            }
            _ => {
                let rig = loaded.pack.rig.clone();
                let (task, frame) = prepare_generate(request, &rig, most_past(&loaded.pack))?;
                loaded.require(task.needs(), "pack")?;
                let notes = check_words(&loaded.pack, &task)?;
                (task, rig, frame, notes)
            }
        };
        Ok(Generation {
            asked: Some(Instant::now()),
            trace: RequestContext::current_trace(),
            parts: loaded.batcher.stream(task, order(arrived, timeout))?,
            writer: PartWriter::new(rig, frame).judged_by(judge),
            path,
            notes,
        })
    }
}
