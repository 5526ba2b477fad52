//! Poses that the user gave on a skeleton of its own. A pose that goes to the pack's skeleton and
//! back differs by a degree or two. Frames meet the given pose exactly, and the difference eases
//! out over the frames beside it.

use troupe_live::skeleton::{Difference, Worn};
use troupe_motion::interpolate::smoothstep;
use troupe_motion::{Quat, Vec3};

/// Frames over which a difference eases out.
const EASE_FRAMES: i64 = 8;

/// What the user gave of a frame.
#[derive(Debug, Clone, Default)]
pub(super) struct Given {
    /// Position of the root joint: x, y, z.
    pub(super) root: [Option<f32>; 3],
    /// Rotations of all joints.
    pub(super) rotations: Option<Vec<Quat>>,
}

/// Differences of given frames to those that are carried over, in the order of the frames.
#[derive(Debug, Default)]
pub(super) struct Pins(Vec<(i64, Difference)>);

impl Pins {
    /// Adds a given frame. `made` is the frame as it is carried over.
    pub(super) fn add(&mut self, worn: &Worn, frame: i64, given: &Given, made: (Vec3, &[Quat])) {
        let root = made.0.to_array();
        let root = [0, 1, 2].map(|axis: usize| given.root[axis].unwrap_or(root[axis]));
        let root = Vec3::from_array(root);
        let difference = match &given.rotations {
            Some(rotations) => worn.difference(made, (root, rotations)),
            None => Difference::of_place(root - made.0),
        };
        self.insert(frame, difference);
    }

    /// Lets no difference be left at `frame`, the last of those that cannot change any more.
    pub(super) fn none_at(&mut self, frame: i64) {
        self.insert(frame, Difference::none());
    }

    /// Keeps the frames in their order.
    fn insert(&mut self, frame: i64, difference: Difference) {
        let at = self.0.partition_point(|(other, _)| *other <= frame);
        self.0.insert(at, (frame, difference));
    }

    /// Puts right a frame that was carried over.
    pub(super) fn settle(&self, worn: &Worn, frame: i64, root: &mut Vec3, rotations: &mut [Quat]) {
        let shares = self.shares(frame);
        let shares: Vec<_> = shares.into_iter().flatten().collect();
        worn.add(&shares, root, rotations);
    }

    /// What is left of the differences beside a frame, 0 to 1.
    fn shares(&self, frame: i64) -> [Option<(f32, &Difference)>; 2] {
        let after = self.0.partition_point(|(pinned, _)| *pinned <= frame);
        let beside = [after.checked_sub(1), Some(after)];
        let beside = beside.map(|at| at.and_then(|at| self.0.get(at)));
        let gap = match beside {
            [Some((before, _)), Some((next, _))] => EASE_FRAMES.min(next - before),
            _ => EASE_FRAMES,
        };
        beside.map(|pin| {
            let (pinned, difference) = pin?;
            let away = (pinned - frame).abs() as f32 / gap.max(1) as f32;
            let share = smoothstep((1.0 - away).max(0.0));
            (share > 0.0).then_some((share, difference))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_have_all_of_what_was_given_and_others_next_to_nothing() {
        let mut pins = Pins::default();
        for frame in [3, 5, 40] {
            pins.insert(frame, Difference::none());
        }
        let sum = |pins: &Pins, frame: i64| -> f32 {
            pins.shares(frame).iter().flatten().map(|(share, _)| share).sum()
        };
        for frame in [3, 5, 40] {
            assert_eq!(sum(&pins, frame), 1.0, "{frame}");
        }
        assert_eq!(sum(&pins, 20), 0.0);
        let each = 0..60;
        let steps: Vec<f32> = each
            .map(|frame| sum(&pins, frame + 1) - sum(&pins, frame))
            .collect();
        assert!(steps.iter().all(|step| step.abs() < 0.2), "{steps:?}");
        // However they are added, and with an end to the first difference.
        let given = |x: f32| Difference::of_place(x * Vec3::X);
        let mut pins = Pins::default();
        pins.insert(40, given(1.0));
        pins.insert(-1, given(1.0));
        pins.none_at(36);
        let shift = |frame: i64| {
            let shares = pins.shares(frame);
            let of_none = |difference: &Difference| *difference == Difference::none();
            let shares = shares.iter().flatten().filter(|(_, found)| !of_none(found));
            shares.map(|(share, _)| share).sum::<f32>()
        };
        assert!(
            shift(0) > 0.9 && shift(40) == 1.0 && shift(36) == 0.0,
            "{} {}",
            shift(0),
            shift(36)
        );
    }
}
