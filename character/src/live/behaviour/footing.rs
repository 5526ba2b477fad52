//! What a character stands on: how far each frame is lifted from the flat ground of the networks.
//!
//! The buffer holds motion over flat ground at height 0. Beside it, every frame has a [`Lift`]: the
//! height of the ground under each foot, and the lift of the root. Frames are lifted as they are
//! shown, so plans never see a step.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use troupe_motion::ik::{Leg, MAX_LEGS, legs};
use troupe_motion::terrain::{Lift, Terrain, lift_frame, lifts};
use troupe_motion::{Quat, Skeleton, Vec3};

use super::super::buffer::MotionBuffer;
use crate::scene::{ScaledScene, Surface};

/// Highest step up or down that a character takes in its stride, metres. Stairs have 0.15 to 0.2.
/// Beyond this limit the rear knee bends deeply and feet accelerate three times as much as on flat
/// ground. Anything higher, up to the hips, is a wall.
pub(super) const STEP_M: f32 = 0.3;
/// Greatest depth at which a surface is looked for, metres of the scene.
pub(super) const DEEPEST_M: f32 = 2.0e4;
/// Greatest depth of a surface to stand on or fall to, both in metres of the scene and of the
/// character. A deeper fall would take longer than [`MAX_FALL_S`], and does not begin.
///
/// [`MAX_FALL_S`]: troupe_motion::ballistic::MAX_FALL_S
const DEEPEST_FALL_M: f32 = 1950.0;
/// Height over the ground from which the search looks down, metres: the height of the hips. Higher
/// things are walls.
const LOOK_FROM_M: f32 = 0.9;
/// How far ground may rise under a character that is then put on top of it, metres. Anything higher
/// is a wall around the character, except for the ground plane.
const RISES_M: f32 = 2.0;
/// Fastest that a character rises or sinks with the ground below it, metres a frame. Feet that
/// catch up are as fast.
const RISE_RATE_M: f32 = 0.07;
/// A character still stands if its root is this far beyond an edge, or this near to both sides of a
/// gap, metres.
const STANCE_M: f32 = 0.15;
/// The directions in which the ground around a place is checked.
const AROUND: [Vec3; 4] = [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z];
/// Lifts are worked out from this many frames before the first that changed.
const BEFORE_FRAMES: i64 = 12;
/// Ground that differs in height by less than this counts as level, metres.
const LEVEL_M: f32 = 0.005;

/// The height of what is under a place, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Support {
    /// Something to stand on, within a step.
    At(f32),
    /// Farther down, at this height. `None`: nothing that a fall would end on.
    Below(Option<f32>),
    /// A wall.
    Above,
}

/// What is at `place` (x and z count) for a character that stands at height `level`.
pub(super) fn support(scene: &ScaledScene, place: Vec3, level: f32) -> Support {
    let from = place.with_y(level + LOOK_FROM_M);
    let deepest_m = DEEPEST_FALL_M.min(DEEPEST_FALL_M / scene.scale());
    match scene.support(from, LOOK_FROM_M + deepest_m, None) {
        None => Support::Below(None),
        Some(hit) if hit.is_inside() || hit.point.y > level + STEP_M + LEVEL_M => Support::Above,
        Some(hit) if hit.point.y < level - STEP_M - LEVEL_M => Support::Below(Some(hit.point.y)),
        Some(hit) => Support::At(hit.point.y),
    }
}

/// What a character stands on. Its root is at `place`, and it stood at height `level`. If there is
/// nothing under the root, ground near enough for the feet counts too.
pub(super) fn stands_on(scene: &ScaledScene, place: Vec3, level: f32) -> Support {
    let below = support(scene, place, level);
    let Support::Below(_) = below else {
        return below;
    };
    let around = AROUND.map(|way| support(scene, place + way * STANCE_M, level));
    let heights = around.into_iter().filter_map(|support| match support {
        Support::At(height) => Some(height),
        Support::Below(_) | Support::Above => None,
    });
    let off = |height: &f32| (height - level).abs();
    match heights.min_by(|a, b| off(a).total_cmp(&off(b))) {
        Some(height) => Support::At(height),
        None => below,
    }
}

/// Height of what to stand on at `place` after the ground changed, for a character that stood at
/// height `level`. `None` if the ground has gone, or a wall has come.
fn height_after_change(scene: &ScaledScene, place: Vec3, level: f32) -> Option<f32> {
    match stands_on(scene, place, level) {
        Support::At(height) => Some(height),
        Support::Above => risen(scene, place, level),
        // The ground plane cannot be seen from below.
        Support::Below(None) => Some(scene.ground_y_m()).filter(|&ground| ground > level),
        Support::Below(Some(_)) => None,
    }
}

/// Height of the ground that has risen above `level` at `place`. An object that was moved there
/// does not count.
fn risen(scene: &ScaledScene, place: Vec3, level: f32) -> Option<f32> {
    [LOOK_FROM_M, RISES_M].into_iter().find_map(|up| {
        let hit = scene.support(place.with_y(level + up), up, None)?;
        let is_object = matches!(hit.surface, Surface::Object(_));
        (!hit.is_inside() && !is_object).then_some(hit.point.y)
    })
}

/// The lifts of a character's frames.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::live) struct Footing {
    #[serde(with = "crate::saved::legs")]
    legs: Arc<[Leg]>,
    /// Frame of the first lift. Frames outside the list have the nearest lift in it.
    first: i64,
    lifts: Vec<Lift>,
    /// Height of what the character stood on in the newest settled frame, metres.
    level: f32,
    /// Lifts after this frame are to be worked out again.
    stale: Option<i64>,
    /// Where the character last stood on its feet, and the scene's revision then.
    stood: Option<(Vec3, u64)>,
    #[serde(skip)]
    scratch: Vec<Lift>,
    #[serde(skip)]
    levels: Vec<(Vec3, f32)>,
}

impl Footing {
    /// A character that stands at height `level`, metres.
    pub(in crate::live) fn new(skeleton: &Skeleton, level: f32) -> Self {
        Self {
            legs: legs(skeleton).into(),
            first: 0,
            lifts: vec![Lift::even(level)],
            level,
            stale: None,
            stood: None,
            scratch: Vec::new(),
            levels: Vec::new(),
        }
    }

    /// The legs of the skeleton, in its order.
    pub(super) fn legs(&self) -> &Arc<[Leg]> {
        &self.legs
    }

    /// Height of what the character stands on, metres.
    pub(super) fn level(&self) -> f32 {
        self.level
    }

    /// Notes that the character now stands at height `height`. Less than [`LEVEL_M`] is no step.
    pub(super) fn step_to(&mut self, height: f32) {
        if (height - self.level).abs() > LEVEL_M {
            self.level = height;
        }
    }

    /// Notes that the character stands on its feet with its root at `place`.
    pub(super) fn stands(&mut self, scene: &ScaledScene, place: Vec3) {
        self.stood = Some((place.with_y(self.level), scene.revision()));
    }

    /// Height of what is under the root at `place`, if the ground that the character stands on has
    /// risen, or sunk by a step, since [`Footing::stands`]. The check looks at where the character
    /// stood then: ground does not change because somebody walks into something.
    pub(super) fn shifted(&self, scene: &ScaledScene, place: Vec3) -> Option<f32> {
        let (stood, revision) = self.stood?;
        if scene.revision() == revision {
            return None;
        }
        let there = height_after_change(scene, stood, stood.y)?;
        if (there - stood.y).abs() <= LEVEL_M {
            return None;
        }
        let here = height_after_change(scene, place, self.level)?;
        ((here - there).abs() <= STEP_M).then_some(here)
    }

    /// Moves the character to ground of height `height` in the frames after `shown`: evenly, or at
    /// once if it is far. Returns the last frame of the movement, if it takes any.
    pub(super) fn shift(&mut self, shown: i64, height: f32) -> Option<i64> {
        let from = self.at(shown);
        let far = (height - from.root_m).abs();
        if far > RISES_M + LEVEL_M {
            self.level_from(shown, height);
            return None;
        }
        self.keep(shown - BEFORE_FRAMES, shown);
        // It starts at the highest rate and comes to rest evenly, so it also follows ground that
        // keeps moving.
        let frames = (2.0 * far / RISE_RATE_M).ceil().max(1.0) as i64;
        for frame in 1..=frames {
            let left = 1.0 - frame as f32 / frames as f32;
            let to = |from: f32| height + (from - height) * left * left;
            self.lifts.push(Lift {
                root_m: to(from.root_m),
                feet_m: from.feet_m.map(to),
            });
        }
        self.level = height;
        Some(shown + frames)
    }

    fn at(&self, frame: i64) -> Lift {
        let last = self.lifts.len() as i64 - 1;
        self.lifts[(frame - self.first).clamp(0, last) as usize]
    }

    /// Lifts a frame of the buffer, `part` of the way (0 to 1) from `frame` to the next.
    pub(in crate::live) fn lift(
        &self,
        skeleton: &Skeleton,
        frame: i64,
        part: f32,
        root: &mut Vec3,
        rotations: &mut [Quat],
    ) {
        lift_frame(skeleton, &self.legs, root, rotations, &self.between(frame, part));
    }

    /// The lift `part` of the way (0 to 1) from `frame` to the next.
    pub(super) fn between(&self, frame: i64, part: f32) -> Lift {
        let (a, b) = (self.at(frame), self.at(frame + 1));
        let between = |a: f32, b: f32| a + (b - a) * part;
        let mut lift = Lift {
            root_m: between(a.root_m, b.root_m),
            feet_m: [0.0; MAX_LEGS],
        };
        for (to, (a, b)) in lift.feet_m.iter_mut().zip(a.feet_m.into_iter().zip(b.feet_m)) {
            *to = between(a, b);
        }
        lift
    }

    /// Lifts the frames after `shown` evenly by `level`: there the character is in the air, or
    /// lands.
    pub(super) fn level_from(&mut self, shown: i64, level: f32) {
        self.keep(shown - BEFORE_FRAMES, shown);
        self.lifts.push(Lift::even(level));
        self.level = level;
    }

    /// Keeps the lifts of frames `oldest` to `shown`, and drops all others.
    fn keep(&mut self, oldest: i64, shown: i64) {
        let from = self.first.max(oldest).min(shown);
        let mut kept = std::mem::take(&mut self.scratch);
        kept.clear();
        kept.extend((from..=shown).map(|frame| self.at(frame)));
        self.scratch = kept;
        std::mem::swap(&mut self.lifts, &mut self.scratch);
        self.first = from;
    }

    /// Notes that the frames after `shown` have changed. A plan may arrive at any moment, so their
    /// lifts are worked out when the next frame is settled, with the scene as it is then.
    pub(super) fn changed(&mut self, shown: i64) {
        self.stale = Some(self.stale.map_or(shown, |stale| stale.min(shown)));
    }

    /// Takes the frame after which lifts are to be worked out again.
    pub(super) fn take_changed(&mut self) -> Option<i64> {
        self.stale.take()
    }

    /// Works out the lifts of the frames after `shown`, because they or the ground have changed.
    pub(super) fn renew(
        &mut self,
        shown: i64,
        buffer: &MotionBuffer,
        scene: &ScaledScene,
        skeleton: &Skeleton,
    ) {
        // Frames up to `shown` may lie ahead.
        self.keep(buffer.first(), shown);
        let from = self.first.max(shown - BEFORE_FRAMES);
        let (level, last) = (self.level, buffer.last());
        let uneven = self.look_ahead(from, last, buffer, scene);
        let known = &self.lifts[(from - self.first) as usize..];
        let is_even = |lift: &Lift| *lift == Lift::even(level);
        if !uneven && known.iter().all(is_even) {
            return;
        }
        let frames = buffer.range(from, last);
        let levels = &self.levels;
        let ground = |x: f32, z: f32| ground(scene, levels, level, x, z);
        lifts(
            skeleton,
            &self.legs,
            frames.roots,
            frames.rotations,
            frames.contacts,
            known,
            ground,
            &Terrain::default(),
            &mut self.scratch,
        );
        self.lifts.truncate((from - self.first) as usize);
        self.lifts.extend_from_slice(&self.scratch);
        if self.lifts.is_empty() {
            self.lifts.push(Lift::even(level));
        }
    }

    /// Notes what is under the root step by step in the frames to come. Answers whether any of it,
    /// or anything near it, differs in height from where the character stands now.
    fn look_ahead(&mut self, from: i64, last: i64, buffer: &MotionBuffer, scene: &ScaledScene) -> bool {
        self.levels.clear();
        let roots = buffer.range(from, last).roots;
        if self.is_plain(roots, scene) {
            return false;
        }
        let mut uneven = false;
        let mut level = self.level;
        for &root in roots {
            match stands_on(scene, root, level) {
                Support::At(height) => {
                    level = height;
                    self.levels.push((root, height));
                    uneven |= (height - self.level).abs() > LEVEL_M;
                }
                Support::Above => uneven = true,
                Support::Below(_) => {
                    uneven = true;
                    break;
                }
            }
        }
        uneven || self.near_steps(scene)
    }

    /// Whether there is only the ground plane along the way, at the height at which the character
    /// stands. Mostly so.
    fn is_plain(&self, roots: &[Vec3], scene: &ScaledScene) -> bool {
        const MARGIN: Vec3 = Vec3::new(1.0, STEP_M, 1.0);
        let low = roots.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let high = roots.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        let (ground, level) = (scene.ground_y_m(), self.level);
        (ground - level).abs() <= LEVEL_M
            && scene.is_bare(
                low.with_y(ground) - MARGIN,
                high.with_y(level + LOOK_FROM_M) + MARGIN,
            )
    }

    /// Whether a foot may land on ground of another height beside the way.
    fn near_steps(&self, scene: &ScaledScene) -> bool {
        const ASIDE_M: f32 = 0.3;
        self.levels.iter().step_by(4).any(|&(root, height)| {
            AROUND.iter().any(|&way| {
                let beside = support(scene, root + way * ASIDE_M, height);
                !matches!(beside, Support::At(at) if (at - height).abs() <= LEVEL_M)
            })
        })
    }
}

/// Height of the ground under a foot: within a step of what the root is over when it is nearest.
/// NaN if there is none.
fn ground(scene: &ScaledScene, levels: &[(Vec3, f32)], level: f32, x: f32, z: f32) -> f32 {
    let foot = Vec3::new(x, 0.0, z);
    let nearest = (levels.iter()).min_by(|a, b| {
        let far = |(root, _): &(Vec3, f32)| (root.with_y(0.0) - foot).length_squared();
        far(a).total_cmp(&far(b))
    });
    match support(scene, foot, nearest.map_or(level, |&(_, height)| height)) {
        Support::At(height) => height,
        Support::Below(_) | Support::Above => f32::NAN,
    }
}
