//! Animations that are added to a character's file.

use std::sync::Arc;

use glam::{Quat, Vec3};
use serde_json::Value;

use crate::clip::Clip;
use crate::glb::{FileJoints, GlbOptions, add_animation_at, parse, write_glb};
use crate::read::tests::people::Person;
use crate::read::{Options, RestPose, Source, Understood, character};

/// A person's clip of one frame.
fn person() -> Clip {
    let person = Person {
        words: 0,
        size: 1.0,
        spine: 2,
        rest: RestPose::A,
    };
    person.walk(1, 30.0, &[0.3, 0.8, 0.1, 0.6])
}

/// What is read of a character's file, and a motion of two frames on it.
fn read(bytes: &[u8]) -> (Understood, Clip) {
    let found = character(&Source::new("hero.glb", bytes), &Options::default()).unwrap();
    let skeleton = Arc::clone(&found.clip.skeleton);
    let rotations = vec![Quat::IDENTITY; 2 * skeleton.joint_count()];
    let roots = vec![Vec3::new(0.1, 0.9, 0.2), Vec3::new(0.3, 0.95, -0.4)];
    let motion = Clip::new(skeleton, 30.0, roots, rotations).unwrap();
    (found, motion)
}

#[test]
fn the_root_moves_in_the_files_unit() {
    let mut made = person();
    let skeleton = Arc::make_mut(&mut made.skeleton);
    skeleton
        .joints
        .iter_mut()
        .for_each(|joint| joint.offset_m *= 100.0);
    made.root_positions.iter_mut().for_each(|root| *root *= 100.0);
    let bytes = write_glb(&made).unwrap();
    let (found, motion) = read(&bytes);
    let at = found.file_joints();
    assert_eq!(at.unit_m, 0.01);
    let dressed = add_animation_at(&bytes, &at, &motion, "steps").unwrap();
    let options = GlbOptions {
        animation: Some("steps".to_owned()),
        ..GlbOptions::default()
    };
    // In the file's unit.
    let again = parse(&dressed, &options).unwrap().to_clip(&options).unwrap();
    assert_eq!(again.frames(), 2);
    for (root, wanted) in again.root_positions.iter().zip(&motion.root_positions) {
        assert!(root.distance(100.0 * *wanted) < 1e-3, "{root} {wanted}");
    }
}

#[test]
fn joints_of_one_name_keep_their_nodes() {
    let mut made = person();
    let joints = &mut Arc::make_mut(&mut made.skeleton).joints;
    let ends = ["LeftHand", "RightHand"].map(|hand| {
        let is_hand = |name: &str| name.ends_with(hand);
        joints.iter().position(|joint| is_hand(&joint.name)).unwrap()
    });
    joints[ends[1]].name = joints[ends[0]].name.clone();
    let bytes = write_glb(&made).unwrap();
    let (found, motion) = read(&bytes);
    let mut of_clip = found.clip.skeleton.joints.iter();
    let second = of_clip
        .position(|joint| joint.name.ends_with("LeftHand_2"))
        .unwrap();
    assert!(add_animation_at(&bytes, &FileJoints::default(), &motion, "steps").is_err());
    let dressed = add_animation_at(&bytes, &found.file_joints(), &motion, "steps").unwrap();
    let json: Value = serde_json::from_slice(&gltf::Glb::from_slice(&dressed).unwrap().json).unwrap();
    let added = json["animations"].as_array().unwrap().last().unwrap();
    let channels = added["channels"].as_array().unwrap();
    let turned: Vec<u64> = channels
        .iter()
        .filter(|channel| channel["target"]["path"] == "rotation")
        .map(|channel| channel["target"]["node"].as_u64().unwrap())
        .collect();
    // Such a file has a node for each joint, in their order.
    assert_eq!(turned[second], ends[1] as u64);
    let mut all = turned;
    all.sort_unstable();
    let wanted: Vec<u64> = (0..motion.skeleton.joint_count() as u64).collect();
    assert_eq!(all, wanted);
}
