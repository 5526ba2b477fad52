//! What a character asks the networks for: the plan requests of locomotion and of object keyframes.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::behaviour::SetPlan;
use super::budget::Pace;
use super::buffer::MotionBuffer;
use super::policy::Policy;
use super::request::{self, Context};
use super::timeline::Ticket;
use super::{CharacterOptions, LiveShape, Pins, PlanCause, PlanRecord, PlanRequest, PlanTrace};
use crate::primitives::recipe::VELOCITY_FRAMES;
use crate::primitives::{Locomotion, PlanContext, PlanTargets};
use crate::style::Style;
use troupe_motion::model::Rig;

/// What plans are made with: the parts of a character that do not change while it makes one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Planned<'a> {
    pub(super) rig: &'a Rig,
    pub(super) options: &'a CharacterOptions,
    pub(super) buffer: &'a MotionBuffer,
}

/// The plan requests of a character, one at a time.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Planning {
    /// How much of the crowd's pressure falls on the character, 0 to 2: see [`super::budget`].
    stretch: f32,
    /// The newest plan leaves off in the middle of a turn.
    unfinished: bool,
    /// A request that the server has not taken yet.
    #[serde(skip)]
    request: Option<PlanRequest>,
    /// The newest request, until its plan arrives.
    #[serde(skip)]
    asked: Option<(Ticket, Arc<LiveShape>)>,
    /// The newest plan that arrived.
    #[serde(skip)]
    newest: Option<Arc<PlanRecord>>,
}

impl Planning {
    /// Takes the character's share of the crowd's pressure, 0 to 2.
    pub(super) fn set_stretch(&mut self, stretch: f32) {
        self.stretch = stretch;
    }

    /// Something else than the newest plan decides how motion goes on.
    pub(super) fn forget_turn(&mut self) {
        self.unfinished = false;
    }

    /// When to ask for plans in `style`.
    pub(super) fn policy(&self, rig: &Rig, options: &CharacterOptions, style: &Style) -> Policy {
        let interval = options.replan_interval_frames;
        let interval = interval.unwrap_or(style.replan_interval_frames);
        let interval_frames = (!style.is_static).then_some(interval);
        Policy {
            interval_frames,
            pace: Pace::new(self.stretch, interval_frames, options.seed, &rig.dims, rig.fps),
            unfinished: self.unfinished,
        }
    }

    /// Asks for a plan of locomotion, `pace` long or as long as usual.
    pub(super) fn ask_locomotion(
        &mut self,
        ticket: Ticket,
        pace: Option<Pace>,
        locomotion: &mut Locomotion,
        by: Planned<'_>,
    ) {
        let Planned { rig, options, buffer } = by;
        let context = Context::at(buffer, ticket.splice);
        let targets = locomotion.plan(&PlanContext {
            frame: ticket.splice as u64,
            roots: context.global_roots(rig.skeleton.left_axis),
            rotations: &context.rotations,
            velocity: buffer.velocity(ticket.splice, VELOCITY_FRAMES as i64, rig.fps),
            seed: options.seed,
            skeleton: &rig.skeleton,
            fps: rig.fps,
            frames_per_token: rig.dims.frames_per_token,
            plan_frames: pace.map(|pace| pace.plan_frames as usize),
        });
        self.unfinished = targets.unfinished;
        self.ask(ticket, context, targets, None, by);
    }

    /// Asks for a plan to the keyframes of an object.
    pub(super) fn ask_set(&mut self, ticket: Ticket, plan: SetPlan, by: Planned<'_>) {
        self.unfinished = false;
        let context = Context::at(by.buffer, ticket.splice);
        self.ask(ticket, context, plan.targets, Some(Arc::new(plan.pins)), by);
    }

    fn ask(
        &mut self,
        ticket: Ticket,
        context: Context,
        targets: PlanTargets,
        pins: Option<Arc<Pins>>,
        by: Planned<'_>,
    ) {
        let (item, shape) = request::build(by.rig, by.options, ticket.number, context, targets);
        let shape = Arc::new(shape);
        self.asked = Some((ticket, Arc::clone(&shape)));
        self.request = Some(PlanRequest {
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

    /// Hands over the request that the server has not taken yet.
    pub(super) fn take_request(&mut self) -> Option<PlanRequest> {
        self.request.take()
    }

    /// Whether plan `number`, the newest that was asked for, leads to the keyframes of an object.
    pub(super) fn is_for_object(&self, number: u64) -> bool {
        let is_it = |(ticket, _): &(Ticket, _)| ticket.number == number && ticket.cause == PlanCause::Object;
        self.asked.as_ref().is_some_and(is_it)
    }

    /// Notes that plan `number` took over.
    pub(super) fn arrived(&mut self, number: u64, trace: PlanTrace) {
        if let Some((ticket, shape)) = self.asked.take_if(|(ticket, _)| ticket.number == number) {
            self.newest = Some(Arc::new(PlanRecord {
                number: ticket.number,
                cause: ticket.cause,
                asked_at: ticket.asked_at as u64,
                splice: ticket.splice as u64,
                shape,
                trace,
            }));
        }
    }

    /// The newest plan that arrived.
    pub(super) fn newest(&self) -> Option<&Arc<PlanRecord>> {
        self.newest.as_ref()
    }

    /// Forgets what was asked for: it would start from frames that have changed.
    pub(super) fn forget_request(&mut self) {
        self.request = None;
        self.asked = None;
    }
}
