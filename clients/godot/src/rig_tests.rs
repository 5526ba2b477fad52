use std::f32::consts::{FRAC_PI_2, PI};
use std::path::Path;

use serde_json::Value;

use super::*;

fn numbers(of: &Value) -> Vec<f32> {
    let numbers = of.as_array().unwrap().iter();
    numbers.map(|number| number.as_f64().unwrap() as f32).collect()
}

fn pose(row: &Value, frame: &str) -> (Vec3, Quat) {
    let [position, rotation] = ["position", "rotation"].map(|part| numbers(&row[frame][part]));
    (Vec3::from_slice(&position), Quat::from_slice(&rotation))
}

#[test]
fn axes_are_those_of_the_table() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../conventions/poses.json");
    let table: Vec<Value> = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    assert!(table.len() >= 8);
    for row in &table {
        let ((position, rotation), (there, turned)) = (pose(row, "troupe"), pose(row, "godot"));
        assert!(axes::position(position).abs_diff_eq(there, 1e-5), "{row}");
        assert!(axes::position(there).abs_diff_eq(position, 1e-5), "{row}");
        assert!(axes::rotation(rotation).abs_diff_eq(turned, 1e-5), "{row}");
        assert!(axes::rotation(turned).abs_diff_eq(rotation, 1e-5), "{row}");
    }
}

/// Half a person in the frame of its skeleton, which is in centimetres with Z up, as some programs
/// export it. It looks along the model's +Z. Children come before parents, and axes point anywhere.
struct Model {
    bones: Vec<Bone>,
    /// Of each bone in the frame of the node.
    places: Vec<Vec3>,
    turns: Vec<Quat>,
}

const NAMES: [&str; 6] = ["Toes", "Foot", "Leg", "Hips", "Root", "Aim"];
const PARENTS: [Option<usize>; 6] = [Some(1), Some(2), Some(3), Some(4), None, Some(4)];

/// The transform of the skeleton in the frame of the node.
fn placed() -> Affine3A {
    Affine3A::from_scale_rotation_translation(
        Vec3::splat(0.01),
        Quat::from_rotation_x(-FRAC_PI_2),
        Vec3::new(0.0, 0.05, 0.0),
    )
}

fn model() -> Model {
    let places = [
        Vec3::new(0.1, 0.02, 0.14),
        Vec3::new(0.1, 0.09, 0.0),
        Vec3::new(0.1, 0.9, 0.01),
        Vec3::new(0.0, 0.95, 0.0),
        Vec3::ZERO,
        Vec3::new(0.0, 1.0, 3.0),
    ];
    let turn = |bone: usize| {
        let axis = Vec3::new(bone as f32 - 2.0, 1.5, 3.0 - bone as f32).normalize();
        Quat::from_axis_angle(axis, 0.4 + 0.5 * bone as f32)
    };
    let turns: Vec<Quat> = (0..6).map(turn).collect();
    let within = |bone: usize| {
        let whole = Affine3A::from_rotation_translation(turns[bone], places[bone]);
        // Bones of this skeleton have no scale of their own.
        let of_skeleton = placed().inverse() * whole;
        of_skeleton * Affine3A::from_scale(Vec3::splat(0.01))
    };
    let rest = |bone: usize| match PARENTS[bone] {
        Some(parent) => within(parent).inverse() * within(bone),
        None => within(bone),
    };
    let bones = (0..6).map(|bone| Bone {
        name: NAMES[bone].to_owned(),
        parent: PARENTS[bone],
        rest: rest(bone),
    });
    Model {
        bones: bones.collect(),
        places: places.to_vec(),
        turns,
    }
}

/// Where the server has the joints in the neutral pose, from the first.
fn on_server(skeleton: &v1::BodySkeleton) -> Vec<(Vec3, Quat)> {
    let mut all: Vec<(Vec3, Quat)> = Vec::new();
    for (joint, turned) in skeleton.joints.iter().zip(&skeleton.neutral) {
        let parent = skeleton
            .joints
            .iter()
            .position(|other| other.name == joint.parent);
        let offset = joint.offset.unwrap();
        let place = match parent {
            Some(parent) => all[parent].0 + all[parent].1 * Vec3::new(offset.x, offset.y, offset.z),
            None => Vec3::ZERO,
        };
        all.push((place, Quat::from_xyzw(turned.x, turned.y, turned.z, turned.w)));
    }
    all
}

#[test]
fn joints_are_in_metres_and_look_ahead() {
    let model = model();
    let rig = Rig::new(&model.bones, "Hips", placed(), Front::Model).unwrap();
    assert_eq!(
        rig.bones(),
        [3, 2, 1, 0],
        "the hips and what is below, parents first"
    );
    let joints = rig.joints();
    let names: Vec<&str> = joints.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["Hips", "Leg", "Foot", "Toes"]);
    let parents: Vec<&str> = joints.joints.iter().map(|joint| joint.parent.as_str()).collect();
    assert_eq!(parents, ["", "Hips", "Leg", "Foot"]);
    // A model that looks along +Z has the server's axes.
    for ((place, _), &bone) in on_server(joints).iter().zip(rig.bones()) {
        let there = model.places[bone] - model.places[3];
        assert!(place.abs_diff_eq(there, 1e-5), "{}: {place} {there}", NAMES[bone]);
    }
}

#[test]
fn a_model_that_looks_back_looks_ahead_on_the_server() {
    let model = model();
    let back = Affine3A::from_rotation_y(PI) * placed();
    let turned = Rig::new(&model.bones, "Hips", back, Front::Camera).unwrap();
    let usual = Rig::new(&model.bones, "Hips", placed(), Front::Model).unwrap();
    for (one, other) in on_server(turned.joints()).iter().zip(on_server(usual.joints())) {
        assert!(one.0.abs_diff_eq(other.0, 1e-5), "{one:?} {other:?}");
        assert!(one.1.angle_between(other.1) < 1e-3, "{one:?} {other:?}");
    }
}

/// What the node does with a frame: the skeleton stands as at rest if the frame is the neutral pose
/// at the place and heading of the node.
#[test]
fn the_neutral_pose_is_the_rest() {
    let model = model();
    let rig = Rig::new(&model.bones, "Hips", placed(), Front::Model).unwrap();
    let (at, yaw) = (Vec3::new(3.0, 0.0, -7.0), 0.7);
    let node = Affine3A::from_rotation_translation(Quat::from_rotation_y(yaw), at);
    let skeleton = node * placed();

    let neutral = on_server(rig.joints());
    let heading = Quat::from_rotation_y(yaw + Front::Model.heading());
    let hips = axes::position(node.transform_point3(model.places[3]));
    let first = heading * neutral[0].1;

    let root = skeleton * model.bones[4].rest;
    let (position, rotation) = root_pose(root, axes::position(hips), axes::rotation(first));
    let mut whole = vec![Affine3A::IDENTITY; 6];
    whole[3] = root * Affine3A::from_rotation_translation(rotation, position);
    for (joint, &bone) in rig.bones().iter().enumerate().skip(1) {
        let parent = PARENTS[bone].unwrap();
        let local = neutral[joint - 1].1.inverse() * neutral[joint].1;
        let rest = model.bones[bone].rest;
        let pose = Affine3A::from_rotation_translation(axes::rotation(local), rest.translation.into());
        whole[bone] = whole[parent] * pose;
    }
    for &bone in rig.bones() {
        let rest = node.transform_point3(model.places[bone]);
        let place = Vec3::from(whole[bone].translation);
        assert!(place.abs_diff_eq(rest, 1e-4), "{}: {place} {rest}", NAMES[bone]);
        let (_, turned, _) = whole[bone].to_scale_rotation_translation();
        let rest = Quat::from_rotation_y(yaw) * model.turns[bone];
        assert!(turned.angle_between(rest) < 1e-2, "{}", NAMES[bone]);
    }
}

#[test]
fn the_name_is_that_of_the_joints() {
    let model = model();
    let rig = |bones: &[Bone]| Rig::new(bones, "Hips", placed(), Front::Model).unwrap();
    let name = rig(&model.bones).name().to_owned();
    assert_eq!(rig(&model.bones).name(), name);
    assert!(
        name.len() <= 64 && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '-'),
        "{name}"
    );
    let mut longer = model.bones.clone();
    longer[1].rest.translation.y += 1.0;
    assert_ne!(rig(&longer).name(), name);
    let mut renamed = model.bones;
    renamed[0].name = "LeftToes".to_owned();
    assert_ne!(rig(&renamed).name(), name);
}

#[test]
fn what_cannot_be_moved_is_an_error() {
    let model = model();
    let error = |bones: &[Bone], root: &str| {
        let rig = Rig::new(bones, root, placed(), Front::Model);
        rig.unwrap_err().to_string()
    };
    let unknown = error(&model.bones, "Pelvis");
    assert!(
        unknown.contains("`Pelvis`") && unknown.contains("Hips, Root"),
        "{unknown}"
    );
    for stretch in [
        Vec3::new(1.0, 2.0, 1.0),
        Vec3::new(-1.0, 1.0, 1.0),
        Vec3::ZERO,
        Vec3::NAN,
    ] {
        let mut bones = model.bones.clone();
        bones[2].rest *= Affine3A::from_scale(stretch);
        let stretched = error(&bones, "Hips");
        assert!(stretched.contains("`Leg`"), "{stretch}: {stretched}");
    }
    let mut circle = model.bones;
    circle[4].parent = Some(1);
    let circle = error(&circle, "Hips");
    assert!(circle.contains("its own ancestor"), "{circle}");
}
