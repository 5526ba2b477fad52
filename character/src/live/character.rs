//! A character's state machine: commands, ticks and plans in; requests for plans and frames out. It
//! knows no clock, no thread and no engine, so the same events give the same frames.
//!
//! In a scene, [`Behaviour`] has the first word about every frame. The buffer's heights count from
//! a flat ground: [`PostProcess`] lifts frames onto what the character stands on, and bends an arm
//! that carries something.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use troupe_motion::ik::Posed;
use troupe_motion::model::Rig;
use troupe_motion::robot::Fitted;

use super::behaviour::{self, Behaviour, CharacterParts, Next, PostProcess, SetPlan};
use super::buffer::{Frames, MotionBuffer};
use super::event::EventLog;
use super::inbox::Inbox;
use super::limbs::finish_limbs;
use super::performance::Performance;
use super::planning::{Planned, Planning};
use super::request::Context;
use super::timeline::{Barrier, Stop, Timeline};
use super::{
    Activity, Advance, Arrival, CONTEXT_FRAMES, CharacterEvent, CharacterOptions, Clock, CommandError,
    CommandOutcome, EventKind, HeldObject, Intent, LivePlan, PerformanceEnd, PlanFailed, PlanRequest, Start,
    Stats, Strain, WaitingCommand, World,
};
use crate::primitives::path::MAX_LEAD_M;
use crate::primitives::{Locomotion, LocomotionCommand};
use crate::skill::Skills;
use crate::style::Style;

/// Frame of the first context frame of a new character.
const FIRST_FRAME: i64 = 1 - CONTEXT_FRAMES as i64;

/// One character.
#[derive(Debug, Serialize, Deserialize)]
pub struct Character {
    #[serde(with = "crate::saved::rig")]
    pub(super) rig: Arc<Rig>,
    pub(super) options: CharacterOptions,
    /// The skills of the character's pack.
    #[serde(with = "crate::saved::skills")]
    skills: Arc<Skills>,
    pub(super) inbox: Inbox,
    /// None in a session without a scene, before its first skill.
    pub(super) behaviour: Option<Behaviour>,
    /// None while the character stands on the ground at height 0.
    pub(super) post: Option<PostProcess>,
    /// None unless a command to perform holds.
    pub(super) performance: Option<Performance>,
    pub(super) locomotion: Locomotion,
    pub(super) planning: Planning,
    pub(super) timeline: Timeline,
    /// Events of paths, performances and commands; those of a scene are its behaviour's.
    pub(super) events: EventLog,
}

impl Character {
    /// A character at frame 0 that does what `command` says, in no scene. The rotations of a
    /// [`Start::Context`] and of the style must fit the pack.
    pub fn new(rig: Arc<Rig>, options: CharacterOptions, start: Start, command: LocomotionCommand) -> Self {
        Self::in_world(rig, options, start, command, None)
    }

    /// As [`Character::new`], in a scene.
    pub fn in_world(
        rig: Arc<Rig>,
        options: CharacterOptions,
        start: Start,
        command: LocomotionCommand,
        world: Option<World>,
    ) -> Self {
        let moving = matches!(start, Start::Context { .. });
        let (context, level) = first_frames(start, &command.style, world.as_ref());
        let buffer = MotionBuffer::new(
            rig.skeleton.joint_count(),
            FIRST_FRAME,
            Frames {
                roots: &context.roots,
                rotations: &context.rotations,
                contacts: &[0; CONTEXT_FRAMES],
            },
        );
        let facing = context.global_roots(rig.skeleton.left_axis)[CONTEXT_FRAMES - 1].heading;
        let mut character = Self {
            timeline: Timeline::new(buffer, options.look_ahead_frames, options.seed),
            planning: Planning::default(),
            inbox: Inbox::default(),
            locomotion: Locomotion::new(0, facing, rig.fps, command),
            performance: None,
            post: world.is_some().then(|| PostProcess::new(&rig.skeleton, level)),
            behaviour: world.map(Behaviour::new),
            skills: Arc::default(),
            events: EventLog::default(),
            rig,
            options,
        };
        if moving {
            let ticket = character.timeline.ask_first();
            let by = planned(&character.rig, &character.options, &character.timeline);
            (character.planning).ask_locomotion(ticket, None, &mut character.locomotion, by);
        }
        character
    }

    /// The same character with the skills of its pack.
    #[must_use]
    pub fn with_skills(mut self, skills: Arc<Skills>) -> Self {
        self.skills = skills;
        self
    }

    /// Gives a command, to hold from `at_frame` on, after those before it. Without `at_frame`, or
    /// if that frame is past, it holds from the next frame that the cursor leaves in
    /// [`Clock::Waits`], or reaches in [`Clock::Runs`].
    ///
    /// # Errors
    /// [`CommandError`] for what the character could not do now.
    pub fn give(
        &mut self,
        sequence: u64,
        at_frame: Option<u64>,
        intent: Intent,
    ) -> Result<CommandOutcome, CommandError> {
        let now = self.frame();
        let at = at_frame.unwrap_or(now).max(now);
        if sequence > self.inbox.last_sequence() {
            self.inbox.check(&intent)?;
            self.check(&intent)?;
        }
        Ok(self.inbox.offer(sequence, at, intent))
    }

    /// Whether the character could carry out a command now.
    fn check(&mut self, intent: &Intent) -> Result<(), CommandError> {
        match intent {
            Intent::Interact { .. } if self.rig.by_path.is_some() => return Err(CommandError::ByPath),
            Intent::Skill { .. } if self.rig.by_path.is_some() => return Err(CommandError::SkillByPath),
            Intent::Skill { name, variant } => {
                return behaviour::skill(&self.skills, self.rig.name(), name, variant.as_deref(), 0)
                    .map(|_| ());
            }
            Intent::FollowPath(path) => {
                let root = self.timeline.buffer().root(self.timeline.frame());
                let off_m = path.lead_m(root);
                let most_m = MAX_LEAD_M;
                return match off_m <= most_m {
                    true => Ok(()),
                    false => Err(CommandError::PathTooFar { off_m, most_m }),
                };
            }
            _ => {}
        }
        match (self.acting(), intent) {
            (Some((behaviour, parts)), intent) => behaviour.check(intent, &parts),
            (None, Intent::Interact { .. }) => Err(CommandError::NoScene),
            (None, _) => Ok(()),
        }
    }

    /// The behaviour of a character in a scene, and what it works on.
    pub(super) fn acting(&mut self) -> Option<(&mut Behaviour, CharacterParts<'_>)> {
        let (behaviour, post) = (self.behaviour.as_mut()?, self.post.as_mut()?);
        let parts = CharacterParts {
            rig: &self.rig,
            options: &self.options,
            timeline: &mut self.timeline,
            locomotion: &mut self.locomotion,
            post,
            skills: &self.skills,
        };
        Some((behaviour, parts))
    }

    /// Gives a character without a scene level ground of its own, for its first skill.
    fn stand_on_level_ground(&mut self) {
        if self.behaviour.is_none() {
            self.behaviour = Some(Behaviour::new(World::level()));
            self.post = Some(PostProcess::new(&self.rig.skeleton, 0.0));
        }
    }

    /// [`Character::give`] for a command that moves the character over the ground.
    #[cfg(test)]
    pub(crate) fn command(
        &mut self,
        sequence: u64,
        at_frame: Option<u64>,
        command: LocomotionCommand,
    ) -> CommandOutcome {
        let given = self.give(sequence, at_frame, Intent::Locomote(command));
        given.expect("moving over the ground is never refused")
    }

    /// Moves what happened since the last call to the end of `into`, in the order of frames. To be
    /// called after every other call.
    pub fn take_events(&mut self, into: &mut Vec<CharacterEvent>) {
        let first = into.len();
        self.events.take(into);
        if let Some(behaviour) = &mut self.behaviour {
            behaviour.take_events(into);
            into[first..].sort_by_key(|event| event.frame);
        }
    }

    /// What the character does at the cursor.
    pub fn activity(&self) -> Activity {
        if let Some(text) = self.performance.as_ref().and_then(Performance::shown) {
            return Activity::Performing { text: text.clone() };
        }
        self.behaviour
            .as_ref()
            .map(Behaviour::activity)
            .unwrap_or_default()
    }

    /// The object in the character's hand.
    pub fn held(&self) -> Option<HeldObject> {
        let behaviour = self.behaviour.as_ref().filter(|behaviour| behaviour.holds())?;
        let mut rotations = Vec::new();
        let (root, _) = self.shown(self.timeline.cursor(), &mut rotations, &mut Fitted::default());
        let rotations = rotations.as_slice();
        behaviour.held(&self.rig, self.timeline.cursor(), Posed { root, rotations })
    }

    /// Takes the character out of its scene for good, as its session ends: puts down what it holds
    /// and frees what it reserved.
    pub fn leave(&mut self) {
        let held = self.held().map(|held| held.transform);
        if let Some(behaviour) = self.behaviour.take() {
            behaviour.leave(held);
        }
    }

    /// Takes the number of a command that asks for no motion: the character goes on as before.
    pub fn note_command(&mut self, sequence: u64) -> CommandOutcome {
        self.inbox.note(sequence)
    }

    /// Takes the load of the networks, which holds until the next call.
    pub fn under_load(&mut self, strain: Strain) {
        self.timeline.expect(strain.expected_frames, strain.lead_frames);
        self.planning.set_stretch(strain.stretch);
    }

    /// Moves the cursor by `sub_frames`, of which a frame has
    /// [`SUB_FRAMES`](super::SUB_FRAMES).
    pub fn advance(&mut self, sub_frames: u32, clock: Clock) -> Advance {
        self.timeline.push(sub_frames);
        loop {
            let barrier = Barrier {
                plan_early: self.post.is_some(),
                frame: self.performance.as_ref().and_then(Performance::barrier),
            };
            match self.timeline.run(clock, barrier) {
                Stop::AtFrame(frame) => self.settle(frame, clock),
                Stop::NeedsPlan => return Advance::NeedsPlan,
                Stop::Done => return Advance::Moved,
            }
        }
    }

    /// The plan to ask for, if there is one. To be called after every other call.
    pub fn take_request(&mut self) -> Option<PlanRequest> {
        self.planning.take_request()
    }

    /// Takes a plan that was asked for, or that it failed.
    pub fn plan_arrived(&mut self, number: u64, plan: Result<LivePlan, PlanFailed>) -> Arrival {
        let Ok(plan) = plan else {
            let arrival = self.timeline.fail(number);
            self.lost(number, arrival);
            return arrival;
        };
        let arrival = self.timeline.land(number, &plan);
        self.lost(number, arrival);
        if !matches!(arrival, Arrival::InTime { .. } | Arrival::Late) {
            return arrival;
        }
        if !self.planning.is_for_object(number) {
            finish_limbs(&self.rig, plan.feet_glide, self.timeline.last_plan_mut());
        }
        if let Some((behaviour, mut parts)) = self.acting() {
            behaviour.landed(number, &plan.trace.off, &mut parts);
        }
        self.planning.arrived(number, plan.trace);
        arrival
    }

    fn lost(&mut self, number: u64, arrival: Arrival) {
        if matches!(arrival, Arrival::Failed | Arrival::Dropped)
            && let Some((behaviour, mut parts)) = self.acting()
        {
            behaviour.lost(number, &mut parts);
        }
    }

    /// The frame that the cursor has reached.
    pub fn frame(&self) -> u64 {
        self.timeline.frame() as u64
    }

    /// Differs from any earlier stamp once the character has gone on, or taken a command or a plan.
    pub fn stamp(&self) -> (i64, u64, i64) {
        let (cursor, last) = (self.timeline.cursor(), self.timeline.buffer().last());
        (cursor, self.inbox.last_sequence(), last)
    }

    /// What the character has done so far.
    pub fn stats(&self) -> Stats {
        self.timeline.stats()
    }

    /// Decides about the frame that the cursor is at: which commands hold, and whether to ask for a
    /// plan.
    fn settle(&mut self, frame: i64, clock: Clock) {
        while let Some(due) = self.inbox.take_due(frame as u64) {
            let sequence = due.sequence;
            if self.take_up(due, frame) {
                self.inbox.set_current(sequence, frame as u64);
                let second = self.rig.fps as u64;
                self.events.push_bounded(frame, second, self.locomotion.instead());
            }
        }
        let next = match self.acting() {
            Some((behaviour, mut parts)) => behaviour.settle(frame, &mut parts),
            None => Next::Locomotion,
        };
        match next {
            Next::Locomotion => self.settle_performance(frame, clock),
            Next::Wait => {
                self.performance_overtaken(frame);
                self.timeline.settle_for(None);
            }
            Next::Ask(plan) => {
                self.performance_overtaken(frame);
                self.settle_set(*plan);
            }
        }
    }

    /// Takes up a command. Answers whether locomotion goes by another command from now on.
    fn take_up(&mut self, due: WaitingCommand, frame: i64) -> bool {
        let intent = match due.intent {
            Intent::Perform(command) => {
                self.take_up_words(due.sequence, command, frame);
                return false;
            }
            intent => intent,
        };
        if intent.ends_performance() {
            self.stop_performing(frame, PerformanceEnd::Interrupted);
        }
        if let Intent::Skill { .. } = intent {
            self.stand_on_level_ground();
        }
        if let Some((behaviour, mut parts)) = self.acting() {
            return behaviour.take_up(intent, frame, &mut parts);
        }
        let command = match intent {
            Intent::Locomote(command) => command,
            Intent::Cancel => LocomotionCommand::standing(&self.locomotion.command().style),
            Intent::FollowPath(path) => {
                self.locomotion.set_path(frame as u64, path);
                self.timeline.command_changed();
                return true;
            }
            Intent::Interact { .. }
            | Intent::Skill { .. }
            | Intent::EndInteraction
            | Intent::Drop
            | Intent::Perform(_) => return false,
        };
        if self.locomotion.goes_by(&command) {
            return false;
        }
        self.locomotion.set_command(frame as u64, command);
        self.timeline.command_changed();
        true
    }

    /// Leaves a frame to locomotion, and to the end of its path.
    pub(super) fn settle_on_foot(&mut self, frame: i64, clock: Clock) {
        self.end_path(frame);
        self.settle_locomotion(clock);
    }

    /// Lets a character stand that has come to the end of its path.
    fn end_path(&mut self, frame: i64) {
        let root = self.timeline.buffer().root(frame);
        let Some(end) = self.locomotion.end_path(frame as u64, root) else {
            return;
        };
        self.timeline.command_changed();
        let (late_s, off_m) = (end.late_s, end.off_m);
        self.events.push(frame, EventKind::Arrived { late_s, off_m });
    }

    /// Asks for the plan to the keyframes of an object.
    fn settle_set(&mut self, plan: SetPlan) {
        let Some(ticket) = self.timeline.settle_for(Some(plan.wish)) else {
            return;
        };
        if let Some(behaviour) = &mut self.behaviour {
            behaviour.asked(ticket.number);
        }
        let by = planned(&self.rig, &self.options, &self.timeline);
        self.planning.ask_set(ticket, plan, by);
    }

    /// Leaves the frame that the cursor is at to locomotion.
    fn settle_locomotion(&mut self, clock: Clock) {
        let style = &self.locomotion.command().style;
        let policy = self.planning.policy(&self.rig, &self.options, style);
        if let Some(ticket) = self.timeline.settle(clock, policy) {
            let by = planned(&self.rig, &self.options, &self.timeline);
            (self.planning).ask_locomotion(ticket, policy.pace, &mut self.locomotion, by);
        }
    }
}

fn planned<'a>(rig: &'a Rig, options: &'a CharacterOptions, timeline: &'a Timeline) -> Planned<'a> {
    Planned {
        rig,
        options,
        buffer: timeline.buffer(),
    }
}

/// The four frames that a character starts from, its root's height over the ground, and the height
/// of that ground, metres.
fn first_frames(start: Start, style: &Style, world: Option<&World>) -> (Context, f32) {
    let level = |place, hips_m| world.map_or(0.0, |world| Behaviour::floor_under(world, place, hips_m));
    match start {
        Start::Standing(root) => (Context::standing(style, root), level(root.position, 0.0)),
        Start::Context { roots, rotations } => {
            let level = level(roots[CONTEXT_FRAMES - 1], style.idle().height_m);
            let roots = roots.map(|root| root.with_y(root.y - level));
            (Context { roots, rotations }, level)
        }
    }
}

#[cfg(test)]
#[path = "character_tests.rs"]
mod tests;
