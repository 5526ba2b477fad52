//! Client-clocked frames. A call advances many characters and waits for the plans that they need.
//!
//! Every character runs until it is done or needs a plan. Then the call waits for all missing plans
//! together, and repeats. The plans of one round share batches.
//!
//! Characters in the same scene advance frame by frame, in the order of their ids. So the result
//! does not depend on whose plan came first, for example when two want the same object.

use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use troupe_proto::v1;

use super::cell::Held;
use super::encode::{BlockWriter, Form};
use super::executor::Turn;
use super::owner::Owner;
use super::planner;
use super::results::{CommandResult, SessionProblem};
use super::wants::Patience;
use super::{LivePack, SessionError};
use super::{Registry, SessionLimits, TimeSource, events};
use crate::wire::units;
use troupe_batch::SubmitError;
use troupe_character::live::{Advance, Clock, FrameOut, SUB_FRAMES, Strain};
use troupe_character::{FieldError, Path};
use troupe_engine::EngineError;
use troupe_motion::model::SIX_D;

/// Maximum number of frames in a step.
pub const MAX_STEP_FRAMES: u32 = 120;
/// Maximum number of frames of all characters in a step, because the answer is built in memory.
pub const MAX_STEP_CHARACTER_FRAMES: usize = 131_072;
/// Frame rates with a whole number of sub-frames per frame.
const RATES_HZ: [u32; 3] = [30, 50, 60];
/// After this many failed plans in a row, a session is reported as a problem.
const MAX_FAILURES: u32 = 3;
/// Estimated numbers of a frame apart from those of joints: root, contacts, hinges.
const NUMBERS_OF_A_FRAME: usize = 40;
/// A character without others in its scene advances this many frames before other tasks get a turn.
const FRAMES_ALONE: usize = 8;

/// Number of sub-frames in one frame at `rate_hz`. A rate of 0 means 30.
///
/// # Errors
/// [`FieldError`] for any other rate than 0, 30, 50 and 60.
pub(super) fn sub_frames(path: &Path<'_>, rate_hz: u32) -> Result<u32, FieldError> {
    let rate = if rate_hz == 0 { 30 } else { rate_hz };
    match RATES_HZ.contains(&rate) {
        // `SUB_FRAMES` is the number of sub-frames in a frame at 30 Hz.
        true => Ok(SUB_FRAMES * 30 / rate),
        false => Err(path
            .field("rate_hz")
            .error(format!("is {rate_hz}"), "30, 50 or 60")),
    }
}

/// A checked step request.
#[derive(Debug)]
pub struct StepPlan {
    frames: usize,
    answer_bytes: usize,
    sub_frames: u32,
    form: Form,
}

/// Checks a step request, apart from its commands and whether its sessions are open. `joints_of`
/// returns the number of joints of an open session.
pub(super) fn check(
    request: &v1::StepRequest,
    limits: &SessionLimits,
    joints_of: impl Fn(&str) -> Option<usize>,
) -> Result<StepPlan, FieldError> {
    let root = Path::root();
    let ids = &request.session_ids;
    units::length(&root.field("session_ids"), ids.len(), 1, limits.per_request)?;
    let mut seen = HashSet::with_capacity(ids.len());
    for (index, id) in ids.iter().enumerate() {
        if !seen.insert(id.as_str()) {
            return Err(root
                .element("session_ids", index)
                .error("is listed twice", "each session once"));
        }
    }
    let frames = request.frames.max(1);
    units::count_within(&root.field("frames"), frames, 1, MAX_STEP_FRAMES)?;
    if ids.len() * frames as usize > MAX_STEP_CHARACTER_FRAMES {
        let most = (MAX_STEP_CHARACTER_FRAMES / ids.len()).max(1);
        return Err(root.field("frames").error(
            format!("is {frames} for {} sessions", ids.len()),
            format!("1 to {most} for this many sessions: {MAX_STEP_CHARACTER_FRAMES} frames in all"),
        ));
    }
    let commands = &root.field("commands");
    units::length(commands, request.commands.len(), 0, super::commands::MAX_COMMANDS)?;
    let form = Form::of(
        &root,
        request.encoding,
        request.return_positions,
        request.return_six_d,
    )?;
    let frame_bytes: usize = (ids.iter().filter_map(|id| joints_of(id)))
        .map(|joints| frame_bytes(form, joints))
        .sum();
    Ok(StepPlan {
        frames: frames as usize,
        answer_bytes: frame_bytes * frames as usize,
        sub_frames: sub_frames(&root, request.rate_hz)?,
        form,
    })
}

impl StepPlan {
    /// Estimated size of all frames in memory, bytes.
    pub fn answer_bytes(&self) -> usize {
        self.answer_bytes
    }
}

/// Estimated size of one frame of a character in memory, bytes.
fn frame_bytes(form: Form, joints: usize) -> usize {
    let numbers_of_a_joint = 4 + 3 * usize::from(form.positions) + SIX_D * usize::from(form.six_d);
    (joints * numbers_of_a_joint + NUMBERS_OF_A_FRAME) * size_of::<f32>()
}

/// The progress of one character in a step.
struct CharacterStep {
    /// Index in the request.
    slot: usize,
    held: Held,
    /// Index of its block.
    block: usize,
    /// Index within the block.
    place: usize,
    /// Whether a frame was begun but not written, because a plan is missing.
    begun: bool,
    /// Frames written so far.
    done: usize,
    trouble: Option<SessionError>,
}

/// The result of a step.
#[derive(Debug, Default)]
pub struct Stepped {
    /// Frames, one block for each pack, body and skeleton.
    pub blocks: Vec<v1::FrameBlock>,
    /// Results of the commands, in their order.
    pub commands: Vec<CommandResult>,
    /// Sessions that could not be served, sorted by their index in the request.
    pub problems: Vec<SessionProblem>,
    /// Events of the characters.
    pub events: Vec<v1::SessionEvents>,
    /// Objects in the characters' hands.
    pub held: Vec<v1::HeldObject>,
    /// Time spent waiting for plans.
    pub waited: Duration,
    /// Duration of the whole step.
    pub total: Duration,
}

/// Advances the sessions. Sessions that cannot be served become problems.
pub(super) async fn step(registry: &Registry, time: &TimeSource, ids: &[String], plan: StepPlan) -> Stepped {
    let mut turn = Turn::begin();
    let mut stepped = Stepped::default();
    let (mut walkers, blocks) = gather((registry, time), ids, plan.form, &mut stepped.problems);
    let mut writers: Vec<BlockWriter> = blocks
        .iter()
        .map(|(pack, count)| BlockWriter::of(pack, plan.form, *count, plan.frames))
        .collect();
    for walker in &walkers {
        writers[walker.block].name(walker.slot as u32);
    }

    let mut out = FrameOut::default();
    let mut going = groups(&walkers);
    while !going.is_empty() {
        let mut waiting = Vec::new();
        for group in going {
            let mut waits_for = None;
            // A single character advances some frames at a time, a group frame by frame.
            let frames_at_once = if group.len() == 1 { FRAMES_ALONE } else { 1 };
            while waits_for.is_none()
                && let Some(until) = next_stop(&walkers, &group, plan.frames, frames_at_once)
            {
                for &index in &group {
                    let walker = &mut walkers[index];
                    if walker.run(&plan, until, &mut writers[walker.block], &mut out) {
                        waits_for = Some(index);
                        break;
                    }
                    turn.pause().await;
                }
            }
            waiting.extend(waits_for.map(|index| (index, group)));
        }
        let since = Instant::now();
        for (index, _) in &waiting {
            walkers[*index].held.cell().changed().await;
        }
        stepped.waited += since.elapsed();
        going = waiting.into_iter().map(|(_, group)| group).collect();
    }
    finish(walkers, writers, &blocks, plan.frames, &mut stepped);
    stepped
}

/// Becomes the owner of the sessions, and gives each a place in the block of its pack.
fn gather(
    (registry, time): (&Registry, &TimeSource),
    ids: &[String],
    form: Form,
    problems: &mut Vec<SessionProblem>,
) -> (Vec<CharacterStep>, Vec<(Arc<LivePack>, usize)>) {
    let now = time.now();
    let mut blocks: Vec<(Arc<LivePack>, usize)> = Vec::new();
    let mut walkers = Vec::with_capacity(ids.len());
    for (slot, id) in ids.iter().enumerate() {
        let field = || format!("session_ids[{slot}]");
        let taken = registry.get(id, now, &field).and_then(|cell| {
            form.check(&Path::root(), cell.pack())?;
            cell.take(Owner::Step, &field)
        });
        let held = match taken {
            Ok(held) => held,
            Err(error) => {
                problems.push(SessionProblem::new(slot, id, error));
                continue;
            }
        };
        {
            let mut live = held.cell().live();
            // Plans may work again after failures for an earlier caller. A step waits for its
            // plans, so the load on the networks does not matter.
            live.trouble = None;
            live.under_load(Strain::default());
        }
        let pack = held.cell().pack();
        let known = blocks.iter().position(|(known, _)| Arc::ptr_eq(known, pack));
        let block = known.unwrap_or_else(|| {
            blocks.push((pack.clone(), 0));
            blocks.len() - 1
        });
        walkers.push(CharacterStep {
            slot,
            held,
            block,
            place: blocks[block].1,
            begun: false,
            done: 0,
            trouble: None,
        });
        blocks[block].1 += 1;
    }
    (walkers, blocks)
}

/// Groups characters that advance together. The characters of a scene form a group, sorted by id.
/// Every other character is a group of its own.
fn groups(walkers: &[CharacterStep]) -> Vec<Vec<usize>> {
    let mut groups = Vec::with_capacity(walkers.len());
    let mut scenes: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (index, walker) in walkers.iter().enumerate() {
        match walker.held.cell().scene() {
            Some(scene) => scenes.entry(scene).or_default().push(index),
            None => groups.push(vec![index]),
        }
    }
    for mut group in scenes.into_values() {
        group.sort_by_key(|&index| walkers[index].held.cell().id());
        groups.push(group);
    }
    groups
}

/// The frame of the step to which a group advances next: `frames_at_once` beyond its slowest
/// character. `None` if all are done.
fn next_stop(
    walkers: &[CharacterStep],
    group: &[usize],
    frames: usize,
    frames_at_once: usize,
) -> Option<usize> {
    let going = group.iter().map(|&index| &walkers[index]);
    let going = going.filter(|walker| walker.trouble.is_none() && walker.done < frames);
    let last = going.map(|walker| walker.done).min()?;
    Some((last + frames_at_once).min(frames))
}

impl CharacterStep {
    /// Runs until the character has done `until` frames of the step, cannot be served, or needs a
    /// plan. Answers whether it needs a plan.
    fn run(&mut self, plan: &StepPlan, until: usize, writer: &mut BlockWriter, out: &mut FrameOut) -> bool {
        if self.trouble.is_some() || self.done >= until {
            return false;
        }
        let cell = self.held.cell().clone();
        let slot = self.slot;
        if let Some(error) = cell.gone(&|| format!("session_ids[{slot}]")) {
            self.trouble = Some(error);
            return false;
        }
        let mut live = cell.live();
        // Finishes a begun frame, if any: of this step before its plan came, or of an earlier step
        // that was stopped.
        let mut moved = live.advance(0, Clock::Waits);
        loop {
            let wants = cell.settle(&mut live);
            if !wants.is_empty() {
                // The answer takes the lock. It comes from another task, or from this call if the
                // runtime ends.
                drop(live);
                planner::serve(&cell, wants, Patience::Waits);
                live = cell.live();
            }
            if moved == Advance::NeedsPlan {
                self.trouble = trouble(live.trouble.as_ref());
                return self.trouble.is_none();
            }
            if std::mem::take(&mut self.begun) {
                live.sample(out);
                writer.write(
                    (self.place, self.done),
                    out,
                    cell.convention(),
                    cell.pack().shown(),
                );
                self.done += 1;
            }
            if self.done >= until {
                return false;
            }
            self.begun = true;
            moved = live.advance(plan.sub_frames, Clock::Waits);
        }
    }
}

/// The error of a session whose plans keep failing. `None` if it should wait for another plan.
fn trouble(failures: Option<&(u32, SubmitError)>) -> Option<SessionError> {
    let (count, error) = failures?;
    let stopped = matches!(error, SubmitError::Engine(EngineError::Stopped));
    (stopped || *count >= MAX_FAILURES).then(|| error.clone().into())
}

fn finish(
    walkers: Vec<CharacterStep>,
    writers: Vec<BlockWriter>,
    blocks: &[(Arc<LivePack>, usize)],
    frames: usize,
    stepped: &mut Stepped,
) {
    let mut good: Vec<Vec<bool>> = blocks.iter().map(|(_, count)| vec![true; *count]).collect();
    for walker in walkers {
        match walker.trouble {
            Some(error) => {
                good[walker.block][walker.place] = false;
                let problem = SessionProblem::new(walker.slot, walker.held.cell().id(), error);
                stepped.problems.push(problem);
            }
            None => report(&walker, stepped),
        }
    }
    stepped.problems.sort_by_key(|problem| problem.slot);
    for ((writer, good), (pack, _)) in writers.into_iter().zip(good).zip(blocks) {
        let block = writer.finish(|place| good[place]);
        if !block.slots.is_empty() {
            pack.metrics.sent(block.slots.len() * frames);
            stepped.blocks.push(block);
        }
    }
}

/// Adds the events of a session and the object in its character's hand to the result.
fn report(walker: &CharacterStep, stepped: &mut Stepped) {
    let cell = walker.held.cell();
    let (slot, measure) = (walker.slot as u32, cell.measure());
    let mut live = cell.live();
    stepped.events.extend(live.events.take(slot, cell.id(), measure));
    if cell.scene().is_some() {
        stepped.held.extend(events::held(&live.character, slot, measure));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frames_of_a_step_are_bounded_in_all() {
        let limits = SessionLimits {
            sessions: 10_000,
            per_request: 10_000,
            per_stream: 1,
            streams: 1,
            ttl_ms: 1000,
            stall_timeout: Duration::ZERO,
        };
        let of = |sessions: usize, frames| {
            let request = v1::StepRequest {
                session_ids: (0..sessions).map(|i| i.to_string()).collect(),
                frames,
                ..v1::StepRequest::default()
            };
            check(&request, &limits, |_| None).map(|plan| plan.frames)
        };
        assert_eq!(of(1092, 120).ok(), Some(120));
        let error = of(2000, 120).expect_err("240,000 frames").to_string();
        assert!(
            error.contains("frames: is 120 for 2000 sessions") && error.contains("1 to 65"),
            "{error}"
        );
    }
}
