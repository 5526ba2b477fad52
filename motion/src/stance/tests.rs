use proptest::prelude::*;

use super::*;
use crate::ik::testing::*;
use crate::ik::{ReachOptions, legs, pose_at, reach_pose};

const UP: Vec3 = Vec3::new(0.0, STAND_M, 0.0);

fn posed(root: Vec3, rotations: &[Quat]) -> Posed<'_> {
    Posed { root, rotations }
}

/// The transition, with its starting pose in front.
fn with_start(from: Posed<'_>, motion: &Motion) -> (Vec<Vec3>, Vec<Quat>) {
    (
        [&[from.root], &motion.roots[..]].concat(),
        [from.rotations, &motion.rotations[..]].concat(),
    )
}

fn seated() -> (Vec3, Vec<Quat>) {
    let (skeleton, pose) = (person(), standing());
    let seat = Vec3::new(0.0, 0.45, -0.36);
    let made = pose_at(&skeleton, &legs(&skeleton), posed(UP, &pose), seat, 0.15);
    (made.root, made.rotations)
}

fn accelerations(roots: &[Vec3], rotations: &[Quat]) -> f32 {
    let skeleton = person();
    let tracks = (0..JOINTS).map(|joint| track(&skeleton, roots, rotations, joint));
    tracks
        .flat_map(|t| {
            t.windows(3)
                .map(|w| (w[2] - 2.0 * w[1] + w[0]).length() * 900.0)
                .collect::<Vec<_>>()
        })
        .fold(0.0, f32::max)
}

#[test]
fn sitting_down_and_standing_up() {
    let (skeleton, stand, (seat, sit)) = (person(), standing(), seated());
    let legs = legs(&skeleton);
    for (from, to) in [
        (posed(UP, &stand), posed(seat, &sit)),
        (posed(seat, &sit), posed(UP, &stand)),
    ] {
        let motion = stance_transition(&skeleton, &legs, from, to, 36, 0.7);
        assert_eq!((motion.frames(), motion.contacts.len()), (36, 36));
        assert_eq!(motion.roots[35], to.root);
        assert!(same(&motion.rotations[35 * JOINTS..], to.rotations));
        assert!(motion.short_m < 1e-5 && motion.contacts.iter().all(|&bits| bits == 0b1111));
        let (roots, rotations) = with_start(from, &motion);
        assert!(stretch(&skeleton, &rotations) < 1e-5);
        for joint in [15, 16, 19, 20] {
            let track = track(&skeleton, &roots, &rotations, joint);
            assert!(track.windows(2).all(|w| w[0].distance(w[1]) < 1e-4), "feet stay");
        }
        assert!(
            fastest(&skeleton, &roots, &rotations) * 30.0 < 1.6,
            "no faster than 1.6 m/s"
        );
        assert!(
            accelerations(&roots, &rotations) < 25.0,
            "{}",
            accelerations(&roots, &rotations)
        );
        // Half way it leans: the head is well ahead of the hips.
        let middle = &motion.rotations[17 * JOINTS..18 * JOINTS];
        let head = positions(&skeleton, motion.roots[17], middle)[4] - motion.roots[17];
        assert!(head.z > 0.25, "{head}");
    }
}

#[test]
fn picking_up_from_a_table() {
    let (skeleton, stand) = (person(), standing());
    let legs = legs(&skeleton);
    for (height, frames, most) in [(0.9, 24, 12.0), (0.7, 24, 14.0), (0.4, 33, 14.0)] {
        let point = [(HAND_R, Vec3::new(-0.15, height, 0.35))];
        let key = reach_pose(
            &skeleton,
            &legs,
            posed(UP, &stand),
            &point,
            &ReachOptions::default(),
        );
        let motion = stance_transition(&skeleton, &legs, posed(UP, &stand), key.posed(), frames, 0.0);
        let hand = positions(
            &skeleton,
            motion.roots[frames - 1],
            &motion.rotations[(frames - 1) * JOINTS..],
        )[HAND_R];
        assert!(hand.distance(point[0].1) < 1e-3);
        let (roots, rotations) = with_start(posed(UP, &stand), &motion);
        let most_found = accelerations(&roots, &rotations);
        assert!(
            most_found < most && motion.short_m < 1e-4,
            "{height}: {most_found} m/s²"
        );
    }
}

#[test]
fn distant_feet_step_one_after_the_other() {
    let (skeleton, stand) = (person(), standing());
    let legs = legs(&skeleton);
    let to = UP + Vec3::new(0.0, 0.0, 0.3);
    let motion = stance_transition(&skeleton, &legs, posed(UP, &stand), posed(to, &stand), 30, 0.0);
    let (roots, rotations) = with_start(posed(UP, &stand), &motion);
    let feet = [15, 19].map(|foot| track(&skeleton, &roots, &rotations, foot));
    for frame in 1..=30 {
        let moves = [0, 1].map(|nth: usize| feet[nth][frame].distance(feet[nth][frame - 1]) > 1e-4);
        assert!(!(moves[0] && moves[1]), "frame {frame}");
        let bits = motion.contacts[frame - 1];
        assert!(!moves[0] || bits & 0b11 == 0 || motion.contacts[frame.min(29)] & 0b11 == 0b11);
        assert!(bits & 0b11 != 0 || bits & 0b1100 != 0, "one foot stands");
    }
    let highest = feet[0].iter().map(|p| p.y).fold(0.0, f32::max) - feet[0][0].y;
    assert!((highest - 0.075).abs() < 0.01, "lifted: {highest}");
    assert!(motion.contacts.contains(&0b11) && motion.contacts.contains(&0b1100));
    assert_eq!(motion.contacts[29], 0b1111);
}

#[test]
fn invalid_input() {
    let (skeleton, stand) = (person(), standing());
    let legs = legs(&skeleton);
    let good = posed(UP, &stand);
    let make = |from, to, count| stance_transition(&skeleton, &legs, from, to, count, f32::NAN);
    assert_eq!(make(good, posed(UP, &stand[..3]), 5), Motion::default());
    assert_eq!(make(posed(UP, &[]), good, 5), Motion::default());
    let made = make(posed(Vec3::NAN, &stand), good, 5);
    assert_eq!(made.roots, [UP; 5]);
    assert!(same(&made.rotations[..JOINTS], &stand));
    assert_eq!(make(good, good, 0).frames(), 1, "at least one");
    assert!(make(good, good, 3).rotations.iter().all(|q| q.is_finite()));
    let none = stance_transition(&skeleton, &[], good, posed(UP * 0.5, &stand), 4, 0.2);
    assert_eq!((none.frames(), none.contacts[0], none.short_m), (4, 0, 0.0));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn any_two_poses_are_joined_without_jumps(
        from in near_standing(0.3), to in near_standing(0.3), way in place(0.2), count in 12usize..50, lean in 0.0f32..0.7,
    ) {
        let skeleton = person();
        let legs = legs(&skeleton);
        let to_root = UP + way * Vec3::new(1.0, 0.5, 1.0) - Vec3::Y * 0.1;
        let start = posed(UP, &from);
        let motion = stance_transition(&skeleton, &legs, start, posed(to_root, &to), count, lean);
        prop_assert_eq!(motion.frames(), count);
        prop_assert!(same(&motion.rotations[(count - 1) * JOINTS..], &to) && motion.roots[count - 1] == to_root);
        let (roots, rotations) = with_start(start, &motion);
        prop_assert!(stretch(&skeleton, &rotations) < 1e-5);
        prop_assert!(rotations.chunks_exact(JOINTS).collect::<Vec<_>>().windows(2)
            .all(|w| w[0].iter().zip(w[1]).all(|(a, b)| a.dot(*b) >= 0.0)));
        // As fast as the distance requires: twice (least jerk) what the farthest joint needs, plus
        // steps and lean.
        let (a, b) = (positions(&skeleton, UP, &from), positions(&skeleton, to_root, &to));
        let way = a.iter().zip(&b).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        let most = (6.0 * way + 0.1 + 4.0 * lean) / count as f32 + 6.0 * motion.short_m;
        prop_assert!(fastest(&skeleton, &roots, &rotations) < most.max(0.12));
    }
}
