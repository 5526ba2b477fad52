//! Using an object: the approach, the sets one after the other, and what happens in them.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use troupe_motion::Vec3;
use troupe_motion::rotation::angle_between;

use super::super::{Activity, FailReason, Intent};
use super::hand::{Hand, Refused};
use super::sets::Prepared;
use super::{Behaviour, Body, Doing, Next};
use crate::object::{Definition, Hold, Origin, Set};
use crate::primitives::object::recipe::REPLAN_LEFT_FRAMES;
use crate::primitives::object::{
    Approach, Entry, Going, Here, Input, Interaction, Key, KeyframeError, Output, Stretch, Want,
};
use crate::primitives::recipe::VELOCITY_FRAMES;
use crate::scene::{Instance, Scene, State, Transform};

/// An object that moves by more than this has moved: metres and radians.
const MOVED: (f32, f32) = (0.02, 0.035);
/// One that is moved farther than this while it is used is not followed, metres: motions to its
/// keyframes are short.
const FOLLOW_M: f32 = 0.5;
/// A keyframe that is farther from where its motion starts than this is not gone to, metres:
/// without the networks, and with them. A step and a stretch, and two seconds of a quick walk.
const FARTHEST_M: (f32, f32) = (1.2, 4.0);
/// Plans that may fail one after the other.
const MAX_FAILURES: u32 = 3;
/// Frames between looks for what has come in the way.
const LOOK_FRAMES: i64 = 10;

/// One use of an object.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Using {
    pub(super) instance: Arc<str>,
    pub(super) interaction: Interaction,
    /// Where the object is for the motion that was made last.
    pub(super) object: Transform,
    /// Index of the approach that was asked for.
    pub(super) wanted_approach: Option<usize>,
    /// Index of the approach that is taken, and the side that it is from, radians.
    pub(super) approach_index: Option<usize>,
    pub(super) side: f32,
    /// The way to the object; none on the way out.
    pub(super) approach: Option<Approach>,
    /// The scene as it was when it was last looked for what is in the way, and the frame.
    looked: (u64, i64),
    /// The plan that was asked for.
    asked: Option<Asked>,
    failures: u32,
    /// The motion of the set that it is in, and of the one that takes over later.
    pub(super) made: Vec<Made>,
    pub(super) outputs: Vec<Output>,
}

/// A plan on its way.
#[derive(Debug, Serialize, Deserialize)]
struct Asked {
    /// Its number, once it is known.
    number: Option<u64>,
    prepared: Prepared,
}

/// The motion of a set, made.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Made {
    pub(super) stretch: Stretch,
    pub(super) keys: Vec<Key>,
    /// Height of the ground at the keyframes, metres.
    pub(super) ground: f32,
    /// How far off it was before it was drawn to them.
    pub(super) off: Vec<KeyframeError>,
    /// Where what is put down at the last of them comes to rest, in the frame of the joint that
    /// holds it.
    rest: Option<Transform>,
}

impl Using {
    /// A use that begins at `frame` with the approach, for a character whose root is at `root`.
    pub(super) fn new(
        instance: &Instance,
        interaction: Interaction,
        wanted_approach: Option<usize>,
        (scene, root): (&Scene, Vec3),
        frame: i64,
        body: &Body<'_>,
    ) -> Self {
        let mut using = Self::idle(Arc::clone(&instance.id), interaction, wanted_approach);
        let entry = using.align(scene, instance.transform, root, body);
        let style = Arc::clone(&body.locomotion.command().style);
        using.approach = Some(Approach::new(entry, style, frame));
        using
    }

    /// A use that begins once the character stands, wherever that is: of an object in the hand, or
    /// of none.
    pub(super) fn where_it_stands(
        instance: Arc<str>,
        interaction: Interaction,
        frame: i64,
        body: &Body<'_>,
    ) -> Self {
        let mut using = Self::idle(instance, interaction, None);
        let entry = Entry {
            key: body.root(frame),
            via: None,
            from_stand: true,
            anywhere: true,
        };
        let style = Arc::clone(&body.locomotion.command().style);
        using.approach = Some(Approach::new(entry, style, frame));
        using
    }

    fn idle(instance: Arc<str>, interaction: Interaction, wanted_approach: Option<usize>) -> Self {
        Self {
            instance,
            interaction,
            object: Transform::IDENTITY,
            wanted_approach,
            approach_index: None,
            side: 0.0,
            approach: None,
            looked: (0, 0),
            asked: None,
            failures: 0,
            made: Vec::new(),
            outputs: Vec::new(),
        }
    }

    pub(super) fn instance(&self) -> &Arc<str> {
        &self.instance
    }

    /// Whether it is a skill: it has no object.
    pub(super) fn is_skill(&self) -> bool {
        self.definition().is_skill
    }

    pub(super) fn definition(&self) -> &Arc<Definition> {
        self.interaction.definition()
    }

    /// The set of this index in the definition.
    pub(super) fn set(&self, index: usize) -> Option<&Set> {
        self.definition().sets.get(index)
    }

    pub(super) fn set_name(&self, index: usize) -> String {
        self.set(index).map(|set| set.name.clone()).unwrap_or_default()
    }

    pub(super) fn approaches(&self) -> bool {
        self.interaction.approaches()
    }

    /// Whether the motion is that of a set, not of locomotion.
    pub(super) fn in_sets(&self) -> bool {
        !self.approaches() && !self.leaves()
    }

    /// An arm that carried something goes over to the motion that was made last, and meets its
    /// first keyframe.
    pub(super) fn rest_arm(&self, body: &mut Body<'_>) {
        if let Some(Made { stretch, keys, .. }) = self.made.last() {
            let others = keys.len().saturating_sub(1) as i64;
            body.carry.rest(stretch.from, stretch.key - others - stretch.from);
        }
    }

    /// Locomotion takes over, or has.
    pub(super) fn leaves(&self) -> bool {
        self.interaction.leaves()
    }

    pub(super) fn approach_name(&self) -> Option<String> {
        let approach = self.definition().approaches.get(self.approach_index?)?;
        Some(approach.name.clone())
    }

    pub(super) fn activity(&self) -> Activity {
        let instance = Arc::clone(&self.instance);
        match self.interaction.now() {
            None => Activity::Approaching { instance },
            Some((stretch, reached)) => {
                let set = self.set_name(stretch.set);
                let holds = self
                    .set(stretch.set)
                    .is_some_and(|set| set.hold != Hold::Frames(0));
                match reached && holds {
                    true => Activity::Held { instance, set },
                    false => Activity::Interacting { instance, set },
                }
            }
        }
    }

    /// A command ends what is held.
    pub(super) fn end(&mut self) {
        self.interaction.on(Input::End, &mut self.outputs);
    }

    /// The plan that was asked for last has this number.
    pub(super) fn asked(&mut self, number: u64) {
        if let Some(asked) = &mut self.asked {
            asked.number = Some(number);
        }
    }

    fn take_asked(&mut self, number: u64) -> Option<Prepared> {
        let asked = self.asked.take_if(|asked| asked.number == Some(number))?;
        Some(asked.prepared)
    }

    /// A plan took over, and goes from the first of these frames on to its last keyframe at the
    /// other.
    pub(super) fn landed(&mut self, number: u64, off: &[KeyframeError], (from, key): (i64, i64)) {
        let Some(prepared) = self.take_asked(number) else {
            return;
        };
        self.failures = 0;
        self.made(prepared, off.to_vec(), from, key);
    }

    fn made(&mut self, prepared: Prepared, off: Vec<KeyframeError>, from: i64, key: i64) {
        let set = prepared.set;
        self.interaction
            .on(Input::Planned { from, key }, &mut self.outputs);
        let kept = self.interaction.now().map(|(now, _)| now);
        self.made.retain(|made| Some(made.stretch) == kept);
        self.made.push(Made {
            stretch: Stretch { set, from, key },
            keys: prepared.keys,
            ground: prepared.ground,
            off,
            rest: prepared.rest,
        });
    }

    /// The frame at which the object in the hand is put down, and where it is then in the joint's
    /// frame, once that is known.
    pub(super) fn rest(&self) -> Option<(i64, Transform)> {
        let made = self.made.last()?;
        Some((made.stretch.key, made.rest?))
    }

    /// A plan will not come. Why it is no use to ask again, where it is none.
    pub(super) fn lost(&mut self, number: u64) -> Option<Refused> {
        self.take_asked(number)?;
        self.failures += 1;
        (self.failures >= MAX_FAILURES).then(|| Refused {
            reason: FailReason::NoPlan,
            message: format!("{} plans failed one after the other", self.failures),
        })
    }

    /// Motion that follows where the object is: whether any is under way, and its last keyframe.
    fn follows(&self) -> Option<i64> {
        let from_object = |set: usize| self.set(set).is_some_and(|set| set.origin == Origin::Object);
        let next = self.interaction.next().filter(|next| from_object(next.set));
        let now = self.interaction.now();
        let now = now.filter(|(now, reached)| !reached && from_object(now.set));
        next.or(now.map(|(now, _)| now)).map(|stretch| stretch.key)
    }

    /// Whether it is in a set that is given from the object, the keyframe of which was reached.
    fn is_at_object(&self) -> bool {
        let now = self.interaction.now();
        now.is_some_and(|(now, _)| self.set(now.set).is_some_and(|set| set.origin == Origin::Object))
    }

    /// Whether the plan that is on its way follows where the object is.
    fn awaits_motion_that_follows(&self) -> bool {
        let set = self.asked.as_ref().and_then(|asked| self.set(asked.prepared.set));
        set.is_some_and(|set| set.origin == Origin::Object)
    }
}

fn has_moved(from: Transform, to: Transform) -> bool {
    let (metres, radians) = MOVED;
    from.position.distance(to.position) > metres || angle_between(from.rotation, to.rotation) > radians
}

impl Behaviour {
    /// Carries out an interaction at the frame that the cursor is at.
    pub(super) fn settle_using(&mut self, scene: &Scene, frame: i64, body: &mut Body<'_>) -> Next {
        match self.go_on_using(scene, frame, body) {
            Ok(next) => next,
            Err(refused) => {
                self.fail(frame, body, refused);
                Next::Locomotion
            }
        }
    }

    fn go_on_using(&mut self, scene: &Scene, frame: i64, body: &mut Body<'_>) -> Result<Next, Refused> {
        self.pass(frame, body)?;
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
            using.follow(scene, there, frame, body)?;
        }
        if using.approaches() && !using.approach(scene, frame, body)? {
            return Ok(Next::Locomotion);
        }
        let next = using.next(scene, frame, (self.hand.as_ref(), self.waiting.as_ref()), body);
        self.turn_in_hand();
        next
    }

    /// Has what is in the hand turn to where it is put down, once the motion to it is made.
    pub(super) fn turn_in_hand(&mut self) {
        if let (Some(hand), Doing::Using(using)) = (&mut self.hand, &self.doing)
            && let Some(rest) = using.rest()
        {
            hand.comes_to_rest(rest);
        }
    }
}

impl Using {
    /// The object, where it is there and nobody else's.
    fn there<'a>(&self, scene: &'a Scene, own: &crate::scene::Holder) -> Result<&'a Arc<Instance>, Refused> {
        let there = scene.instance(&self.instance).ok_or_else(|| Refused {
            reason: FailReason::Removed,
            message: format!("object {:?} was taken out of the scene", self.instance),
        })?;
        match &there.state {
            State::Reserved(by) | State::Held(by) if by != own => Err(Refused {
                reason: FailReason::Taken,
                message: format!("object {:?} is taken by {by}", self.instance),
            }),
            _ => Ok(there),
        }
    }

    /// Follows the object, where it has moved: the approach leads elsewhere, or the motion to its
    /// keyframes is made again.
    fn follow(
        &mut self,
        scene: &Scene,
        there: &Instance,
        frame: i64,
        body: &Body<'_>,
    ) -> Result<(), Refused> {
        if !has_moved(self.object, there.transform) {
            return Ok(());
        }
        if self.approaches() {
            let root = body.timeline.buffer().root(frame);
            let entry = self.align(scene, there.transform, root, body);
            if let Some(approach) = &mut self.approach {
                approach.redirect(entry);
            }
            return Ok(());
        }
        if self.awaits_motion_that_follows() {
            // It is known when it comes which frames it has.
            return Ok(());
        }
        let moved = |how: &str| Refused {
            reason: FailReason::Moved,
            message: format!("object {:?} was moved {how}", self.instance),
        };
        let Some(key) = self.follows() else {
            // Who sits on it, or stands where it had it stand, cannot go with it.
            if self.is_at_object() {
                return Err(moved("while it was used"));
            }
            self.object = there.transform;
            return Ok(());
        };
        if self.object.position.distance(there.transform.position) > FOLLOW_M {
            return Err(moved(&format!("by more than {FOLLOW_M} m while it was used")));
        }
        if key - (frame + body.timeline.look_ahead()) < REPLAN_LEFT_FRAMES {
            return Err(moved("too late to follow it"));
        }
        self.interaction.on(Input::Again, &mut self.outputs);
        // Where the set before is under way too, the next look has it made again as well.
        if self.follows().is_none() {
            self.object = there.transform;
        }
        Ok(())
    }

    /// Goes a frame further on the way to the object; whether the first set may begin.
    fn approach(&mut self, scene: &Scene, frame: i64, body: &mut Body<'_>) -> Result<bool, Refused> {
        self.look(scene, frame, body)?;
        let at = body.timeline.soonest(frame);
        let here = Here {
            frame: at,
            root: body.root(at),
            velocity: body.velocity(at, VELOCITY_FRAMES as i64),
        };
        let Some(approach) = &mut self.approach else {
            return Ok(true);
        };
        match approach.step(&here) {
            Going::On => Ok(false),
            Going::Command {
                command,
                anew,
                stand_at,
            } => {
                body.locomotion.set_command(frame as u64, command);
                if let Some(place) = stand_at {
                    body.locomotion.stand_at(place);
                }
                if anew {
                    body.timeline.command_changed();
                }
                Ok(false)
            }
            Going::HandOver => {
                // A plan on its way is waited for: it comes within the look-ahead.
                if body.timeline.is_free() {
                    self.interaction.on(Input::Arrived, &mut self.outputs);
                    let anywhere = self
                        .approach
                        .take()
                        .is_some_and(|approach| approach.entry().anywhere);
                    if let Some(there) = scene.instance(&self.instance).filter(|_| anywhere) {
                        // It may have come to stand on another side than it was on.
                        self.align(scene, there.transform, here.root.position, body);
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

    /// Looks whether something has come in the way.
    fn look(&mut self, scene: &Scene, frame: i64, body: &Body<'_>) -> Result<(), Refused> {
        let (revision, looked_at) = self.looked;
        if scene.revision() == revision || frame - looked_at < LOOK_FRAMES {
            return Ok(());
        }
        self.looked = (scene.revision(), frame);
        let root = body.timeline.buffer().root(frame);
        match self.blocked(scene, root, body.footing.level()) {
            None => Ok(()),
            Some(by) => Err(Refused {
                reason: FailReason::Blocked,
                message: format!("the way to object {:?} is blocked by {by}", self.instance),
            }),
        }
    }

    /// What is to be done for the motion that comes next. `waiting` comes after it.
    fn next(
        &mut self,
        scene: &Scene,
        frame: i64,
        (hand, waiting): (Option<&Hand>, Option<&Intent>),
        body: &mut Body<'_>,
    ) -> Result<Next, Refused> {
        if self.interaction.now().is_some() {
            body.hold(frame);
        }
        if !body.timeline.is_free() {
            return Ok(Next::Wait);
        }
        let (look_ahead, ahead) = (body.timeline.look_ahead(), body.timeline.ahead());
        match self.interaction.want() {
            None => Ok(Next::Wait),
            Some(Want::Leave(from)) if from > frame + look_ahead => Ok(Next::Wait),
            Some(Want::Leave(from)) => {
                let at = from.max(frame + look_ahead);
                self.interaction.on(Input::Leaving(at), &mut self.outputs);
                let command = match waiting {
                    Some(Intent::Locomote(command)) => command.clone(),
                    _ => body.standing(),
                };
                body.move_on(frame, command, false);
                Ok(Next::Locomotion)
            }
            Some(Want::Set { from: Some(from), .. }) if from > frame + ahead => Ok(Next::Wait),
            Some(Want::Set { set, from }) => {
                let splice = match from {
                    Some(from) => from.max(frame + look_ahead),
                    None => body.timeline.soonest(frame),
                };
                self.begin_set(scene, set, splice, hand, body)
            }
        }
    }

    /// Makes the motion of a set, or says what to ask the networks for.
    fn begin_set(
        &mut self,
        scene: &Scene,
        set: usize,
        splice: i64,
        hand: Option<&Hand>,
        body: &mut Body<'_>,
    ) -> Result<Next, Refused> {
        if let Some(there) = scene.instance(&self.instance) {
            self.object = there.transform;
        }
        let still = self.interaction.now().is_some_and(|(now, _)| splice >= now.key);
        let prepared = self.prepare(scene, set, splice, hand, body)?;
        let definition = Arc::clone(self.definition());
        let Some(set) = definition.sets.get(set) else {
            return Ok(Next::Wait);
        };
        let is_stance = prepared.is_stance(set, body);
        prepared.check_way(set, if is_stance { FARTHEST_M.0 } else { FARTHEST_M.1 }, body)?;
        if is_stance {
            let key = prepared.write(set, still, body);
            body.renew_footing(splice, scene);
            self.made(prepared, Vec::new(), splice, key);
            self.rest_arm(body);
            body.hold(splice);
            return Ok(Next::Wait);
        }
        let first = self.interaction.now().is_none();
        let plan = prepared.plan(set, still, first, body);
        self.asked = Some(Asked {
            number: None,
            prepared,
        });
        Ok(Next::Ask(Box::new(plan)))
    }
}
