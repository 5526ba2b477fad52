use std::f32::consts::{FRAC_PI_2, TAU};

use glam::{Quat, Vec3};
use proptest::prelude::*;

use super::*;
use crate::clip::Clip;
use crate::root::wrap_angle;
use crate::rotation::{angle_between, yaw};
use crate::testing::{biped, stand};

/// A walk of the test biped: straight swinging legs and a swaying pelvis, on a line or an arc.
#[derive(Clone, Copy, Debug)]
struct Steps {
    frames: usize,
    period: f32,
    left_mps: f32,
    forward_mps: f32,
    heading: f32,
    turn_rps: f32,
    /// Frames after the first at which the left foot is foremost.
    first: f32,
}

const WALK: Steps = Steps {
    frames: 120,
    period: 32.0,
    left_mps: 0.0,
    forward_mps: 1.2,
    heading: 0.7,
    turn_rps: 0.0,
    first: 11.0,
};

impl Steps {
    fn clip(&self) -> Clip {
        let mut clip = stand(self.frames);
        let travel = Vec3::new(self.left_mps, 0.0, self.forward_mps);
        // Legs swing in the direction of travel: forwards about X, sideways about Z.
        let axis = Vec3::new(-travel.z, 0.0, travel.x).normalize_or_zero();
        let mut ground = Vec3::ZERO;
        for f in 0..self.frames {
            let phase = TAU * (f as f32 - self.first) / self.period;
            let heading = self.heading + self.turn_rps * f as f32 / 30.0;
            let pose = clip.rotations_at_mut(f);
            pose[0] = yaw(heading + 0.1 * phase.sin());
            pose[2] = Quat::from_axis_angle(axis, 0.4 * phase.cos());
            pose[5] = Quat::from_axis_angle(axis, -0.4 * phase.cos());
            let bob = 0.02 * (2.0 * phase).cos();
            clip.root_positions[f] = ground + Vec3::new(0.0, 0.95 + bob, 0.0);
            ground += yaw(heading + 0.5 * self.turn_rps / 30.0) * travel / 30.0;
        }
        clip
    }
}

fn best(clip: &Clip) -> Cycle {
    find_cycles(clip, &CycleOptions::default()).unwrap()[0]
}

#[test]
fn a_straight_walk_is_measured() {
    let cycle = best(&WALK.clip());
    // Left strikes at 11, 43, 75, 107.
    assert_eq!((cycle.start + 32 - 11) % 32, 0, "{cycle:?}");
    assert_eq!(cycle.frames, 32);
    assert!(
        (cycle.forward_mps - 1.2).abs() < 1e-3 && cycle.left_mps.abs() < 1e-3,
        "{cycle:?}"
    );
    assert!(
        cycle.turn_rps.abs() < 1e-3 && (cycle.heading - 0.7).abs() < 1e-3,
        "{cycle:?}"
    );
    assert!(
        (cycle.height_m - 0.95).abs() < 1e-3 && cycle.closure_m < 1e-3,
        "{cycle:?}"
    );
    assert!((cycle.speed_mps() - 1.2).abs() < 1e-3);
}

#[test]
fn sideways_and_backwards_start_with_the_leading_foot() {
    for (left, forward) in [(0.6, 0.6), (-0.5, 0.9), (0.0, -0.8)] {
        let steps = Steps {
            left_mps: left,
            forward_mps: forward,
            ..WALK
        };
        let cycle = best(&steps.clip());
        assert!(
            (cycle.left_mps - left).abs() < 2e-3 && (cycle.forward_mps - forward).abs() < 2e-3,
            "{cycle:?}"
        );
        assert_eq!((cycle.start + 32 - 11) % 32, 0, "{cycle:?}");
    }
}

#[test]
fn a_curve_has_a_turning_rate() {
    let steps = Steps {
        turn_rps: 0.9,
        ..WALK
    };
    let options = CycleOptions {
        way: Way::Turning,
        ..CycleOptions::default()
    };
    let cycle = find_cycles(&steps.clip(), &options).unwrap()[0];
    assert!((cycle.turn_rps - 0.9).abs() < 0.02, "{cycle:?}");
    assert!(
        (cycle.forward_mps - 1.2).abs() < 0.02 && cycle.left_mps.abs() < 0.03,
        "{cycle:?}"
    );
}

#[test]
fn the_turning_cycle_is_found_among_straight_ones() {
    // Straight, a quarter turn over 45 frames, straight again.
    let mut clip = Steps { frames: 200, ..WALK }.clip();
    let mut ground = Vec3::ZERO;
    for f in 0..200 {
        let turn = FRAC_PI_2 * ((f as f32 - 80.0) / 45.0).clamp(0.0, 1.0);
        clip.rotations_at_mut(f)[0] = yaw(turn) * clip.rotations_at(f)[0];
        clip.root_positions[f] = ground.with_y(clip.root_positions[f].y);
        ground += yaw(0.7 + turn) * Vec3::Z * (1.2 / 30.0);
    }
    let with = |way| {
        let options = CycleOptions {
            way,
            ..CycleOptions::default()
        };
        find_cycles(&clip, &options).unwrap()[0]
    };
    assert!(with(Way::Turning).turn_rps > 0.8, "{:?}", with(Way::Turning));
    assert!(
        with(Way::Straight).turn_rps.abs() < 0.05,
        "{:?}",
        with(Way::Straight)
    );
}

#[test]
fn errors_say_why_a_clip_has_no_cycle() {
    let why = |clip: &Clip| find_cycles(clip, &CycleOptions::default()).unwrap_err();
    assert_eq!(why(&stand(9)), GaitError::TooShort { frames: 9, least: 14 });
    assert_eq!(why(&stand(90)), GaitError::Stands { speed_mps: 0.0 });
    let mut glides = stand(90);
    (0..90).for_each(|f| glides.root_positions[f].z = f as f32 * 0.04);
    assert!(
        matches!(why(&glides), GaitError::NoSteps { strikes: 0 | 1 }),
        "{}",
        why(&glides)
    );
    let short = Steps { frames: 40, ..WALK }.clip();
    assert_eq!(why(&short), GaitError::NoSteps { strikes: 1 });
    let slow = Steps {
        period: 90.0,
        frames: 300,
        ..WALK
    };
    let error = why(&slow.clip());
    assert!(
        matches!(
            error,
            GaitError::Period {
                shortest: 90,
                longest: 90,
                least: 12,
                most: 75
            }
        ),
        "{error}"
    );
    // Every stride is higher than the one before.
    let mut climbs = WALK.clip();
    (0..120).for_each(|f| climbs.root_positions[f].y += 0.01 * f as f32);
    assert!(matches!(why(&climbs), GaitError::Open { .. }), "{}", why(&climbs));
}

#[test]
fn a_skeleton_without_sides_has_no_gait() {
    let mut skeleton = (*biped()).clone();
    skeleton.contacts = None;
    let walk = WALK.clip();
    let clip = Clip::new(skeleton.into(), 30.0, walk.root_positions, walk.rotations).unwrap();
    assert_eq!(
        find_cycles(&clip, &CycleOptions::default()),
        Err(GaitError::NoFeet)
    );
    assert_eq!(
        find_stand(&clip, &StandOptions::default()),
        Err(GaitError::NoFeet)
    );
}

#[test]
fn feet_take_the_side_of_their_leg() {
    let feet = feet(&biped()).unwrap();
    assert_eq!((feet.left, feet.right), (vec![3, 4], vec![6, 7]));
}

#[test]
fn the_stillest_frame_is_the_stand() {
    let mut clip = stand(30);
    for f in 0..30 {
        // Leans ahead, slower and slower until frame 20, then faster again.
        let away = (f as f32 - 20.0) / 30.0;
        clip.root_positions[f].z = away * away;
    }
    let found = find_stand(&clip, &StandOptions::default()).unwrap();
    assert!((20..=21).contains(&found.frame), "{found:?}");
    assert!(
        found.speed_mps < 0.04 && (found.height_m - 0.97).abs() < 1e-6,
        "{found:?}"
    );
}

#[test]
fn hopping_or_fidgeting_is_not_standing() {
    let mut hops = stand(30);
    (0..30).for_each(|f| hops.rotations_at_mut(f)[2] = Quat::from_rotation_x(1.0));
    let error = find_stand(&hops, &StandOptions::default()).unwrap_err();
    assert!(
        matches!(error, GaitError::Restless { speed_mps, .. } if speed_mps.is_infinite()),
        "{error}"
    );
    let mut fidgets = stand(30);
    (0..30).for_each(|f| fidgets.root_positions[f].z = 0.1 * (f % 2) as f32);
    let error = find_stand(&fidgets, &StandOptions::default()).unwrap_err();
    assert!(
        matches!(error, GaitError::Restless { speed_mps, .. } if speed_mps > 1.0),
        "{error}"
    );
}

#[test]
fn a_stand_is_held_for_ever() {
    let mut clip = stand(3);
    clip.rotations_at_mut(1)[0] = yaw(1.3);
    let closed = ClosedCycle::stand(&clip, 1);
    assert!(closed.stands() && closed.velocity() == (0.0, 0.0, 0.0));
    for at in [-7.5, 0.0, 100.0] {
        let (root, pose) = closed.at(at);
        assert!((root - Vec3::Y * 0.97).length() < 1e-6, "{root}");
        assert!(angle_between(pose[0], Quat::IDENTITY) < 1e-3);
    }
}

/// A captured cycle that does not quite close, on any course.
fn captured() -> impl Strategy<Value = Steps> {
    let courses = (-0.8f32..0.8, 0.5f32..2.0, -3.0f32..3.0, -1.0f32..1.0);
    (courses, 16.0f32..50.0).prop_map(|((left, forward, heading, turn), period)| Steps {
        frames: 170,
        period,
        left_mps: left,
        forward_mps: forward,
        heading,
        turn_rps: turn,
        first: 8.0,
    })
}

proptest! {
    #[test]
    fn a_closed_cycle_has_no_seam(steps in captured(), at in -3.0f32..3.0) {
        let clip = steps.clip();
        let Ok(found) = find_cycles(&clip, &CycleOptions::default()) else {
            return Err(TestCaseError::reject("no cycle"));
        };
        let closed = ClosedCycle::new(&clip, &found[0]);
        let frames = closed.frames() as f32;
        // A cycle later it has the same pose, turned by the cycle's turn, and has travelled along
        // its arc.
        let at = at * frames;
        let (here, pose) = closed.at(at);
        let (there, later) = closed.at(at + frames);
        let turned = closed.heading_at(at + frames) - closed.heading_at(at);
        prop_assert!((there.y - here.y).abs() < 1e-3);
        prop_assert!(angle_between(later[0], yaw(turned) * pose[0]) < 5e-3);
        for (a, b) in pose.iter().zip(&later).skip(1) {
            prop_assert!(angle_between(*a, *b) < 2e-3);
        }
        // No jump anywhere around the seam.
        let step = |f: f32| closed.at(f + 1.0).0 - closed.at(f).0;
        let seam = step(frames - 1.0);
        let speed = closed.velocity().0.hypot(closed.velocity().1) / 30.0;
        prop_assert!((seam.with_y(0.0).length() - speed).abs() < 0.25 * speed + 0.01, "{seam} {speed}");
    }

    #[test]
    fn a_closed_cycle_keeps_the_pace(steps in captured()) {
        let clip = steps.clip();
        let Ok(found) = find_cycles(&clip, &CycleOptions::default()) else {
            return Err(TestCaseError::reject("no cycle"));
        };
        let closed = ClosedCycle::new(&clip, &found[0]);
        let (left, forward, turn) = closed.velocity();
        prop_assert!((left - steps.left_mps).abs() < 0.12, "{left} {}", steps.left_mps);
        prop_assert!((forward - steps.forward_mps).abs() < 0.12, "{forward} {}", steps.forward_mps);
        prop_assert!(wrap_angle(turn - steps.turn_rps).abs() < 0.15, "{turn} {}", steps.turn_rps);
        let sampled = closed.clip(-5.0, 2 * closed.frames()).unwrap();
        let mean = sampled.root_positions.iter().map(|p| p.y).sum::<f32>() / sampled.frames() as f32;
        prop_assert!((mean - closed.height_m()).abs() < 2e-3);
    }
}
