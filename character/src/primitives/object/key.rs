//! Works out full keyframes, and what to ask the networks for to meet them.

use serde::{Deserialize, Serialize};
use troupe_motion::fk::joint_transform;
use troupe_motion::ik::{Leg, Posed, ReachOptions, legs, pose_at, reach_pose};
use troupe_motion::root::{heading_of, wrap_angle};
use troupe_motion::rotation::yaw;
use troupe_motion::{GlobalRoot, Quat, Skeleton, Vec3};

use super::recipe::{
    FEET_STAY, FIRST_TOKENS, LEAN_M, LEAST_PLAN_FRAMES, LOW_FRAMES, LOW_STANCE, NEXT_TOKENS, NO_STEP_M,
    REACHED_M, SLOWEST, SPARE_TOKENS, STANCE_FRAMES, STAYS_M, STEP_FRAMES, TURN_RPS,
};
use crate::object::{Anchor, Motion, Set, WorldKeyframe};
use crate::primitives::{CONTEXT_FRAMES, PlanTargets, TargetKey};
use crate::style::StyleKey;
use troupe_motion::model::{Dims, Rig};

/// How near the hips come to a keyframe's place, metres, in at most this many rounds.
const PLACED_M: f32 = 0.002;
const PLACE_ROUNDS: usize = 6;

/// The parts of a character's body that keyframes need.
#[derive(Debug, Clone, Copy)]
pub struct BodyParts<'a> {
    /// The pack's skeleton.
    pub skeleton: &'a Skeleton,
    /// The legs of that skeleton, in its order.
    pub legs: &'a [Leg],
    /// The standing pose, which completes what a keyframe leaves out.
    pub standing: &'a StyleKey,
}

/// A full keyframe. Heights count from what the character stands on there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Key {
    /// Position of the root joint, metres.
    pub root: Vec3,
    /// The pose: joint 0 in the world, others relative to their parents.
    pub rotations: Vec<Quat>,
    /// The joints that the keyframe has points for, with their positions in metres.
    pub points: Vec<(usize, Vec3)>,
}

/// Distance of a motion from a keyframe.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct KeyframeError {
    /// Of the root joint, metres.
    pub root_m: f32,
    /// Of the heading, radians.
    pub heading: f32,
    /// Of the farthest joint, metres.
    pub joint_m: f32,
}

/// A point that no pose reaches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unreachable {
    /// Index of the joint in the skeleton.
    pub joint: usize,
    /// Remaining distance to the point, metres.
    pub short_m: f32,
}

impl Key {
    /// The root with the heading of the pose.
    pub fn global_root(&self, left_axis: Vec3) -> GlobalRoot {
        let pelvis = self.rotations.first().copied().unwrap_or_default();
        GlobalRoot::of_pose(self.root, pelvis, left_axis)
    }

    /// The keyframe as one frame of a motion.
    pub fn posed(&self) -> Posed<'_> {
        Posed {
            root: self.root,
            rotations: &self.rotations,
        }
    }

    /// Distance of `frame` from the keyframe.
    pub fn error(&self, skeleton: &Skeleton, frame: Posed<'_>) -> KeyframeError {
        let heading =
            |pose: &[Quat]| heading_of(pose.first().copied().unwrap_or_default(), skeleton.left_axis);
        KeyframeError {
            root_m: frame.root.distance(self.root),
            heading: wrap_angle(heading(frame.rotations) - heading(&self.rotations)).abs(),
            joint_m: farthest(skeleton, self.posed(), frame),
        }
    }
}

/// Largest distance of a joint between two frames, metres.
fn farthest(skeleton: &Skeleton, a: Posed<'_>, b: Posed<'_>) -> f32 {
    let place = |frame: Posed<'_>, joint| joint_transform(skeleton, frame.root, frame.rotations, joint).0;
    (0..skeleton.joint_count())
        .map(|joint| place(a, joint).distance(place(b, joint)))
        .fold(0.0, f32::max)
}

/// Frames that the steps between two poses take; the feet step one after the other.
fn stepping_frames(skeleton: &Skeleton, a: Posed<'_>, b: Posed<'_>) -> f32 {
    let place =
        |posed: Posed<'_>, leg: &Leg| joint_transform(skeleton, posed.root, posed.rotations, leg.foot).0;
    legs(skeleton)
        .iter()
        .map(|leg| place(a, leg).distance(place(b, leg)))
        .filter(|&way| way > NO_STEP_M)
        .map(|way| STEP_FRAMES * way.sqrt())
        .sum()
}

/// The full keyframes of `set`, anchored by `anchor`. The character comes from the frame `from`,
/// whose root height counts from what it stands on, and stands at height `ground_y` in the world at
/// the keyframes. What a keyframe leaves out comes from the standing pose; place and heading come
/// from the keyframe before.
///
/// # Errors
/// [`Unreachable`] for the first point that is out of reach.
pub fn keys(
    set: &Set,
    anchor: &Anchor,
    ground_y: f32,
    body: &BodyParts<'_>,
    from: Posed<'_>,
) -> Result<Vec<Key>, Unreachable> {
    let pelvis = from.rotations.first().copied().unwrap_or_default();
    let mut before = GlobalRoot::of_pose(from.root, pelvis, body.skeleton.left_axis);
    let mut keys = Vec::with_capacity(set.keyframes.len());
    for keyframe in &set.keyframes {
        let world = anchor.keyframe(keyframe);
        let key = key(&world, keyframe.pose_scale, ground_y, body, before)?;
        before = key.global_root(body.skeleton.left_axis);
        keys.push(key);
    }
    Ok(keys)
}

fn key(
    given: &WorldKeyframe,
    pose_scale: Option<f32>,
    ground_y: f32,
    body: &BodyParts<'_>,
    before: GlobalRoot,
) -> Result<Key, Unreachable> {
    let height = given.height.map(|height| height - ground_y);
    let standing = GlobalRoot::new(before.position.with_y(body.standing.height_m), before.heading);
    let root = GlobalRoot {
        position: given
            .root_or(standing)
            .position
            .with_y(height.unwrap_or(body.standing.height_m)),
        ..given.root_or(standing)
    };
    let (root_m, rotations) = match &given.rotations {
        Some(rotations) => {
            let rotations = match pose_scale {
                Some(scale) => on_own_legs(root.position, rotations, scale, body),
                None => rotations.clone(),
            };
            (root.position, rotations)
        }
        None => upright(root, before, body),
    };
    let points: Vec<(usize, Vec3)> = (given.points.iter())
        .map(|point| (point.joint, point.position - Vec3::Y * ground_y))
        .collect();
    if points.is_empty() {
        return Ok(Key {
            root: root_m,
            rotations,
            points,
        });
    }
    let options = ReachOptions {
        // A given height is kept. Otherwise the hips go to where the hand needs them.
        root: height.map(|_| root_m),
        ..ReachOptions::default()
    };
    let reach = |root: Vec3| {
        let base = Posed {
            root,
            rotations: &rotations,
        };
        reach_pose(body.skeleton, body.legs, base, &points, &options)
    };
    let mut reached = reach(root_m);
    if given.place.is_some() {
        // Bowing moves the hips back. So the feet stand far enough ahead for the hips to come to
        // the given place.
        let mut base = root_m;
        for _ in 0..PLACE_ROUNDS {
            let off = (root_m - reached.root).with_y(0.0);
            if off.length() < PLACED_M || !off.is_finite() {
                break;
            }
            base += off;
            reached = reach(base);
        }
    }
    for (&(joint, _), &short_m) in points.iter().zip(&reached.errors_m) {
        if short_m.is_nan() || short_m > REACHED_M {
            return Err(Unreachable { joint, short_m });
        }
    }
    Ok(Key {
        root: reached.root,
        rotations: reached.rotations,
        points,
    })
}

/// The standing pose at a root. At another height the feet stay on the ground: in place, if
/// the character comes from `before` close by, otherwise below the root.
fn upright(root: GlobalRoot, before: GlobalRoot, body: &BodyParts<'_>) -> (Vec3, Vec<Quat>) {
    let standing_at = |root: GlobalRoot| {
        let mut rotations = body.standing.rotations.clone();
        if let Some(pelvis) = rotations.first_mut() {
            *pelvis = (yaw(root.heading) * *pelvis).normalize();
        }
        (root.position.with_y(body.standing.height_m), rotations)
    };
    if root.position.y == body.standing.height_m {
        return standing_at(root);
    }
    let (near_m, near_turn) = FEET_STAY;
    let way = (root.position - before.position).with_y(0.0).length();
    let stays = way < near_m && wrap_angle(root.heading - before.heading).abs() < near_turn;
    let (position, rotations) = standing_at(if stays { before } else { root });
    let base = Posed {
        root: position,
        rotations: &rotations,
    };
    let posed = pose_at(body.skeleton, body.legs, base, root.position, 0.0);
    (posed.root, posed.rotations)
}

/// The pose `rotations` with its root at `root`, after its height was divided by `scale`. At the
/// undivided height the pose has its feet where they belong. They stay there if the legs reach;
/// otherwise they dangle.
fn on_own_legs(root: Vec3, rotations: &[Quat], scale: f32, body: &BodyParts<'_>) -> Vec<Quat> {
    let written = Posed {
        root: root.with_y(root.y * scale),
        rotations,
    };
    let made = pose_at(body.skeleton, body.legs, written, root, 0.0);
    match made.short_m <= REACHED_M {
        true => made.rotations,
        false => rotations.to_vec(),
    }
}

/// Whether the motion to these keyframes of `set` is made without the networks, for a character
/// that comes from `from`.
pub fn suits_stance(set: &Set, keys: &[Key], from: Posed<'_>) -> bool {
    let low = |height: f32| height < set.low_hips_m;
    let hands_alone = (set.keyframes.iter()).all(|key| {
        !key.points.is_empty() && key.rotations.is_none() && key.place_m.is_none() && key.heading.is_none()
    });
    match set.motion {
        Some(motion) => motion == Motion::Stance,
        None => hands_alone || low(from.root.y) || keys.iter().any(|key| low(key.root.y)),
    }
}

/// Frames of a motion to `key` without the networks, and its lean on the way, radians.
pub fn stance_frames(set: &Set, skeleton: &Skeleton, from: Posed<'_>, key: &Key) -> (u32, f32) {
    let way = key.root - from.root;
    let low = from.root.y.min(key.root.y) < set.low_hips_m;
    let (frames, lean) = match low {
        true if way.x.hypot(way.z) > LEAN_M => LOW_STANCE,
        true => (LOW_FRAMES, 0.0),
        false => {
            let (fewest, most, metre) = STANCE_FRAMES;
            let frames = metre * farthest(skeleton, from, key.posed()).sqrt();
            let frames = frames.max(stepping_frames(skeleton, from, key.posed()));
            ((frames.round() as u32).clamp(fewest, most), 0.0)
        }
    };
    (set.frames.unwrap_or(frames).max(1), lean)
}

/// The start of a motion to keyframes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Way {
    /// Position and heading of the root.
    pub from: GlobalRoot,
    /// Velocity over the ground, m/s.
    pub velocity: Vec3,
    /// Whether the keyframes are the first of an interaction.
    pub first: bool,
}

/// What to ask the networks for, to bring a character to `keys`.
pub fn targets(set: &Set, keys: &[Key], rig: &Rig, way: &Way) -> PlanTargets {
    let left_axis = rig.skeleton.left_axis;
    let target = |key: &Key| TargetKey {
        root: Some(key.global_root(left_axis)),
        velocity: None,
        rotations: Some(key.rotations.clone()),
        height_m: None,
    };
    let end = keys.last().map_or(way.from, |key| key.global_root(left_axis));
    let allowed = match set.frames {
        Some(_) => Vec::new(),
        None => token_counts(&rig.dims, rig.fps, way, end),
    };
    let frames = |frames: u32| CONTEXT_FRAMES + frames.max(LEAST_PLAN_FRAMES) as usize;
    PlanTargets {
        targets: keys.iter().map(target).collect(),
        gap_poses: Vec::new(),
        frames: set.frames.map(frames),
        allowed_token_counts: allowed,
        guide: None,
        follow: None,
        r_g1: end,
        r_g2: Vec::new(),
        path: None,
        unfinished: false,
        gaits: Vec::new(),
    }
}

/// Token counts that give the way and the turn enough time.
fn token_counts(dims: &Dims, fps: f32, way: &Way, to: GlobalRoot) -> Vec<u32> {
    let Way {
        from,
        velocity,
        first,
    } = *way;
    let far = (to.position - from.position).with_y(0.0).length();
    let turn = wrap_angle(to.heading - from.heading).abs();
    let (share, least_mps) = SLOWEST;
    let slowest = (share * velocity.with_y(0.0).length()).max(least_mps);
    let seconds = (far / slowest).max(if first { 0.0 } else { turn / TURN_RPS });
    let frames = seconds * fps + CONTEXT_FRAMES as f32;
    let needed = (frames / dims.frames_per_token as f32).ceil() as u32;
    let (least, most_needed, most) = if first { FIRST_TOKENS } else { NEXT_TOKENS };
    let fewest = needed.clamp(least, most_needed);
    let stays = !first && far < STAYS_M;
    let most = if stays { fewest + SPARE_TOKENS } else { most };
    let (low, high) = (dims.min_tokens as u32, dims.max_tokens as u32);
    (fewest.clamp(low, high)..=most.clamp(low, high)).collect()
}

#[cfg(test)]
#[path = "key_tests.rs"]
mod tests;
