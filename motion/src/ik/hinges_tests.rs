//! Limbs of the G1 robot.

use glam::{Quat, Vec3};
use proptest::prelude::*;

use super::hinges::{Goal, solve};
use super::testing::positions;
use super::{FootLock, Posed, arm_of, arms, legs, lock_feet, place_end, pose_at, two_bone};
use crate::ballistic::{Drop, fall_motion};
use crate::fk::joint_transform;
use crate::robot::testing::g1;
use crate::robot::{Fitted, HingeDoc, MimicDoc, RobotDoc};
use crate::rotation::angle_between;
use crate::skeleton::{Joint, Skeleton};
use crate::stance::stance_transition;
use crate::terrain::{Terrain, lift_motion};

/// Height of the root of [`standing`], metres.
const STAND_M: f32 = 0.755;

fn joint(skeleton: &Skeleton, name: &str) -> usize {
    skeleton.joint_index(name).unwrap()
}

/// The G1 standing with slightly bent knees and its arms down.
fn standing(skeleton: &Skeleton) -> Vec<Quat> {
    let robot = skeleton.robot.as_ref().unwrap();
    let mut angles = vec![0.0; robot.hinges().len()];
    for (name, angle) in [
        ("hip_pitch", -0.2),
        ("knee", 0.4),
        ("ankle_pitch", -0.2),
        ("elbow", 0.9),
    ] {
        for side in ["left", "right"] {
            let joint = joint(skeleton, &format!("{side}_{name}"));
            angles[robot.hinge_of(joint).unwrap()] = angle;
        }
    }
    let mut pose = vec![Quat::IDENTITY; skeleton.joint_count()];
    robot.pose(Quat::IDENTITY, &angles, &mut pose);
    pose
}

/// Largest error of poses on their hinges, radians, and hinges beyond their limits.
fn misfit(skeleton: &Skeleton, poses: &[Quat]) -> (f32, usize) {
    let mut fitted = Fitted::default();
    poses
        .chunks_exact(skeleton.joint_count())
        .fold((0.0, 0), |(residual, clamped), pose| {
            skeleton
                .robot
                .as_ref()
                .unwrap()
                .fit(&mut pose.to_vec(), &mut fitted);
            (fitted.residual_rad.max(residual), clamped + fitted.clamped)
        })
}

fn place(skeleton: &Skeleton, root: Vec3, pose: &[Quat], joint: usize) -> (Vec3, Quat) {
    joint_transform(skeleton, root, pose, joint)
}

proptest! {
    #[test]
    fn three_hinges_turn_exactly(shares in proptest::collection::vec(0.02_f32..0.98, 29)) {
        let skeleton = g1();
        let robot = skeleton.robot.as_ref().unwrap();
        let angles = robot.hinges().iter().zip(&shares);
        let angles: Vec<f32> = angles
            .map(|(hinge, share)| hinge.lower_rad + share * (hinge.upper_rad - hinge.lower_rad))
            .collect();
        let mut wanted = standing(&skeleton);
        robot.pose(Quat::from_rotation_y(0.7), &angles, &mut wanted);
        for [top, end] in [
            ["left_hip_pitch", "left_hip_yaw"],
            ["waist_yaw", "waist_pitch"],
            ["right_shoulder_pitch", "right_shoulder_yaw"],
            ["left_wrist_roll", "left_wrist_yaw"],
        ] {
            let [top, end] = [top, end].map(|name| joint(&skeleton, name));
            let rotation = place(&skeleton, Vec3::ZERO, &wanted, end).1;
            let mut pose = wanted.clone();
            robot.pose(Quat::from_rotation_y(0.7), &angles, &mut pose);
            pose[top..=end].copy_from_slice(&standing(&skeleton)[top..=end]);
            if super::three::turn((&skeleton, robot), &mut pose, (top, end), rotation) {
                let turned = place(&skeleton, Vec3::ZERO, &pose, end).1;
                prop_assert!(angle_between(turned, rotation) < 2e-3);
                let (residual, clamped) = misfit(&skeleton, &pose);
                prop_assert!(residual < 1e-3 && clamped == 0);
            } else {
                // The first and the last axis are almost on a line.
                let axis = |joint: usize| {
                    let hinge = &robot.hinges()[robot.hinge_of(joint).unwrap()];
                    place(&skeleton, Vec3::ZERO, &wanted, joint).1 * hinge.axis
                };
                let sin = axis(top).cross(axis(end)).length();
                prop_assert!(sin < 0.02, "{sin}");
            }
        }
    }
}

#[test]
fn legs_and_arms_are_found_through_the_hinges() {
    let skeleton = g1();
    let name = |joint: usize| skeleton.joints[joint].name.as_str();
    let legs = legs(&skeleton);
    let found: Vec<_> = legs.iter().map(|leg| leg.chain().map(name)).collect();
    assert_eq!(
        found,
        [
            ["left_hip_pitch", "left_knee", "left_ankle_roll"],
            ["right_hip_pitch", "right_knee", "right_ankle_roll"]
        ]
    );
    assert_eq!(legs[0].toe.map(name), Some("left_toe"));
    assert_eq!(legs[1].contacts, [Some(2), Some(3)]);
    assert_eq!(legs[0].clearance_m, [0.035, 0.005]);
    let length = legs[0].length_m(&skeleton);
    // As far as the knee alone brings the foot.
    let robot = skeleton.robot.as_ref().unwrap();
    let knee = robot.hinges()[3];
    let mut angles = vec![0.0; robot.hinges().len()];
    let mut pose = vec![Quat::IDENTITY; skeleton.joint_count()];
    let mut farthest = 0.0_f32;
    for step in 0..200 {
        angles[3] = knee.limited(-0.1 + 0.005 * step as f32);
        robot.pose(Quat::IDENTITY, &angles, &mut pose);
        let [hip, foot] = [1, 6].map(|joint| place(&skeleton, Vec3::ZERO, &pose, joint).0);
        farthest = farthest.max(hip.distance(foot));
    }
    assert!((length - farthest).abs() < 2e-4, "{length} {farthest}");

    let arms = arms(&skeleton);
    let found: Vec<_> = arms.iter().map(|arm| arm.map(name)).collect();
    assert_eq!(
        found,
        [
            ["left_shoulder_pitch", "left_elbow", "left_wrist_yaw"],
            ["right_shoulder_pitch", "right_elbow", "right_wrist_yaw"]
        ]
    );
    // A hand is fixed to the last hinge.
    let hand = joint(&skeleton, "right_hand");
    assert_eq!(
        arm_of(&skeleton, hand).map(|arm| arm.map(name)),
        Some(["right_shoulder_pitch", "right_elbow", "right_hand"])
    );
    assert_eq!(arm_of(&skeleton, joint(&skeleton, "waist_pitch")), None);
}

#[test]
fn a_goal_that_is_met_changes_nothing() {
    let skeleton = g1();
    let (pose, root) = (standing(&skeleton), Vec3::Y * STAND_M);
    for leg in legs(&skeleton) {
        let mut bent = pose.clone();
        let goal = place(&skeleton, root, &pose, leg.foot).0;
        let short = two_bone(&skeleton, root, &mut bent, leg.chain(), goal, Vec3::Z, true);
        assert_eq!((short, &bent), (0.0, &pose));
        let nan = two_bone(&skeleton, root, &mut bent, leg.chain(), Vec3::NAN, Vec3::Z, true);
        assert_eq!((nan, &bent), (f32::INFINITY, &pose));
    }
}

#[test]
fn the_limb_comes_near_to_a_goal_out_of_reach() {
    let skeleton = g1();
    let (mut pose, root) = (standing(&skeleton), Vec3::Y * STAND_M);
    let leg = legs(&skeleton)[0];
    let goal = place(&skeleton, root, &pose, leg.foot).0 - Vec3::Y * 0.3;
    let short = two_bone(&skeleton, root, &mut pose, leg.chain(), goal, Vec3::Z, false);
    let foot = place(&skeleton, root, &pose, leg.foot).0;
    assert!(
        (foot.distance(goal) - short).abs() < 2e-3,
        "{short} {}",
        foot.distance(goal)
    );
    // The leg is nearly straight, so the rest of the way remains.
    let way = 0.3 - (leg.length_m(&skeleton) - 0.645);
    assert!((0.2..0.31).contains(&short) && way > 0.0, "{short}");
    assert_eq!(misfit(&skeleton, &pose).1, 0);
}

#[test]
fn a_hand_is_brought_to_a_place() {
    let skeleton = g1();
    let (mut pose, root) = (standing(&skeleton), Vec3::Y * STAND_M);
    let hand = joint(&skeleton, "left_hand");
    let chain = arm_of(&skeleton, hand).unwrap();
    let goal = Vec3::new(0.25, STAND_M + 0.2, 0.25);
    let short = two_bone(&skeleton, root, &mut pose, chain, goal, Vec3::NEG_Y, false);
    assert!(short < 1e-3, "{short}");
    assert!(place(&skeleton, root, &pose, hand).0.distance(goal) < 1e-3);
    let turned = Quat::from_rotation_y(0.3) * place(&skeleton, root, &pose, hand).1;
    let short = place_end(
        &skeleton,
        root,
        &mut pose,
        chain,
        (goal, 0.0),
        Vec3::NEG_Y,
        turned,
    );
    let (there, rotation) = place(&skeleton, root, &pose, hand);
    assert!(short < 1e-3 && there.distance(goal) < 1e-3, "{short}");
    assert!(angle_between(rotation, turned) < 5e-3);
    assert!(misfit(&skeleton, &pose).0 < 1e-4);
}

#[test]
fn feet_are_lifted_onto_a_step() {
    let skeleton = g1();
    let legs = legs(&skeleton);
    let pose = standing(&skeleton);
    let frames = 20;
    let mut roots = vec![Vec3::Y * STAND_M; frames];
    let mut rotations = pose.repeat(frames);
    let contacts = vec![0b1111; frames];
    // The left foot stands on a step of 6 cm.
    let ground = |x: f32, _z: f32| if x > 0.0 { 0.06 } else { 0.0 };
    let short = lift_motion(
        &skeleton,
        &legs,
        &mut roots,
        &mut rotations,
        &contacts,
        ground,
        &Terrain::default(),
    );
    assert!(short < 1e-3, "{short}");
    let before = positions(&skeleton, Vec3::Y * STAND_M, &pose);
    let after = positions(&skeleton, roots[10], &rotations[10 * 34..11 * 34]);
    for (leg, up) in legs.iter().zip([0.06, 0.0]) {
        let moved = after[leg.foot] - before[leg.foot];
        assert!(moved.distance(Vec3::Y * up) < 1e-3, "{moved}");
        // Feet keep their rotation: the toes are lifted by the same height.
        let toe = leg.toe.unwrap();
        assert!((after[toe] - before[toe]).distance(Vec3::Y * up) < 2e-3);
    }
    assert!(misfit(&skeleton, &rotations).0 < 1e-4);
}

#[test]
fn feet_that_slide_are_held() {
    let skeleton = g1();
    let legs = legs(&skeleton);
    let frames = 30;
    let mut roots: Vec<Vec3> = (0..frames)
        .map(|f| Vec3::new(0.0, STAND_M, 0.002 * f as f32))
        .collect();
    let mut rotations = standing(&skeleton).repeat(frames);
    let locked = lock_feet(
        &skeleton,
        &legs,
        &mut roots,
        &mut rotations,
        &vec![0b1111; frames],
        &FootLock::over(0..frames),
    );
    assert!(locked.max_short_m < 1e-3, "{locked:?}");
    for leg in &legs {
        let feet: Vec<Vec3> = (0..frames)
            .map(|f| place(&skeleton, roots[f], &rotations[f * 34..(f + 1) * 34], leg.foot).0)
            .collect();
        let slid = feet.windows(2).map(|w| w[0].distance(w[1])).fold(0.0, f32::max);
        assert!(slid < 1e-3, "{slid} m in a frame");
    }
    assert!(misfit(&skeleton, &rotations).0 < 1e-4);
}

#[test]
fn crouching_bowing_and_falling_stay_on_the_hinges() {
    let skeleton = g1();
    let legs = legs(&skeleton);
    let pose = standing(&skeleton);
    let upright = Posed {
        root: Vec3::Y * STAND_M,
        rotations: &pose,
    };
    let low = pose_at(&skeleton, &legs, upright, Vec3::new(0.0, 0.55, -0.05), 0.5);
    assert!(low.short_m < 2e-3, "{}", low.short_m);
    assert!(misfit(&skeleton, &low.rotations).0 < 1e-4);
    for leg in &legs {
        let feet = [upright, low.posed()].map(|p| place(&skeleton, p.root, p.rotations, leg.foot).0);
        assert!(feet[0].distance(feet[1]) < 2e-3, "{feet:?}");
    }

    let down = stance_transition(&skeleton, &legs, upright, low.posed(), 40, 0.2);
    assert!(down.short_m < 5e-3, "{}", down.short_m);
    let (residual, clamped) = misfit(&skeleton, &down.rotations);
    assert!(residual < 1e-3 && clamped == 0, "{residual} {clamped}");

    let drop = Drop {
        velocity: Vec3::new(0.0, 0.0, 0.8),
        floor_m: -0.6,
        wall_s: None,
        standing: upright,
        under_way: &[],
        air: None,
        fps: 30.0,
    };
    let fall = fall_motion(&skeleton, &legs, upright, &drop);
    assert!(fall.motion.frames() > 20);
    let (residual, clamped) = misfit(&skeleton, &fall.motion.rotations);
    assert!(residual < 2e-3 && clamped == 0, "{residual} {clamped}");
    let last = fall.motion.frames() - 1;
    let stands = positions(
        &skeleton,
        fall.motion.roots[last],
        &fall.motion.rotations[last * 34..],
    );
    for leg in &legs {
        let over = stands[leg.foot].y + 0.6;
        let before = place(&skeleton, upright.root, &pose, leg.foot).0.y;
        assert!((over - before).abs() < 1e-3, "{over}");
    }
}

proptest! {
    #[test]
    fn a_foot_goes_to_its_goal_and_keeps_its_rotation(
        goal in [-0.06_f32..0.06, 0.03_f32..0.1, -0.05_f32..0.1],
        turn in -0.15_f32..0.15,
        heading in -3.0_f32..3.0,
        left in proptest::bool::ANY,
    ) {
        let skeleton = g1();
        let mut pose = standing(&skeleton);
        pose[0] = Quat::from_rotation_y(heading) * Quat::from_rotation_x(turn);
        let before = pose.clone();
        let root = Vec3::new(3.0, STAND_M, -2.0);
        let leg = legs(&skeleton)[usize::from(!left)];
        let (foot, rotation) = place(&skeleton, root, &pose, leg.foot);
        let goal = foot + Quat::from_rotation_y(heading) * Vec3::from(goal);
        let short = two_bone(&skeleton, root, &mut pose, leg.chain(), goal, Vec3::Z, true);
        let (there, turned) = place(&skeleton, root, &pose, leg.foot);
        prop_assert!(short < 2e-3 && there.distance(goal) < 2e-3, "{} {}", short, there.distance(goal));
        prop_assert!(angle_between(rotation, turned) < 1e-2, "{}", angle_between(rotation, turned));
        let (residual, clamped) = misfit(&skeleton, &pose);
        prop_assert!(residual < 1e-4 && clamped == 0);
        // Only the leg has changed.
        for joint in 0..34 {
            let of_leg = (leg.upper..=leg.foot).contains(&joint);
            prop_assert!(of_leg || pose[joint] == before[joint]);
        }
    }
}

#[test]
fn a_knee_that_follows_the_hip_shortens_the_leg() {
    let joint = |name: &str, parent, y| Joint {
        name: name.to_owned(),
        parent,
        offset_m: Vec3::new(0.0, y, 0.0),
    };
    let joints = vec![
        joint("base", None, 0.0),
        joint("thigh", Some(0), -0.1),
        joint("shin", Some(1), -0.4),
        joint("foot", Some(2), -0.4),
    ];
    let doc = RobotDoc {
        name: "leg".to_owned(),
        hinges: vec![HingeDoc {
            joint: "thigh".to_owned(),
            axis: Vec3::X,
            rest: [1.0, 0.0, 0.0, 0.0],
            lower_rad: -1.5,
            upper_rad: 1.5,
            max_speed_rad_per_s: 9.0,
            max_acceleration_rad_per_s2: None,
        }],
        mimics: vec![MimicDoc {
            joint: "shin".to_owned(),
            follows: "thigh".to_owned(),
            multiplier: -2.0,
            offset_rad: 0.0,
            axis: Vec3::X,
            rest: [1.0, 0.0, 0.0, 0.0],
        }],
    };
    let skeleton = Skeleton::new(joints, Vec3::X, 0.0, None)
        .unwrap()
        .with_robot(&doc)
        .unwrap();
    let robot = skeleton.robot.as_ref().unwrap();
    let at = |angle: f32| {
        let mut pose = vec![Quat::IDENTITY; 4];
        robot.pose(Quat::IDENTITY, &[angle], &mut pose);
        pose
    };
    let wanted = place(&skeleton, Vec3::ZERO, &at(0.9), 3).0;
    let mut pose = at(0.2);
    let goal = Goal {
        place: Some(wanted),
        rotation: None,
    };
    let short = solve((&skeleton, robot), Vec3::ZERO, &mut pose, (1, 3), &goal).unwrap();
    assert!(short < 1e-4, "{short}");
    assert!(angle_between(pose[2], Quat::from_rotation_x(-1.8)) < 1e-3);
    assert!(misfit(&skeleton, &pose).0 < 1e-5);
}
