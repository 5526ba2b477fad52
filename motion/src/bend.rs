//! Bends a root's way so that it passes through given places.
//!
//! The steps of a body keep their direction as the body sees it. Between two places they turn more
//! and more, and become longer or shorter. What is then missing is spread over the frames. Turn,
//! length and shift change smoothly, and not at all at a place itself. So speed has no jump there.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Vec2, Vec3};

use crate::interpolate::smoothstep;
use crate::root::{GlobalRoot, wrap_angle};

/// Shortest and longest steps, as multiples of the given ones.
const LENGTHS: [f32; 2] = [0.2, 2.0];
/// Share of the frames over which the length of steps changes, at either end.
const RAMP: f32 = 0.25;
/// Largest turn in the middle of a way that turns back before its end, radians.
const MOST_BULGE: f32 = FRAC_PI_2;
/// Bulges that are tried on either side.
const BULGES: i32 = 24;
/// Halvings of the distance between them in the search for the best.
const HALVINGS: usize = 8;
/// What a bulge of one radian costs, in shares of the way.
const BULGE_COST: f32 = 0.05;
/// What steps of twice the length cost, in shares of the way.
const LENGTH_COST: f32 = 0.02;
/// A shorter way has no direction, metres.
const NO_WAY_M: f32 = 0.3;

/// A place that the root must be at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Index of the frame.
    pub frame: usize,
    /// x and z, metres.
    pub ground: Vec2,
    /// Heading, radians. None: the body turns as its way does.
    pub heading: Option<f32>,
}

/// The bent way of `roots`. The first frame stays, and so do heights. Frames behind the last place
/// are moved along with it.
///
/// Frames of `places` must increase. Those of the first frame and beyond the end are ignored.
#[must_use]
pub fn bend_through(roots: &[GlobalRoot], places: &[Place]) -> Vec<GlobalRoot> {
    let mut bent = Vec::with_capacity(roots.len());
    bent.extend(roots.first());
    let mut turn = 0.0;
    for place in places {
        let from = bent.len().saturating_sub(1);
        if place.frame <= from || place.frame >= roots.len() {
            continue;
        }
        let span = Span::of(&roots[from..=place.frame], turn);
        turn += span.lead(place, &mut bent);
    }
    for frame in bent.len().max(1)..roots.len() {
        let step = step(roots[frame - 1], roots[frame]);
        let at = bent[frame - 1].position + grounded(turned(step, turn));
        bent.push(root(roots[frame], at, turn));
    }
    bent
}

/// The highest speed over the ground between two frames, m/s.
pub fn fastest_mps(roots: &[GlobalRoot], fps: f32) -> f32 {
    let steps = roots.windows(2).map(|pair| step(pair[0], pair[1]).length());
    steps.fold(0.0, f32::max) * fps
}

fn step(from: GlobalRoot, to: GlobalRoot) -> Vec2 {
    let step = to.position - from.position;
    Vec2::new(step.x, step.z)
}

/// A direction over the ground, turned about +Y.
fn turned(step: Vec2, angle: f32) -> Vec2 {
    let (sin, cos) = angle.sin_cos();
    Vec2::new(cos * step.x + sin * step.y, cos * step.y - sin * step.x)
}

fn grounded(step: Vec2) -> Vec3 {
    Vec3::new(step.x, 0.0, step.y)
}

/// The angle about +Y from one direction over the ground to another.
fn angle(from: Vec2, to: Vec2) -> f32 {
    wrap_angle(to.x.atan2(to.y) - from.x.atan2(from.y))
}

fn root(made: GlobalRoot, at: Vec3, turn: f32) -> GlobalRoot {
    GlobalRoot::new(at.with_y(made.position.y), wrap_angle(made.heading + turn))
}

/// Frames from one place to the next.
struct Span<'a> {
    roots: &'a [GlobalRoot],
    /// Steps between the frames, turned as the frames before were.
    steps: Vec<Vec2>,
    /// The turn of the frames before, radians.
    turn: f32,
    /// Length of the way, metres.
    way_m: f32,
}

/// How a span is bent.
#[derive(Clone, Copy)]
struct Shape {
    /// Turn at the end, radians.
    end: f32,
    /// Additional turn in the middle, radians.
    bulge: f32,
    /// Additional length of steps, as a multiple.
    longer: f32,
    /// What is missing at the end, metres.
    missing: Vec2,
}

impl Shape {
    /// The turn at a share of the span.
    fn turn(&self, share: f32) -> f32 {
        let middle = share * (1.0 - share);
        self.end * smoothstep(share) + self.bulge * 16.0 * middle * middle
    }
}

/// How much of the additional length steps have at a share of the span.
fn ramp(share: f32) -> f32 {
    smoothstep((share.min(1.0 - share) / RAMP).min(1.0))
}

impl<'a> Span<'a> {
    fn of(roots: &'a [GlobalRoot], turn: f32) -> Self {
        let steps = roots.windows(2);
        let steps: Vec<Vec2> = steps.map(|pair| turned(step(pair[0], pair[1]), turn)).collect();
        Self {
            roots,
            turn,
            way_m: steps.iter().map(|step| step.length()).sum(),
            steps,
        }
    }

    /// The share of the span in the middle of a step.
    fn share(&self, step: usize) -> f32 {
        (step as f32 + 0.5) / self.steps.len() as f32
    }

    /// Appends the frames that lead to `place`, and returns by how much more they turn.
    fn lead(&self, place: &Place, bent: &mut Vec<GlobalRoot>) -> f32 {
        let Some(start) = bent.last().map(|root| root.position) else {
            return 0.0;
        };
        let goal = place.ground - Vec2::new(start.x, start.z);
        let shape = self.best(goal, self.end(place, goal));
        let count = self.steps.len();
        let mut at = start;
        for (nth, step) in self.steps.iter().enumerate() {
            let share = self.share(nth);
            let longer = 1.0 + shape.longer * ramp(share);
            at += grounded(turned(*step, shape.turn(share)) * longer);
            let share = (nth + 1) as f32 / count as f32;
            let shifted = at + grounded(shape.missing * smoothstep(share));
            bent.push(root(self.roots[nth + 1], shifted, self.turn + shape.turn(share)));
        }
        if let Some(last) = bent.last_mut() {
            // Rounding adds up on a long way.
            (last.position.x, last.position.z) = (place.ground.x, place.ground.y);
        }
        shape.end
    }

    /// The turn that the span ends with.
    fn end(&self, place: &Place, goal: Vec2) -> f32 {
        let made = self.roots[self.roots.len() - 1].heading + self.turn;
        match place.heading {
            Some(heading) => wrap_angle(heading - made),
            None => {
                let chord: Vec2 = self.steps.iter().sum();
                match chord.length() >= NO_WAY_M && goal.length() >= NO_WAY_M {
                    // A way that turns evenly ends with twice the angle of its chord.
                    true => (2.0 * angle(chord, goal)).clamp(-PI, PI),
                    false => 0.0,
                }
            }
        }
    }

    /// The shape that comes to `goal` with the least cost.
    fn best(&self, goal: Vec2, end: f32) -> Shape {
        let spacing = MOST_BULGE / BULGES as f32;
        let mut best = self.shape(goal, end, 0.0);
        for nth in 1..=BULGES {
            for side in [-1.0, 1.0] {
                best = self.better(best, self.shape(goal, end, side * spacing * nth as f32));
            }
        }
        let mut reach = spacing;
        for _ in 0..HALVINGS {
            reach /= 2.0;
            let middle = best.bulge;
            for side in [-reach, reach] {
                best = self.better(best, self.shape(goal, end, middle + side));
            }
        }
        best
    }

    /// The cheaper of two shapes: the first one if they cost the same.
    fn better(&self, first: Shape, second: Shape) -> Shape {
        match self.cost(&second) < self.cost(&first) {
            true => second,
            false => first,
        }
    }

    fn cost(&self, shape: &Shape) -> f32 {
        let Shape { bulge, longer, .. } = shape;
        let bent = BULGE_COST * bulge * bulge + LENGTH_COST * longer * longer;
        shape.missing.length() + self.way_m * bent
    }

    /// The shape with this bulge, whose length of steps leaves least missing.
    fn shape(&self, goal: Vec2, end: f32, bulge: f32) -> Shape {
        let mut shape = Shape {
            end,
            bulge,
            longer: 0.0,
            missing: Vec2::ZERO,
        };
        let (mut gone, mut ramped) = (Vec2::ZERO, Vec2::ZERO);
        for (nth, step) in self.steps.iter().enumerate() {
            let share = self.share(nth);
            let step = turned(*step, shape.turn(share));
            gone += step;
            ramped += step * ramp(share);
        }
        let missing = goal - gone;
        let square = ramped.length_squared();
        if square > f32::EPSILON {
            shape.longer = (ramped.dot(missing) / square).clamp(LENGTHS[0] - 1.0, LENGTHS[1] - 1.0);
        }
        shape.missing = missing - ramped * shape.longer;
        shape
    }
}

#[cfg(test)]
#[path = "bend_tests.rs"]
mod tests;
