//! `troupe.v1.Motion/Generate`: a motion part by part, as the generator makes it.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use troupe_character::post::check_finite;
use troupe_character::take::PathPlan;
use troupe_character::{FieldError, Path};
use troupe_motion::SegmentFrame;
use troupe_motion::feasibility::Judge;
use troupe_motion::model::{Capability, Output, Rig, Task};
use troupe_proto::v1;
use troupe_proto::v1::generate_request::Goal;

use super::streamed::{Pieces, Streamed};
use super::{Service, ServiceError};
use crate::inbetween::{
    PartWriter, Prepared, no_sampling, path_judge, prepare_path, prepare_prompt, refuse_frames, refuse_path,
};
use troupe_batch::{Batcher, Piece};
use troupe_live::packs::LoadedPack;

/// A motion on its way.
#[derive(Debug)]
#[must_use = "dropping it gives up the request"]
pub struct Generation {
    pieces: Pieces,
    writer: PartWriter,
    /// Of a motion along a path, what is still to be made.
    path: Option<PathWay>,
    /// What the model was asked for that it may not do well, until there is a part.
    notes: Vec<String>,
    /// Parts of the piece that came last.
    ready: VecDeque<v1::GenerateResponse>,
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

/// What a request asks for.
struct Wanted {
    task: Task,
    rig: Arc<Rig>,
    frame: SegmentFrame,
    notes: Vec<String>,
    /// Of a motion along a path, who judges its frames where the body has limits.
    judge: Option<Judge>,
    path: Option<PathWay>,
}

impl Streamed for Generation {
    type Part = v1::GenerateResponse;

    async fn next(&mut self) -> Option<Result<v1::GenerateResponse, ServiceError>> {
        while self.ready.is_empty() {
            let written = match self.pieces.next().await? {
                Ok(piece) => self.written(piece),
                Err(error) => Err(error),
            };
            match written {
                Ok(parts) => self.ready.extend(parts),
                Err(error) => return Some(Err(error)),
            }
        }
        let part = self.ready.pop_front()?;
        Some(Ok(v1::GenerateResponse {
            notes: std::mem::take(&mut self.notes),
            ..part
        }))
    }
}

impl Generation {
    /// The messages of a piece; of a path's window, which puts the next window on its way.
    fn written(&mut self, piece: Piece) -> Result<Vec<v1::GenerateResponse>, ServiceError> {
        let (Some(way), Output::Motion(motion)) = (&mut self.path, &piece.output) else {
            return Ok(self.writer.write(piece.output, piece.is_last)?);
        };
        // What is not finite must not become the past of the next.
        check_finite(motion)?;
        self.writer.move_to(way.frame);
        let (fresh, is_last) = way.plan.receive(motion, &way.frame);
        let parts = self.writer.write(Output::Motion(fresh), is_last)?;
        if way.strict {
            parts
                .iter()
                .filter_map(|part| part.feasibility.as_ref())
                .try_for_each(refuse_frames)?;
        }
        if let Some((task, frame)) = way.plan.next_task() {
            way.frame = frame;
            self.pieces.ask_on(&way.batcher, task.into(), way.timeout)?;
        }
        Ok(parts)
    }
}

impl Service {
    /// `troupe.v1.Motion/Generate`. Has a place in the queue when it returns.
    ///
    /// # Errors
    /// [`ServiceError`] for a value that is not accepted, a pack that cannot do it, and where there
    /// is no place.
    pub fn generate(&self, request: &v1::GenerateRequest) -> Result<Generation, ServiceError> {
        let arrived = Instant::now();
        let loaded = self.table()?.find("pack", &request.pack)?;
        let wanted = match &request.goal {
            None => Err(no_goal().into()),
            Some(Goal::Prompt(prompt)) => words(request, prompt, loaded),
            Some(Goal::Path(goal)) => self.path(request, goal, loaded),
        }?;
        Ok(Generation {
            pieces: Pieces::ask(&loaded.batcher, wanted.task, arrived, self.common.timeout)?,
            writer: PartWriter::new(wanted.rig, wanted.frame).judged_by(wanted.judge),
            path: wanted.path,
            notes: wanted.notes,
            ready: VecDeque::new(),
        })
    }

    fn path(
        &self,
        request: &v1::GenerateRequest,
        goal: &v1::PathGoal,
        loaded: &LoadedPack,
    ) -> Result<Wanted, ServiceError> {
        loaded.require(Capability::Path, "pack")?;
        no_sampling(request)?;
        let mut plan = prepare_path(goal, &request.past, request.seed, &loaded.pack)?;
        if goal.strict {
            refuse_path(&plan)?;
        }
        let judge = path_judge(&plan);
        let (task, frame) = plan.next_task().ok_or(ServiceError::Starting)?;
        Ok(Wanted {
            task: task.into(),
            rig: plan.body.rig.clone(),
            frame,
            notes: std::mem::take(&mut plan.notes),
            judge,
            path: Some(PathWay {
                plan,
                frame,
                batcher: loaded.batcher.clone(),
                timeout: self.common.timeout,
                strict: goal.strict,
            }),
        })
    }
}

fn words(
    request: &v1::GenerateRequest,
    prompt: &v1::Prompt,
    loaded: &LoadedPack,
) -> Result<Wanted, ServiceError> {
    loaded.require(Capability::Text, "pack")?;
    if !prompt.others.is_empty() {
        loaded.require(Capability::Agents, "pack")?;
    }
    let Prepared { task, frame, notes } = prepare_prompt(request, prompt, &loaded.pack)?;
    Ok(Wanted {
        task,
        rig: loaded.pack.rig.clone(),
        frame,
        notes,
        judge: None,
        path: None,
    })
}

fn no_goal() -> FieldError {
    Path::root().field("goal").error("is missing", "prompt or path")
}
