//! A character's state machine: commands, ticks and plans in; requests for plans and frames out. It
//! knows no clock, no thread and no engine, so the same events give the same frames.
//!
//! In a scene, [`Behaviour`] has the first word about every frame, [`Footing`] lifts frames onto
//! what is there to stand on, for the buffer's heights count from a flat ground, and [`Carry`]
//! bends an arm that carries something.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use troupe_motion::GlobalRoot;
use troupe_motion::ik::Posed;
use troupe_motion::robot::Fitted;
use troupe_motion::rotation::yaw;

use super::behaviour::{self, Behaviour, Body, Carry, Footing, Next, SetPlan};
use super::budget::Pace;
use super::buffer::{Frames, MotionBuffer};
use super::inbox::Inbox;
use super::performance::Performance;
use super::policy::Policy;
use super::request::{self, Context};
use super::timeline::{Stop, Ticket, Timeline};
use super::{
    Activity, Advance, Arrival, CONTEXT_FRAMES, CharacterEvent, CharacterOptions, Clock, CommandOutcome,
    EventKind, HeldObject, Intent, LivePlan, LiveShape, PerformanceEnd, Pins, PlanCause, PlanFailed,
    PlanRecord, PlanRequest, Refusal, Start, Stats, Strain, WaitingCommand, WordsRequest, World,
};
use crate::post::part_legs;
use crate::primitives::path::MAX_LEAD_M;
use crate::primitives::recipe::VELOCITY_FRAMES;
use crate::primitives::{Locomotion, LocomotionCommand, PlanContext, PlanTargets};
use crate::skill::Skills;
use crate::style::Style;
use troupe_motion::model::Rig;

/// Frame of the first context frame of a new character.
const FIRST_FRAME: i64 = 1 - CONTEXT_FRAMES as i64;

/// One character.
#[derive(Debug, Serialize, Deserialize)]
pub struct Character {
    #[serde(with = "crate::saved::rig")]
    pub(super) rig: Arc<Rig>,
    pub(super) options: CharacterOptions,
    /// What it can do where it stands.
    #[serde(with = "crate::saved::skills")]
    skills: Arc<Skills>,
    /// What it does in its scene; none without one, before it does its first skill.
    pub(super) behaviour: Option<Behaviour>,
    /// What it stands on; none where that is the ground at height 0 always.
    footing: Option<Footing>,
    /// How it carries what is in its hand.
    carry: Carry,
    /// What happened outside of what it does in a scene.
    pub(super) events: Vec<CharacterEvent>,
    pub(super) timeline: Timeline,
    /// How much of the crowd's pressure falls on it.
    stretch: f32,
    /// The newest plan leaves off in the middle of a turn.
    pub(super) unfinished: bool,
    inbox: Inbox,
    pub(super) locomotion: Locomotion,
    /// What it acts out, or is about to.
    pub(super) performance: Option<Performance>,
    /// Sequence number of the current command, and the frame from which it held.
    current: (u64, u64),
    /// The frame at which it was told what is done instead of a command; none since a command that
    /// can be followed.
    told: Option<u64>,
    /// A plan to ask for.
    #[serde(skip)]
    outbox: Option<PlanRequest>,
    /// Words to ask for.
    #[serde(skip)]
    pub(super) words_outbox: Option<WordsRequest>,
    /// What the newest plan was asked with.
    #[serde(skip)]
    asked: Option<(Ticket, Arc<LiveShape>)>,
    #[serde(skip)]
    newest: Option<Arc<PlanRecord>>,
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
        let under = |place, hips_m| move |world: &World| Behaviour::floor_under(world, place, hips_m);
        let level = |place, hips_m| world.as_ref().map_or(0.0, under(place, hips_m));
        let (context, level) = match start {
            Start::Standing(root) => (standing(&command.style, root), level(root.position, 0.0)),
            Start::Context { roots, rotations } => {
                let level = level(roots[CONTEXT_FRAMES - 1], command.style.idle().height_m);
                let roots = roots.map(|root| root.with_y(root.y - level));
                (Context { roots, rotations }, level)
            }
        };
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
        let timeline = Timeline::new(buffer, options.look_ahead_frames, options.seed);
        let mut character = Self {
            timeline: match world {
                Some(_) => timeline.looks_ahead(),
                None => timeline,
            },
            stretch: 0.0,
            unfinished: false,
            inbox: Inbox::default(),
            locomotion: Locomotion::new(0, facing, rig.fps, command),
            performance: None,
            current: (0, 0),
            told: None,
            outbox: None,
            words_outbox: None,
            asked: None,
            newest: None,
            footing: world.is_some().then(|| Footing::new(&rig.skeleton, level)),
            behaviour: world.map(Behaviour::new),
            skills: Arc::default(),
            carry: Carry::default(),
            events: Vec::new(),
            rig,
            options,
        };
        if moving {
            let ticket = character.timeline.ask_first();
            character.ask(ticket, None);
        }
        character
    }

    /// The same, with what it can do where it stands.
    #[must_use]
    pub fn with_skills(mut self, skills: Arc<Skills>) -> Self {
        self.skills = skills;
        self
    }

    /// Gives a command, to hold from `at_frame` on, after those before it. Without it, or where
    /// that frame is past: from the next frame that the cursor leaves in [`Clock::Waits`], or
    /// reaches in [`Clock::Runs`].
    ///
    /// # Errors
    /// [`Refusal`] for what the character could not do now.
    pub fn give(
        &mut self,
        sequence: u64,
        at_frame: Option<u64>,
        intent: Intent,
    ) -> Result<CommandOutcome, Refusal> {
        let now = self.timeline.frame() as u64;
        let at = at_frame.unwrap_or(now).max(now);
        if sequence > self.inbox.last_sequence() {
            self.inbox.check(&intent)?;
            self.check(&intent)?;
        }
        Ok(self.inbox.offer(sequence, at, intent))
    }

    /// Whether a command could be carried out now.
    fn check(&mut self, intent: &Intent) -> Result<(), Refusal> {
        match intent {
            Intent::Interact { .. } if self.rig.by_path.is_some() => return Err(Refusal::ByPath),
            Intent::Skill { .. } if self.rig.by_path.is_some() => return Err(Refusal::SkillByPath),
            Intent::Skill { name, variant } => {
                return behaviour::skill(&self.skills, self.rig.name(), name, variant.as_deref(), 0)
                    .map(|_| ());
            }
            Intent::FollowPath(path) => {
                let root = self.timeline.buffer().root(self.timeline.frame());
                let off_m = path.lead_m(root);
                return match off_m <= MAX_LEAD_M {
                    true => Ok(()),
                    false => Err(Refusal::PathTooFar { off_m }),
                };
            }
            _ => {}
        }
        match (self.acting(), intent) {
            (Some((act, body)), intent) => act.check(intent, &body),
            (None, Intent::Interact { .. }) => Err(Refusal::NoScene),
            (None, _) => Ok(()),
        }
    }

    /// What the character does in its scene, and what that works on.
    pub(super) fn acting(&mut self) -> Option<(&mut Behaviour, Body<'_>)> {
        let (act, footing) = (self.behaviour.as_mut()?, self.footing.as_mut()?);
        let body = Body {
            rig: &self.rig,
            options: &self.options,
            timeline: &mut self.timeline,
            locomotion: &mut self.locomotion,
            footing,
            carry: &mut self.carry,
            skills: &self.skills,
        };
        Some((act, body))
    }

    /// One without a scene has level ground of its own from its first skill on.
    fn stand_on_level_ground(&mut self) {
        if self.behaviour.is_none() {
            self.behaviour = Some(Behaviour::new(World::level()));
            self.footing = Some(Footing::new(&self.rig.skeleton, 0.0));
            self.timeline.look_ahead_from_now();
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

    /// Moves what happened since the last call to the end of `into`, in order; to be called after
    /// every other call.
    pub fn take_events(&mut self, into: &mut Vec<CharacterEvent>) {
        let first = into.len();
        into.append(&mut self.events);
        if let Some(act) = &mut self.behaviour {
            act.take_events(into);
            into[first..].sort_by_key(|event| event.frame);
        }
    }

    /// What the character is about.
    pub fn activity(&self) -> Activity {
        if let Some(text) = self.performance.as_ref().and_then(Performance::shown) {
            return Activity::Performing { text: text.clone() };
        }
        self.behaviour
            .as_ref()
            .map(Behaviour::activity)
            .unwrap_or_default()
    }

    /// What is in its hand, where that is something.
    pub fn held(&self) -> Option<HeldObject> {
        let act = self.behaviour.as_ref().filter(|act| act.holds())?;
        let mut rotations = Vec::new();
        let (root, _) = self.shown(self.timeline.cursor(), &mut rotations, &mut Fitted::default());
        let rotations = rotations.as_slice();
        act.held(&self.rig, self.timeline.cursor(), Posed { root, rotations })
    }

    /// Takes the character out of its scene for good, as its session ends: what it holds is put
    /// down, what it reserved is free.
    pub fn leave(&mut self) {
        let held = self.held().map(|held| held.transform);
        if let Some(act) = self.behaviour.take() {
            act.leave(held);
        }
    }

    /// Takes the number of a command that asks for no motion: the character goes on with what it
    /// does.
    pub fn note_command(&mut self, sequence: u64) -> CommandOutcome {
        self.inbox.note(sequence)
    }

    /// How it is with the networks from now on.
    pub fn under_load(&mut self, strain: Strain) {
        self.timeline.expect(strain.expected_frames, strain.lead_frames);
        self.stretch = strain.stretch;
    }

    /// Moves the cursor by `sub_frames` of the [`SUB_FRAMES`] that a frame has.
    pub fn advance(&mut self, sub_frames: u32, clock: Clock) -> Advance {
        self.timeline.push(sub_frames);
        loop {
            match self.timeline.run(clock) {
                Stop::AtFrame(frame) => self.settle(frame, clock),
                Stop::NeedsPlan => return Advance::NeedsPlan,
                Stop::Done => return Advance::Moved,
            }
        }
    }

    /// The plan to ask for, if there is one; to be called after every other call.
    pub fn take_request(&mut self) -> Option<PlanRequest> {
        self.outbox.take()
    }

    /// A plan that was asked for has come, or will not.
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
        let for_object =
            |(ticket, _): &(Ticket, _)| ticket.number == number && ticket.cause == PlanCause::Object;
        if !self.asked.as_ref().is_some_and(for_object) {
            let (roots, rotations) = self.timeline.last_plan_mut();
            part_legs(&self.rig, roots, rotations);
        }
        if let Some((act, mut body)) = self.acting() {
            act.landed(number, &plan.trace.off, &mut body);
        }
        if let Some((ticket, shape)) = self.asked.take_if(|(ticket, _)| ticket.number == number) {
            self.newest = Some(Arc::new(PlanRecord {
                number: ticket.number,
                cause: ticket.cause,
                asked_at: ticket.asked_at as u64,
                splice: ticket.splice as u64,
                shape,
                trace: plan.trace,
            }));
        }
        arrival
    }

    fn lost(&mut self, number: u64, arrival: Arrival) {
        if matches!(arrival, Arrival::Failed | Arrival::Dropped)
            && let Some((act, mut body)) = self.acting()
        {
            act.lost(number, &mut body);
        }
    }

    /// The frame that the cursor has reached.
    pub fn frame(&self) -> u64 {
        self.timeline.frame() as u64
    }

    /// Another whenever the character has gone on, was given a command or a plan.
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
                self.current = (sequence, frame as u64);
                self.tell_instead(frame);
            }
        }
        let next = match self.acting() {
            Some((act, mut body)) => act.settle(frame, &mut body),
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

    /// Takes up a command. Answers whether locomotion goes by another from now on.
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
        if let Some((act, mut body)) = self.acting() {
            return act.take_up(intent, frame, &mut body);
        }
        let now = self.locomotion.command();
        let command = match intent {
            Intent::Locomote(command) => command,
            Intent::FollowPath(path) => {
                self.locomotion.set_path(frame as u64, path);
                self.timeline.command_changed();
                return true;
            }
            Intent::Cancel => LocomotionCommand::standing(&now.style),
            Intent::Interact { .. }
            | Intent::Skill { .. }
            | Intent::EndInteraction
            | Intent::Drop
            | Intent::Perform(_) => {
                return false;
            }
        };
        if self.locomotion.path().is_none() && same(now, &command) {
            return false;
        }
        self.locomotion.set_command(frame as u64, command);
        self.timeline.command_changed();
        true
    }

    /// Tells what is done instead of a command that the style cannot follow, at most once a second
    /// while commands change.
    fn tell_instead(&mut self, frame: i64) {
        let Some(instead) = self.locomotion.instead() else {
            self.told = None;
            return;
        };
        let second = self.rig.fps as u64;
        if self.told.is_none_or(|told| told + second <= frame as u64) {
            self.told = Some(frame as u64);
            self.events.push(CharacterEvent {
                frame: frame as u64,
                kind: EventKind::Bounded {
                    wanted_mps: instead.wanted_mps,
                    speed_mps: instead.speed_mps,
                    facing: instead.facing,
                },
            });
        }
    }

    /// Leaves a frame to locomotion, and to the end of its path.
    pub(super) fn settle_on_foot(&mut self, frame: i64, clock: Clock) {
        self.end_path(frame);
        self.settle_locomotion(clock);
    }

    /// Has one stand who has come to the end of a path.
    fn end_path(&mut self, frame: i64) {
        let root = self.timeline.buffer().root(frame);
        let Some(end) = self.locomotion.end_path(frame as u64, root) else {
            return;
        };
        self.timeline.command_changed();
        let (late_s, off_m) = (end.late_s, end.off_m);
        self.events.push(CharacterEvent {
            frame: frame as u64,
            kind: EventKind::Arrived { late_s, off_m },
        });
    }

    /// Asks for the plan to the keyframes of an object.
    fn settle_set(&mut self, plan: SetPlan) {
        let Some(ticket) = self.timeline.settle_for(Some(plan.wish)) else {
            return;
        };
        if let Some(act) = &mut self.behaviour {
            act.asked(ticket.number);
        }
        let context = self.context(ticket.splice);
        self.unfinished = false;
        self.send(ticket, context, plan.targets, Some(Arc::new(plan.pins)));
    }

    /// Leaves the frame that the cursor is at to locomotion.
    fn settle_locomotion(&mut self, clock: Clock) {
        let style = &self.locomotion.command().style;
        let interval = self
            .options
            .replan_interval_frames
            .unwrap_or(style.replan_interval_frames);
        let interval_frames = (!style.is_static).then_some(interval);
        let policy = Policy {
            interval_frames,
            pace: self.pace(interval_frames),
            unfinished: self.unfinished,
        };
        if let Some(ticket) = self.timeline.settle(clock, policy) {
            self.ask(ticket, policy.pace);
        }
    }

    fn pace(&self, interval_frames: Option<u32>) -> Option<Pace> {
        let (dims, fps) = (&self.rig.dims, self.rig.fps);
        Pace::new(self.stretch, interval_frames, self.options.seed, dims, fps)
    }

    fn ask(&mut self, ticket: Ticket, pace: Option<Pace>) {
        let context = self.context(ticket.splice);
        let skeleton = &self.rig.skeleton;
        let targets = self.locomotion.plan(&PlanContext {
            frame: ticket.splice as u64,
            roots: context.global_roots(skeleton.left_axis),
            rotations: &context.rotations,
            velocity: (self.timeline.buffer()).velocity(ticket.splice, VELOCITY_FRAMES as i64, self.rig.fps),
            seed: self.options.seed,
            skeleton,
            fps: self.rig.fps,
            frames_per_token: self.rig.dims.frames_per_token,
            plan_frames: pace.map(|pace| pace.plan_frames as usize),
        });
        self.unfinished = targets.unfinished;
        self.send(ticket, context, targets, None);
    }

    fn send(&mut self, ticket: Ticket, context: Context, targets: PlanTargets, pins: Option<Arc<Pins>>) {
        let (item, shape) = request::build(&self.rig, &self.options, ticket.number, context, targets);
        let shape = Arc::new(shape);
        self.asked = Some((ticket, Arc::clone(&shape)));
        self.outbox = Some(PlanRequest {
            number: ticket.number,
            cause: ticket.cause,
            item,
            shape,
            pins,
            splice_in_frames: (ticket.splice - ticket.asked_at) as u32,
            due_in_frames: (ticket.due - ticket.asked_at) as u32,
            spacing_frames: ticket.spacing.map(|frames| frames.max(0) as u32),
        });
    }

    /// The frames that a plan with this splice frame starts from.
    fn context(&self, splice: i64) -> Context {
        let buffer = self.timeline.buffer();
        let frames = std::array::from_fn::<i64, CONTEXT_FRAMES, _>(|i| splice + FIRST_FRAME + i as i64);
        Context {
            roots: frames.map(|frame| buffer.root(frame)),
            rotations: frames
                .iter()
                .flat_map(|&frame| buffer.pose(frame))
                .copied()
                .collect(),
        }
    }
}

/// Four frames of a style's standing pose.
fn standing(style: &Style, root: GlobalRoot) -> Context {
    let key = style.idle();
    let mut pose = key.rotations.clone();
    if let Some(pelvis) = pose.first_mut() {
        *pelvis = yaw(root.heading) * *pelvis;
    }
    Context {
        roots: [root.position.with_y(key.height_m); CONTEXT_FRAMES],
        rotations: pose.repeat(CONTEXT_FRAMES),
    }
}

/// Whether two commands ask for the same.
pub(super) fn same(a: &LocomotionCommand, b: &LocomotionCommand) -> bool {
    (Arc::ptr_eq(&a.style, &b.style) || a.style == b.style)
        && (a.velocity, a.facing, &a.gait, a.height_m) == (b.velocity, b.facing, &b.gait, b.height_m)
}

#[path = "rejoin.rs"]
mod rejoin;
#[path = "shown.rs"]
mod shown;

pub use rejoin::{LastSeen, MAX_REJOIN_FRAMES, MAX_REJOIN_M, RejoinError};

#[cfg(test)]
#[path = "character_tests.rs"]
mod tests;
