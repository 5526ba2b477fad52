//! A character's state machine: commands, ticks and plans in; requests for plans and frames out. It knows no clock, no
//! thread and no engine, so the same events give the same frames.

use std::sync::Arc;

use troupe_motion::rotation::yaw;
use troupe_motion::{GlobalRoot, Vec3};

use super::budget::Pace;
use super::buffer::{Frames, MotionBuffer};
use super::inbox::Inbox;
use super::policy::Policy;
use super::request::{self, Context};
use super::timeline::{Stop, Ticket, Timeline};
use super::{
    Activity, Advance, Arrival, CONTEXT_FRAMES, CharacterEvent, CharacterOptions, Clock, CommandOutcome,
    FrameOut, HeldObject, Intent, LivePlan, LiveShape, Peek, PlanFailed, PlanRecord, PlanRequest, Refusal,
    SUB_FRAMES, Start, Stats, Strain, View, WaitingCommand, World,
};
use crate::pack::Pack;
use crate::primitives::recipe::VELOCITY_FRAMES;
use crate::primitives::{Locomotion, LocomotionCommand, PlanContext};
use crate::style::Style;

/// Frame of the first context frame of a new character.
const FIRST_FRAME: i64 = 1 - CONTEXT_FRAMES as i64;

/// One character.
#[derive(Debug)]
pub struct Character {
    pack: Arc<Pack>,
    options: CharacterOptions,
    world: Option<World>,
    timeline: Timeline,
    /// How much of the crowd's pressure falls on it.
    stretch: f32,
    /// The newest plan leaves off in the middle of a turn.
    unfinished: bool,
    inbox: Inbox,
    locomotion: Locomotion,
    /// Sequence number of the current command, and the frame from which it held.
    current: (u64, u64),
    /// A plan to ask for.
    outbox: Option<PlanRequest>,
    /// What the newest plan was asked with.
    asked: Option<(Ticket, Arc<LiveShape>)>,
    newest: Option<Arc<PlanRecord>>,
}

impl Character {
    /// A character at frame 0 that does what `command` says, in no scene. The rotations of a [`Start::Context`] and of the
    /// style must fit the pack.
    pub fn new(pack: Arc<Pack>, options: CharacterOptions, start: Start, command: LocomotionCommand) -> Self {
        Self::in_world(pack, options, start, command, None)
    }

    /// As [`Character::new`], in a scene.
    pub fn in_world(
        pack: Arc<Pack>,
        options: CharacterOptions,
        start: Start,
        command: LocomotionCommand,
        world: Option<World>,
    ) -> Self {
        let moving = matches!(start, Start::Context { .. });
        let context = match start {
            Start::Standing(root) => standing(&command.style, root),
            Start::Context { roots, rotations } => Context { roots, rotations },
        };
        let buffer = MotionBuffer::new(
            pack.skeleton.joint_count(),
            FIRST_FRAME,
            Frames {
                roots: &context.roots,
                rotations: &context.rotations,
                contacts: &[0; CONTEXT_FRAMES],
            },
        );
        let facing = context.global_roots(pack.skeleton.left_axis)[CONTEXT_FRAMES - 1].heading;
        let mut character = Self {
            timeline: Timeline::new(buffer, options.look_ahead_frames, options.seed),
            stretch: 0.0,
            unfinished: false,
            inbox: Inbox::default(),
            locomotion: Locomotion::new(0, facing, pack.manifest.fps, command),
            current: (0, 0),
            outbox: None,
            asked: None,
            newest: None,
            pack,
            options,
            world,
        };
        if moving {
            let ticket = character.timeline.ask_first();
            character.ask(ticket, None);
        }
        character
    }

    /// Gives a command, to hold from `at_frame` on. Without it, or where that frame is past: from the next frame that the
    /// cursor leaves in [`Clock::Waits`], or reaches in [`Clock::Runs`].
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
        Ok(self.inbox.offer(sequence, at, intent))
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

    /// Moves what happened since the last call to the end of `into`, in order; to be called after every other call.
    pub fn take_events(&mut self, into: &mut Vec<CharacterEvent>) {
        let _ = into;
    }

    /// What the character is about.
    pub fn activity(&self) -> Activity {
        Activity::Locomotion
    }

    /// What is in its hand, where that is something.
    pub fn held(&self) -> Option<HeldObject> {
        None
    }

    /// Takes the character out of its scene for good, as its session ends: whatever it reserved or holds there is free.
    pub fn leave(&mut self) {
        let Some(World { scene, holder, .. }) = self.world.take() else {
            return;
        };
        if scene.snapshot().of_holder(&holder).next().is_some() {
            scene.free_all(&holder);
        }
    }

    /// Takes the number of a command that asks for no motion: the character goes on with what it does.
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
            return self.timeline.fail(number);
        };
        let arrival = self.timeline.land(number, &plan);
        if matches!(arrival, Arrival::InTime { .. } | Arrival::Late)
            && let Some((ticket, shape)) = self.asked.take_if(|(ticket, _)| ticket.number == number)
        {
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

    /// The frame at the cursor.
    pub fn sample(&self, out: &mut FrameOut) {
        let cursor = self.timeline.cursor();
        (out.root, out.contacts) = self.timeline.buffer().sample(cursor, &mut out.rotations);
        out.frame = self.timeline.frame() as u64;
        out.underrun = self.timeline.slowing();
    }

    /// The frame that the cursor has reached.
    pub fn frame(&self) -> u64 {
        self.timeline.frame() as u64
    }

    /// What the character has done so far.
    pub fn stats(&self) -> Stats {
        self.timeline.stats()
    }

    /// The character as it stands.
    pub fn view(&self) -> View {
        let (buffer, cursor) = (self.timeline.buffer(), self.timeline.cursor());
        let mut pose = Vec::new();
        let (position, _) = buffer.sample(cursor, &mut pose);
        let (before, _) = buffer.sample(cursor - i64::from(SUB_FRAMES), &mut Vec::new());
        let way = (position - before).with_y(0.0).length();
        let pelvis = pose.first().copied().unwrap_or_default();
        View {
            frame: self.timeline.frame() as u64,
            root: GlobalRoot::of_pose(position, pelvis, self.pack.skeleton.left_axis),
            speed_mps: way * self.pack.manifest.fps,
            buffered_frames: self.timeline.frames_left() as u32,
            last_sequence: self.inbox.last_sequence(),
            stats: self.timeline.stats(),
        }
    }

    /// Up to `frames` frames of the future, and the plan behind them.
    pub fn peek(&self, frames: usize) -> Peek {
        let first = self.timeline.frame() + 1;
        let last = first.saturating_add_unsigned(frames as u64).saturating_sub(1);
        let future = self.timeline.buffer().range(first, last);
        Peek {
            first_frame: first as u64,
            roots: future.roots.to_vec(),
            rotations: future.rotations.to_vec(),
            contacts: future.contacts.to_vec(),
            plan: self.newest.clone(),
            in_flight: self.timeline.awaits_plan(),
            waiting: self.waiting(),
        }
    }

    /// The command that waits for its frame, or the current one where no plan was asked for with it yet.
    fn waiting(&self) -> Option<WaitingCommand> {
        self.inbox.waiting().cloned().or_else(|| {
            let (sequence, frame) = self.current;
            (sequence > 0 && self.timeline.command_waits()).then(|| WaitingCommand {
                sequence,
                frame,
                intent: Intent::Locomote(self.locomotion.command().clone()),
            })
        })
    }

    /// Decides about the frame that the cursor is at: which command holds, and whether to ask for a plan.
    fn settle(&mut self, frame: i64, clock: Clock) {
        if let Some(due) = self.inbox.take_due(frame as u64)
            && let Intent::Locomote(command) = due.intent
            && !same(self.locomotion.command(), &command)
        {
            self.current = (due.sequence, frame as u64);
            self.locomotion.set_command(frame as u64, command);
            self.timeline.command_changed();
        }
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
        let (dims, fps) = (&self.pack.dims, self.pack.manifest.fps);
        Pace::new(self.stretch, interval_frames, self.options.seed, dims, fps)
    }

    fn ask(&mut self, ticket: Ticket, pace: Option<Pace>) {
        let context = self.context(ticket.splice);
        let skeleton = &self.pack.skeleton;
        let targets = self.locomotion.plan(&PlanContext {
            frame: ticket.splice as u64,
            roots: context.global_roots(skeleton.left_axis),
            rotations: &context.rotations,
            velocity: self.velocity(ticket.splice),
            skeleton,
            fps: self.pack.manifest.fps,
            frames_per_token: self.pack.dims.frames_per_token,
            plan_frames: pace.map(|pace| pace.plan_frames as usize),
        });
        self.unfinished = targets.unfinished;
        let (item, shape) = request::build(&self.pack, &self.options, ticket.number, context, targets);
        let shape = Arc::new(shape);
        self.asked = Some((ticket, Arc::clone(&shape)));
        self.outbox = Some(PlanRequest {
            number: ticket.number,
            cause: ticket.cause,
            item,
            shape,
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

    /// Mean velocity over the ground of the frames before `splice`.
    fn velocity(&self, splice: i64) -> Vec3 {
        let buffer = self.timeline.buffer();
        let from = (splice - VELOCITY_FRAMES as i64).max(buffer.first());
        let way = (buffer.root(splice) - buffer.root(from)).with_y(0.0);
        way * self.pack.manifest.fps / (splice - from).max(1) as f32
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
fn same(a: &LocomotionCommand, b: &LocomotionCommand) -> bool {
    (Arc::ptr_eq(&a.style, &b.style) || a.style == b.style)
        && (a.velocity, a.facing, &a.gait, a.height_m) == (b.velocity, b.facing, &b.gait, b.height_m)
}

#[cfg(test)]
#[path = "character_tests.rs"]
mod tests;
