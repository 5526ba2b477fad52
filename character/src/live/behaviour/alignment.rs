//! From which side a character approaches an object, and whether the way there is free.

use std::f32::consts::PI;
use std::sync::Arc;

use troupe_motion::{GlobalRoot, Vec3};

use super::CharacterParts;
use super::footing::STEP_M;
use super::using::Using;
use crate::object::{Anchor, Motion, Origin, Set};
use crate::primitives::object::Entry;
use crate::scene::{ScaledScene, Surface, Transform};

/// Half the width and depth of the box that must fit along the way, metres.
const HALF_WIDTH_M: f32 = 0.15;
/// Upper end of that box over the ground, metres. Its lower end is above anything that a character
/// can step onto.
const HEAD_M: f32 = 1.6;
/// A shorter way counts as none, metres.
const STAYS_M: f32 = 0.05;
/// If the way is blocked, other sides are tried at this angle from each other, radians, to the left
/// and right alternately up to the far side.
const SIDE_STEP: f32 = PI / 12.0;
const SIDE_STEPS: i32 = 12;

impl Using {
    /// Chooses side and approach for an object at `object` and a character at `root`. Returns where
    /// that leads. It is the side that the character is on. If the way there is blocked and the
    /// object can be used from other sides, it is the nearest free one: a cup on a table is taken
    /// over the table's edge.
    pub(super) fn align(
        &mut self,
        scene: &ScaledScene,
        object: Transform,
        root: Vec3,
        parts: &CharacterParts<'_>,
    ) -> Entry {
        let natural = self.definition().side_of(object, root);
        let level = parts.post.footing.level();
        if !self.any_side() {
            return self.align_from(natural, object, parts);
        }
        let sides = (1..=SIDE_STEPS).flat_map(|step| [step, -step]);
        let sides = std::iter::once(0).chain(sides);
        for side in sides.map(|step| natural + step as f32 * SIDE_STEP) {
            let entry = self.align_from(side, object, parts);
            if self.blocked_to(&entry, scene, root, level).is_none() {
                return entry;
            }
        }
        self.align_from(natural, object, parts)
    }

    /// Whether the side that the character comes from makes a difference.
    fn any_side(&self) -> bool {
        let pivots = |set: &Set| set.keyframes.first().is_some_and(|key| key.pivot);
        !self.definition().approaches.is_empty() || self.interaction.coming().is_some_and(pivots)
    }

    fn align_from(&mut self, side: f32, object: Transform, parts: &CharacterParts<'_>) -> Entry {
        let definition = Arc::clone(self.definition());
        let choice = definition.approach_by(self.wanted_approach, side);
        (self.object, self.side, self.approach_index) = (object, choice.side, choice.index);
        let anchor = self.anchor(parts.post.footing.level());
        let start = choice.distance_m.map(|distance| anchor.start(distance));
        let here = parts.root(parts.timeline.frame());
        let set = self.interaction.coming();
        let from_object = set.filter(|set| set.origin == Origin::Object);
        let key = from_object.and_then(|set| set.keyframes.first());
        let key = key.map(|key| anchor.keyframe(key)).unwrap_or_default();
        let place = key.place.map(|[x, z]| Vec3::new(x, 0.0, z));
        let there = start.unwrap_or(here);
        Entry {
            key: GlobalRoot::new(
                place.unwrap_or(there.position),
                key.heading.unwrap_or(there.heading),
            ),
            via: place.and(start).map(|start| start.position),
            from_stand: set.is_some_and(stops),
            anywhere: place.is_none() && start.is_none(),
        }
    }

    /// The anchor of sets whose origin is the object.
    pub(super) fn anchor(&self, ground_y: f32) -> Anchor {
        self.definition().anchor(self.object, self.side, ground_y)
    }

    /// What stands in the way from `root`, on ground of height `level`, to the start of the first
    /// set.
    pub(super) fn blocked(&self, scene: &ScaledScene, root: Vec3, level: f32) -> Option<String> {
        self.blocked_to(self.approach.as_ref()?.entry(), scene, root, level)
    }

    fn blocked_to(&self, entry: &Entry, scene: &ScaledScene, root: Vec3, level: f32) -> Option<String> {
        if entry.anywhere {
            return None;
        }
        let mut from = root;
        [entry.via, Some(entry.key.position)]
            .into_iter()
            .flatten()
            .find_map(|to| {
                let way = std::mem::replace(&mut from, to);
                blocked(scene, way, to, level, self.instance())
            })
    }
}

/// Whether a character stops before it begins this set.
fn stops(set: &Set) -> bool {
    let low = set.keyframes.iter().filter(|key| key.from_ground);
    let low = low
        .filter_map(|key| key.height_m)
        .any(|height| height < set.low_hips_m);
    set.from_stand || set.motion == Some(Motion::Stance) || (low && set.motion.is_none())
}

/// What stands between `from` and `to` for a character on ground of height `level`, apart from the
/// object `own`.
fn blocked(scene: &ScaledScene, from: Vec3, to: Vec3, level: f32, own: &str) -> Option<String> {
    let (low, high) = (level + STEP_M + 0.05, level + HEAD_M);
    let sweep = (to - from).with_y(0.0);
    if sweep.length() < STAYS_M {
        return None;
    }
    let start = Transform::upright(from.with_y(0.5 * (low + high)), sweep.x.atan2(sweep.z));
    let half = Vec3::new(HALF_WIDTH_M, 0.5 * (high - low), HALF_WIDTH_M);
    scene
        .first_solid(start, half, sweep, Some(own))
        .map(|surface| match surface {
            Surface::Ground => "the ground".to_owned(),
            Surface::Collider(id) => format!("collider {id:?}"),
            Surface::Object(id) => format!("object {id:?}"),
        })
}
