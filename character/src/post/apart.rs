//! Ways around: where a bone would pass through another in some frames, how far it has to leave its
//! path in these frames and in those around them.

use std::ops::Range;

use troupe_motion::Vec3;
use troupe_motion::bones::nearest_points;
use troupe_motion::interpolate::smoothstep;

/// Frames that a limb takes to leave its path, and as many to return, around the frame with the
/// greatest detour.
pub(super) const AROUND_FRAMES: usize = 4;
/// Frames over which limbs begin to leave their path at the start of a plan.
pub(super) const LEAVE_FRAMES: usize = 2;
/// Farthest that a limb leaves its path, metres.
const FARTHEST_M: f32 = 0.12;
/// Distances between bones shorter than this have no direction, metres.
const NOWHERE_M: f32 = 0.005;

/// How a bone lies to another in a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Meeting {
    /// The point of the bone that is nearest to the other.
    pub(super) point: Vec3,
    /// From the other bone to that point, over the ground, metres.
    between: Vec3,
    /// Least distance there over the ground, metres.
    least_m: f32,
    /// How far that point goes when the bone's second end moves by 1.
    share: f32,
    /// To the side on which the bone hangs, over the ground.
    side: Vec3,
}

impl Meeting {
    /// Of two bones, each from end to end, that should be `apart_m` apart.
    pub(super) fn of(bone: [Vec3; 2], other: [Vec3; 2], side: Vec3, apart_m: f32) -> Self {
        let [point, on_other] = nearest_points(bone, other);
        let between = point - on_other;
        let length = bone[0].distance(bone[1]).max(NOWHERE_M);
        Self {
            point,
            between: between.with_y(0.0),
            least_m: (apart_m * apart_m - between.y * between.y).max(0.0).sqrt(),
            share: (point.distance(bone[0]) / length).min(1.0),
            side: side.with_y(0.0),
        }
    }

    /// The same if the point counts from this share of the bone on: nearer to the first end, moving
    /// the second helps little. At 1 every point moves as far as the limb.
    pub(super) fn counting_from(self, least_share: f32) -> Self {
        Self {
            share: self.share.max(least_share),
            ..self
        }
    }

    /// Distance that is missing, metres; negative if the bones are apart.
    pub(super) fn lack_m(&self) -> f32 {
        self.least_m - self.between.length()
    }
}

/// Runs of frames in which the bones are too near.
pub(super) fn runs(meetings: &[Meeting]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for (frame, _) in meetings.iter().enumerate().filter(|(_, m)| m.lack_m() > 0.0) {
        match runs.last_mut() {
            Some(run) if run.end == frame => run.end += 1,
            _ => runs.push(frame..frame + 1),
        }
    }
    runs
}

/// The frames of a range and `reach` frames on either side, within `len` frames.
pub(super) fn around(range: Range<usize>, reach: usize, len: usize) -> Range<usize> {
    range.start.saturating_sub(reach)..(range.end + reach).min(len)
}

/// The direction in which bones are moved apart while they are near. It is the same in all of those
/// frames: otherwise a limb that passes through the other would be pushed to one side first, and
/// then to the other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Apart {
    direction: Vec3,
}

impl Apart {
    /// For a run of frames.
    pub(super) fn of(near: &[Meeting]) -> Self {
        let [.., last] = near else {
            return Self { direction: Vec3::X };
        };
        let mean = near.iter().map(|m| m.between).sum::<Vec3>() / near.len() as f32;
        let passes = last.between - near[0].between;
        let side = near[near.len() / 2].side;
        // Across the direction of passing, to the side that the limb is on, or else that on which
        // it hangs.
        let across = |side: Vec3| match passes.length() > NOWHERE_M {
            true => side - passes * (side.dot(passes) / passes.length_squared()),
            false => side,
        };
        let candidates = [across(mean), across(side), side];
        let found = candidates.into_iter().find(|way| way.length() > NOWHERE_M);
        Self {
            direction: found.unwrap_or(Vec3::X).normalize(),
        }
    }

    /// Offset of the bone's second end against the other bone, metres.
    pub(super) fn way(&self, meeting: &Meeting) -> Vec3 {
        let along = meeting.between.dot(self.direction);
        let aside = meeting.between - self.direction * along;
        let wanted = (meeting.least_m * meeting.least_m - aside.length_squared())
            .max(0.0)
            .sqrt();
        self.direction * ((wanted - along).max(0.0) / meeting.share).min(FARTHEST_M)
    }
}

/// Offsets that grow and fade over [`AROUND_FRAMES`]. None is smaller than before, except at the
/// very start.
pub(super) fn eased(ways: &[Vec3]) -> Vec<Vec3> {
    let near = |frame: usize, reach: usize| around(frame..frame + 1, reach, ways.len());
    let longer = |a: Vec3, b: Vec3| match b.length_squared() > a.length_squared() {
        true => b,
        false => a,
    };
    let longest = |frame: usize| {
        let all = ways[near(frame, AROUND_FRAMES)].iter().copied();
        all.fold(Vec3::ZERO, longer)
    };
    let mut eased: Vec<Vec3> = (0..ways.len()).map(longest).collect();
    for _ in 0..2 {
        let mean = |frame: usize| {
            let some = &eased[near(frame, AROUND_FRAMES / 2)];
            some.iter().sum::<Vec3>() / some.len() as f32
        };
        eased = (0..ways.len()).map(mean).collect();
    }
    for (frame, way) in eased.iter_mut().enumerate().take(LEAVE_FRAMES) {
        *way *= smoothstep((frame + 1) as f32 / (LEAVE_FRAMES + 1) as f32);
    }
    eased
}

#[cfg(test)]
#[path = "apart_tests.rs"]
mod tests;
