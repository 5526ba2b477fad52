//! Neutral poses of bodies from files.

use glam::{DQuat, Quat, Vec3};

use super::people::{Dialect, Person};
use crate::read::{Options, RestPose, Source, Understood, read};
use crate::rotation::angle_between;

const NUMBERS: [f32; 7] = [0.3, 0.8, 0.1, 0.6, 0.9, 0.2, 0.45];
/// Farthest that a limb may be from hanging, degrees.
const MAX_OFF_DEG: f32 = 1.0;

fn read_person(words: usize, rest: RestPose, frames: Vec<DQuat>) -> Understood {
    let person = Person {
        words,
        size: 1.0,
        spine: 2,
        rest,
    };
    let dialect = Dialect {
        turns_bones: frames.is_empty(),
        frames,
        ..Dialect::plain()
    };
    let bytes = dialect.bytes(&person.walk(120, 30.0, &NUMBERS));
    read(&Source::new("walk.bvh", &bytes), &Options::default()).unwrap()
}

/// Places of the joints in the neutral pose, relative to the root.
fn places(found: &Understood, neutral: &[Quat]) -> Vec<Vec3> {
    let mut places: Vec<Vec3> = Vec::new();
    for joint in &found.clip.skeleton.joints {
        let place = joint.parent.map_or(Vec3::ZERO, |parent| {
            places[parent] + neutral[parent] * joint.offset_m
        });
        places.push(place);
    }
    places
}

/// Asserts that arms and legs hang, and that the left is on +X.
fn hangs(found: &Understood, limbs: [[&str; 3]; 2]) {
    let neutral = found.neutral_pose().unwrap();
    let places = places(found, &neutral);
    let place = |name: &str, side: &str| {
        let name = name.replace('*', side);
        places[found
            .clip
            .skeleton
            .joint_index(&name)
            .unwrap_or_else(|| panic!("{name}"))]
    };
    let sides = match found.clip.skeleton.joint_index(&limbs[0][0].replace('*', "Left")) {
        Some(_) => ["Left", "Right"],
        None => ["L", "R"],
    };
    for [top, middle, end] in limbs {
        for side in sides {
            let joints = [top, middle, end].map(|name| place(name, side));
            for bone in joints.windows(2) {
                let off = (bone[1] - bone[0]).angle_between(Vec3::NEG_Y).to_degrees();
                assert!(off < MAX_OFF_DEG, "{side} {top}: {off}°");
            }
        }
        assert!(place(top, sides[0]).x > 0.05 && place(top, sides[1]).x < -0.05);
    }
}

const MIXAMO: [[&str; 3]; 2] = [
    ["mixamorig:*Arm", "mixamorig:*ForeArm", "mixamorig:*Hand"],
    ["mixamorig:*UpLeg", "mixamorig:*Leg", "mixamorig:*Foot"],
];
const BANDAI: [[&str; 3]; 2] = [
    ["UpperArm_*", "LowerArm_*", "Hand_*"],
    ["UpperLeg_*", "LowerLeg_*", "Foot_*"],
];

#[test]
fn the_arms_of_a_t_pose_and_of_an_a_pose_are_let_down() {
    for rest in [RestPose::T, RestPose::A] {
        let found = read_person(0, rest, Vec::new());
        assert_eq!(found.report.rest_pose.value, rest);
        hangs(&found, MIXAMO);
        hangs(&read_person(2, rest, Vec::new()), BANDAI);
    }
}

#[test]
fn a_standing_rest_pose_is_kept() {
    let found = read_person(0, RestPose::Standing, Vec::new());
    let neutral = found.neutral_pose().unwrap();
    assert!(
        neutral
            .iter()
            .all(|turn| angle_between(*turn, Quat::IDENTITY) < 1e-3)
    );
}

#[test]
fn a_rest_pose_that_is_no_stance_gives_way_to_the_average_pose() {
    let frames = (0..7).map(|nth| DQuat::from_rotation_z(f64::from(nth)) * DQuat::from_rotation_x(1.0));
    let found = read_person(0, RestPose::T, frames.collect());
    assert_eq!(found.report.rest_pose.value, RestPose::None);
    hangs(&found, MIXAMO);
    let neutral = found.neutral_pose().unwrap();
    let places = places(&found, &neutral);
    let height = |name: &str| places[found.clip.skeleton.joint_index(name).unwrap()].y;
    assert!(height("mixamorig:Head") > 0.5 && height("mixamorig:LeftToeBase") < -0.8);
}

#[test]
fn a_clip_on_a_given_skeleton_has_none() {
    let found = read_person(0, RestPose::T, Vec::new());
    let bytes = Dialect::plain().bytes(&found.clip);
    let options = Options {
        skeleton: Some(found.clip.skeleton.clone()),
        ..Options::default()
    };
    let again = read(&Source::new("walk.bvh", &bytes), &options).unwrap();
    assert_eq!(again.neutral_pose(), None);
}
