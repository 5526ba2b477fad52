//! Pinning: makes generated frames meet their keyframes exactly, without a pop.
//!
//! The networks come close to a keyframe, but not onto it. [`crate::segment::pin_targets`] spreads
//! the root's error over the whole gap (root interpolation, MotionBricks fig. 14), and
//! [`pin_poses`] the pose's error over a few frames on either side.

use glam::Quat;

use crate::interpolate::smoothstep;
use crate::rotation::align_sign;

/// A pose that a frame must have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosePin<'a> {
    /// Index of the frame.
    pub frame: usize,
    /// The required rotations, in the form of the generated ones: joint 0 in the world or segment,
    /// others parent-relative.
    pub rotations: &'a [Quat],
}

/// Turns generated poses so that every pinned frame has exactly its required rotations.
///
/// The error at a pin fades out over `reach_frames` on either side, or sooner if the next pin is
/// nearer, so pins do not affect each other. `rotations` has `joints` rotations a frame. Pins
/// beyond the end, or without `joints` rotations, are ignored. Pins must be in the order of their
/// frames.
pub fn pin_poses(rotations: &mut [Quat], joints: usize, pins: &[PosePin<'_>], reach_frames: usize) {
    let frames = rotations.len() / joints.max(1);
    let pins: Vec<&PosePin<'_>> = pins
        .iter()
        .filter(|pin| pin.frame < frames && pin.rotations.len() == joints)
        .collect();
    // All residuals before any change, so that each is relative to the generated pose.
    let mut residuals = Vec::with_capacity(pins.len() * joints);
    for pin in &pins {
        let generated = &rotations[pin.frame * joints..][..joints];
        residuals.extend(
            pin.rotations
                .iter()
                .zip(generated)
                .map(|(given, made)| residual(*given, *made)),
        );
    }
    for (nth, pin) in pins.iter().enumerate() {
        let lacking = &residuals[nth * joints..][..joints];
        let before = nth.checked_sub(1).map_or(0, |previous| pins[previous].frame + 1);
        let after = pins.get(nth + 1).map_or(frames, |next| next.frame);
        for frame in
            before.max(pin.frame.saturating_sub(reach_frames))..after.min(pin.frame + reach_frames + 1)
        {
            let made = &mut rotations[frame * joints..][..joints];
            if frame == pin.frame {
                for (made, given) in made.iter_mut().zip(pin.rotations) {
                    *made = align_sign(*given, *made);
                }
                continue;
            }
            let room = if frame < pin.frame {
                pin.frame + 1 - before
            } else {
                after - pin.frame
            };
            let weight = fade(frame.abs_diff(pin.frame), reach_frames.min(room));
            for (made, lacking) in made.iter_mut().zip(lacking) {
                *made = (Quat::IDENTITY.slerp(*lacking, weight) * *made).normalize();
            }
        }
    }
}

/// The turn from `made` to `given`, the short way.
fn residual(given: Quat, made: Quat) -> Quat {
    let turn = given * made.conjugate();
    if turn.w < 0.0 { -turn } else { turn }
}

/// Share of a pin's error that a frame takes at `distance` frames from it: 1 at the pin, 0 from
/// `reach` frames on, flat at both ends.
pub fn fade(distance: usize, reach: usize) -> f32 {
    if distance == 0 {
        return 1.0;
    }
    let t = (distance as f32 / reach.max(1) as f32).min(1.0);
    1.0 - smoothstep(t)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const JOINTS: usize = 3;

    fn wavy(frames: usize) -> Vec<Quat> {
        (0..frames * JOINTS)
            .map(|i| Quat::from_rotation_x((i as f32 * 0.13).sin()) * Quat::from_rotation_z(i as f32 * 0.02))
            .collect()
    }

    fn pose(angle: f32) -> [Quat; JOINTS] {
        [
            Quat::from_rotation_y(angle),
            Quat::from_rotation_x(angle),
            Quat::from_rotation_z(-angle),
        ]
    }

    fn same(a: Quat, b: Quat) -> bool {
        a.dot(b).abs() > 1.0 - 1e-5
    }

    #[test]
    fn pinned_frames_are_exact_and_distant_ones_untouched() {
        let before = wavy(40);
        let mut after = before.clone();
        let (first, last) = (pose(0.3), pose(-0.4));
        let pins = [
            PosePin {
                frame: 3,
                rotations: &first,
            },
            PosePin {
                frame: 39,
                rotations: &last,
            },
        ];
        pin_poses(&mut after, JOINTS, &pins, 6);
        for joint in 0..JOINTS {
            assert!(same(after[3 * JOINTS + joint], first[joint]));
            assert!(same(after[39 * JOINTS + joint], last[joint]));
        }
        assert_eq!(after[9 * JOINTS..33 * JOINTS], before[9 * JOINTS..33 * JOINTS]);
        assert!(!same(after[4 * JOINTS], before[4 * JOINTS]));
    }

    #[test]
    fn a_pin_that_is_already_met_changes_nothing() {
        let before = wavy(10);
        let mut after = before.clone();
        let given = before[4 * JOINTS..5 * JOINTS].to_vec();
        pin_poses(
            &mut after,
            JOINTS,
            &[PosePin {
                frame: 4,
                rotations: &given,
            }],
            8,
        );
        assert!(after.iter().zip(&before).all(|(a, b)| same(*a, *b)));
    }

    #[test]
    fn unusable_pins_are_ignored() {
        let before = wavy(5);
        let mut after = before.clone();
        let (given, short) = (pose(1.0), [Quat::IDENTITY]);
        let pins = [
            PosePin {
                frame: 2,
                rotations: &short,
            },
            PosePin {
                frame: 5,
                rotations: &given,
            },
        ];
        pin_poses(&mut after, JOINTS, &pins, 8);
        assert_eq!(after, before);
    }

    proptest! {
        #[test]
        fn every_pin_is_met_whatever_the_others(
            mut frames in proptest::collection::btree_set(0_usize..30, 1..8),
            reach in 0_usize..12,
        ) {
            let poses: Vec<[Quat; JOINTS]> = (0..frames.len()).map(|i| pose(0.2 * i as f32 - 0.5)).collect();
            let places: Vec<usize> = std::mem::take(&mut frames).into_iter().collect();
            let pins: Vec<PosePin<'_>> = places
                .iter()
                .zip(&poses)
                .map(|(&frame, rotations)| PosePin { frame, rotations })
                .collect();
            let mut made = wavy(30);
            pin_poses(&mut made, JOINTS, &pins, reach);
            for pin in pins {
                for joint in 0..JOINTS {
                    prop_assert!(same(made[pin.frame * JOINTS + joint], pin.rotations[joint]));
                }
            }
        }
    }
}
