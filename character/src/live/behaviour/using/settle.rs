//! What using an object does at each frame: follow the object, approach it, and have the motion of
//! its sets made.

use std::sync::Arc;

use troupe_motion::rotation::angle_between;

use super::super::super::{FailReason, Intent};
use super::super::hand::{Hand, Refused};
use super::super::{Behaviour, CharacterParts, Doing, Next};
use super::{Asked, Using};
use crate::primitives::object::recipe::REPLAN_LEFT_FRAMES;
use crate::primitives::object::{Going, Here, Input, Want};
use crate::primitives::recipe::VELOCITY_FRAMES;
use crate::scene::{Holder, Instance, ScaledScene, State, Transform};

/// An object that changes by more than this has moved: metres and radians.
const MOVED: (f32, f32) = (0.02, 0.035);
/// An object that moves farther than this while it is used is not followed, metres: motions to its
/// keyframes are short.
const FOLLOW_M: f32 = 0.5;
/// Farthest that a keyframe may be from where its motion starts, metres: without the networks (a
/// step and a stretch), and with them (two seconds of a quick walk).
const FARTHEST_M: (f32, f32) = (1.2, 4.0);
/// Frames between checks for obstacles.
const LOOK_FRAMES: i64 = 10;

fn has_moved(from: Transform, to: Transform) -> bool {
    let (metres, radians) = MOVED;
    from.position.distance(to.position) > metres || angle_between(from.rotation, to.rotation) > radians
}

impl Behaviour {
    /// Carries out an interaction at the frame that the cursor is at.
    pub(in crate::live::behaviour) fn settle_using(
        &mut self,
        scene: &ScaledScene,
        frame: i64,
        parts: &mut CharacterParts<'_>,
    ) -> Next {
        match self.go_on_using(scene, frame, parts) {
            Ok(next) => next,
            Err(refused) => {
                self.fail(frame, parts, refused);
                Next::Locomotion
            }
        }
    }

    fn go_on_using(
        &mut self,
        scene: &ScaledScene,
        frame: i64,
        parts: &mut CharacterParts<'_>,
    ) -> Result<Next, Refused> {
        self.pass(frame, parts)?;
        let Doing::Using(using) = &mut self.doing else {
            return Ok(Next::Locomotion);
        };
        if using.leaves() {
            return Ok(Next::Locomotion);
        }
        let held = self
            .hand
            .as_ref()
            .is_some_and(|hand| hand.instance == using.instance);
        if !held && !using.is_skill() {
            let there = using.there(scene, &self.world.holder)?;
            using.follow(scene, there, frame, parts)?;
        }
        if using.approaches() && !using.approach(scene, frame, parts)? {
            return Ok(Next::Locomotion);
        }
        let next = using.next(scene, frame, (self.hand.as_ref(), self.waiting.as_ref()), parts);
        self.turn_in_hand();
        next
    }

    /// Has the object in the hand turn to its final place, once the motion to there is made.
    pub(in crate::live::behaviour) fn turn_in_hand(&mut self) {
        if let (Some(hand), Doing::Using(using)) = (&mut self.hand, &self.doing)
            && let Some(rest) = using.rest()
        {
            hand.comes_to_rest(rest);
        }
    }
}

impl Using {
    /// The object, if it is in the scene and not another character's.
    fn there<'a>(&self, scene: &'a ScaledScene, own: &Holder) -> Result<&'a Arc<Instance>, Refused> {
        let there = scene.instance(&self.instance).ok_or_else(|| Refused {
            reason: FailReason::Removed,
            message: format!("object {:?} was removed from the scene", self.instance),
        })?;
        match &there.state {
            State::Reserved(by) | State::Held(by) if by != own => Err(Refused {
                reason: FailReason::Taken,
                message: format!("object {:?} is taken by {by}", self.instance),
            }),
            _ => Ok(there),
        }
    }

    /// Follows an object that has moved: redirects the approach, or has the motion to its keyframes
    /// made again.
    fn follow(
        &mut self,
        scene: &ScaledScene,
        there: &Instance,
        frame: i64,
        parts: &CharacterParts<'_>,
    ) -> Result<(), Refused> {
        let object = scene.place_of(there);
        if !has_moved(self.object, object) {
            return Ok(());
        }
        if self.approaches() {
            let root = parts.timeline.buffer().root(frame);
            let entry = self.align(scene, object, root, parts);
            if let Some(approach) = &mut self.approach {
                approach.redirect(entry);
            }
            return Ok(());
        }
        if self.awaits_motion_that_follows() {
            // Its frames are known only when it arrives.
            return Ok(());
        }
        let moved = |how: &str| Refused {
            reason: FailReason::Moved,
            message: format!("object {:?} was moved {how}", self.instance),
        };
        let Some(key) = self.follows() else {
            // A seated character cannot move along, nor can one that stands at a place the object
            // gave.
            if self.is_at_object() {
                return Err(moved("while it was used"));
            }
            self.object = object;
            return Ok(());
        };
        if self.object.position.distance(object.position) > FOLLOW_M {
            let metres = FOLLOW_M * scene.scale();
            return Err(moved(&format!("by more than {metres:.1} m while it was used")));
        }
        if key - (frame + parts.timeline.look_ahead()) < REPLAN_LEFT_FRAMES {
            return Err(moved("too late to follow it"));
        }
        self.interaction.on(Input::Again, &mut self.outputs);
        // If the set before is under way too, the next check has it made again as well.
        if self.follows().is_none() {
            self.object = object;
        }
        Ok(())
    }

    /// Goes a frame further on the way to the object. Answers whether the first set may begin.
    fn approach(
        &mut self,
        scene: &ScaledScene,
        frame: i64,
        parts: &mut CharacterParts<'_>,
    ) -> Result<bool, Refused> {
        self.look(scene, frame, parts)?;
        let at = parts.timeline.soonest(frame);
        let here = Here {
            frame: at,
            root: parts.root(at),
            velocity: parts.velocity(at, VELOCITY_FRAMES as i64),
        };
        let Some(approach) = &mut self.approach else {
            return Ok(true);
        };
        match approach.step(&here) {
            Going::On => Ok(false),
            Going::Command {
                command,
                replan,
                stand_at,
            } => {
                parts.locomotion.set_command(frame as u64, command);
                if let Some(place) = stand_at {
                    parts.locomotion.stand_at(place);
                }
                if replan {
                    parts.timeline.command_changed();
                }
                Ok(false)
            }
            Going::HandOver => {
                // A plan on its way is awaited: it arrives within the look-ahead.
                if parts.timeline.is_free() {
                    self.interaction.on(Input::Arrived, &mut self.outputs);
                    let anywhere = self
                        .approach
                        .take()
                        .is_some_and(|approach| approach.entry().anywhere);
                    if let Some(there) = scene.instance(&self.instance).filter(|_| anywhere) {
                        // The character may have come to stand on another side than it was on.
                        self.align(scene, scene.place_of(there), here.root.position, parts);
                    }
                }
                Ok(!self.approaches())
            }
            Going::TimedOut => Err(Refused {
                reason: FailReason::NotReached,
                message: format!("object {:?} was not reached in time", self.instance),
            }),
        }
    }

    /// Checks whether something has come in the way.
    fn look(&mut self, scene: &ScaledScene, frame: i64, parts: &CharacterParts<'_>) -> Result<(), Refused> {
        let (revision, looked_at) = self.looked;
        if scene.revision() == revision || frame - looked_at < LOOK_FRAMES {
            return Ok(());
        }
        self.looked = (scene.revision(), frame);
        let root = parts.timeline.buffer().root(frame);
        match self.blocked(scene, root, parts.post.footing.level()) {
            None => Ok(()),
            Some(by) => Err(Refused {
                reason: FailReason::Blocked,
                message: format!("the way to object {:?} is blocked by {by}", self.instance),
            }),
        }
    }

    /// What the motion that comes next calls for. `waiting` is the command after it.
    fn next(
        &mut self,
        scene: &ScaledScene,
        frame: i64,
        (hand, waiting): (Option<&Hand>, Option<&Intent>),
        parts: &mut CharacterParts<'_>,
    ) -> Result<Next, Refused> {
        if self.interaction.now().is_some() {
            parts.hold(frame);
        }
        if !parts.timeline.is_free() {
            return Ok(Next::Wait);
        }
        let (look_ahead, ahead) = (parts.timeline.look_ahead(), parts.timeline.ahead());
        match self.interaction.want() {
            None => Ok(Next::Wait),
            Some(Want::Leave(from)) if from > frame + look_ahead => Ok(Next::Wait),
            Some(Want::Leave(from)) => {
                let at = from.max(frame + look_ahead);
                self.interaction.on(Input::Leaving(at), &mut self.outputs);
                let command = match waiting {
                    Some(Intent::Locomote(command)) => command.clone(),
                    _ => parts.standing(),
                };
                parts.move_on(frame, command, false);
                Ok(Next::Locomotion)
            }
            Some(Want::Set { from: Some(from), .. }) if from > frame + ahead => Ok(Next::Wait),
            Some(Want::Set { set, from }) => {
                let splice = match from {
                    Some(from) => from.max(frame + look_ahead),
                    None => parts.timeline.soonest(frame),
                };
                self.begin_set(scene, set, splice, hand, parts)
            }
        }
    }

    /// Makes the motion of a set, or says what to ask the networks for.
    fn begin_set(
        &mut self,
        scene: &ScaledScene,
        set: usize,
        splice: i64,
        hand: Option<&Hand>,
        parts: &mut CharacterParts<'_>,
    ) -> Result<Next, Refused> {
        if let Some(there) = scene.instance(&self.instance) {
            self.object = scene.place_of(there);
        }
        let still = self.interaction.now().is_some_and(|(now, _)| splice >= now.key);
        let prepared = self.prepare(scene, set, splice, hand, parts)?;
        let definition = Arc::clone(self.definition());
        let Some(set) = definition.sets.get(set) else {
            return Ok(Next::Wait);
        };
        let is_stance = prepared.is_stance(set, parts);
        let farthest_m = if is_stance { FARTHEST_M.0 } else { FARTHEST_M.1 };
        prepared.check_way(set, farthest_m, scene.scale(), parts)?;
        if is_stance {
            let key = prepared.write(set, still, parts);
            parts.renew_footing(splice, scene);
            self.made(prepared, Vec::new(), splice, key);
            self.rest_arm(parts);
            parts.hold(splice);
            return Ok(Next::Wait);
        }
        let first = self.interaction.now().is_none();
        let plan = prepared.plan(set, still, first, parts);
        self.asked = Some(Asked {
            number: None,
            prepared,
        });
        Ok(Next::Ask(Box::new(plan)))
    }
}
