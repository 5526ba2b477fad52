//! What a character does in a scene: using objects, holding them, stepping up and down, falling.
//!
//! ```text
//!              Interact              approach over, sets gone through, failed, or a command
//! Locomotion ───────────► Using ─────────────────────────────────────────────► Locomotion
//!     │                     │ on the way to the object only
//!     └──── ground ends ────┴──────► Falling ──── landed and up again ───────► Locomotion
//! ```
//!
//! Who breaks off in a low pose stands up first ([`getting_up`]): the networks know no such poses.
//!
//! This is the only place that knows both the timeline and the primitives of
//! [`crate::primitives::object`]. Every frame is settled here first ([`Behaviour::settle`]); what
//! is left to locomotion goes its usual way. The scene is read through snapshots, and changed only
//! where an object is reserved, taken, put down or let go.

use serde::{Deserialize, Serialize};
mod alignment;
mod body;
mod carry;
mod check;
mod events;
mod fall;
mod footing;
mod getting_up;
mod hand;
mod plans;
mod sets;
mod skill;
mod using;

#[cfg(test)]
mod carry_tests;
#[cfg(test)]
mod command_tests;
#[cfg(test)]
mod ground_tests;
#[cfg(test)]
mod random_tests;
#[cfg(test)]
mod shift_tests;
#[cfg(test)]
mod skill_tests;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use troupe_motion::Vec3;
use troupe_motion::ik::Posed;

use super::timeline::Wish;
use super::{
    Activity, CharacterEvent, EventKind, FailReason, HeldObject, Intent, Pins, Refusal, SUB_FRAMES, World,
};
use crate::primitives::{LocomotionCommand, PlanTargets};
use crate::scene::{Scene, Transform};
use troupe_motion::model::Rig;

pub(super) use body::Body;
pub(super) use carry::Carry;
use fall::Fall;
pub(super) use footing::Footing;
use footing::Support;
use hand::{Hand, Refused};
pub(super) use skill::find as skill;
use using::Using;

/// What is to be done about a frame.
pub(super) enum Next {
    /// What locomotion says.
    Locomotion,
    /// Nothing is to be asked for.
    Wait,
    /// A plan to the keyframes of an object.
    Ask(Box<SetPlan>),
}

/// A plan to keyframes.
pub(super) struct SetPlan {
    pub(super) wish: Wish,
    pub(super) targets: PlanTargets,
    pub(super) pins: Pins,
}

/// What a character is about in its scene.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Behaviour {
    #[serde(with = "crate::saved::world")]
    world: World,
    doing: Doing,
    hand: Option<Hand>,
    /// An interaction has left the character in whatever pose it was in.
    left_off: bool,
    /// It stands up until this frame.
    gets_up_until: Option<i64>,
    /// What a command asked for during a fall or a skill.
    waiting: Option<Intent>,
    events: Vec<CharacterEvent>,
    /// Frame of the last event.
    told: u64,
    /// Interactions that began so far.
    begun: u64,
}

#[derive(Debug, Serialize, Deserialize)]
enum Doing {
    Locomotion,
    Using(Box<Using>),
    Falling(Fall),
}

impl Behaviour {
    pub(super) fn new(world: World) -> Self {
        Self {
            world,
            doing: Doing::Locomotion,
            hand: None,
            left_off: false,
            gets_up_until: None,
            waiting: None,
            events: Vec::new(),
            told: 0,
            begun: 0,
        }
    }

    /// Height of what a character stands on that starts at `place`, its root `hips_m` over its feet
    /// or at them: the first surface at or below it, or, inside of something, where its feet are.
    pub(super) fn floor_under(world: &World, place: Vec3, hips_m: f32) -> f32 {
        const ABOVE_M: f32 = 0.05;
        let scene = world.scene.snapshot();
        match scene.support(place + Vec3::Y * ABOVE_M, footing::DEEPEST_M, None) {
            Some(hit) if hit.is_inside() => place.y - hips_m,
            Some(hit) => hit.point.y,
            None => scene.ground_y_m(),
        }
    }

    /// Moves what happened since the last call to the end of `into`.
    pub(super) fn take_events(&mut self, into: &mut Vec<CharacterEvent>) {
        into.append(&mut self.events);
    }

    /// Events are told in the order of their frames: keyframes of a set, which are told with its
    /// last, may have been overtaken.
    fn emit(&mut self, frame: i64, kind: EventKind) {
        let frame = self.told.max(frame.max(0) as u64);
        self.told = frame;
        self.events.push(CharacterEvent { frame, kind });
    }

    pub(super) fn activity(&self) -> Activity {
        match &self.doing {
            Doing::Locomotion => Activity::Locomotion,
            Doing::Using(using) => using.activity(),
            Doing::Falling(_) => Activity::Falling,
        }
    }

    /// What is in the hand, in the frame at the cursor, of which `posed` is what is shown.
    pub(super) fn held(&self, body_of: &Rig, cursor: i64, posed: Posed<'_>) -> Option<HeldObject> {
        let hand = self.hand.as_ref()?;
        let frame = cursor as f64 / f64::from(SUB_FRAMES);
        Some(HeldObject {
            instance: Arc::clone(&hand.instance),
            transform: hand.transform(&body_of.skeleton, frame, posed),
        })
    }

    /// Whether something is in the hand.
    pub(super) fn holds(&self) -> bool {
        self.hand.is_some()
    }

    /// Puts down what is in the hand, which is at `held`, and frees all that the character has in
    /// the scene.
    pub(super) fn leave(self, held: Option<Transform>) {
        if let (Some(hand), Some(at)) = (&self.hand, held) {
            hand.let_go(&self.world, at);
        }
        let World { scene, holder, .. } = self.world;
        if scene.snapshot().of_holder(&holder).next().is_some() {
            scene.free_all(&holder);
        }
    }

    /// Whether a command could be carried out now.
    ///
    /// # Errors
    /// [`Refusal`].
    pub(super) fn check(&self, intent: &Intent, body: &Body<'_>) -> Result<(), Refusal> {
        let Intent::Interact {
            instance,
            variant,
            approach,
        } = intent
        else {
            return Ok(());
        };
        let root = body.timeline.buffer().root(body.timeline.frame());
        let seed = self.seed(body);
        self.checked(
            instance,
            (variant.as_deref(), approach.as_deref()),
            seed,
            root,
            body,
        )
        .map(|_| ())
    }

    /// Takes up a command at a frame. Answers whether locomotion goes by another command from now
    /// on.
    pub(super) fn take_up(&mut self, intent: Intent, frame: i64, body: &mut Body<'_>) -> bool {
        if let Doing::Falling(_) = self.doing {
            return match intent {
                // It holds once the character stands again.
                Intent::Locomote(command) => {
                    self.waiting = None;
                    body.locomotion.set_command(frame as u64, command);
                    true
                }
                other => {
                    self.waiting = Some(other);
                    false
                }
            };
        }
        let Some(intent) = self.after_skill(intent, frame, body) else {
            return false;
        };
        match intent {
            Intent::Locomote(command) => {
                if !self.interrupt(frame, body, Some(&command)) {
                    let same = super::character::same(body.locomotion.command(), &command);
                    if same && body.locomotion.path().is_none() {
                        return false;
                    }
                    body.locomotion.set_command(frame as u64, command);
                    body.timeline.command_changed();
                }
                true
            }
            Intent::FollowPath(path) => {
                self.interrupt(frame, body, None);
                body.locomotion.set_path(frame as u64, path);
                body.timeline.command_changed();
                true
            }
            Intent::Interact {
                instance,
                variant,
                approach,
            } => {
                self.interrupt(frame, body, None);
                self.begin(&instance, variant.as_deref(), approach.as_deref(), frame, body);
                false
            }
            Intent::Skill { name, variant } => {
                self.interrupt(frame, body, None);
                self.begin_skill(&name, variant.as_deref(), frame, body);
                false
            }
            Intent::EndInteraction => {
                self.end(frame, body);
                false
            }
            Intent::Cancel => {
                let standing = body.standing();
                let stood = super::character::same(body.locomotion.command(), &standing)
                    && body.locomotion.path().is_none();
                if !self.interrupt(frame, body, None) && !stood {
                    body.move_on(frame, standing, true);
                }
                self.let_go(frame, body);
                true
            }
            Intent::Drop => {
                self.drop_held(frame, body);
                false
            }
            // The character makes way for it: see `Behaviour::make_way`.
            Intent::Perform(_) => false,
        }
    }

    /// Ends what is held; an interaction that has not come to its object is broken off, and one
    /// that is over but for the object in the hand goes on with its way out. A way out goes on: it
    /// is the end that was asked for.
    fn end(&mut self, frame: i64, body: &mut Body<'_>) {
        match &mut self.doing {
            Doing::Using(using) if using.approaches() && !using.interaction.exits() => {
                self.interrupt(frame, body, None);
            }
            Doing::Using(using) => using.end(),
            Doing::Locomotion => self.begin_way_out(frame, body),
            Doing::Falling(_) => {}
        }
    }

    /// Other motion than any of a scene is to come: an interaction is broken off, and nothing waits
    /// for the end of a fall.
    pub(super) fn make_way(&mut self, frame: i64, body: &mut Body<'_>) {
        self.waiting = None;
        self.interrupt(frame, body, None);
    }

    /// Other motion than any of a scene has left the character in whatever pose it is in.
    pub(super) fn leave_off(&mut self) {
        self.left_off = true;
    }

    /// Other motion than any of a scene moves the frames behind `shown`.
    pub(super) fn moved(&mut self, shown: i64, body: &mut Body<'_>) {
        body.carry.due(shown);
        self.settle_arm(shown, body);
        let scene = self.world.scene.snapshot();
        body.renew_footing(shown, &scene);
    }

    /// Breaks off an interaction. Locomotion goes by `command`, or stands. Answers whether there
    /// was one.
    fn interrupt(&mut self, frame: i64, body: &mut Body<'_>, command: Option<&LocomotionCommand>) -> bool {
        let Doing::Using(using) = &self.doing else {
            return false;
        };
        if using.leaves() {
            // It is over but for the last few frames.
            self.go_through(frame, body);
            return false;
        }
        let instance = Arc::clone(using.instance());
        self.emit(frame, EventKind::Interrupted { instance });
        self.stop_using(frame, body, command);
        true
    }

    /// Has an interaction that locomotion takes over from come to its end at once: what was to
    /// happen in the frames to come happens in this one.
    fn go_through(&mut self, frame: i64, body: &mut Body<'_>) {
        if let Err(refused) = self.pass_to(i64::MAX, frame, body) {
            self.fail(frame, body, refused);
        }
    }

    /// Breaks off an interaction that cannot go on; the character stands.
    fn fail(&mut self, frame: i64, body: &mut Body<'_>, Refused { reason, message }: Refused) {
        let Doing::Using(using) = &self.doing else {
            return;
        };
        let instance = Arc::clone(using.instance());
        self.emit(
            frame,
            EventKind::Failed {
                instance,
                reason,
                message,
            },
        );
        let waiting = self.waiting.take();
        self.stop_using(frame, body, None);
        if let Some(intent) = waiting {
            self.take_up(intent, frame, body);
        }
    }

    /// Frees what an interaction has reserved; locomotion goes by `command`, or stands. What is in
    /// the hand stays there.
    fn stop_using(&mut self, frame: i64, body: &mut Body<'_>, command: Option<&LocomotionCommand>) {
        if let Doing::Using(using) = std::mem::replace(&mut self.doing, Doing::Locomotion) {
            self.unreserve(&using);
            let command = command.cloned().unwrap_or_else(|| body.standing());
            body.move_on(frame, command, using.approaches());
            self.left_off = true;
            if let Some(hand) = &mut self.hand {
                hand.stays(frame);
            }
        }
    }

    fn unreserve(&self, using: &Using) {
        if using.is_skill() {
            return;
        }
        let instance = &**using.instance();
        let World { scene, holder, .. } = &self.world;
        if scene
            .snapshot()
            .instance(instance)
            .is_some_and(|it| it.state.holder() == Some(holder))
        {
            // A scene in which there was nothing to free is not published again.
            let _ = scene.update(|scene| match scene.unreserve(instance, holder) {
                true => Ok(()),
                false => Err(()),
            });
        }
    }

    /// Puts down what is in the hand by its rule, where there is a place for it.
    fn drop_held(&mut self, frame: i64, body: &Body<'_>) {
        let Some(hand) = &self.hand else { return };
        let at = hand.transform(&body.rig.skeleton, frame as f64, body.shown(frame).posed());
        let instance = Arc::clone(&hand.instance);
        let kind = match hand.put_down(&self.world, at) {
            Ok(transform) => {
                self.hand = None;
                EventKind::Released { instance, transform }
            }
            Err(Refused { reason, message }) => {
                if reason == FailReason::Removed {
                    self.hand = None;
                }
                EventKind::Failed {
                    instance,
                    reason,
                    message,
                }
            }
        };
        self.emit(frame, kind);
    }

    /// Lets go of what is in the hand, wherever it then comes to lie.
    fn let_go(&mut self, frame: i64, body: &Body<'_>) {
        let Some(hand) = self.hand.take() else { return };
        let at = hand.transform(&body.rig.skeleton, frame as f64, body.shown(frame).posed());
        if let Some(transform) = hand.let_go(&self.world, at) {
            let instance = Arc::clone(&hand.instance);
            self.emit(frame, EventKind::Released { instance, transform });
        }
    }

    /// Decides about the frame that the cursor is at.
    pub(super) fn settle(&mut self, frame: i64, body: &mut Body<'_>) -> Next {
        let next = self.decide(frame, body);
        self.settle_arm(frame, body);
        next
    }

    fn settle_arm(&self, frame: i64, body: &mut Body<'_>) {
        body.settle_arm(frame, self.hand.as_ref().and_then(Hand::socket));
    }

    fn decide(&mut self, frame: i64, body: &mut Body<'_>) -> Next {
        let scene = self.world.scene.snapshot();
        if let Some(from) = body.footing.take_changed() {
            body.renew_footing(from, &scene);
        }
        self.watch_hand(&scene, frame, body);
        if self.settle_rise(&scene, frame, body) {
            return Next::Wait;
        }
        if self.lose_ground(&scene, frame, body) {
            return Next::Wait;
        }
        match &self.doing {
            Doing::Locomotion => Next::Locomotion,
            Doing::Falling(_) => self.settle_fall(frame, body),
            Doing::Using(_) => self.settle_using(&scene, frame, body),
        }
    }

    /// What was taken out of the scene, or put there again, is in nobody's hand any more; that ends
    /// its use too.
    fn watch_hand(&mut self, scene: &Scene, frame: i64, body: &mut Body<'_>) {
        let lost = |hand: &mut Hand| {
            let there = scene.instance(&hand.instance);
            there.is_none_or(|it| it.state.holder() != Some(&self.world.holder))
        };
        let Some(Hand { instance, .. }) = self.hand.take_if(lost) else {
            return;
        };
        let reason = FailReason::Removed;
        let message = format!("object {instance:?} was taken out of the scene, and of the hand");
        match &self.doing {
            Doing::Using(using) if !using.is_skill() && *using.instance() == instance => {
                self.fail(frame, body, Refused { reason, message });
            }
            _ => self.emit(
                frame,
                EventKind::Failed {
                    instance,
                    reason,
                    message,
                },
            ),
        }
    }

    /// Looks at what a character on its feet stands on: a step is taken note of, ground that has
    /// moved is followed, and where the ground ends a fall begins, unless it is busy with an
    /// object. Answers whether one did.
    fn lose_ground(&mut self, scene: &Scene, frame: i64, body: &mut Body<'_>) -> bool {
        let may_fall = match &self.doing {
            Doing::Locomotion => true,
            Doing::Using(using) => using.approaches(),
            Doing::Falling(_) => return false,
        };
        let root = body.timeline.buffer().root(frame);
        if root.y < body.rig.low_hips_m {
            // What is under the hips of one who sits is no ground.
            return false;
        }
        if may_fall && let Some(height) = body.footing.shifted(scene, root) {
            body.shift_footing(frame, height, scene);
        }
        match footing::stands_on(scene, root, body.footing.level()) {
            Support::At(height) => {
                body.footing.step_to(height);
                if may_fall {
                    body.footing.stands(scene, root);
                }
                false
            }
            Support::Below(Some(_)) if may_fall => self.begin_fall(scene, frame, body),
            // A wall, or nothing to land on: it stays where it is.
            Support::Above | Support::Below(_) => false,
        }
    }
}
