//! Poses that the user gave on a skeleton of its own. A pose that goes to the pack's skeleton and
//! back differs by a degree or two. Frames meet the given pose exactly, and the difference eases
//! out over the frames beside it.

use troupe_motion::interpolate::smoothstep;
use troupe_motion::rotation::slerp;
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

/// Differences of given frames to those that are carried over.
#[derive(Debug, Default)]
pub(super) struct Pins(Vec<Pin>);

#[derive(Debug)]
struct Pin {
    frame: i64,
    root: Vec3,
    /// One turn a joint, in its parent's frame of reference. Empty: none.
    turns: Vec<Quat>,
}

impl Pins {
    /// Adds a given frame. `made` is the frame as it is carried over.
    pub(super) fn add(&mut self, frame: i64, given: &Given, made: (Vec3, &[Quat])) {
        let turns = given.rotations.as_ref().map(|given| {
            let pairs = given.iter().zip(made.1);
            pairs.map(|(given, made)| *given * made.conjugate()).collect()
        });
        self.insert(Pin {
            frame,
            root: apart(given.root, made.0),
            turns: turns.unwrap_or_default(),
        });
    }

    /// Lets no difference be left at `frame`, the last of those that cannot change any more.
    pub(super) fn none_at(&mut self, frame: i64) {
        self.insert(Pin {
            frame,
            root: Vec3::ZERO,
            turns: Vec::new(),
        });
    }

    /// Keeps the frames in their order.
    fn insert(&mut self, pin: Pin) {
        let at = self.0.partition_point(|other| other.frame <= pin.frame);
        self.0.insert(at, pin);
    }

    /// Puts right a frame that was carried over.
    pub(super) fn settle(&self, frame: i64, root: &mut Vec3, rotations: &mut [Quat]) {
        let after = self.0.partition_point(|pin| pin.frame <= frame);
        let (before, next) = (after.checked_sub(1).map(|at| &self.0[at]), self.0.get(after));
        let gap = match (before, next) {
            (Some(before), Some(next)) => EASE_FRAMES.min(next.frame - before.frame),
            _ => EASE_FRAMES,
        };
        for pin in [before, next].into_iter().flatten() {
            let away = (pin.frame - frame).abs() as f32 / gap.max(1) as f32;
            let share = smoothstep((1.0 - away).max(0.0));
            if share <= 0.0 {
                continue;
            }
            *root += share * pin.root;
            for (rotation, &turn) in rotations.iter_mut().zip(&pin.turns) {
                *rotation = (slerp(Quat::IDENTITY, turn, share) * *rotation).normalize();
            }
        }
    }
}

/// From a place to what is given of one.
fn apart(given: [Option<f32>; 3], made: Vec3) -> Vec3 {
    let made = made.to_array();
    Vec3::from_array([0, 1, 2].map(|axis: usize| given[axis].map_or(0.0, |value| value - made[axis])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_meet_what_was_given_and_others_hardly_change() {
        let turn = Quat::from_rotation_x(0.1);
        let given = Given {
            root: [Some(1.0), None, None],
            rotations: Some(vec![turn]),
        };
        let mut pins = Pins::default();
        for frame in [3, 5, 40] {
            pins.add(frame, &given, (Vec3::ZERO, &[Quat::IDENTITY]));
        }
        let at = |frame: i64| {
            let (mut root, mut rotations) = (Vec3::ZERO, [Quat::IDENTITY]);
            pins.settle(frame, &mut root, &mut rotations);
            (root.x, rotations[0].angle_between(Quat::IDENTITY))
        };
        for frame in [3, 5, 40] {
            let (x, angle) = at(frame);
            assert!(
                (x - 1.0).abs() < 1e-6 && (angle - 0.1).abs() < 1e-3,
                "{frame}: {x} {angle}"
            );
        }
        assert_eq!(at(20), (0.0, 0.0));
        // However they are added, and with an end to the first difference.
        let mut pins = Pins::default();
        pins.add(40, &given, (Vec3::ZERO, &[Quat::IDENTITY]));
        pins.add(-1, &given, (Vec3::ZERO, &[Quat::IDENTITY]));
        pins.none_at(36);
        let shift = |frame: i64| {
            let (mut root, mut rotations) = (Vec3::ZERO, [Quat::IDENTITY]);
            pins.settle(frame, &mut root, &mut rotations);
            root.x
        };
        assert!(
            shift(0) > 0.9 && shift(40) == 1.0 && shift(36) == 0.0,
            "{} {}",
            shift(0),
            shift(36)
        );
        let steps: Vec<f32> = (0..60).map(|frame| at(frame + 1).0 - at(frame).0).collect();
        assert!(steps.iter().all(|step| step.abs() < 0.2), "{steps:?}");
    }
}
