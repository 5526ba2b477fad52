//! The way of a motion over the ground.

use rand::RngExt as _;
use troupe_motion::path::{GroundPath, PathPoint};
use troupe_motion::root::heading_of;

use super::note::Note;
use super::request::{Effector, Knot, PoseKey, Take};
use super::seed::dice;

/// Frames between the knots of a random way.
const STEP: usize = 10;
/// A way that does not stand at its end continues for this long, seconds.
const BEYOND_S: f32 = 2.0;
/// Range of a random speed, as a share of the style's default.
const SPEEDS: std::ops::Range<f32> = 0.85..1.15;
/// Range of a random turn rate, radians a second.
const TURNS: std::ops::Range<f32> = -0.35..0.35;
/// A root stops this far before the position that a hand must reach, metres.
const REACH_M: f32 = 0.35;
/// A slower way counts as standing, m/s.
pub(super) const STANDING_MPS: f32 = 0.1;

/// A way through knots, in the order of their frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Way {
    /// At least two knots, in the order of their frames.
    pub knots: Vec<Knot>,
    /// Frames a second of the knots.
    pub fps: f32,
    /// True for the way of a request, false for a random one.
    pub is_given: bool,
}

impl Way {
    /// The way of a sample: that of the request, or a random one at about `usual_mps`.
    pub fn of(take: &Take, sample: usize, usual_mps: f32, notes: &mut Vec<Note>) -> Self {
        let fps = take.clock.native_fps;
        let mut knots = given(take);
        let origin = Knot {
            frame: 0.0,
            place: [0.0; 2],
            heading: None,
        };
        let last = take.frames.saturating_sub(1) as f32;
        let is_given = knots.iter().any(|knot| knot.frame >= 1.0);
        match knots.as_slice() {
            [] => knots = drawn(take, sample, origin, usual_mps, notes),
            [only] if only.frame < 1.0 => knots = drawn(take, sample, *only, usual_mps, notes),
            [only] => knots = vec![origin, *only],
            _ => {}
        }
        let end = knots[knots.len() - 1];
        let [x, z] = slope(&knots[knots.len() - 2..], fps);
        // It stays at its last knot, unless the motion ends there.
        let goes_on = end.frame > last - 1.0;
        let beyond = if goes_on { BEYOND_S } else { 0.0 };
        knots.push(Knot {
            frame: end.frame + BEYOND_S * fps,
            place: [end.place[0] + x * beyond, end.place[1] + z * beyond],
            heading: end.heading,
        });
        Self { knots, fps, is_given }
    }

    /// Velocity over the ground at the first knot, m/s; 0 for a way that starts later than the
    /// motion.
    pub fn start_mps(&self) -> [f32; 2] {
        match self.knots[0].frame < 1.0 {
            true => slope(&self.knots[..2], self.fps),
            false => [0.0; 2],
        }
    }

    fn ground(&self) -> Option<GroundPath> {
        let points = self.knots.iter().map(|knot| PathPoint {
            time_s: knot.frame / self.fps,
            place: knot.place,
            heading: knot.heading,
        });
        GroundPath::new(points.collect())
    }

    /// [`GroundPath::shows_steps`] of the knots.
    pub fn shows_steps(&self) -> bool {
        self.ground().is_some_and(|path| path.shows_steps())
    }

    /// World x, z and heading at a frame, which may be a fraction.
    pub fn at(&self, frame: f32) -> [f32; 3] {
        let made = self
            .ground()
            .and_then(|path| path.frames(frame / self.fps, self.fps, 1).pop());
        made.unwrap_or_default()
    }

    /// World x and z at a frame.
    pub fn place(&self, frame: f32) -> [f32; 2] {
        let [x, z, _] = self.at(frame);
        [x, z]
    }

    /// Moves all knots so that the way passes `place` at a frame.
    pub fn shift_to(&mut self, frame: f32, place: [f32; 2]) {
        let here = self.place(frame);
        for knot in &mut self.knots {
            knot.place = [0, 1].map(|axis| knot.place[axis] + place[axis] - here[axis]);
        }
    }

    /// Adds a knot in front, `frames` frames before the first one.
    pub fn begin_before(&mut self, frames: usize) {
        let first = self.knots[0];
        let [x, z] = self.start_mps();
        let time_s = frames as f32 / self.fps;
        self.knots.insert(
            0,
            Knot {
                frame: first.frame - frames as f32,
                place: [first.place[0] - x * time_s, first.place[1] - z * time_s],
                heading: first.heading,
            },
        );
    }

    /// Heading at the start, radians.
    pub fn first_heading(&self) -> f32 {
        if let Some(heading) = self.knots[0].heading {
            return heading;
        }
        let slopes = self.knots.windows(2).map(|pair| slope(pair, self.fps));
        let mut moving = slopes.filter(|[x, z]| x.hypot(*z) > STANDING_MPS);
        moving.next().map_or(0.0, |[x, z]| x.atan2(z))
    }
}

fn slope(pair: &[Knot], fps: f32) -> [f32; 2] {
    let [a, b] = [pair[0], pair[1]];
    let time_s = ((b.frame - a.frame) / fps).max(1e-3);
    [0, 1].map(|axis| (b.place[axis] - a.place[axis]) / time_s)
}

/// The knots of a request: those of its path, or else of its poses and effectors.
fn given(take: &Take) -> Vec<Knot> {
    let wanted = &take.wanted;
    if !wanted.path.is_empty() {
        return wanted.path.clone();
    }
    let left = take.subject.rig.skeleton.left_axis;
    let of_pose = |key: &PoseKey| {
        let root = key.root?;
        Some(Knot {
            frame: key.frame as f32,
            place: [root.x, root.z],
            heading: key.rotations[0].map(|pelvis| heading_of(pelvis, left)),
        })
    };
    let mut knots: Vec<Knot> = wanted.keys.iter().filter_map(of_pose).collect();
    for effector in &wanted.effectors {
        add_effector(take, effector, &mut knots);
    }
    knots
}

/// Adds a knot from which an effector is within reach. Feet are below the root, hands in front of
/// it.
fn add_effector(take: &Take, effector: &Effector, knots: &mut Vec<Knot>) {
    let frame = effector.frame as f32;
    // A body that reaches for several points in short succession stays in place.
    let near = take.clock.native_fps / 2.0;
    if knots.iter().any(|knot| (knot.frame - frame).abs() < near) {
        return;
    }
    let rig = &take.subject.rig;
    let is_foot = rig
        .legs
        .iter()
        .any(|leg| leg.foot == effector.joint || leg.toe == Some(effector.joint));
    let back_m = if is_foot || effector.joint == 0 {
        0.0
    } else {
        REACH_M
    };
    let after = knots.partition_point(|knot| knot.frame < frame);
    let from = after
        .checked_sub(1)
        .map_or([0.0; 2], |before| knots[before].place);
    let way = [effector.point.x - from[0], effector.point.z - from[1]];
    let length = way[0].hypot(way[1]);
    let share = ((length - back_m) / length.max(1e-3)).clamp(0.0, 1.0);
    let knot = Knot {
        frame,
        place: [from[0] + way[0] * share, from[1] + way[1] * share],
        heading: None,
    };
    knots.insert(after, knot);
}

/// A way with a random speed and turn rate of the sample.
fn drawn(take: &Take, sample: usize, from: Knot, usual_mps: f32, notes: &mut Vec<Note>) -> Vec<Knot> {
    let mut dice = dice(take.seed, sample);
    let fps = take.clock.native_fps;
    let speed = usual_mps * dice.random_range(SPEEDS);
    let turn = if take.is_loop {
        0.0
    } else {
        dice.random_range(TURNS)
    };
    if sample == 0 && usual_mps > 0.0 {
        let message = "the request names no place to go to: each sample has a random way, speed and turn";
        notes.push(Note::info("path_drawn", message));
    }
    let mut heading = from.heading.unwrap_or(0.0);
    let mut knots = vec![from];
    let mut place = from.place;
    for frame in (STEP..take.frames + STEP).step_by(STEP) {
        let time_s = STEP as f32 / fps;
        let middle = heading + turn * time_s / 2.0;
        place = [
            place[0] + middle.sin() * speed * time_s,
            place[1] + middle.cos() * speed * time_s,
        ];
        heading += turn * time_s;
        knots.push(Knot {
            frame: from.frame + frame as f32,
            place,
            // A standing body keeps its heading.
            heading: (speed <= STANDING_MPS).then_some(heading),
        });
    }
    knots
}
