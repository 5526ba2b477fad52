//! The motion of one set: its full keyframes, and the way to them, made by the networks or without.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use troupe_motion::Vec3;
use troupe_motion::ik::Posed;
use troupe_motion::root::wrap_angle;
use troupe_motion::stance::stance_transition;

use super::super::buffer::Frames;
use super::super::{FailReason, Pins};
use super::footing::{Support, support};
use super::hand::{Hand, Refused};
use super::using::Using;
use super::{CharacterParts, SetPlan, Wish};
use crate::object::{Action, Anchor, Moment, Origin, Set};
use crate::primitives::object::recipe::{IN_PLACE_M, STANDS_MPS, STOPPED_TURN};
use crate::primitives::object::{
    BodyParts, Key, Unreachable, Way, keys, stance_frames, suits_stance, targets,
};
use crate::primitives::recipe::VELOCITY_FRAMES;
use crate::scene::{ScaledScene, Transform};

/// An object may be put down this far below or above its keyframe, metres: the hand follows the
/// surface. Farther below, the object falls.
const PUT_DOWN_M: f32 = 0.4;
/// How near the object comes to the surface, metres, in at most this many rounds: a hand that moves
/// lower also turns.
const PUT_DOWN_NEAR_M: f32 = 0.003;
const PUT_DOWN_ROUNDS: usize = 4;

/// A set whose motion is about to be made.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Prepared {
    /// Index of the set in the definition.
    pub(super) set: usize,
    /// The frame that the motion starts from.
    splice: i64,
    /// The set's keyframes, with heights over the ground, metres.
    pub(super) keys: Vec<Key>,
    /// Height of the ground at the keyframes, metres.
    pub(super) ground: f32,
    /// Where an object that is put down at the last keyframe comes to rest, in the frame of
    /// reference of the joint that holds it.
    pub(super) rest: Option<Transform>,
}

impl Using {
    /// Works out the keyframes of a set for a character that comes from frame `splice`, with the
    /// object of `hand`.
    pub(super) fn prepare(
        &self,
        scene: &ScaledScene,
        index: usize,
        splice: i64,
        hand: Option<&Hand>,
        parts: &CharacterParts<'_>,
    ) -> Result<Prepared, Refused> {
        let Some(set) = self.set(index) else {
            return Err(Refused {
                reason: FailReason::Removed,
                message: format!("the definition has no set {index}"),
            });
        };
        let from = parts.flat(splice);
        let level = parts.post.footing.level();
        let anchor = |ground_y| match set.origin {
            Origin::Object => self.anchor(ground_y),
            Origin::Character => Anchor::of_character(parts.root(splice), ground_y),
        };
        let ground = ground_at(scene, set, &anchor(level), from.root, level);
        let style = &parts.locomotion.command().style;
        let body = BodyParts {
            skeleton: &parts.rig.skeleton,
            legs: parts.post.footing.legs(),
            standing: style.idle(),
        };
        let make = |set: &Set| keys(set, &anchor(ground), ground, &body, from);
        let keys = make(set);
        let keys = keys.map_err(|Unreachable { joint, short_m }| {
            let joint = parts
                .rig
                .skeleton
                .joints
                .get(joint)
                .map(|joint| joint.name.as_str());
            let short_m = short_m * scene.scale();
            Refused {
                reason: FailReason::OutOfReach,
                message: format!(
                    "set {:?}: {} cannot come nearer than {short_m:.2} m to its point",
                    set.name,
                    joint.unwrap_or("a joint")
                ),
            }
        })?;
        let hand = hand.filter(|hand| hand.instance == self.instance && puts_down(set));
        let (keys, rest) = match hand {
            Some(hand) => {
                let on_release = |key: &Key| {
                    let posed = Posed {
                        root: key.root + Vec3::Y * ground,
                        rotations: &key.rotations,
                    };
                    hand.on_release(scene, &parts.rig.skeleton, posed)
                };
                let lowered = hand.socket().and_then(|socket| {
                    onto_surface(set, socket.joint, &keys, on_release, |set| make(set).ok())
                });
                lowered.map_or((keys, None), |(keys, rest)| (keys, Some(rest)))
            }
            None => (keys, None),
        };
        Ok(Prepared {
            set: index,
            splice,
            keys,
            ground,
            rest,
        })
    }
}

fn puts_down(set: &Set) -> bool {
    let mut events = set.events.iter();
    events.any(|event| event.action == Action::Release && event.at != Moment::Start)
}

/// The keyframes of a set that puts down what `joint` holds, with the joint's points raised or
/// lowered so that the object lands on the surface: a definition cannot know how high that is. Also
/// returns where the object then lies in the joint's frame of reference. `None` if the joint has no
/// point, or the surface is too far or out of reach: then the object falls.
fn onto_surface(
    set: &Set,
    joint: usize,
    keys: &[Key],
    on_release: impl Fn(&Key) -> Option<(f32, Transform)>,
    make: impl Fn(&Set) -> Option<Vec<Key>>,
) -> Option<(Vec<Key>, Transform)> {
    let (mut set, mut moved, mut lifted) = (set.clone(), keys.to_vec(), 0.0);
    for _ in 0..PUT_DOWN_ROUNDS {
        let (lift, _) = on_release(moved.last()?)?;
        if lift.abs() < PUT_DOWN_NEAR_M {
            break;
        }
        lifted += lift;
        let points = set.keyframes.iter_mut().flat_map(|key| &mut key.points);
        let mut points = points.filter(|point| point.joint == joint).peekable();
        if points.peek().is_none() || lifted.abs() > PUT_DOWN_M {
            return None;
        }
        points.for_each(|point| point.position_m.y += lift);
        moved = make(&set)?;
    }
    let (_, rest) = on_release(moved.last()?)?;
    Some((moved, rest))
}

/// Height of what the character stands on at the last keyframe of `set`: what is under its root,
/// unless the hips are low. A seated character keeps its feet on the ground where it stood, at
/// height `level`.
fn ground_at(scene: &ScaledScene, set: &Set, anchor: &Anchor, from: Vec3, level: f32) -> f32 {
    let last = set
        .keyframes
        .last()
        .map(|key| anchor.keyframe(key))
        .unwrap_or_default();
    let place = last.place.map_or(from, |[x, z]| Vec3::new(x, 0.0, z));
    let low = last.height.is_some_and(|height| height - level < set.low_hips_m);
    match support(scene, place, level) {
        Support::At(height) if !low => height,
        _ => level,
    }
}

impl Prepared {
    /// Whether the motion is made without the networks.
    pub(super) fn is_stance(&self, set: &Set, parts: &CharacterParts<'_>) -> bool {
        suits_stance(set, &self.keys, parts.flat(self.splice)) || self.is_there(set, parts)
    }

    /// Refuses a keyframe that is more than `farthest_m` away, in words in metres of the scene, of
    /// which a metre has `scale`.
    pub(super) fn check_way(
        &self,
        set: &Set,
        farthest_m: f32,
        scale: f32,
        parts: &CharacterParts<'_>,
    ) -> Result<(), Refused> {
        let from = parts.flat(self.splice).root;
        let ways = self.keys.iter().map(|key| (key.root - from).with_y(0.0).length());
        let way = ways.fold(0.0, f32::max);
        match way <= farthest_m {
            true => Ok(()),
            false => Err(Refused {
                reason: FailReason::OutOfReach,
                message: format!(
                    "set {:?}: its keyframe is {:.1} m away; allowed: up to {:.1} m",
                    set.name,
                    way * scale,
                    farthest_m * scale
                ),
            }),
        }
    }

    /// Whether the character stopped for the set and stands at its keyframe, apart from a small
    /// step or turn. The networks fill so short a way with gestures: an arm goes up before the
    /// character sits down.
    fn is_there(&self, set: &Set, parts: &CharacterParts<'_>) -> bool {
        let (from, left_axis) = (parts.root(self.splice), parts.rig.skeleton.left_axis);
        let speed = parts.velocity(self.splice, VELOCITY_FRAMES as i64).length();
        let near = |key: &Key| {
            let to = key.global_root(left_axis);
            (to.position - from.position).with_y(0.0).length() < IN_PLACE_M
                && wrap_angle(to.heading - from.heading).abs() < STOPPED_TURN
        };
        set.from_stand && set.motion.is_none() && speed < STANDS_MPS && self.keys.iter().all(near)
    }

    /// What to ask the networks for. `first`: this is the interaction's first set.
    pub(super) fn plan(&self, set: &Set, still: bool, first: bool, parts: &CharacterParts<'_>) -> SetPlan {
        let way = Way {
            from: parts.root(self.splice),
            velocity: parts.velocity(self.splice, VELOCITY_FRAMES as i64),
            first,
        };
        SetPlan {
            wish: Wish {
                splice: self.splice,
                still,
            },
            targets: targets(set, &self.keys, parts.rig, &way),
            pins: Pins {
                keys: self.keys.clone(),
                settles: set.comes_to_rest(),
                legs: Arc::clone(parts.post.footing.legs()),
                fps: parts.rig.fps,
            },
        }
    }

    /// Writes the motion into the buffer without the networks. Returns the frame of its last
    /// keyframe.
    pub(super) fn write(&self, set: &Set, still: bool, parts: &mut CharacterParts<'_>) -> i64 {
        let skeleton = &parts.rig.skeleton;
        let Some((first, others)) = self.keys.split_first() else {
            return self.splice;
        };
        let from = parts.flat(self.splice);
        let (count, lean) = stance_frames(set, skeleton, from, first);
        let count = (count as usize).saturating_sub(others.len()).max(1);
        let legs = parts.post.footing.legs();
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
        parts.timeline.put(self.splice, frames, !still);
        parts.timeline.buffer().last()
    }
}
