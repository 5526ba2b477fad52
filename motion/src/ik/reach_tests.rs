use proptest::prelude::*;

use super::testing::*;
use super::*;
use crate::fk::joint_transform;
use crate::rotation::{angle_between, yaw};

const UP: Vec3 = Vec3::new(0.0, STAND_M, 0.0);

fn reach(points: &[(usize, Vec3)], options: &ReachOptions) -> Reached {
    let (skeleton, pose) = (person(), standing());
    let base = Posed {
        root: UP,
        rotations: &pose,
    };
    reach_pose(&skeleton, &legs(&skeleton), base, points, options)
}

fn place_of(made: &Reached, joint: usize) -> Vec3 {
    joint_transform(&person(), made.root, &made.rotations, joint).0
}

#[test]
fn a_near_point_is_reached_upright() {
    let point = Vec3::new(-0.15, 1.2, 0.3);
    let made = reach(&[(HAND_R, point)], &ReachOptions::default());
    assert!(made.errors_m[0] < 1e-4 && place_of(&made, HAND_R).distance(point) < 1e-4);
    assert_eq!((made.bow, made.crouch_m, made.short_m), (0.0, 0.0, 0.0));
    let before = standing();
    for joint in (0..JOINTS).filter(|joint| !ARM_R.contains(joint)) {
        assert!(
            angle_between(made.rotations[joint], before[joint]) < 1e-5,
            "joint {joint}"
        );
    }
}

#[test]
fn a_table_is_reached_bowing_and_the_floor_crouching() {
    let feet = [15, 19].map(|foot| joint_transform(&person(), UP, &standing(), foot));
    let mut postures = Vec::new();
    for (height, ahead) in [(0.9, 0.4), (0.7, 0.4), (0.4, 0.35), (0.1, 0.3)] {
        let point = Vec3::new(-0.15, height, ahead);
        let made = reach(&[(HAND_R, point)], &ReachOptions::default());
        assert!(
            made.errors_m[0] < 1e-3 && made.short_m < 1e-4,
            "{height}: {:?}",
            made.errors_m
        );
        assert!(stretch(&person(), &made.rotations) < 1e-5);
        for (nth, foot) in [15, 19].into_iter().enumerate() {
            let (place, rotation) = joint_transform(&person(), made.root, &made.rotations, foot);
            assert!(place.distance(feet[nth].0) < 1e-4, "feet stay");
            assert!(angle_between(rotation, feet[nth].1) < 1e-3);
        }
        postures.push(made.bow + 10.0 * made.crouch_m);
    }
    assert!(postures.is_sorted(), "the lower the deeper: {postures:?}");
    assert!(postures[0] < 1.0, "hardly for a table: {postures:?}");
}

#[test]
fn the_distance_to_a_point_out_of_reach_is_returned() {
    let made = reach(&[(HAND_R, Vec3::new(-0.1, 1.2, 2.0))], &ReachOptions::default());
    assert!(
        made.errors_m[0] > 0.8 && made.errors_m[0] < 1.6,
        "{:?}",
        made.errors_m
    );
    let upright = ReachOptions {
        max_bow: 0.0,
        max_crouch_m: 0.0,
        ..ReachOptions::default()
    };
    let made = reach(&[(HAND_R, Vec3::new(-0.15, 0.4, 0.4))], &upright);
    assert!(made.errors_m[0] > 0.2 && made.bow == 0.0 && made.crouch_m == 0.0);
}

#[test]
fn both_hands_feet_and_toes_are_met_together() {
    let toe = positions(&person(), UP, &standing())[16];
    let points = [
        (HAND_L, Vec3::new(0.2, 0.9, 0.35)),
        (HAND_R, Vec3::new(-0.2, 0.85, 0.35)),
        (16, toe + Vec3::new(0.0, 0.1, 0.15)),
        (19, Vec3::new(-0.1, 0.1174, -0.1)),
    ];
    let made = reach(&points, &ReachOptions::default());
    assert!(
        made.errors_m.iter().all(|&error| error < 1e-3),
        "{:?}",
        made.errors_m
    );
}

#[test]
fn a_given_root_stays_where_it_is() {
    let root = Vec3::new(0.05, 0.8, 0.1);
    let point = (HAND_R, Vec3::new(-0.15, 0.9, 0.45));
    let options = ReachOptions {
        root: Some(root),
        ..ReachOptions::default()
    };
    let made = reach(&[point], &options);
    assert_eq!((made.root, made.crouch_m), (root, 0.0));
    assert!(made.errors_m[0] < 1e-3);
    let made = reach(&[(0, root), point], &ReachOptions::default());
    assert_eq!((made.root, made.errors_m[0]), (root, 0.0));
}

#[test]
fn a_seat() {
    let (skeleton, pose) = (person(), standing());
    let base = Posed {
        root: UP,
        rotations: &pose,
    };
    let seat = Vec3::new(0.0, 0.45, -0.36);
    let made = pose_at(&skeleton, &legs(&skeleton), base, seat, 0.15);
    assert_eq!((made.root, made.bow), (seat, 0.15));
    assert!(made.short_m < 1e-5 && (made.crouch_m - (STAND_M - 0.45)).abs() < 1e-6);
    let (foot, knee) = (place_of(&made, 15), place_of(&made, 14));
    assert!(foot.distance(positions(&skeleton, UP, &pose)[15]) < 1e-4);
    assert!(
        (knee.y - 0.52).abs() < 0.03 && knee.z > 0.0,
        "knees up and ahead: {knee}"
    );
    let head = place_of(&made, 4) - seat;
    assert!(head.z > 0.0 && head.y > 0.4, "bowed forward a little: {head}");
    assert_eq!(made.posed().rotations, made.rotations);
}

#[test]
fn invalid_input_is_returned_unchanged() {
    let (skeleton, pose) = (person(), standing());
    let legs = legs(&skeleton);
    let point = [(HAND_R, Vec3::new(-0.15, 0.9, 0.4)), (HAND_L, Vec3::ONE)];
    let base = |root: Vec3, rotations| Posed { root, rotations };
    let options = ReachOptions::default();
    for odd in [base(Vec3::NAN, &pose[..]), base(UP, &pose[..4])] {
        let made = reach_pose(&skeleton, &legs, odd, &point, &options);
        assert_eq!(
            (&made.rotations[..], &made.errors_m[..]),
            (odd.rotations, &[f32::INFINITY; 2][..])
        );
        assert_eq!(pose_at(&skeleton, &legs, odd, UP, 0.1).rotations, odd.rotations);
    }
    assert_eq!(
        pose_at(&skeleton, &legs, base(UP, &pose), Vec3::NAN, 0.1).root,
        UP
    );
    let points = [
        (HAND_R, Vec3::NAN),
        (99, Vec3::ZERO),
        (HAND_L, Vec3::new(0.15, 1.2, 0.3)),
        (0, Vec3::NAN),
    ];
    let made = reach(&points, &options);
    assert_eq!(
        (made.errors_m[0], made.errors_m[1], made.errors_m[3]),
        (f32::INFINITY, f32::INFINITY, f32::INFINITY)
    );
    assert!(made.errors_m[2] < 1e-3);
    let odd = ReachOptions {
        root: Some(Vec3::INFINITY),
        max_bow: f32::NAN,
        max_crouch_m: -4.0,
        parts: None,
    };
    let made = reach(&point[..1], &odd);
    assert!(made.root.is_finite() && made.bow == 0.0 && made.crouch_m == 0.0);
    assert_eq!(reach(&[], &options).errors_m, [] as [f32; 0]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn points_on_a_table_are_met_for_any_heading_and_pose(
        pose in near_standing(0.06), heading in -3.1f32..3.1, x in -0.25f32..0.05, height in 0.75f32..1.3, z in 0.25f32..0.4,
    ) {
        let skeleton = person();
        let legs = legs(&skeleton);
        let mut pose = pose;
        pose[0] = yaw(heading) * pose[0];
        let point = yaw(heading) * Vec3::new(x, height, z);
        let base = Posed { root: UP, rotations: &pose };
        let made = reach_pose(&skeleton, &legs, base, &[(HAND_R, point)], &ReachOptions::default());
        prop_assert!(made.errors_m[0] < 1e-3, "{:?}", made.errors_m);
        prop_assert!(stretch(&skeleton, &made.rotations) < 1e-5);
        for foot in [15, 19] {
            let before = joint_transform(&skeleton, UP, &pose, foot).0;
            prop_assert!(place_of(&made, foot).distance(before) < 1e-3 + made.short_m);
        }
    }
}
