//! The motion of one set: its keyframes in full, and the way to them, by the networks or without them.

use std::sync::Arc;

use troupe_motion::Vec3;
use troupe_motion::stance::stance_transition;

use super::super::buffer::Frames;
use super::super::{FailReason, Meets};
use super::footing::{Support, support};
use super::hand::Refused;
use super::using::Using;
use super::{Body, SetPlan, Wish};
use crate::object::{Anchor, Origin, Set};
use crate::primitives::object::recipe::LOW_HIPS_M;
use crate::primitives::object::{
    BodyParts, Key, Unreachable, Way, keys, stance_frames, suits_stance, targets,
};
use crate::primitives::recipe::VELOCITY_FRAMES;
use crate::scene::Scene;

/// A set whose motion is to be made.
#[derive(Debug)]
pub(super) struct Prepared {
    /// Index of the set in the definition.
    pub(super) set: usize,
    /// The frame that the motion starts from.
    splice: i64,
    /// Its keyframes, with heights over the ground.
    pub(super) keys: Vec<Key>,
    /// Height of the ground at the keyframes, metres.
    pub(super) ground: f32,
}

impl Using {
    /// Works out the keyframes of a set for a character that comes from frame `splice`.
    pub(super) fn prepare(
        &self,
        scene: &Scene,
        index: usize,
        splice: i64,
        body: &Body<'_>,
    ) -> Result<Prepared, Refused> {
        let Some(set) = self.set(index) else {
            return Err(Refused {
                reason: FailReason::Removed,
                message: format!("the definition has no set {index}"),
            });
        };
        let from = body.flat(splice);
        let level = body.footing.level();
        let anchor = |ground_y| match set.origin {
            Origin::Object => self.anchor(ground_y),
            Origin::Character => Anchor::of_character(body.root(splice), ground_y),
        };
        let ground = ground_at(scene, set, &anchor(level), from.root, level);
        let style = &body.locomotion.command().style;
        let parts = BodyParts {
            skeleton: &body.pack.skeleton,
            legs: body.footing.legs(),
            standing: style.idle(),
        };
        let keys = keys(set, &anchor(ground), ground, &parts, from);
        let keys = keys.map_err(|Unreachable { joint, short_m }| {
            let joint = body
                .pack
                .skeleton
                .joints
                .get(joint)
                .map(|joint| joint.name.as_str());
            Refused {
                reason: FailReason::OutOfReach,
                message: format!(
                    "set {:?}: {} stays {short_m:.2} m from its point",
                    set.name,
                    joint.unwrap_or("a joint")
                ),
            }
        })?;
        Ok(Prepared {
            set: index,
            splice,
            keys,
            ground,
        })
    }
}

/// Height of what the character stands on at the last keyframe of `set`: what is under its root, but where the hips are low.
/// One who sits keeps its feet on the ground that it stood on, at height `level`.
fn ground_at(scene: &Scene, set: &Set, anchor: &Anchor, from: Vec3, level: f32) -> f32 {
    let last = set
        .keyframes
        .last()
        .map(|key| anchor.keyframe(key))
        .unwrap_or_default();
    let place = last.place.map_or(from, |[x, z]| Vec3::new(x, 0.0, z));
    let low = last.height.is_some_and(|height| height - level < LOW_HIPS_M);
    match support(scene, place, level) {
        Support::At(height) if !low => height,
        _ => level,
    }
}

impl Prepared {
    /// Whether the motion is made without the networks.
    pub(super) fn is_stance(&self, set: &Set, body: &Body<'_>) -> bool {
        suits_stance(set, &self.keys, body.flat(self.splice))
    }

    /// What to ask the networks for. `first`: it is the first set.
    pub(super) fn plan(&self, set: &Set, still: bool, first: bool, body: &Body<'_>) -> SetPlan {
        let way = Way {
            from: body.root(self.splice),
            velocity: body.speed(self.splice, VELOCITY_FRAMES as i64),
            first,
        };
        SetPlan {
            wish: Wish {
                splice: self.splice,
                still,
            },
            targets: targets(set, &self.keys, body.pack, &way),
            meets: Meets {
                keys: self.keys.clone(),
                settles: set.comes_to_rest(),
                legs: Arc::clone(body.footing.legs()),
            },
        }
    }

    /// Writes the motion into the buffer without the networks; the frame of its last keyframe.
    pub(super) fn write(&self, set: &Set, still: bool, body: &mut Body<'_>) -> i64 {
        let skeleton = &body.pack.skeleton;
        let Some((first, others)) = self.keys.split_first() else {
            return self.splice;
        };
        let from = body.flat(self.splice);
        let (count, lean) = stance_frames(set, skeleton, from, first);
        let count = (count as usize).saturating_sub(others.len()).max(1);
        let legs = body.footing.legs();
        let mut motion = stance_transition(skeleton, legs, from, first.posed(), count, lean);
        for key in others {
            motion.roots.push(key.root);
            motion.rotations.extend_from_slice(&key.rotations);
            motion
                .contacts
                .push(motion.contacts.last().copied().unwrap_or_default());
        }
        let frames = Frames {
            roots: &motion.roots,
            rotations: &motion.rotations,
            contacts: &motion.contacts,
        };
        body.timeline.put(self.splice, frames, !still);
        body.timeline.buffer().last()
    }
}
