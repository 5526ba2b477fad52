//! NumPy archives of people.

use glam::{DQuat, Quat, Vec3};

use super::people::Person;
use crate::clip::Clip;
use crate::files::npz::Archive;
use crate::files::write_npz;
use crate::fk::WorldMotion;
use crate::read::{Basis, Format, Options, ReadError, RestPose, Source, Topic, Understood, Up, read};
use crate::rotation::angle_between;

const NUMBERS: [f32; 7] = [0.3, 0.8, 0.1, 0.6, 0.9, 0.2, 0.45];

fn walk(words: usize) -> Clip {
    let person = Person {
        words,
        size: 1.0,
        spine: 3,
        rest: RestPose::T,
    };
    person.walk(60, 30.0, &NUMBERS)
}

fn with(bytes: &[u8], options: &Options) -> Result<Understood, ReadError> {
    read(&Source::new("walk.npz", bytes), options)
}

fn plain(bytes: &[u8]) -> Understood {
    with(bytes, &Options::default()).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn troupes_own_archive_comes_back() {
    let truth = walk(0);
    let found = plain(&write_npz(&truth).unwrap());
    assert_eq!((found.report.format.value, found.clip.fps), (Format::Npz, 30.0));
    let (a, b) = (
        WorldMotion::from_clip(&truth),
        WorldMotion::from_clip(&found.clip),
    );
    assert!(
        a.positions
            .iter()
            .zip(&b.positions)
            .all(|(a, b)| a.distance(*b) < 1e-5)
    );
    let fast = Options {
        fps: Some(60.0),
        ..Options::default()
    };
    let found = with(&write_npz(&truth).unwrap(), &fast).unwrap();
    assert_eq!((found.clip.fps, found.report.fps.basis), (60.0, Basis::Given));
    let options = Options {
        skeleton: Some(truth.skeleton.clone()),
        ..Options::default()
    };
    let found = with(&write_npz(&truth).unwrap(), &options).unwrap();
    assert!(
        found
            .clip
            .rotations
            .iter()
            .zip(&truth.rotations)
            .all(|(a, b)| angle_between(*a, *b) < 1e-4)
    );
}

/// AMASS arrays of a person who walks along Y and turns about Z, with an elbow bent by 1 rad.
pub(super) fn amass(frames: usize, width: usize, rate: Option<&str>, split: bool) -> Vec<u8> {
    let mut archive = Archive::new();
    let mut poses = vec![0.0_f32; frames * width];
    let mut trans = Vec::new();
    for (frame, pose) in poses.chunks_exact_mut(width).enumerate() {
        let t = frame as f32 / 120.0;
        // SMPL's Y becomes the world's Z; then a turn about it.
        let upright =
            DQuat::from_rotation_z(0.5 * f64::from(t)) * DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
        pose[..3].copy_from_slice(&upright.to_scaled_axis().as_vec3().to_array());
        pose[3 * 18 + 1] = -1.0;
        trans.extend([0.2, 1.5 * t, 0.9]);
    }
    archive.add("trans", &[frames, 3], &trans).unwrap();
    match split {
        false => archive.add("poses", &[frames, width], &poses).unwrap(),
        true => {
            let part = |from: usize, to: usize| -> Vec<f32> {
                poses
                    .chunks_exact(width)
                    .flat_map(|pose| pose[from..to].to_vec())
                    .collect()
            };
            archive.add("root_orient", &[frames, 3], &part(0, 3)).unwrap();
            archive.add("pose_body", &[frames, 63], &part(3, 66)).unwrap();
            archive
                .add("pose_hand", &[frames, 90], &vec![0.0_f32; 90 * frames])
                .unwrap();
        }
    }
    if let Some(rate) = rate {
        archive.add(rate, &[], &[120.0_f64]).unwrap();
    }
    archive.add("betas", &[16], &[0.0_f64; 16]).unwrap();
    archive.finish().unwrap()
}

#[test]
fn amass_is_read_with_the_published_tree() {
    for (width, rate, split, model) in [
        (156, Some("mocap_framerate"), false, "SMPL-H"),
        (165, Some("mocap_frame_rate"), false, "SMPL-X"),
        (72, Some("fps"), false, "SMPL"),
        (66, Some("mocap_frame_rate"), true, "SMPL-X"),
    ] {
        let found = plain(&amass(60, width, rate, split));
        let report = &found.report;
        assert_eq!(
            (report.format.value, &*report.skeleton.value, report.joints),
            (Format::Amass, model, 22)
        );
        assert_eq!(
            (report.up.value, report.fps.value, report.fps.basis),
            (Up::Z, 120.0, Basis::Stated)
        );
        assert_eq!(
            report.rest_pose.value,
            RestPose::T,
            "{}",
            report.rest_pose.evidence
        );
        assert!(report.oddities.is_empty(), "{:?}", report.oddities);
        let world = WorldMotion::from_clip(&found.clip);
        let joint = |name: &str| found.clip.skeleton.joint_index(name).unwrap();
        let at = |name: &str| world.positions_at(0)[joint(name)];
        let (head, foot) = (at("head").y, at("left_foot").y.min(at("right_foot").y));
        assert!(
            (1.4..1.7).contains(&(head - foot)) && foot.abs() < 0.1,
            "{head} {foot}"
        );
        // A bent left elbow brings the wrist ahead of it: the person faces -Y of AMASS, which is
        // +Z.
        assert!(at("left_wrist").z > at("left_elbow").z + 0.15);
        let way = found.clip.root_positions[59] - found.clip.root_positions[0];
        assert!(
            way.abs_diff_eq(Vec3::new(0.0, 0.0, -1.5 * 59.0 / 120.0), 1e-4),
            "{way}"
        );
        assert!((found.clip.skeleton.left_axis - Vec3::X).length() < 0.05);
    }
    let found = plain(&amass(60, 156, None, false));
    assert!(found.report.oddities.iter().all(|note| note.topic != Topic::Up));
    assert_eq!(
        (found.report.fps.value, found.report.fps.basis),
        (120.0, Basis::Assumed)
    );
    let error = with(&amass(60, 100, None, false), &Options::default())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("\"poses\": 100 numbers a frame; SMPL has 66 or 72"),
        "{error}"
    );
}

#[test]
fn shapes_of_bodies_are_noted() {
    let noted = |betas: &[f64]| {
        let mut archive = Archive::new();
        archive
            .add("trans", &[30, 3], &[0.0, 0.0, 0.9].repeat(30))
            .unwrap();
        let mut pose = vec![0.0_f64; 72];
        pose[0] = std::f64::consts::FRAC_PI_2;
        archive.add("poses", &[30, 72], &pose.repeat(30)).unwrap();
        archive.add("betas", &[betas.len()], betas).unwrap();
        let repairs = plain(&archive.finish().unwrap()).report.repairs;
        repairs
            .iter()
            .any(|note| note.topic == Topic::Body && note.text.contains("(betas) is not applied"))
    };
    assert!(!noted(&[0.0; 16]) && noted(&[2.0, 0.0]));
}

#[test]
fn smpl_x_has_a_pelvis_of_its_own() {
    let root = |width, split| plain(&amass(2, width, Some("fps"), split)).clip.root_positions[0];
    // Added to `trans` along the file's axes, whose Z is our Y and whose Y is our -Z.
    let place = |[x, y, z]: [f32; 3]| Vec3::new(0.2 + x, 0.9 + z, -y);
    for (width, split) in [(72, false), (156, false)] {
        assert!(root(width, split).abs_diff_eq(place([-0.0018, -0.2233, 0.0282]), 1e-5));
    }
    for (width, split) in [(165, false), (66, true)] {
        let found = root(width, split);
        assert!(
            found.abs_diff_eq(place([0.0031, -0.3514, 0.0120]), 1e-5),
            "{found}"
        );
    }
}

/// AMASS arrays of a person who walks on steps of a Y-up world, or lies in a Z-up one.
fn amass_along_y(climbs_m: f32) -> Vec<u8> {
    let frames = 60;
    let mut archive = Archive::new();
    let trans: Vec<f32> = (0..frames)
        .flat_map(|frame| [0.0, 0.9, climbs_m * frame as f32])
        .collect();
    archive.add("trans", &[frames, 3], &trans).unwrap();
    archive
        .add("poses", &[frames, 72], &vec![0.0_f32; frames * 72])
        .unwrap();
    archive.add("fps", &[], &[30.0_f64]).unwrap();
    archive.finish().unwrap()
}

#[test]
fn amass_arrays_may_be_y_up() {
    let found = plain(&amass_along_y(0.05));
    assert_eq!(
        (found.report.up.value, found.report.up.basis),
        (Up::Y, Basis::Found)
    );
    assert!(
        found
            .report
            .repairs
            .iter()
            .any(|note| note.text.starts_with("y is up, not z"))
    );
    // One who stays in one place may lie.
    let found = plain(&amass_along_y(0.0));
    assert_eq!(
        (found.report.up.value, found.report.up.basis),
        (Up::Z, Basis::Stated)
    );
    let odd = found.report.oddities.iter().find(|note| note.topic == Topic::Up);
    assert!(odd.unwrap().text.contains("100 % y over the frames"), "{odd:?}");
}

/// Kimodo's arrays of a motion of random turns on random bones.
pub(super) fn kimodo(joints: usize) -> (Vec<u8>, Vec<Vec3>, Vec<Quat>) {
    let frames = 8;
    let mut places = Vec::new();
    let mut turns = Vec::new();
    // Any tree: what counts is that places and rotations come back. Joints keep the offsets that
    // the tree of the format gives them, so places are made by it.
    let (_, parents) = crate::read::kimodo::tree_of(joints).unwrap();
    for frame in 0..frames {
        let first = frame * joints;
        for (joint, parent) in parents.iter().enumerate() {
            let local = Quat::from_scaled_axis(
                Vec3::new(0.3, 0.1 * joint as f32, 0.2) * (frame as f32 * 0.1 + joint as f32 * 0.01).sin(),
            );
            let offset = Vec3::new(0.02 * (joint % 5) as f32, 0.05, -0.01 * (joint % 3) as f32);
            match parent {
                None => {
                    places.push(Vec3::new(0.0, 1.0, 0.03 * frame as f32));
                    turns.push(local);
                }
                Some(parent) => {
                    let (above, turn): (Vec3, Quat) = (places[first + parent], turns[first + parent]);
                    places.push(above + turn * offset);
                    turns.push(turn * local);
                }
            }
        }
    }
    let mut archive = Archive::new();
    let numbers: Vec<f32> = places.iter().flat_map(|p| p.to_array()).collect();
    archive
        .add("posed_joints", &[frames, joints, 3], &numbers)
        .unwrap();
    let matrices: Vec<f32> = turns
        .iter()
        .flat_map(|q| glam::Mat3::from_quat(*q).transpose().to_cols_array())
        .collect();
    archive
        .add("global_rot_mats", &[frames, joints, 3, 3], &matrices)
        .unwrap();
    (archive.finish().unwrap(), places, turns)
}

#[test]
fn kimodos_archives_come_back() {
    for (joints, name) in [
        (77, "SOMA, 77 joints"),
        (30, "SOMA, 30 joints"),
        (22, "SMPL-X, 22 joints"),
        (34, "Unitree G1, 34 joints"),
    ] {
        let (bytes, places, turns) = kimodo(joints);
        let found = plain(&bytes);
        assert_eq!(
            (&*found.report.skeleton.value, found.report.joints),
            (name, joints)
        );
        assert_eq!(
            (found.report.fps.value, found.report.fps.basis),
            (30.0, Basis::Assumed)
        );
        let world = WorldMotion::from_clip(&found.clip);
        assert!(
            world
                .positions
                .iter()
                .zip(&places)
                .all(|(a, b)| a.distance(*b) < 5e-4),
            "{name}"
        );
        assert!(
            world
                .rotations
                .iter()
                .zip(&turns)
                .all(|(a, b)| angle_between(*a, *b).to_degrees() < 0.1),
            "{name}"
        );
    }
    let fast = Options {
        fps: Some(25.0),
        ..Options::default()
    };
    let found = with(&kimodo(30).0, &fast).unwrap();
    assert_eq!((found.clip.fps, found.report.fps.basis), (25.0, Basis::Given));
    let (bytes, ..) = kimodo(34);
    let options = Options {
        skeleton: Some(crate::robot::testing::g1()),
        ..Options::default()
    };
    let error = with(&bytes, &options).unwrap_err().to_string();
    assert!(error.contains("the .csv that Kimodo writes beside it"), "{error}");
}

#[test]
fn files_without_animations_take_no_name_of_one() {
    let options = Options {
        animation: Some("Walk".to_owned()),
        ..Options::default()
    };
    let error = with(&write_npz(&walk(0)).unwrap(), &options)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("animation \"Walk\": only .glb, .gltf and .fbx files"),
        "{error}"
    );
    let text = b"HIERARCHY";
    let error = read(&Source::new("walk.bvh", text), &options).unwrap_err();
    assert!(error.to_string().contains("animation \"Walk\""), "{error}");
}

#[test]
fn archives_without_motion_say_what_they_hold() {
    let mut archive = Archive::new();
    archive.add("weights", &[2], &[0.0_f32; 2]).unwrap();
    let error = with(&archive.finish().unwrap(), &Options::default())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("array \"weights\": no motion that is read") && error.contains("AMASS's trans"),
        "{error}"
    );
    assert!(
        with(b"PK\x03\x04", &Options::default())
            .unwrap_err()
            .to_string()
            .contains("no .npz archive: the zip archive is damaged or cut off")
    );
}
