use proptest::prelude::*;

use super::testing::*;
use super::*;
use crate::fk::WorldMotion;
use crate::metrics::foot_skate_m_per_frame;

type Frames = (Vec<Vec3>, Vec<Quat>, Vec<u8>);

fn lock(motion: &Frames, options: &FootLock) -> (Frames, Locked) {
    let skeleton = person();
    let mut made = motion.clone();
    let locked = lock_feet(
        &skeleton,
        &legs(&skeleton),
        &mut made.0,
        &mut made.1,
        &made.2,
        options,
    );
    (made, locked)
}

/// Farthest that a held foot moves over the ground between two frames, metres: its toe while that
/// is in contact in both frames, otherwise its ankle.
fn slide(motion: &Frames, frames: std::ops::Range<usize>) -> f32 {
    let skeleton = person();
    let mut worst = 0.0_f32;
    for (foot, shift) in [(15, 0), (19, 2)] {
        let [foot, toe] = [foot, foot + 1].map(|joint| track(&skeleton, &motion.0, &motion.1, joint));
        for frame in frames.clone().skip(1) {
            let bits = [frame - 1, frame].map(|f| motion.2[f] >> shift & 0b11);
            let held = match bits {
                [0b10 | 0b11, 0b10 | 0b11] => &toe,
                [0b01, 0b01] => &foot,
                _ => continue,
            };
            let step = held[frame] - held[frame - 1];
            worst = worst.max(Vec3::new(step.x, 0.0, step.z).length());
        }
    }
    worst
}

fn skate(motion: &Frames) -> f64 {
    let skeleton = person();
    let joints = skeleton.joint_count();
    let mut world = WorldMotion {
        joints,
        positions: Vec::new(),
        rotations: vec![Quat::IDENTITY; motion.1.len()],
    };
    for (&root, pose) in motion.0.iter().zip(motion.1.chunks_exact(joints)) {
        world.positions.extend(positions(&skeleton, root, pose));
    }
    foot_skate_m_per_frame(&skeleton, &world, 0..motion.0.len()).unwrap()
}

#[test]
fn feet_in_contact_stand_still() {
    let before = walk(90);
    let (after, locked) = lock(&before, &FootLock::default());
    assert!(slide(&before, 0..90) > 0.01, "they slid");
    assert!(slide(&after, 0..90) < 1e-4, "{}", slide(&after, 0..90));
    assert!(
        skate(&after) < 0.5 * skate(&before),
        "{} {}",
        skate(&before),
        skate(&after)
    );
    assert!(locked.held_frames > 60 && locked.max_short_m < 1e-5, "{locked:?}");
    assert!(
        locked.max_offset_m > 0.02 && locked.max_offset_m < 0.25,
        "{locked:?}"
    );
    let skeleton = person();
    assert!(stretch(&skeleton, &after.1) < 1e-5);
    let speeds = [&before, &after].map(|m| fastest(&skeleton, &m.0, &m.1));
    assert!(speeds[1] < speeds[0] * 1.3, "no foot jumps: {speeds:?}");
}

/// Largest acceleration of a knee, m/s².
fn knee_acceleration(motion: &Frames) -> f32 {
    let skeleton = person();
    let knees = [14, 18].map(|knee| track(&skeleton, &motion.0, &motion.1, knee));
    let bends = knees.iter().flat_map(|knee| knee.windows(3));
    bends
        .map(|w| (w[2] - 2.0 * w[1] + w[0]).length() * 900.0)
        .fold(0.0, f32::max)
}

#[test]
fn knees_do_not_jump_as_a_straight_leg_is_released() {
    // The faster the walk, the straighter a leg becomes before its contact ends.
    for (faster, max_drop_m, most) in [(1.0, 0.08, 90.0), (1.2, 0.08, 105.0), (1.2, 0.0, 60.0)] {
        let mut before = walk(90);
        before.0.iter_mut().for_each(|root| root.z *= faster);
        assert!(knee_acceleration(&before) < 26.0);
        let options = FootLock {
            max_drop_m,
            ..FootLock::default()
        };
        let (after, _) = lock(&before, &options);
        let (knee, skate) = (knee_acceleration(&after), skate(&after));
        assert!(knee < most, "{faster}: {knee} m/s²");
        assert!(skate < 0.0015, "{faster}: {skate} m a frame");
    }
}

#[test]
fn frames_outside_the_range_stay_bit_for_bit_and_feet_join_them() {
    let before = walk(60);
    let range = 10..47;
    let (after, _) = lock(&before, &FootLock::over(range.clone()));
    for frame in (0..60).filter(|frame| !range.contains(frame)) {
        assert_eq!(after.0[frame], before.0[frame]);
        let at = frame * JOINTS..(frame + 1) * JOINTS;
        assert_eq!(after.1[at.clone()], before.1[at]);
    }
    assert_ne!(after.1, before.1);
    let skeleton = person();
    let speeds = [&before, &after].map(|m| fastest(&skeleton, &m.0, &m.1));
    assert!(
        speeds[1] < speeds[0] * 1.3,
        "no foot jumps at the ends: {speeds:?}"
    );
    // In the contact that was under way at its start, the foot is at the place that was shown.
    for (foot, shift) in [(15, 0), (19, 2)] {
        let toes = track(&skeleton, &after.0, &after.1, foot + 1);
        for frame in range.clone().take_while(|&f| before.2[f] >> shift & 0b10 != 0) {
            let way = toes[frame] - track(&skeleton, &before.0, &before.1, foot + 1)[9];
            assert!(Vec3::new(way.x, 0.0, way.z).length() < 1e-3, "{way}");
        }
    }
}

#[test]
fn a_foot_that_must_be_at_two_places_slides_evenly() {
    // Standing, but drifting by 6 cm in 30 frames between two frames that may not change.
    let mut before = walk(32);
    for frame in 0..32 {
        before.0[frame] = Vec3::new(0.002 * frame as f32, STAND_M, 0.0);
        before.1[frame * JOINTS..(frame + 1) * JOINTS].copy_from_slice(&standing());
    }
    before.2.fill(0b1111);
    let (after, _) = lock(&before, &FootLock::over(1..31));
    assert!(slide(&after, 0..32) < 0.0035, "1.5 times the mean at most");
    let (free, locked) = lock(&before, &FootLock::default());
    assert!(slide(&free, 0..32) < 1e-4);
    assert!(
        (locked.max_offset_m - 0.031).abs() < 1e-3,
        "the mean is half way: {locked:?}"
    );
    let (held, _) = lock(&before, &FootLock::over(1..32));
    assert!(slide(&held, 0..32) < 1e-4, "at the place that was shown");
}

#[test]
fn the_root_comes_down_for_a_leg_that_is_too_short() {
    let mut before = walk(60);
    for frame in 0..60 {
        // Drifting ahead by 35 cm while the feet stand.
        let ahead = 0.35 * smoothstep((frame as f32 / 59.0).min(1.0));
        before.0[frame] = Vec3::new(0.0, STAND_M, ahead);
        before.1[frame * JOINTS..(frame + 1) * JOINTS].copy_from_slice(&standing());
    }
    before.2.fill(0b1111);
    let (after, locked) = lock(&before, &FootLock::default());
    assert!(
        locked.max_drop_m > 0.005 && locked.max_drop_m <= 0.08,
        "{locked:?}"
    );
    assert!(
        locked.max_short_m < 1e-4 && slide(&after, 0..60) < 1e-4,
        "{locked:?}"
    );
    let speed = fastest(&person(), &after.0, &after.1);
    assert!(speed < 0.03, "and smoothly: {speed}");
    let none = FootLock {
        max_drop_m: 0.0,
        ..FootLock::default()
    };
    assert!(lock(&before, &none).1.max_short_m > 1e-3);
}

#[test]
fn feet_are_lifted_out_of_the_ground() {
    let mut before = walk(60);
    for (frame, root) in before.0.iter_mut().enumerate() {
        root.y -= 0.03 * (std::f32::consts::PI * frame as f32 / 59.0).sin();
    }
    let skeleton = person();
    let lowest = |motion: &Frames| {
        let toes = [16, 20].map(|joint| track(&skeleton, &motion.0, &motion.1, joint));
        toes.concat().iter().map(|p| p.y).fold(f32::INFINITY, f32::min)
    };
    assert!(lowest(&before) < 0.03);
    let options = FootLock {
        floor_m: Some(0.0),
        ..FootLock::default()
    };
    let (after, _) = lock(&before, &options);
    assert!(lowest(&after) > 0.0424, "{}", lowest(&after));
    assert!(slide(&after, 0..60) < 1e-4);
}

#[test]
fn nothing_to_do_changes_nothing() {
    let mut before = walk(30);
    for frame in 0..30 {
        before.0[frame] = Vec3::new(0.0, STAND_M, 0.0);
        before.1[frame * JOINTS..(frame + 1) * JOINTS].copy_from_slice(&standing());
    }
    assert_eq!(
        lock(&before, &FootLock::default()).0,
        before,
        "feet that already stand"
    );
    let mut walking = walk(30);
    walking.2.fill(0);
    assert_eq!(lock(&walking, &FootLock::default()).0, walking, "no contacts");
    let walking = walk(30);
    let empty: &[std::ops::Range<usize>] = &[0..0, 50..60, 30..31];
    for range in empty {
        assert_eq!(lock(&walking, &FootLock::over(range.clone())).0, walking);
    }
    let skeleton = person();
    let mut made = walking.clone();
    lock_feet(
        &skeleton,
        &[],
        &mut made.0,
        &mut made.1,
        &made.2,
        &FootLock::default(),
    );
    lock_feet(
        &skeleton,
        &legs(&skeleton),
        &mut made.0,
        &mut made.1,
        &[],
        &FootLock::default(),
    );
    assert_eq!(made, walking, "no legs, no contacts");
}

#[test]
fn values_that_are_not_finite_are_unchanged() {
    let mut before = walk(40);
    before.0[12] = Vec3::NAN;
    before.1[30 * JOINTS + 13] = Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0);
    let options = FootLock {
        max_offset_m: f32::NAN,
        max_drop_m: f32::NAN,
        floor_m: Some(f32::NAN),
        fade_frames: usize::MAX / 4,
        ..FootLock::default()
    };
    for options in [FootLock::default(), options] {
        let (after, _) = lock(&before, &options);
        for frame in (0..40).filter(|frame| ![12, 30].contains(frame)) {
            assert!(after.0[frame].is_finite(), "frame {frame}");
            let pose = &after.1[frame * JOINTS..][..JOINTS];
            assert!(pose.iter().all(|q| q.is_finite()), "frame {frame}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn held_feet_stand_for_any_contacts(
        flips in proptest::collection::vec((0usize..90, 0u32..4), 0..24),
        start in 0usize..45, length in 1usize..90, shake in 0.0f32..0.01,
    ) {
        let mut before = walk(90);
        for &(frame, bit) in &flips {
            before.2[frame] ^= 1 << bit;
        }
        for (frame, root) in before.0.iter_mut().enumerate() {
            root.x += shake * (frame as f32 * 1.7).sin();
        }
        let options = FootLock { min_frames: 1, ..FootLock::over(start..start + length) };
        let (after, locked) = lock(&before, &options);
        prop_assert!(stretch(&person(), &after.1) < 1e-5);
        prop_assert!(after.1.iter().zip(&before.1).all(|(a, b)| a.is_finite() && a.dot(*b) >= 0.0));
        let end = (start + length).min(90);
        // Contacts that reach from one end of the range to the other, or nearly, must slide.
        let off = |bits: u8| before.2[start..end].windows(2).skip(2).rev().skip(2).any(|w| (w[0] | w[1]) & bits == 0);
        let free = start == 0 || end == 90 || (off(0b11) && off(0b1100));
        if free && locked.max_short_m < 1e-4 && locked.max_offset_m < 0.249 {
            let slid = slide(&after, start..end);
            prop_assert!(slid < 1e-4, "slid {slid}");
        }
    }
}
