//! `troupe.v1.Motion/Generate`: makes a motion part by part.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use troupe_character::live::{PartReader, WordsPart};
use troupe_character::post::{NonFinite, check_finite};
use troupe_character::take::{Ending, Making, PathPlan, Steady};
use troupe_character::{FieldError, Path, Size};
use troupe_motion::feasibility::Judge;
use troupe_motion::model::{Capability, Output, Rig, Task};
use troupe_motion::{GlobalRoot, SegmentFrame, Vec3};
use troupe_proto::v1;
use troupe_proto::v1::generate_request::Goal;

use crate::carried::Planning;
use crate::inbetween::{
    PartWriter, Prepared, count_generate, no_sampling, path_judge, prepare_path, prepare_prompt,
    prepare_walk, refuse_frames, refuse_path, refuse_walk, walk_judge,
};
use crate::own::{OwnAnswer, take_generate};
use crate::streamed::{Pieces, Streamed};
use crate::{Service, ServiceError};
use troupe_base::offload::offload;
use troupe_batch::{Batcher, Piece};
use troupe_live::packs::LoadedPack;
use troupe_live::session::SessionError;
use troupe_live::skeleton::Worn;

/// A motion in progress.
#[derive(Debug)]
#[must_use = "dropping it gives up the request"]
pub struct Generation {
    pieces: Pieces,
    writer: PartWriter,
    words: Words,
    /// Windows still to make. Only for a motion along a path.
    path: Option<PathWay>,
    /// Notes about what the model may not do well. They go into the first part.
    notes: Vec<String>,
    /// Brings the parts to a skeleton of the user's own.
    own: Option<OwnAnswer>,
    /// Parts of the last piece that are not sent yet.
    ready: VecDeque<v1::GenerateResponse>,
}

/// What becomes of the frames of motion for words.
#[derive(Debug)]
enum Words {
    /// They stay as the network made them.
    Raw,
    /// Their feet are held, part by part. There is a reader for each character.
    Held(Vec<PartReader>),
    /// They end at a place or in given frames, and come in one part.
    Ending(Box<Ending>),
}

/// A motion along a path. It is made window by window, and each window continues the one before.
#[derive(Debug)]
struct PathWay {
    windows: Windows,
    batcher: Batcher,
    timeout: Duration,
    /// Whether frames that are not feasible end the answer with an error.
    strict: bool,
}

/// How the windows of a path are made.
#[derive(Debug)]
enum Windows {
    /// By a network with path input. The current window's segment lies at `frame`. `steady`
    /// finishes its frames, unless the network's own are asked for.
    Follow {
        plan: Box<PathPlan>,
        frame: SegmentFrame,
        steady: Option<Steady>,
    },
    /// By walking from keyframe to keyframe.
    Walk(Making),
}

/// A request as the task of a pack.
pub(crate) struct Planned {
    /// The queue of the pack.
    batcher: Batcher,
    /// The request as the pack takes it.
    request: v1::GenerateRequest,
    wanted: Wanted,
    own: Option<OwnAnswer>,
}

impl Planned {
    /// Whether the motion cannot keep up with the path.
    pub(crate) fn falls_behind(&self) -> bool {
        self.wanted.falls_behind
    }

    /// Adds a note in front of the others.
    pub(crate) fn add_note(&mut self, note: String) {
        self.wanted.notes.insert(0, note);
    }
}

/// What a request asks for.
struct Wanted {
    task: Task,
    rig: Arc<Rig>,
    frame: SegmentFrame,
    /// Where motion for words ends, if the request says so.
    ending: Option<Ending>,
    notes: Vec<String>,
    /// Judges the frames of a motion along a path, if the body has limits.
    judge: Option<Judge>,
    path: Option<PathWay>,
    /// Whether the motion cannot keep up with the path.
    falls_behind: bool,
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
        let mut part = self.ready.pop_front()?;
        if let Some(own) = &mut self.own {
            own.part(&mut part);
        }
        Some(Ok(v1::GenerateResponse {
            notes: std::mem::take(&mut self.notes),
            ..part
        }))
    }
}

impl Generation {
    /// The messages of a piece. For a path this also queues the next window.
    fn written(&mut self, piece: Piece) -> Result<Vec<v1::GenerateResponse>, ServiceError> {
        let Some(way) = &mut self.path else {
            return match &mut self.words {
                Words::Held(readers) => steady_words(readers, &mut self.writer, piece),
                Words::Ending(ending) => {
                    let (parts, notes) = ended(ending, &mut self.writer, &piece)?;
                    self.notes.extend(notes);
                    Ok(parts)
                }
                Words::Raw => Ok(self.writer.write(piece.output, piece.is_last)?),
            };
        };
        let (parts, next) = match &mut way.windows {
            Windows::Follow { plan, frame, steady } => {
                follow((plan, frame, steady.as_mut()), &mut self.writer, &piece.output)?
            }
            Windows::Walk(making) => walk(making, &mut self.writer, &piece.output)?,
        };
        if way.strict {
            parts
                .iter()
                .filter_map(|part| part.feasibility.as_ref())
                .try_for_each(refuse_frames)?;
        }
        if let Some(task) = next {
            self.pieces.ask_on(&way.batcher, task, way.timeout)?;
        }
        Ok(parts)
    }
}

/// Messages of a window, and the task of the next window.
type Written = (Vec<v1::GenerateResponse>, Option<Task>);

fn follow(
    (plan, frame, steady): (&mut PathPlan, &mut SegmentFrame, Option<&mut Steady>),
    writer: &mut PartWriter,
    made: &Output,
) -> Result<Written, ServiceError> {
    let Output::Motion(motion) = made else {
        return Err(NonFinite.into());
    };
    // Numbers that are not finite must not become the past of the next window.
    check_finite(motion)?;
    let parts = match steady {
        Some(steady) => {
            let (part, is_last) = steady.receive(plan, motion, frame);
            writer.write_track(part, is_last)
        }
        None => {
            writer.move_to(*frame);
            let (fresh, is_last) = plan.receive(motion, frame);
            writer.write(Output::Motion(fresh), is_last)?
        }
    };
    let next = plan.next_task().map(|(task, at)| {
        *frame = at;
        task.into()
    });
    Ok((parts, next))
}

/// The messages of motion for words, whose standing feet are held.
fn steady_words(
    readers: &mut Vec<PartReader>,
    writer: &mut PartWriter,
    piece: Piece,
) -> Result<Vec<v1::GenerateResponse>, ServiceError> {
    let motions = match piece.output {
        Output::Motion(motion) => vec![motion],
        Output::Motions(motions) => motions,
        Output::Text(_) | Output::Audio(_) => Vec::new(),
    };
    while readers.len() < motions.len() {
        readers.push(PartReader::new(writer.rig(), writer.rig()).map_err(|_| NonFinite)?);
    }
    let parts = readers.iter_mut().zip(&motions);
    let parts = parts.map(|(reader, motion)| reader.read(motion));
    let parts: Vec<WordsPart> = parts.collect::<Result<_, _>>()?;
    Ok(writer.write_words(parts, piece.is_last))
}

/// The messages of motion that ends somewhere: none before its last piece. Also notes about it.
fn ended(
    ending: &mut Ending,
    writer: &mut PartWriter,
    piece: &Piece,
) -> Result<(Vec<v1::GenerateResponse>, Vec<String>), ServiceError> {
    let rig = writer.rig().clone();
    if let Output::Motion(motion) = &piece.output {
        ending.receive(motion, &rig)?;
    }
    if !piece.is_last {
        return Ok((Vec::new(), Vec::new()));
    }
    let (track, notes) = ending.finish(&rig);
    Ok((writer.write_track(track, true), notes))
}

fn walk(making: &mut Making, writer: &mut PartWriter, made: &Output) -> Result<Written, ServiceError> {
    making.receive(made)?;
    let part = making.part();
    let next = making.next_task()?;
    Ok((writer.write_track(part, next.is_none()), next))
}

impl Service {
    /// `troupe.v1.Motion/Generate`. The request has a place in the queue when this returns.
    ///
    /// # Errors
    /// [`ServiceError`] if a value is not accepted, if the pack cannot do what is asked, or if the
    /// queue is full.
    pub async fn generate(&self, request: v1::GenerateRequest) -> Result<Generation, ServiceError> {
        let arrived = Instant::now();
        let loaded = &*self.pack(&request.pack)?;
        require(&request, loaded)?;
        let planned = match self.carried(&request, loaded).await? {
            Planning::Carried(planned) => *planned,
            Planning::Own(note) => self.by_itself(request, loaded, note).await?,
        };
        let Planned {
            batcher,
            request,
            mut wanted,
            own,
        } = planned;
        let frames = match &wanted.task {
            Task::Prompt(task) => task.frames,
            Task::Describe(_) | Task::Keyframes(_) | Task::Path(_) => None,
        };
        let pieces = Pieces::ask(&batcher, wanted.task, arrived, self.common.timeout)?;
        let words = match wanted.ending {
            _ if request.raw => Words::Raw,
            None => Words::Held(Vec::new()),
            Some(mut ending) => {
                if let Some(frames) = frames.filter(|_| ending.is_gap()) {
                    let known = self.know_way(&request, (loaded, frames), &mut ending);
                    wanted.notes.extend(known.await?);
                }
                Words::Ending(Box::new(ending))
            }
        };
        Ok(Generation {
            pieces,
            writer: PartWriter::new(wanted.rig, wanted.frame).judged_by(wanted.judge),
            words,
            path: wanted.path,
            notes: wanted.notes,
            own,
            ready: VecDeque::new(),
        })
    }

    /// Makes a request the task of the pack that it names.
    async fn by_itself(
        &self,
        request: v1::GenerateRequest,
        loaded: &LoadedPack,
        note: Option<String>,
    ) -> Result<Planned, ServiceError> {
        let place = match &request.goal {
            Some(Goal::Path(goal)) if !request.skeleton.is_empty() => {
                (loaded.place_of("path.body", &goal.body)).map_err(SessionError::from)?
            }
            _ => 0,
        };
        let worn = self.worn(&request.skeleton, (loaded, place)).await?;
        let on = worn.map(|worn| (worn, None));
        let mut planned = self.planned(request, (loaded, place), on).await?;
        planned.wanted.notes.extend(note);
        Ok(planned)
    }

    /// Makes a request the task of a pack, for the body with index `place`. With a skeleton the
    /// request is `on` that one: a user's own, or the body of another pack with this rig.
    ///
    /// # Errors
    /// [`ServiceError`] if a value is not accepted.
    pub(crate) async fn planned(
        &self,
        mut request: v1::GenerateRequest,
        (loaded, place): (&LoadedPack, usize),
        on: Option<(Arc<Worn>, Option<Arc<Rig>>)>,
    ) -> Result<Planned, ServiceError> {
        let mut own = None;
        if let Some((worn, body)) = on {
            let (dims, fps) = (loaded.rig(place).dims, loaded.rig(place).fps);
            count_generate(&request, &loaded.pack, &dims)?;
            let taken = offload(usize::MAX, 0, move || {
                let own = take_generate(&mut request, &worn, (fps, body.as_deref()))?;
                Ok::<_, FieldError>((request, own))
            });
            let (taken, answer) = taken.await??;
            (request, own) = (taken, Some(answer));
        }
        let root = Path::root().sized(own.as_ref().map_or_else(Size::default, OwnAnswer::size));
        let wanted = match &request.goal {
            None => return Err(no_goal().into()),
            Some(Goal::Prompt(prompt)) => words(&root, &request, prompt, loaded)?,
            Some(Goal::Path(goal)) => self.path(&root, &request, goal, loaded)?,
        };
        Ok(Planned {
            batcher: loaded.batcher.clone(),
            request,
            wanted,
            own,
        })
    }

    fn path(
        &self,
        root: &Path<'_>,
        request: &v1::GenerateRequest,
        goal: &v1::PathGoal,
        loaded: &LoadedPack,
    ) -> Result<Wanted, ServiceError> {
        let takes_paths = loaded.pack.manifest.capabilities.has(Capability::Path);
        let mut falls_behind = false;
        let (task, rig, notes, judge, windows) = match !takes_paths && loaded.walks(0) {
            true => {
                let walking = prepare_walk(root, request, goal, &loaded.pack, &loaded.styles[0])?;
                let rig = loaded.pack.rig.clone();
                if goal.strict {
                    refuse_walk(root, &walking, &rig)?;
                }
                let mut making = Making::new(&walking.path.take, 0);
                let task = making.next_task()?.ok_or(NonFinite)?;
                let judge = walk_judge(&walking, &rig);
                falls_behind = walking.path.too_fast.is_some();
                (task, rig, walking.notes(root), judge, Windows::Walk(making))
            }
            false => {
                no_sampling(request)?;
                let mut plan = Box::new(prepare_path(
                    root,
                    goal,
                    &request.past,
                    request.seed,
                    &loaded.pack,
                )?);
                if goal.strict {
                    refuse_path(root, &plan)?;
                }
                let (task, frame) = plan.next_task().ok_or(NonFinite)?;
                let (rig, notes) = (plan.body.rig.clone(), std::mem::take(&mut plan.notes));
                let judge = path_judge(&plan);
                let steady = (!request.raw).then(Steady::default);
                (
                    task.into(),
                    rig,
                    notes,
                    judge,
                    Windows::Follow { plan, frame, steady },
                )
            }
        };
        Ok(Wanted {
            task,
            rig,
            frame: SegmentFrame::from_root(GlobalRoot::new(Vec3::ZERO, 0.0)),
            ending: None,
            notes,
            judge,
            path: Some(PathWay {
                windows,
                batcher: loaded.batcher.clone(),
                timeout: self.common.timeout,
                strict: goal.strict,
            }),
            falls_behind,
        })
    }
}

/// Checks that a pack can do what is asked.
fn require(request: &v1::GenerateRequest, loaded: &LoadedPack) -> Result<(), ServiceError> {
    match &request.goal {
        None => return Err(no_goal().into()),
        Some(Goal::Prompt(prompt)) => {
            loaded.require(Capability::Text, "pack")?;
            if !prompt.others.is_empty() {
                loaded.require(Capability::Agents, "pack")?;
            }
        }
        Some(Goal::Path(_)) => {
            let takes_paths = loaded.require(Capability::Path, "pack");
            if takes_paths.is_err() && !loaded.walks(0) {
                takes_paths?;
            }
        }
    }
    Ok(())
}

fn words(
    root: &Path<'_>,
    request: &v1::GenerateRequest,
    prompt: &v1::Prompt,
    loaded: &LoadedPack,
) -> Result<Wanted, ServiceError> {
    let Prepared {
        task,
        frame,
        ending,
        notes,
    } = prepare_prompt(root, request, prompt, &loaded.pack)?;
    Ok(Wanted {
        task,
        rig: loaded.pack.rig.clone(),
        frame,
        ending,
        notes,
        judge: None,
        path: None,
        falls_behind: false,
    })
}

fn no_goal() -> FieldError {
    Path::root().field("goal").error("is missing", "prompt or path")
}
