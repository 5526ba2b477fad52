//! What a character does in a scene: using objects, holding them, stepping up and down, falling.
//!
//! ```text
//!              Interact              approach over, sets gone through, failed, or a command
//! Locomotion ───────────► Using ─────────────────────────────────────────────► Locomotion
//!     │                     │ on the way to the object only
//!     └──── ground ends ────┴──────► Falling ──── landed and up again ───────► Locomotion
//! ```
//!
//! A character that breaks off in a low pose stands up first ([`getting_up`]): the networks know no
//! such poses.
//!
//! Only this module knows both the timeline and the primitives of [`crate::primitives::object`].
//! Every frame is settled here first ([`Behaviour::settle`]); locomotion does the rest. The scene
//! is read through snapshots. It is changed only to reserve, take, put down or release an object.

mod alignment;
mod break_off;
mod carry;
mod check;
mod events;
mod fall;
mod footing;
mod getting_up;
mod hand;
mod parts;
mod plans;
mod post_process;
mod sets;
mod skill;
mod using;

#[cfg(test)]
mod carry_tests;
#[cfg(test)]
mod command_tests;
#[cfg(test)]
mod conflict_tests;
#[cfg(test)]
mod ground_tests;
#[cfg(test)]
mod random_tests;
#[cfg(test)]
mod shift_tests;
#[cfg(test)]
mod size_tests;
#[cfg(test)]
mod skill_tests;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use troupe_motion::Vec3;
use troupe_motion::ik::Posed;
use troupe_motion::model::Rig;

use super::event::EventLog;
use super::timeline::Wish;
use super::{
    Activity, CharacterEvent, CommandError, EventKind, FailReason, HeldObject, Intent, Pins, SUB_FRAMES,
    World,
};
use crate::primitives::PlanTargets;
use crate::scene::{ScaledScene, Transform};

use carry::Carry;
use fall::Fall;
use footing::{Footing, Support};
use hand::{Hand, Refused};
pub(super) use parts::CharacterParts;
pub(super) use post_process::PostProcess;
pub(super) use skill::find as skill;
use using::Using;

/// What a frame calls for.
pub(super) enum Next {
    /// Whatever locomotion asks for.
    Locomotion,
    /// No plan.
    Wait,
    /// A plan to the keyframes of an object.
    Ask(Box<SetPlan>),
}

/// A plan to keyframes, and when it is to take over.
pub(super) struct SetPlan {
    pub(super) wish: Wish,
    pub(super) targets: PlanTargets,
    pub(super) pins: Pins,
}

/// What a character is doing in its scene.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Behaviour {
    #[serde(with = "crate::saved::world")]
    world: World,
    doing: Doing,
    hand: Option<Hand>,
    /// An interaction left the character in an arbitrary pose.
    left_off: bool,
    /// The character stands up until this frame.
    gets_up_until: Option<i64>,
    /// A command that came during a fall or a skill.
    waiting: Option<Intent>,
    events: EventLog,
    /// Number of interactions that began so far.
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
            events: EventLog::default(),
            begun: 0,
        }
    }

    /// Height of what a new character stands on. Its root is at `place`, `hips_m` over its feet or
    /// at their height. It is the first surface at or below `place`; inside of something, it is the
    /// height of the feet.
    pub(super) fn floor_under(world: &World, place: Vec3, hips_m: f32) -> f32 {
        const ABOVE_M: f32 = 0.05;
        let scene = world.snapshot();
        let depth_m = footing::DEEPEST_M / scene.scale();
        match scene.support(place + Vec3::Y * ABOVE_M, depth_m, None) {
            Some(hit) if hit.is_inside() => place.y - hips_m,
            Some(hit) => hit.point.y,
            None => scene.ground_y_m(),
        }
    }

    /// Moves what happened since the last call to the end of `into`.
    pub(super) fn take_events(&mut self, into: &mut Vec<CharacterEvent>) {
        self.events.take(into);
    }

    pub(super) fn activity(&self) -> Activity {
        match &self.doing {
            Doing::Locomotion => Activity::Locomotion,
            Doing::Using(using) => using.activity(),
            Doing::Falling(_) => Activity::Falling,
        }
    }

    /// The object in the hand at the cursor, whose frame shows `posed`.
    pub(super) fn held(&self, body_of: &Rig, cursor: i64, posed: Posed<'_>) -> Option<HeldObject> {
        let hand = self.hand.as_ref()?;
        let frame = cursor as f64 / f64::from(SUB_FRAMES);
        Some(HeldObject {
            instance: Arc::clone(&hand.instance),
            transform: hand.transform(&body_of.skeleton, frame, posed),
            joint: hand.socket().map_or(0, |socket| socket.joint),
        })
    }

    /// Adds the joints that a keyframe holds at places of the scene at `frame`, or will soon.
    pub(super) fn reaches(&self, frame: i64, into: &mut Vec<usize>) {
        if let Doing::Using(using) = &self.doing {
            using.reaches(frame, into);
        }
    }

    /// Whether the hand holds an object.
    pub(super) fn holds(&self) -> bool {
        self.hand.is_some()
    }

    /// Puts down the object in the hand, which is at `held`, and frees everything that the
    /// character has in the scene.
    pub(super) fn leave(self, held: Option<Transform>) {
        if let (Some(hand), Some(at)) = (&self.hand, held) {
            hand.let_go(&self.world, at);
        }
        let World { scene, holder, .. } = self.world;
        if scene.snapshot().of_holder(&holder).next().is_some() {
            scene.free_all(&holder);
        }
    }

    /// Whether the character could carry out a command now.
    ///
    /// # Errors
    /// [`CommandError`] if not.
    pub(super) fn check(&self, intent: &Intent, parts: &CharacterParts<'_>) -> Result<(), CommandError> {
        let Intent::Interact {
            instance,
            variant,
            approach,
        } = intent
        else {
            return Ok(());
        };
        let root = parts.timeline.buffer().root(parts.timeline.frame());
        let seed = self.seed(parts);
        self.checked(
            instance,
            (variant.as_deref(), approach.as_deref()),
            seed,
            root,
            parts,
        )
        .map(|_| ())
    }

    /// Takes up a command at a frame. Answers whether locomotion goes by another command from now
    /// on.
    pub(super) fn take_up(&mut self, intent: Intent, frame: i64, parts: &mut CharacterParts<'_>) -> bool {
        if let Doing::Falling(_) = self.doing {
            return match intent {
                // It holds once the character stands again.
                Intent::Locomote(command) => {
                    self.waiting = None;
                    parts.locomotion.set_command(frame as u64, command);
                    true
                }
                other => {
                    self.waiting = Some(other);
                    false
                }
            };
        }
        let Some(intent) = self.after_skill(intent, frame, parts) else {
            return false;
        };
        match intent {
            Intent::Locomote(command) => {
                if !self.interrupt(frame, parts, Some(&command)) {
                    if parts.locomotion.goes_by(&command) {
                        return false;
                    }
                    parts.locomotion.set_command(frame as u64, command);
                    parts.timeline.command_changed();
                }
                true
            }
            Intent::FollowPath(path) => {
                self.interrupt(frame, parts, None);
                parts.locomotion.set_path(frame as u64, path);
                parts.timeline.command_changed();
                true
            }
            Intent::Interact {
                instance,
                variant,
                approach,
            } => {
                self.interrupt(frame, parts, None);
                self.begin(&instance, variant.as_deref(), approach.as_deref(), frame, parts);
                false
            }
            Intent::Skill { name, variant } => {
                self.interrupt(frame, parts, None);
                self.begin_skill(&name, variant.as_deref(), frame, parts);
                false
            }
            Intent::EndInteraction => {
                self.end(frame, parts);
                false
            }
            Intent::Cancel => {
                let standing = parts.standing();
                let stood = parts.locomotion.goes_by(&standing);
                if !self.interrupt(frame, parts, None) && !stood {
                    parts.move_on(frame, standing, true);
                }
                self.let_go(frame, parts);
                true
            }
            Intent::Drop => {
                self.drop_held(frame, parts);
                false
            }
            // The character makes way for it: see `Behaviour::make_way`.
            Intent::Perform(_) => false,
        }
    }

    /// Ends what is held. An interaction that has not reached its object breaks off. If only the
    /// object in the hand is left of one, its way out begins. A way out goes on: it is the end that
    /// the command asks for.
    fn end(&mut self, frame: i64, parts: &mut CharacterParts<'_>) {
        match &mut self.doing {
            Doing::Using(using) if using.approaches() && !using.interaction.exits() => {
                self.interrupt(frame, parts, None);
            }
            Doing::Using(using) => using.end(),
            Doing::Locomotion => self.begin_way_out(frame, parts),
            Doing::Falling(_) => {}
        }
    }

    /// Makes way for a performance: breaks an interaction off, and drops a command that waits for
    /// the end of a fall.
    pub(super) fn make_way(&mut self, frame: i64, parts: &mut CharacterParts<'_>) {
        self.waiting = None;
        self.interrupt(frame, parts, None);
    }

    /// A performance left the character in an arbitrary pose.
    pub(super) fn leave_off(&mut self) {
        self.left_off = true;
    }

    /// A performance moves the frames after `shown`.
    pub(super) fn moved(&mut self, shown: i64, parts: &mut CharacterParts<'_>) {
        parts.post.carry.due(shown);
        self.settle_arm(shown, parts);
        let scene = self.world.snapshot();
        parts.renew_footing(shown, &scene);
    }

    /// Decides about the frame that the cursor is at.
    pub(super) fn settle(&mut self, frame: i64, parts: &mut CharacterParts<'_>) -> Next {
        let next = self.decide(frame, parts);
        self.settle_arm(frame, parts);
        next
    }

    fn settle_arm(&self, frame: i64, parts: &mut CharacterParts<'_>) {
        parts.settle_arm(frame, self.hand.as_ref().and_then(Hand::socket));
    }

    fn decide(&mut self, frame: i64, parts: &mut CharacterParts<'_>) -> Next {
        let scene = self.world.snapshot();
        if let Some(from) = parts.post.footing.take_changed() {
            parts.renew_footing(from, &scene);
        }
        self.watch_hand(&scene, frame, parts);
        if self.settle_rise(&scene, frame, parts) {
            return Next::Wait;
        }
        if self.lose_ground(&scene, frame, parts) {
            return Next::Wait;
        }
        match &self.doing {
            Doing::Locomotion => Next::Locomotion,
            Doing::Falling(_) => self.settle_fall(frame, parts),
            Doing::Using(_) => self.settle_using(&scene, frame, parts),
        }
    }

    /// Notices that the object in the hand was removed from the scene, or put there again. That
    /// ends its use too.
    fn watch_hand(&mut self, scene: &ScaledScene, frame: i64, parts: &mut CharacterParts<'_>) {
        let lost = |hand: &mut Hand| {
            let there = scene.instance(&hand.instance);
            there.is_none_or(|it| it.state.holder() != Some(&self.world.holder))
        };
        let Some(Hand { instance, .. }) = self.hand.take_if(lost) else {
            return;
        };
        let reason = FailReason::Removed;
        let message = format!("object {instance:?} was removed from the scene, and from the hand");
        match &self.doing {
            Doing::Using(using) if !using.is_skill() && *using.instance() == instance => {
                self.fail(frame, parts, Refused { reason, message });
            }
            _ => self.events.push(
                frame,
                EventKind::Failed {
                    instance,
                    reason,
                    message,
                },
            ),
        }
    }

    /// Looks at what a character on its feet stands on: notes a step, and follows ground that has
    /// moved. If the ground ends, a fall begins, unless the character is busy with an object.
    /// Answers whether a fall began.
    fn lose_ground(&mut self, scene: &ScaledScene, frame: i64, parts: &mut CharacterParts<'_>) -> bool {
        let may_fall = match &self.doing {
            Doing::Locomotion => true,
            Doing::Using(using) => using.approaches(),
            Doing::Falling(_) => return false,
        };
        let root = parts.timeline.buffer().root(frame);
        if root.y < parts.rig.low_hips_m {
            // Whatever is under the hips of a seated character is no ground.
            return false;
        }
        if may_fall && let Some(height) = parts.post.footing.shifted(scene, root) {
            parts.shift_footing(frame, height, scene);
        }
        match footing::stands_on(scene, root, parts.post.footing.level()) {
            Support::At(height) => {
                parts.post.footing.step_to(height);
                if may_fall {
                    parts.post.footing.stands(scene, root);
                }
                false
            }
            Support::Below(Some(_)) if may_fall => self.begin_fall(scene, frame, parts),
            // At a wall, or with nothing to land on, the character stays.
            Support::Above | Support::Below(_) => false,
        }
    }
}
