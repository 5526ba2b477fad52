//! The way of a foot: still while it stands, and from one place to the next between.

use std::f32::consts::PI;
use std::ops::Range;

use glam::Vec3;

use crate::ik::smooth;
use crate::interpolate::{hermite, smoothstep};

use super::schedule::{flat, velocity};

/// A contact this near to a fixed frame stands where the foot is, frames.
const ANCHOR_FRAMES: usize = 3;
/// Frames over which heights leave those of a fixed frame.
const EDGE_FRAMES: usize = 6;
/// Frames over which an offset fades out behind the last contact.
const FADE_FRAMES: usize = 12;
/// A foot that is carried farther than the network has it is lifted by this share of the
/// difference, at most by the second value, leg lengths.
const LIFT_SHARE: f32 = 0.15;
const MOST_LIFT: f32 = 0.09;
/// Half of the window over which heights are smoothed, frames.
const HEIGHT_HALF_WINDOW: usize = 1;

/// An offset of a foot and its velocity, metres and metres a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Knot {
    pub(super) offset: Vec3,
    pub(super) velocity: Vec3,
}

/// What one foot does, and where it may not be changed.
#[derive(Debug)]
pub(super) struct Foot<'a> {
    /// Places of the foot's foremost point.
    pub(super) toes: &'a [Vec3],
    /// Heights of the lowest point of the foot over where it stands, metres.
    pub(super) low_m: &'a [f32],
    /// Contacts, in the order of their frames.
    pub(super) stands: &'a [Range<usize>],
    pub(super) length_m: f32,
    /// The last frame before the free ones, and the first behind them.
    pub(super) fixed: [Option<(usize, Knot)>; 2],
    /// Where the foot stands in the fixed frame before the free ones.
    pub(super) held: Option<Vec3>,
}

impl Foot<'_> {
    /// The offset of the foot in every frame.
    pub(super) fn offsets(&self) -> Vec<Vec3> {
        let frames = self.toes.len();
        let mut offsets = vec![Vec3::ZERO; frames];
        for span in self.stands {
            self.stand(span, &mut offsets);
        }
        self.swing(&mut offsets);
        offsets
    }

    /// Offsets within a contact.
    fn stand(&self, span: &Range<usize>, offsets: &mut [Vec3]) {
        let last = span.end - 1;
        let [before, behind] = self.fixed;
        // Beside a fixed frame there is no room to go to another place.
        let begins = before.and_then(|(frame, knot)| match span.start <= frame {
            true => self.held,
            false => (span.start <= frame + ANCHOR_FRAMES).then_some(self.toes[span.start] + knot.offset),
        });
        let ends = behind
            .and_then(|(frame, _)| (last + ANCHOR_FRAMES >= frame).then_some(self.toes[last.min(frame)]));
        let mean = self.toes[span.clone()].iter().sum::<Vec3>() / span.len() as f32;
        for frame in span.clone() {
            let share = smoothstep((frame - span.start) as f32 / (span.len() - 1).max(1) as f32);
            let place = match (begins, ends) {
                (Some(begins), Some(ends)) => begins.lerp(ends, share),
                (Some(place), None) | (None, Some(place)) => place,
                (None, None) => mean,
            };
            offsets[frame] = flat(place - self.toes[frame]);
        }
        // The lowest point comes onto the ground.
        let low: Vec<f32> = self.low_m[span.clone()].to_vec();
        for (frame, low) in span.clone().zip(smooth(&low, HEIGHT_HALF_WINDOW)) {
            offsets[frame].y = self.eased(frame, -low);
        }
    }

    /// A height that leaves that of a fixed frame, and comes to it, over a few frames.
    fn eased(&self, frame: usize, height_m: f32) -> f32 {
        let [before, behind] = self.fixed;
        let near = |from: usize| smoothstep((frame.abs_diff(from) as f32 / EDGE_FRAMES as f32).min(1.0));
        let leaves = before.map_or(height_m, |(from, knot)| {
            knot.offset.y + (height_m - knot.offset.y) * near(from)
        });
        leaves * behind.map_or(1.0, |(from, _)| near(from))
    }

    /// Offsets between contacts, before the first and behind the last.
    fn swing(&self, offsets: &mut [Vec3]) {
        let frames = offsets.len();
        let [before, behind] = self.fixed;
        let mut knots: Vec<(Range<usize>, [Knot; 2])> = Vec::with_capacity(self.stands.len() + 2);
        if let Some((frame, knot)) = before
            && self.stands.first().is_none_or(|span| span.start > frame)
        {
            knots.push((frame..frame + 1, [knot; 2]));
        }
        for span in self.stands {
            let [from, to] = [span.start, span.end - 1].map(|frame| Knot {
                offset: offsets[frame],
                // The foot leaves its place, and comes to it, without a jump of its speed.
                velocity: -velocity(self.toes, frame),
            });
            knots.push((span.clone(), [from, to]));
        }
        if let Some((frame, knot)) = behind
            && self.stands.last().is_none_or(|span| span.end <= frame)
        {
            knots.push((frame..frame + 1, [knot; 2]));
        }
        if let (Some((first, [start, _])), Some((last, [_, end]))) = (knots.first(), knots.last()) {
            for offset in &mut offsets[..first.start] {
                *offset = start.offset;
            }
            let fades = (last.end + FADE_FRAMES, Knot::default());
            self.carry((last.end - 1, *end), fades, offsets);
        }
        for pair in knots.windows(2) {
            let [(left, [_, from]), (right, [to, _])] = pair else {
                continue;
            };
            self.carry((left.end - 1, *from), (right.start, *to), offsets);
        }
        let free = before.map_or(0, |(frame, _)| frame + 1)..behind.map_or(frames, |(frame, _)| frame);
        for frame in free {
            offsets[frame].y = offsets[frame].y.max(self.eased(frame, -self.low_m[frame]));
        }
    }

    /// Offsets between two frames. A foot that is carried farther is lifted.
    fn carry(&self, (left, from): (usize, Knot), (right, to): (usize, Knot), offsets: &mut [Vec3]) {
        let span = (right - left) as f32;
        let farther_m = flat(to.offset - from.offset).length();
        let lift_m = (LIFT_SHARE * farther_m).min(MOST_LIFT * self.length_m);
        for frame in left + 1..right.min(offsets.len()) {
            let way = (frame - left) as f32 / span;
            let curve =
                |from: f32, leaves: f32, to: f32, comes: f32| hermite(way, span, (from, leaves), (to, comes));
            let (a, u, b, v) = (from.offset, from.velocity, to.offset, to.velocity);
            let y = curve(a.y, u.y, b.y, v.y);
            let lack_m = lift_m * (PI * way).sin() - (self.low_m[frame] + y);
            offsets[frame] = Vec3::new(
                curve(a.x, u.x, b.x, v.x),
                y + lack_m.max(0.0),
                curve(a.z, u.z, b.z, v.z),
            );
        }
    }
}
