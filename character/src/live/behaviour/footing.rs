//! What a character stands on: how far each of its frames is lifted from the flat ground that the
//! networks know.
//!
//! The buffer holds motion over a flat ground at height 0. Beside it, every frame has a [`Lift`]:
//! the height of the ground under each foot, and how far the root is lifted with them. Frames are
//! lifted as they are shown, so plans never see a step.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use troupe_motion::ik::{Leg, MAX_LEGS, legs};
use troupe_motion::terrain::{Lift, Terrain, lift_frame, lifts};
use troupe_motion::{Quat, Skeleton, Vec3};

use super::super::buffer::MotionBuffer;
use crate::scene::{Scene, Surface};

/// Highest step up or down that a character takes in its stride, metres. Stairs have 0.15 to 0.2;
/// beyond this the rear knee bends deep and feet are accelerated three times as much as on the
/// flat. What is higher, up to the hips, is a wall.
pub(super) const STEP_M: f32 = 0.3;
/// How far down a surface is looked for, metres.
pub(super) const DEEPEST_M: f32 = 2.0e4;
/// The same for one to stand on or fall to: deeper falls take longer than [`MAX_FALL_S`], and are
/// none.
///
/// [`MAX_FALL_S`]: troupe_motion::ballistic::MAX_FALL_S
const DEEPEST_FALL_M: f32 = 1950.0;
/// Height over the ground from which it is looked for downwards, metres: the hips'. Higher things
/// are walls.
const LOOK_FROM_M: f32 = 0.9;
/// How far ground may come up under a character that is then put on top of it, metres. What is
/// higher is a wall around it; the ground plane is none, however high.
const RISES_M: f32 = 2.0;
/// Fastest that a character goes up or down with the ground below it, metres in a frame. Feet that
/// catch up with their way go as fast.
const RISE_RATE_M: f32 = 0.07;
/// A character whose root is this far beyond an edge, or within this of both sides of a gap, still
/// stands, metres.
const STANCE_M: f32 = 0.15;
/// The ways that are looked in around a place.
const AROUND: [Vec3; 4] = [Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z];
/// Frames before the first new one that lifts are worked out with.
const BEFORE_FRAMES: i64 = 12;
/// Ground that is nearer to where the character stands than this makes no difference, metres.
const LEVEL_M: f32 = 0.005;

/// Height of what is under a place, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Support {
    /// Something to stand on, within a step.
    At(f32),
    /// It is farther down: this high. `None`: there is nothing that a fall would come to.
    Below(Option<f32>),
    /// A wall.
    Above,
}

/// What is at `place` (x and z count) for a character that stands at height `level`.
pub(super) fn support(scene: &Scene, place: Vec3, level: f32) -> Support {
    let from = place.with_y(level + LOOK_FROM_M);
    match scene.support(from, LOOK_FROM_M + DEEPEST_FALL_M, None) {
        None => Support::Below(None),
        Some(hit) if hit.is_inside() || hit.point.y > level + STEP_M + LEVEL_M => Support::Above,
        Some(hit) if hit.point.y < level - STEP_M - LEVEL_M => Support::Below(Some(hit.point.y)),
        Some(hit) => Support::At(hit.point.y),
    }
}

/// What a character stands on whose root is at `place` and that stood at height `level`: what is
/// under its root, or near enough to it for its feet. Looks around only where there is nothing
/// under the root.
pub(super) fn stands_on(scene: &Scene, place: Vec3, level: f32) -> Support {
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

/// Height of what is to stand on at `place` for one that stood at height `level` before the ground
/// there changed. `None` where the ground has gone, or a wall has come.
fn stands_anew(scene: &Scene, place: Vec3, level: f32) -> Option<f32> {
    match stands_on(scene, place, level) {
        Support::At(height) => Some(height),
        Support::Above => risen(scene, place, level),
        // From below the plane is not seen.
        Support::Below(None) => Some(scene.ground_y_m()).filter(|&ground| ground > level),
        Support::Below(Some(_)) => None,
    }
}

/// Height of the ground that has come up over `level` at `place`. An object that was moved there is
/// none.
fn risen(scene: &Scene, place: Vec3, level: f32) -> Option<f32> {
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
    /// Frame of the first lift. Frames before and behind are lifted as the nearest that is there.
    first: i64,
    lifts: Vec<Lift>,
    /// Height of what it stands on at the frame that was settled last, metres.
    level: f32,
    /// The frame behind which lifts are to be worked out again.
    stale: Option<i64>,
    /// Where it stood on its feet last, and the revision of the scene then.
    stood: Option<(Vec3, u64)>,
    #[serde(skip)]
    scratch: Vec<Lift>,
    #[serde(skip)]
    levels: Vec<(Vec3, f32)>,
}

impl Footing {
    /// A character that stands at height `level`.
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

    /// The legs of the skeleton.
    pub(super) fn legs(&self) -> &Arc<[Leg]> {
        &self.legs
    }

    /// Height of what it stands on, metres.
    pub(super) fn level(&self) -> f32 {
        self.level
    }

    /// What it stands on is this high now. Less than [`LEVEL_M`] is no step.
    pub(super) fn step_to(&mut self, height: f32) {
        if (height - self.level).abs() > LEVEL_M {
            self.level = height;
        }
    }

    /// Notes that it stands on its feet, its root at `place`.
    pub(super) fn stands(&mut self, scene: &Scene, place: Vec3) {
        self.stood = Some((place.with_y(self.level), scene.revision()));
    }

    /// Height of what is under its root at `place` now, where the ground that it stands on has gone
    /// up, or down by a step, since [`Footing::stands`]. Whoever has walked into something has not
    /// had the ground change: that is looked at where it stood.
    pub(super) fn shifted(&self, scene: &Scene, place: Vec3) -> Option<f32> {
        let (stood, revision) = self.stood?;
        if scene.revision() == revision {
            return None;
        }
        let there = stands_anew(scene, stood, stood.y)?;
        if (there - stood.y).abs() <= LEVEL_M {
            return None;
        }
        let here = stands_anew(scene, place, self.level)?;
        ((here - there).abs() <= STEP_M).then_some(here)
    }

    /// The ground that it stands on is at `height` now: it goes there in the frames behind `shown`,
    /// as it stands or walks; at once where that is far. The first frame at that height, where it
    /// took some.
    pub(super) fn shift(&mut self, shown: i64, height: f32) -> Option<i64> {
        let from = self.at(shown);
        let far = (height - from.root_m).abs();
        if far > RISES_M + LEVEL_M {
            self.level_from(shown, height);
            return None;
        }
        self.keep(shown - BEFORE_FRAMES, shown);
        // It starts as fast as it may and comes to rest evenly: ground that goes on moving is
        // followed.
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
        let (a, b) = (self.at(frame), self.at(frame + 1));
        let between = |a: f32, b: f32| a + (b - a) * part;
        let mut lift = Lift {
            root_m: between(a.root_m, b.root_m),
            feet_m: [0.0; MAX_LEGS],
        };
        for (to, (a, b)) in lift.feet_m.iter_mut().zip(a.feet_m.into_iter().zip(b.feet_m)) {
            *to = between(a, b);
        }
        lift_frame(skeleton, &self.legs, root, rotations, &lift);
    }

    /// Frames behind `shown` are lifted evenly, by `level`: they are in the air or come to stand
    /// there.
    pub(super) fn level_from(&mut self, shown: i64, level: f32) {
        self.keep(shown - BEFORE_FRAMES, shown);
        self.lifts.push(Lift::even(level));
        self.level = level;
    }

    /// Keeps the lifts of frames `oldest` to `shown`.
    fn keep(&mut self, oldest: i64, shown: i64) {
        let from = self.first.max(oldest).min(shown);
        let mut kept = std::mem::take(&mut self.scratch);
        kept.clear();
        kept.extend((from..=shown).map(|frame| self.at(frame)));
        self.scratch = kept;
        std::mem::swap(&mut self.lifts, &mut self.scratch);
        self.first = from;
    }

    /// The frames behind `shown` have changed. Their lifts are worked out when the next frame is
    /// settled, with the scene as it is then: a plan may come at any moment.
    pub(super) fn changed(&mut self, shown: i64) {
        self.stale = Some(self.stale.map_or(shown, |stale| stale.min(shown)));
    }

    /// The frame behind which lifts are to be worked out again, once.
    pub(super) fn take_changed(&mut self) -> Option<i64> {
        self.stale.take()
    }

    /// Works out the lifts of the frames behind `shown`, which have changed, or the ground has.
    pub(super) fn renew(&mut self, shown: i64, buffer: &MotionBuffer, scene: &Scene, skeleton: &Skeleton) {
        // Frames up to `shown` may be still to come.
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

    /// Notes what is under the root at the frames to come, step by step; says whether any of it, or
    /// near it, is at another height than where the character stands now.
    fn look_ahead(&mut self, from: i64, last: i64, buffer: &MotionBuffer, scene: &Scene) -> bool {
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

    /// Whether there is nothing but the ground plane along the way, which is where the character
    /// stands: most often so.
    fn is_plain(&self, roots: &[Vec3], scene: &Scene) -> bool {
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

    /// Whether the ground beside the way is at another height: a foot may stand there.
    fn near_steps(&self, scene: &Scene) -> bool {
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
/// NaN where there is none.
fn ground(scene: &Scene, levels: &[(Vec3, f32)], level: f32, x: f32, z: f32) -> f32 {
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
