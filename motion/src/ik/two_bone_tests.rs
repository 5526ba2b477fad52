use std::sync::Arc;

use proptest::prelude::*;

use super::limbs::spine;
use super::testing::*;
use super::*;
use crate::fk::joint_transform;
use crate::rotation::angle_between;
use crate::rotation::tests::any_quat;
use crate::skeleton::Joint;
use crate::testing::biped;

const UP: Vec3 = Vec3::new(0.0, STAND_M, 0.0);

fn limb(lengths: [f32; 2]) -> Arc<Skeleton> {
    let joint = |name: &str, parent, offset_m| Joint {
        name: name.to_owned(),
        parent,
        offset_m,
    };
    let joints = vec![
        joint("pelvis", None, Vec3::ZERO),
        joint("upper", Some(0), Vec3::X * 0.1),
        joint("middle", Some(1), Vec3::NEG_Y * lengths[0]),
        joint("end", Some(2), Vec3::NEG_Y * lengths[1]),
    ];
    Arc::new(Skeleton::new(joints, Vec3::X, 0.0, None).unwrap())
}

#[test]
fn legs_and_arms_are_found_without_names() {
    let person = person();
    let found = legs(&person);
    assert_eq!(found.len(), 2);
    assert_eq!(found[0].chain(), LEG_L);
    assert_eq!((found[0].toe, found[0].contacts), (Some(16), [Some(0), Some(1)]));
    assert_eq!((found[1].foot, found[1].contact_bits()), (19, 0b1100));
    assert_eq!(found[1].clearance_m, [0.1174, 0.0425]);
    assert!((found[0].length_m(&person) - 0.801).abs() < 1e-6);
    assert_eq!(arms(&person), [[6, 7, 8], ARM_R]);
    assert_eq!(spine(&person), [0, 1, 2]);
    assert_eq!(arm_of(&person, HAND_R), Some(ARM_R));
    assert_eq!(arm_of(&person, 15), Some(LEG_L));
    for joint in [0, 1, 2, 4, 13, 99] {
        assert_eq!(
            arm_of(&person, joint),
            None,
            "joint {joint} moves others or has no limb"
        );
    }
    assert_eq!(legs(&biped()), [], "no knees");
    assert_eq!(legs(&limb([0.4, 0.4])), [], "no contact joints");
    assert_eq!(spine(&biped()), [0]);
}

#[test]
fn contact_joints_may_be_toes_only_or_heel_and_toes() {
    let with = |joints: Vec<usize>| {
        let mut skeleton = Skeleton::clone(&person());
        let heel = Joint {
            name: "Heel_L".to_owned(),
            parent: Some(15),
            offset_m: Vec3::new(0.0, -0.08, -0.05),
        };
        skeleton.joints.push(heel);
        let contacts = skeleton.contacts.as_mut().unwrap();
        contacts.clearance_m = (0..joints.len()).map(|nth| nth as f32).collect();
        contacts.joints = joints;
        legs(&skeleton)
    };
    let toes = with(vec![16, 20]);
    assert_eq!((toes[0].chain(), toes[0].contacts), (LEG_L, [None, Some(0)]));
    assert_eq!((toes[1].foot, toes[1].clearance_m), (19, [0.0, 1.0]));
    let heels = with(vec![21, 16]);
    assert_eq!(heels.len(), 1);
    assert_eq!((heels[0].chain(), heels[0].toe), (LEG_L, Some(16)));
    assert_eq!(heels[0].contacts, [Some(0), Some(1)]);
    let ankles = with(vec![15, 19]);
    assert_eq!((ankles[1].toe, ankles[1].contacts), (None, [Some(1), None]));
}

#[test]
fn a_straight_limb_bends_to_the_pole() {
    let skeleton = limb([0.4, 0.4]);
    for pole in [Vec3::Z, Vec3::NEG_Z, Vec3::X] {
        let mut pose = vec![Quat::IDENTITY; 4];
        let goal = Vec3::new(0.1, -0.6, 0.0);
        assert_eq!(
            two_bone(&skeleton, Vec3::ZERO, &mut pose, [1, 2, 3], goal, pole, false),
            0.0
        );
        let middle = positions(&skeleton, Vec3::ZERO, &pose)[2];
        assert!((middle - goal / 2.0).dot(pole) > 0.2, "{middle}");
        assert!(positions(&skeleton, Vec3::ZERO, &pose)[3].distance(goal) < 1e-5);
    }
}

#[test]
fn the_distance_to_a_goal_out_of_reach_is_returned() {
    let skeleton = limb([0.5, 0.3]);
    let solve = |goal: Vec3| {
        let mut pose = vec![Quat::IDENTITY; 4];
        pose[2] = Quat::from_rotation_x(0.5);
        let short = two_bone(&skeleton, Vec3::ZERO, &mut pose, [1, 2, 3], goal, Vec3::Z, false);
        let end = positions(&skeleton, Vec3::ZERO, &pose)[3];
        (short, end)
    };
    let (short, end) = solve(Vec3::new(0.1, -2.0, 0.0));
    assert!((short - 1.2).abs() < 1e-3, "0.8 of 2 m is reached");
    assert!(
        end.distance(Vec3::new(0.1, -0.8, 0.0)) < 1e-3,
        "in the direction of the goal"
    );
    let (short, end) = solve(Vec3::new(0.1, 0.0, 0.05));
    assert!(
        (short - 0.151).abs() < 1e-4,
        "folded it reaches no nearer than 0.2 m"
    );
    assert!((end.distance(Vec3::X * 0.1) - 0.201).abs() < 1e-4);
    let (short, end) = solve(Vec3::X * 0.1);
    assert!(
        short > 0.2 && end.is_finite(),
        "the goal is where the limb begins"
    );
}

#[test]
fn invalid_input_changes_nothing() {
    let before = standing();
    let mut pose = before.clone();
    let skeleton = person();
    for goal in [Vec3::NAN, Vec3::INFINITY, Vec3::splat(1e30)] {
        let short = two_bone(&skeleton, UP, &mut pose, LEG_L, goal, Vec3::Z, true);
        assert!(short > 1e6);
        if !goal.is_finite() {
            assert_eq!(pose, before);
        }
        assert!(pose.iter().all(|q| q.is_finite()));
        pose.clone_from(&before);
    }
    let goal = Vec3::new(0.1, 0.3, 0.1);
    for chain in [[13, 14, 19], [15, 14, 13], [13, 13, 13], [13, 14, 99]] {
        assert_eq!(
            two_bone(&skeleton, UP, &mut pose, chain, goal, Vec3::Z, true),
            f32::INFINITY
        );
    }
    assert_eq!(
        two_bone(&skeleton, Vec3::NAN, &mut pose, LEG_L, goal, Vec3::Z, true),
        f32::INFINITY
    );
    assert_eq!(
        two_bone(&skeleton, UP, &mut pose[..5], LEG_L, goal, Vec3::Z, true),
        f32::INFINITY
    );
    assert_eq!(
        two_bone(&limb([0.0, 0.4]), UP, &mut pose, [1, 2, 3], goal, Vec3::Z, true),
        f32::INFINITY
    );
    assert_eq!(pose, before);
    // An unusable pole has no effect.
    for pole in [Vec3::NAN, Vec3::ZERO, Vec3::NEG_Y] {
        assert_eq!(two_bone(&skeleton, UP, &mut pose, LEG_L, goal, pole, true), 0.0);
        assert!(positions(&skeleton, UP, &pose)[15].distance(goal) < 1e-4);
    }
}

#[test]
fn a_goal_that_is_met_changes_nothing() {
    let skeleton = person();
    let mut pose = standing();
    pose[13] = Quat::IDENTITY;
    pose[14] = Quat::IDENTITY;
    let before = pose.clone();
    let foot = positions(&skeleton, UP, &pose)[15];
    assert_eq!(
        two_bone(&skeleton, UP, &mut pose, LEG_L, foot, Vec3::Z, true),
        0.0
    );
    assert_eq!(pose, before, "a straight leg stays straight");
    // A goal that is hardly off changes hardly anything.
    two_bone(
        &skeleton,
        UP,
        &mut pose,
        LEG_L,
        foot + Vec3::new(1e-4, 0.0, 0.0),
        Vec3::Z,
        true,
    );
    let knee = positions(&skeleton, UP, &pose)[14];
    assert!(knee.distance(positions(&skeleton, UP, &before)[14]) < 1e-3);
}

#[test]
fn settling_ends_on_the_pose_without_a_jump() {
    let skeleton = person();
    let (mut roots, mut rotations, _) = walk(40);
    let before = (roots.clone(), rotations.clone());
    let (root, pose) = (Vec3::new(0.1, 0.9, roots[39].z), standing());
    settle(&mut roots, &mut rotations, JOINTS, root, &pose, 14);
    assert_eq!(roots[39], root);
    assert!(same(&rotations[39 * JOINTS..], &pose));
    assert_eq!(roots[..26], before.0[..26]);
    assert_eq!(rotations[..26 * JOINTS], before.1[..26 * JOINTS]);
    let speed = fastest(&skeleton, &roots, &rotations);
    assert!(speed < 1.2 * fastest(&skeleton, &before.0, &before.1), "{speed}");
    // Longer than the motion, and not at all.
    settle(&mut roots, &mut rotations, JOINTS, root, &pose, 400);
    assert_eq!(roots[39], root);
    let before = (roots.clone(), rotations.clone());
    settle(&mut roots, &mut rotations, JOINTS, Vec3::NAN, &pose, 4);
    settle(&mut roots, &mut rotations, JOINTS, root, &pose[1..], 4);
    settle(&mut roots, &mut rotations, 0, root, &pose, 4);
    settle(&mut [], &mut [], JOINTS, root, &pose, 4);
    assert_eq!((roots, rotations), before);
}

proptest! {
    #[test]
    fn goals_in_reach_are_met_and_bones_keep_their_length(
        pose in proptest::collection::vec(any_quat(), JOINTS), root in place(30.0), goal in place(0.79),
        pole in place(1.0), keep in any::<bool>(), leg in any::<bool>(),
    ) {
        let skeleton = person();
        let chain = if leg { LEG_L } else { ARM_R };
        let reach: f32 = chain[1..].iter().map(|&j| skeleton.joints[j].offset_m.length()).sum();
        let goal = joint_transform(&skeleton, root, &pose, chain[0]).0 + goal * (reach / 0.801);
        let distance = goal.distance(joint_transform(&skeleton, root, &pose, chain[0]).0);
        let mut made = pose.clone();
        let short = two_bone(&skeleton, root, &mut made, chain, goal, pole, keep);
        prop_assert!(stretch(&skeleton, &made) < 1e-5);
        let (end, rotation) = joint_transform(&skeleton, root, &made, chain[2]);
        if distance > 0.03 && distance < 0.999 * reach {
            prop_assert!(short < 1e-6 && end.distance(goal) < 1e-4, "missed by {}", end.distance(goal));
        }
        prop_assert!((end.distance(goal) - short).abs() < 1e-4, "the returned distance is the distance");
        let was = joint_transform(&skeleton, root, &pose, chain[2]).1;
        prop_assert!(!keep || angle_between(rotation, was) < 1e-3);
        for joint in 0..JOINTS {
            let changes = joint == chain[0] || joint == chain[1] || (keep && joint == chain[2]);
            prop_assert!(changes || made[joint] == pose[joint]);
            prop_assert!(made[joint].dot(pose[joint]) >= 0.0, "the hemisphere is kept");
        }
    }

    #[test]
    fn a_goal_that_moves_smoothly_moves_the_limb_smoothly(
        pose in near_standing(0.2), from in place(0.25), to in place(0.25),
    ) {
        // Goals on a line below the hip, from 0.3 m to out of reach.
        let skeleton = person();
        let hip = positions(&skeleton, UP, &pose)[13];
        let mut before: Option<Vec3> = None;
        for step in 0..=50 {
            let mut made = pose.clone();
            let goal = hip + Vec3::NEG_Y * 0.6 + from.lerp(to, step as f32 / 50.0);
            two_bone(&skeleton, UP, &mut made, LEG_L, goal, Vec3::Z, true);
            let knee = positions(&skeleton, UP, &made)[14];
            if let Some(before) = before {
                // Near the end of its reach, a knee moves faster than the foot: with the root of
                // the bend.
                let speed = knee.distance(before);
                prop_assert!(speed < 0.05 + 4.0 * from.distance(to) / 50.0, "{speed}");
            }
            before = Some(knee);
        }
    }
}
