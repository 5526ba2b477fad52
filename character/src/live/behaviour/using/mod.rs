//! Using an object: the approach, the sets one after another, and what happens in them.

mod settle;

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use troupe_motion::Vec3;

use super::super::{Activity, FailReason, REACH_LEAD_FRAMES};
use super::CharacterParts;
use super::hand::Refused;
use super::sets::Prepared;
use crate::object::{Definition, Hold, Origin, Set};
use crate::primitives::object::{Approach, Entry, Input, Interaction, Key, KeyframeError, Output, Stretch};
use crate::scene::{Instance, ScaledScene, Transform};

/// This many failed plans in a row end an interaction.
const MAX_FAILURES: u32 = 3;

/// One use of an object.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Using {
    pub(super) instance: Arc<str>,
    pub(super) interaction: Interaction,
    /// The object's place when the newest motion was made.
    pub(super) object: Transform,
    /// Index of the approach that the command names.
    pub(super) wanted_approach: Option<usize>,
    /// Index of the approach that is taken, and the side that it comes from, radians.
    pub(super) approach_index: Option<usize>,
    pub(super) side: f32,
    /// The way to the object; none on the way out.
    pub(super) approach: Option<Approach>,
    /// Revision of the scene and frame of the last check for obstacles.
    looked: (u64, i64),
    /// The plan that is on its way.
    asked: Option<Asked>,
    failures: u32,
    /// The motion of the current set, and of one that takes over later.
    pub(super) made: Vec<Made>,
    pub(super) outputs: Vec<Output>,
}

/// A plan on its way.
#[derive(Debug, Serialize, Deserialize)]
struct Asked {
    /// None until the timeline has given it a number.
    number: Option<u64>,
    prepared: Prepared,
}

/// The finished motion of a set.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Made {
    pub(super) stretch: Stretch,
    pub(super) keys: Vec<Key>,
    /// Height of the ground at the keyframes, metres.
    pub(super) ground: f32,
    /// How far the plan was off before it was pinned to them.
    pub(super) off: Vec<KeyframeError>,
    /// Where an object that is put down at the last keyframe comes to rest, in the frame of
    /// reference of the joint that holds it.
    rest: Option<Transform>,
}

impl Using {
    /// A use that begins at `frame` with the approach, for a character whose root is at `root`.
    pub(super) fn new(
        instance: &Instance,
        interaction: Interaction,
        wanted_approach: Option<usize>,
        (scene, root): (&ScaledScene, Vec3),
        frame: i64,
        parts: &CharacterParts<'_>,
    ) -> Self {
        let mut using = Self::idle(Arc::clone(&instance.id), interaction, wanted_approach);
        let entry = using.align(scene, scene.place_of(instance), root, parts);
        let style = Arc::clone(&parts.locomotion.command().style);
        using.approach = Some(Approach::new(entry, style, frame));
        using
    }

    /// A use that begins where the character comes to stand: of an object in the hand, or of none.
    pub(super) fn where_it_stands(
        instance: Arc<str>,
        interaction: Interaction,
        frame: i64,
        parts: &CharacterParts<'_>,
    ) -> Self {
        let mut using = Self::idle(instance, interaction, None);
        let entry = Entry {
            key: parts.root(frame),
            via: None,
            from_stand: true,
            anywhere: true,
        };
        let style = Arc::clone(&parts.locomotion.command().style);
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

    /// Whether it is a skill, which has no object.
    pub(super) fn is_skill(&self) -> bool {
        self.definition().is_skill
    }

    pub(super) fn definition(&self) -> &Arc<Definition> {
        self.interaction.definition()
    }

    /// The set with this index in the definition.
    pub(super) fn set(&self, index: usize) -> Option<&Set> {
        self.definition().sets.get(index)
    }

    pub(super) fn set_name(&self, index: usize) -> String {
        self.set(index).map(|set| set.name.clone()).unwrap_or_default()
    }

    pub(super) fn approaches(&self) -> bool {
        self.interaction.approaches()
    }

    /// Whether a set moves the character, and not locomotion.
    pub(super) fn in_sets(&self) -> bool {
        !self.approaches() && !self.leaves()
    }

    /// An arm that carried something changes over to the newest motion, and meets its first
    /// keyframe.
    pub(super) fn rest_arm(&self, parts: &mut CharacterParts<'_>) {
        if let Some(Made { stretch, keys, .. }) = self.made.last() {
            let others = keys.len().saturating_sub(1) as i64;
            parts
                .post
                .carry
                .rest(stretch.from, stretch.key - others - stretch.from);
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

    /// Adds the joints with points of the scene, and joint 0 if the hips rest on the object, from
    /// [`REACH_LEAD_FRAMES`] before their keyframe to the end of its set.
    pub(super) fn reaches(&self, frame: i64, into: &mut Vec<usize>) {
        if self.leaves() {
            return;
        }
        for (nth, made) in self.made.iter().enumerate() {
            let Made { stretch, keys, .. } = made;
            let of_scene = |set: &Set| set.origin == Origin::Object || made.rest.is_some();
            let first = stretch.key + 1 - keys.len() as i64;
            let end = (self.made.get(nth + 1)).map_or(i64::MAX, |next| next.stretch.from);
            let is_on = (first - REACH_LEAD_FRAMES..=end).contains(&frame);
            let set = self.set(stretch.set).filter(|_| is_on);
            if let Some(set) = set.filter(|set| of_scene(set)) {
                let points = keys.iter().flat_map(|key| &key.points);
                let hips = set.rests().then_some(0);
                for joint in points.map(|&(joint, _)| joint).chain(hips) {
                    if !into.contains(&joint) {
                        into.push(joint);
                    }
                }
            }
        }
    }

    /// Ends what is held, because a command asks for that.
    pub(super) fn end(&mut self) {
        self.interaction.on(Input::End, &mut self.outputs);
    }

    /// Notes the number of the plan that was asked for last.
    pub(super) fn asked(&mut self, number: u64) {
        if let Some(asked) = &mut self.asked {
            asked.number = Some(number);
        }
    }

    fn take_asked(&mut self, number: u64) -> Option<Prepared> {
        let asked = self.asked.take_if(|asked| asked.number == Some(number))?;
        Some(asked.prepared)
    }

    /// A plan took over. Its frames go from the first of the pair to its last keyframe, the second.
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

    /// The frame at which the object in the hand is put down, and its place in the joint's frame of
    /// reference then. `None` until that is known.
    pub(super) fn rest(&self) -> Option<(i64, Transform)> {
        let made = self.made.last()?;
        Some((made.stretch.key, made.rest?))
    }

    /// A plan will not arrive. Returns the failure if asking again is no use.
    pub(super) fn lost(&mut self, number: u64) -> Option<Refused> {
        self.take_asked(number)?;
        self.failures += 1;
        (self.failures >= MAX_FAILURES).then(|| Refused {
            reason: FailReason::NoPlan,
            message: format!("{} plans failed in a row", self.failures),
        })
    }

    /// Whether motion that follows the object is under way: the frame of its last keyframe.
    fn follows(&self) -> Option<i64> {
        let from_object = |set: usize| self.set(set).is_some_and(|set| set.origin == Origin::Object);
        let next = self.interaction.next().filter(|next| from_object(next.set));
        let now = self.interaction.now();
        let now = now.filter(|(now, reached)| !reached && from_object(now.set));
        next.or(now.map(|(now, _)| now)).map(|stretch| stretch.key)
    }

    /// Whether the keyframe of a set whose origin is the object has been reached.
    fn is_at_object(&self) -> bool {
        let now = self.interaction.now();
        now.is_some_and(|(now, _)| self.set(now.set).is_some_and(|set| set.origin == Origin::Object))
    }

    /// Whether the plan on its way follows the object.
    fn awaits_motion_that_follows(&self) -> bool {
        let set = self.asked.as_ref().and_then(|asked| self.set(asked.prepared.set));
        set.is_some_and(|set| set.origin == Origin::Object)
    }
}
