//! One pass over a file's motion: how the body stands, and which joints slide.

use glam::DVec3;

use super::report::Up;
use crate::anatomy::{Biped, Name, Tree};
use crate::convert::{Source, Transform};

/// Most frames that are looked at for how the body stands.
const LOOKED_AT: usize = 256;

/// Largest angle of legs and trunk from the vertical in a rest pose that is a stance, degrees.
const MAX_LEAN_DEG: f64 = 45.0;

/// Lengths are in the file's units.
pub(super) struct Survey {
    pub(super) tree: Tree,
    pub(super) body: Option<Biped>,
    /// Mean place of each joint in its parent.
    pub(super) places: Vec<DVec3>,
    /// How far each joint moves in its parent from its first place, and in which frame most.
    pub(super) slides: Vec<(f64, usize)>,
    /// Places of the joints at rest in the world.
    pub(super) rest: Vec<DVec3>,
    pub(super) stance: Option<Stance>,
}

/// How a two-legged body stands. Lengths are in the file's units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stance {
    /// Length of a leg from hip to ankle plus that of the spine from pelvis to head.
    pub(super) length: f64,
    /// Mean direction from the feet to the head over the frames. As long as it is constant, up to
    /// 1.
    pub(super) moving: DVec3,
    /// Direction from the feet to the head at rest, unit length.
    pub(super) resting: DVec3,
    /// For each axis, how far the lowest joint's place along it varies over the frames (standard
    /// deviation), both ways: along +X, +Y, +Z, −X, −Y, −Z.
    pub(super) floor: [f64; 6],
}

impl Survey {
    pub(super) fn of(source: &dyn Source) -> Self {
        let tree = tree_of(source);
        let body = Biped::find(&tree);
        let joints = source.joint_count();
        let mut local = vec![Transform::default(); joints];
        source.rest(&mut local);
        let mut rest = vec![Transform::default(); joints];
        to_world(&tree, &local, &mut rest);
        let rest: Vec<DVec3> = rest.iter().map(|at| at.place).collect();
        let (places, slides) = places(source, &mut local);
        let stance = body
            .as_ref()
            .and_then(|body| Stance::of(source, &tree, body, &rest, &places));
        Self {
            tree,
            body,
            places,
            slides,
            rest,
            stance,
        }
    }
}

/// Names and parents of a file's joints.
fn tree_of(source: &dyn Source) -> Tree {
    let joints = 0..source.joint_count();
    Tree {
        names: joints.clone().map(|joint| Name::of(source.name(joint))).collect(),
        parents: joints.map(|joint| source.parent(joint)).collect(),
    }
}

/// World transforms out of those in the parents.
pub(super) fn to_world(tree: &Tree, local: &[Transform], world: &mut [Transform]) {
    for joint in 0..local.len() {
        world[joint] = match tree.parents[joint] {
            None => local[joint],
            Some(parent) => world[parent].to_world(&local[joint]),
        };
    }
}

/// Mean places, and the largest distance from the first with its frame.
fn places(source: &dyn Source, local: &mut [Transform]) -> (Vec<DVec3>, Vec<(f64, usize)>) {
    let (joints, frames) = (source.joint_count(), source.frames());
    let mut sums = vec![DVec3::ZERO; joints];
    let mut firsts = vec![DVec3::ZERO; joints];
    let mut slides = vec![(0.0, 0); joints];
    for frame in 0..frames {
        source.locals(frame, local);
        for (joint, Transform { place, .. }) in local.iter().enumerate() {
            if frame == 0 {
                firsts[joint] = *place;
            }
            sums[joint] += *place;
            let distance = place.distance(firsts[joint]);
            if distance > slides[joint].0 {
                slides[joint] = (distance, frame);
            }
        }
    }
    let count = frames.max(1) as f64;
    (sums.into_iter().map(|sum| sum / count).collect(), slides)
}

impl Stance {
    fn of(source: &dyn Source, tree: &Tree, body: &Biped, rest: &[DVec3], places: &[DVec3]) -> Option<Self> {
        let length_of =
            |chain: &[usize]| -> f64 { chain[1..].iter().map(|&joint| places[joint].length()).sum() };
        let legs = [0, 1].map(|side| tree.chain(body.hips[side], body.feet[side]));
        let [Some(left), Some(right)] = legs else {
            return None;
        };
        let length = 0.5 * (length_of(&left) + length_of(&right)) + length_of(&body.spine);
        let upwards = |places: &dyn Fn(usize) -> DVec3| {
            let feet = 0.5 * (places(body.feet[0]) + places(body.feet[1]));
            (places(body.head) - feet).try_normalize()
        };
        let frames = source.frames();
        let step = frames.div_ceil(LOOKED_AT).max(1);
        let mut local = vec![Transform::default(); source.joint_count()];
        let mut world = local.clone();
        let mut moving = DVec3::ZERO;
        let mut floors = Floors::default();
        let is_below = tree.below(body.pelvis);
        let below: Vec<usize> = (0..local.len()).filter(|&joint| is_below[joint]).collect();
        let mut looked_at = 0;
        for frame in (0..frames).step_by(step) {
            source.locals(frame, &mut local);
            to_world(tree, &local, &mut world);
            moving += upwards(&|joint| world[joint].place).unwrap_or_default();
            floors.add(below.iter().map(|&joint| world[joint].place));
            looked_at += 1;
        }
        let stance = Self {
            length,
            moving: moving / f64::from(looked_at.max(1)),
            resting: upwards(&|joint| rest[joint])
                .filter(|&up| is_stance(body, rest, up))
                .unwrap_or_default(),
            floor: floors.deviations(),
        };
        (length.is_finite() && length > 0.0).then_some(stance)
    }
}

/// Whether the legs point down and the head is above the pelvis. The bones of many files all point
/// along one axis at rest.
fn is_stance(body: &Biped, rest: &[DVec3], up: DVec3) -> bool {
    let points = |from: usize, to: usize, along: DVec3| {
        (rest[to] - rest[from]).angle_between(along).to_degrees() <= MAX_LEAN_DEG
    };
    let legs = body.hips.iter().zip(&body.feet);
    legs.clone().all(|(&hip, &foot)| points(hip, foot, -up)) && points(body.pelvis, body.head, up)
}

/// Heights of the lowest joint along each axis, both ways.
#[derive(Default)]
struct Floors {
    count: f64,
    sums: [f64; 6],
    squares: [f64; 6],
}

impl Floors {
    fn add(&mut self, places: impl Iterator<Item = DVec3>) {
        let ends = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (low, high) = places.fold(ends, |(low, high), place| (low.min(place), high.max(place)));
        self.count += 1.0;
        for (nth, height) in low.to_array().into_iter().chain((-high).to_array()).enumerate() {
            self.sums[nth] += height;
            self.squares[nth] += height * height;
        }
    }

    fn deviations(&self) -> [f64; 6] {
        let count = self.count.max(1.0);
        std::array::from_fn(|nth| {
            let mean = self.sums[nth] / count;
            (self.squares[nth] / count - mean * mean).max(0.0).sqrt()
        })
    }
}

impl Up {
    /// The direction, unit length.
    pub(super) fn direction(self) -> DVec3 {
        let axis = [DVec3::X, DVec3::Y, DVec3::Z][self as usize % 3];
        if self as usize >= 3 { -axis } else { axis }
    }

    /// The axis that a direction is nearest to, and its share of it.
    pub(super) fn nearest(direction: DVec3) -> (Self, f64) {
        let share = |up: Self| direction.dot(up.direction());
        let best = Self::ALL
            .into_iter()
            .max_by(|&a, &b| share(a).total_cmp(&share(b)));
        let best = best.unwrap_or(Self::Y);
        (best, share(best))
    }
}
