//! Roots that replace the predicted ones (root override: MotionBricks, section 7.3, figures 4 and
//! 14).

use glam::{Quat, Vec3};

use super::GLOBAL_ROOT;
use crate::interpolate::{hermite, knot_slope};
use crate::root::{GlobalRoot, wrap_angle};
use crate::rotation::yaw;

/// The root of a frame as a request gives it. Missing parts stay as the networks make them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RootKey {
    /// Index of the segment's frame.
    pub frame: usize,
    /// World x and z in the segment frame, metres.
    pub ground: Option<[f32; 2]>,
    /// Height, metres.
    pub height: Option<f32>,
    /// Heading, radians.
    pub heading: Option<f32>,
}

impl RootKey {
    /// A key with all parts of a root.
    pub fn whole(frame: usize, root: GlobalRoot) -> Self {
        Self {
            frame,
            ground: Some([root.position.x, root.position.z]),
            height: Some(root.position.y),
            heading: Some(root.heading),
        }
    }
}

/// Roots that frames of a segment must have.
///
/// The pose tokens belong to the predicted trajectory. The decoder sees that trajectory bent
/// through the keys instead. The difference to a key is spread over the frames between keys by a
/// cubic curve each for place, height and heading. The curve is zero in the last context frame, and
/// constant after the last key.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RootOverride {
    keys: Box<[RootKey]>,
    last_context: usize,
}

impl RootOverride {
    /// An override through `keys`, whose frames increase. Keys up to frame `last_context` have no
    /// effect.
    pub fn new(keys: impl IntoIterator<Item = RootKey>, last_context: usize) -> Self {
        let keys = keys.into_iter().filter(|key| key.frame > last_context);
        Self {
            keys: keys.collect(),
            last_context,
        }
    }

    /// The keys after the context.
    pub fn keys(&self) -> &[RootKey] {
        &self.keys
    }

    /// Bends roots, frames of [`GLOBAL_ROOT`] numbers, through the keys.
    pub fn draw(&self, roots: &mut [f32]) {
        let (roots, _) = roots.as_chunks_mut::<GLOBAL_ROOT>();
        let lacking = self.lacking(roots.len(), |frame| GlobalRoot::from_array(roots[frame]));
        for (frame, root) in roots.iter_mut().enumerate().skip(self.last_context + 1) {
            let (shift, turn) = lacking.at(frame);
            let (turn_sin, turn_cos) = turn.sin_cos();
            let [x, y, z, cos, sin] = *root;
            *root = [
                x + shift.x,
                y + shift.y,
                z + shift.z,
                cos * turn_cos - sin * turn_sin,
                sin * turn_cos + cos * turn_sin,
            ];
        }
    }

    /// Bends roots through the keys, and turns poses along. `rotations` has `joints` rotations a
    /// frame, of which the first has no parent. Afterwards the keys are met up to rounding.
    pub fn pin(&self, roots: &mut [GlobalRoot], rotations: &mut [Quat], joints: usize) {
        let lacking = self.lacking(roots.len(), |frame| roots[frame]);
        let poses = rotations.chunks_exact_mut(joints.max(1));
        let frames = roots.iter_mut().zip(poses).enumerate();
        for (frame, (root, pose)) in frames.skip(self.last_context + 1) {
            let (shift, turn) = lacking.at(frame);
            root.position += shift;
            root.heading = wrap_angle(root.heading + turn);
            pose[0] = (yaw(turn) * pose[0]).normalize();
        }
    }

    /// The differences of `frames` roots to the keys.
    fn lacking(&self, frames: usize, root: impl Fn(usize) -> GlobalRoot) -> Lacking {
        let room = self.keys.len() + 1;
        let mut lacking = Lacking {
            ground: Curve::from(self.last_context, room),
            height: Curve::from(self.last_context, room),
            heading: Curve::from(self.last_context, room),
        };
        for key in self.keys.iter().take_while(|key| key.frame < frames) {
            let made = root(key.frame);
            if let Some([x, z]) = key.ground {
                let shift = [x - made.position.x, z - made.position.z];
                lacking.ground.push(key.frame, shift);
            }
            if let Some(height) = key.height {
                lacking.height.push(key.frame, [height - made.position.y]);
            }
            if let Some(heading) = key.heading {
                // The short way round from one key to the next.
                let [before] = lacking.heading.last();
                let turn = before + wrap_angle(heading - made.heading - before);
                lacking.heading.push(key.frame, [turn]);
            }
        }
        lacking
    }
}

/// Differences to the keys over the frames.
struct Lacking {
    ground: Curve<2>,
    height: Curve<1>,
    heading: Curve<1>,
}

impl Lacking {
    /// Offset and turn of a frame's root.
    fn at(&self, frame: usize) -> (Vec3, f32) {
        let [x, z] = self.ground.at(frame);
        let [y] = self.height.at(frame);
        let [turn] = self.heading.at(frame);
        (Vec3::new(x, y, z), turn)
    }
}

/// A cubic curve through values at frames. It starts at zero, at rest, and keeps its last value.
struct Curve<const N: usize> {
    knots: Vec<(usize, [f32; N])>,
}

impl<const N: usize> Curve<N> {
    fn from(frame: usize, room: usize) -> Self {
        let mut knots = Vec::with_capacity(room);
        knots.push((frame, [0.0; N]));
        Self { knots }
    }

    fn push(&mut self, frame: usize, value: [f32; N]) {
        self.knots.push((frame, value));
    }

    fn last(&self) -> [f32; N] {
        self.knots[self.knots.len() - 1].1
    }

    fn at(&self, frame: usize) -> [f32; N] {
        let after = self.knots.partition_point(|knot| knot.0 < frame);
        let Some(&(next, to)) = self.knots.get(after) else {
            return self.last();
        };
        if next == frame || after == 0 {
            return to;
        }
        let (before, from) = self.knots[after - 1];
        let span = (next - before) as f32;
        let (leaving, arriving) = (self.slope(after - 1), self.slope(after));
        let t = (frame - before) as f32 / span;
        std::array::from_fn(|axis| hermite(t, span, (from[axis], leaving[axis]), (to[axis], arriving[axis])))
    }

    /// Slope a frame at a knot: that of the parabola through it and its neighbours, zero at both
    /// ends.
    fn slope(&self, knot: usize) -> [f32; N] {
        let neighbours = knot
            .checked_sub(1)
            .and_then(|before| Some((self.knots.get(before)?, self.knots.get(knot + 1)?)));
        let Some((before, behind)) = neighbours else {
            return [0.0; N];
        };
        let here = &self.knots[knot];
        let spans = [(here.0 - before.0) as f32, (behind.0 - here.0) as f32];
        std::array::from_fn(|axis| {
            let slopes = [here.1[axis] - before.1[axis], behind.1[axis] - here.1[axis]];
            knot_slope([slopes[0] / spans[0], slopes[1] / spans[1]], spans)
        })
    }
}

#[cfg(test)]
#[path = "root_override_tests.rs"]
mod tests;
