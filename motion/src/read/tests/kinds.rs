//! One file of each kind that used to go wrong.

use std::sync::Arc;

use glam::{DVec3, Quat, Vec3};

use super::names_its_options;
use super::people::{Dialect, Person, encoded};
use crate::bvh::{BvhFile, BvhJoint, Channel, write};
use crate::clip::Clip;
use crate::fk::WorldMotion;
use crate::glb::write_glb;
use crate::read::{
    Agreement, Basis, Choice, Format, LeadingPose, OptionName, Options, ReadError, ReadErrorKind, RestPose,
    Source, Topic, Understood, Up, character, read, survey,
};
use crate::skeleton::{Joint, Skeleton};

const NUMBERS: [f32; 7] = [0.3, 0.8, 0.1, 0.6, 0.9, 0.2, 0.45];

pub(super) fn person() -> Person {
    Person {
        words: 2,
        size: 1.0,
        spine: 2,
        rest: RestPose::T,
    }
}

fn walk() -> Clip {
    person().walk(60, 30.0, &NUMBERS)
}

fn text() -> String {
    String::from_utf8(Dialect::plain().bytes(&walk())).unwrap()
}

pub(super) fn with(name: &str, bytes: &[u8], options: &Options) -> Result<Understood, ReadError> {
    read(&Source::new(name, bytes), options).inspect_err(names_its_options)
}

pub(super) fn plain(name: &str, bytes: &[u8]) -> Understood {
    with(name, bytes, &Options::default()).unwrap_or_else(|e| panic!("{e}"))
}

fn message(name: &str, bytes: &[u8], options: &Options) -> String {
    with(name, bytes, options).unwrap_err().to_string()
}

fn topics(found: &Understood) -> Vec<Topic> {
    found.report.repairs.iter().map(|note| note.topic).collect()
}

/// What is needed of a pack's manifest.
#[derive(serde::Deserialize)]
struct Pack {
    skeleton: Skeleton,
}

fn topics_of_oddities(found: &Understood) -> Vec<Topic> {
    found.report.oddities.iter().map(|note| note.topic).collect()
}

fn top_m(clip: &Clip) -> f32 {
    let world = WorldMotion::from_clip(clip);
    world.positions_at(0).iter().map(|p| p.y).fold(0.0, f32::max)
}

#[test]
fn a_plain_file_needs_no_repair() {
    let found = plain("walk.bvh", text().as_bytes());
    assert_eq!((topics(&found), &found.report.oddities[..]), (vec![], &[][..]));
    assert_eq!(found.report.format.value, Format::Bvh);
    assert_eq!(found.report.up.basis, Basis::Found);
    assert_eq!(
        found.report.contacts.value,
        ["Foot_L", "Toes_L", "Foot_R", "Toes_R"]
    );
    let rows = found.report.rows();
    assert!(rows.iter().all(|row| !row[1].is_empty()), "{rows:?}");
    assert_eq!(found.rest.unwrap(), vec![Quat::IDENTITY; found.report.joints]);
}

#[test]
fn encodings_and_small_mistakes_of_the_text_are_put_right_and_noted() {
    let text = text();
    for (bytes, wanted) in [
        (encoded(&text, 1), vec![Topic::Encoding]),
        (encoded(&text, 2), vec![Topic::Encoding]),
        (
            text.replace("Frames: 60", "Frames: 61").into_bytes(),
            vec![Topic::Frames],
        ),
        (
            text.replace("Frames: 60", "Frames: 59").into_bytes(),
            vec![Topic::Frames],
        ),
        (text.replace("Xposition", "XPosition").into_bytes(), vec![]),
    ] {
        let found = plain("walk.bvh", &bytes);
        assert_eq!(topics(&found), wanted);
        assert_eq!(found.clip, plain("walk.bvh", text.as_bytes()).clip);
    }
}

#[test]
fn what_a_text_leaves_open_names_the_option_that_decides() {
    let text = text();
    let still = text.replace("Frame Time: 0.03333333333333333", "Frame Time: 0");
    assert!(still.contains("Frame Time: 0\n"));
    let error = message("walk.bvh", still.as_bytes(), &Options::default());
    assert!(
        error.starts_with("walk.bvh: line ") && error.contains("--fps decides"),
        "{error}"
    );
    let options = Options {
        fps: Some(30.0),
        ..Options::default()
    };
    let found = with("walk.bvh", still.as_bytes(), &options).unwrap();
    assert_eq!(
        (found.report.fps.value, found.report.fps.basis),
        (30.0, Basis::Given)
    );
    let far = text.replace("Frames: 60", "Frames: 70");
    let error = message("walk.bvh", far.as_bytes(), &Options::default());
    assert!(error.contains("70 frames are declared"), "{error}");
    let slow = text.replace("Frame Time: 0.03333333333333333", "Frame Time: 33");
    let error = message("walk.bvh", slow.as_bytes(), &Options::default());
    assert!(error.contains("allowed: 0.001 to 1 s; --fps decides"), "{error}");
    let options = Options {
        unit_m: Some(-1.0),
        ..Options::default()
    };
    assert!(message("walk.bvh", text.as_bytes(), &options).contains("--unit is -1"));
}

/// A ROOT beside the first, which does not move.
fn with_second_root(second: &str) -> String {
    let more =
        format!("ROOT {second}\n{{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n}}\nMOTION");
    let text = text().replace("MOTION", &more);
    let (head, rows) = text.split_once("Frame Time").unwrap();
    let (time, rows) = rows.split_once('\n').unwrap();
    let rows: Vec<String> = rows.lines().map(|row| format!("{row} 0 0 0\n")).collect();
    format!("{head}Frame Time{time}\n{}", rows.concat())
}

#[test]
fn of_two_roots_the_body_is_read() {
    let found = plain("walk.bvh", with_second_root("Prop").as_bytes());
    assert_eq!(topics(&found), [Topic::Bystanders]);
    assert_eq!(found.clip, plain("walk.bvh", text().as_bytes()).clip);
    let nameless = with_second_root("Prop").replace("Foot_", "Thing_");
    let error = message("walk.bvh", nameless.as_bytes(), &Options::default());
    assert!(
        error.contains("2 roots: Hips, Prop") && error.contains("--root Hips or --root Prop decides"),
        "{error}"
    );
    let options = Options {
        root: Some("Prop".to_owned()),
        ..Options::default()
    };
    let found = with("walk.bvh", nameless.as_bytes(), &options).unwrap();
    assert_eq!(found.report.joints, 1);
    let options = Options {
        root: Some("Tail".to_owned()),
        ..Options::default()
    };
    let error = message("walk.bvh", nameless.as_bytes(), &options);
    assert!(
        error.contains("--root is \"Tail\"; allowed: a joint of the file"),
        "{error}"
    );
}

#[test]
fn a_second_joint_of_a_name_is_renamed_and_a_namespace_lost_if_asked() {
    let twice = text().replace("Toes_R", "Toes_L");
    let found = plain("walk.bvh", twice.as_bytes());
    assert_eq!(topics(&found), [Topic::Names]);
    assert!(found.clip.skeleton.joint_index("Toes_L_2").is_some());
    let mixamo = Person { words: 0, ..person() }.walk(60, 30.0, &NUMBERS);
    let bytes = Dialect::plain().bytes(&mixamo);
    let found = plain("walk.bvh", &bytes);
    assert_eq!(found.clip.skeleton.joints[0].name, "mixamorig:Hips");
    assert_eq!(found.report.producer.as_ref().unwrap().value, "Mixamo");
    let options = Options {
        strip_namespaces: true,
        ..Options::default()
    };
    let bare = with("walk.bvh", &bytes, &options).unwrap();
    assert_eq!(
        (&*bare.clip.skeleton.joints[0].name, topics(&bare)),
        ("Hips", vec![Topic::Names])
    );
    // A skeleton without the namespace takes the file as it is.
    let options = Options {
        skeleton: Some(bare.clip.skeleton.clone()),
        ..Options::default()
    };
    let on = with("walk.bvh", &bytes, &options).unwrap();
    assert_eq!(on.clip.rotations, bare.clip.rotations);
}

/// A walk whose first frame is the rest pose.
pub(super) fn with_leading_pose() -> Clip {
    let mut clip = walk();
    let pose = vec![Quat::IDENTITY; clip.skeleton.joint_count()];
    clip.rotations_at_mut(0).copy_from_slice(&pose);
    // The arms hang in all other frames.
    let arms = ["UpperArm_L", "UpperArm_R"].map(|name| clip.skeleton.joint_index(name).unwrap());
    for frame in 1..clip.frames() {
        for (arm, turn) in arms.into_iter().zip([-1.2, 1.2]) {
            clip.rotations_at_mut(frame)[arm] = Quat::from_rotation_z(turn);
        }
    }
    clip
}

#[test]
fn a_pose_before_the_motion_is_left_out() {
    let clip = with_leading_pose();
    let bytes = Dialect::plain().bytes(&clip);
    let found = plain("walk.bvh", &bytes);
    assert_eq!(
        (found.clip.frames(), topics(&found)),
        (59, vec![Topic::LeadingPose])
    );
    let options = Options {
        leading_pose: LeadingPose::Keep,
        ..Options::default()
    };
    assert_eq!(with("walk.bvh", &bytes, &options).unwrap().clip.frames(), 60);
    // Fingers, or one joint that is off, do not hide the pose; nor do several frames of it.
    let mut off = clip.clone();
    off.rotations_at_mut(0)[clip.skeleton.joint_index("UpperArm_L").unwrap()] = Quat::from_rotation_z(0.17);
    let legs = ["UpperLeg_L", "UpperLeg_R"].map(|name| clip.skeleton.joint_index(name).unwrap());
    for frame in 1..clip.frames() {
        for leg in legs {
            off.rotations_at_mut(frame)[leg] *= Quat::from_rotation_x(-1.0);
        }
    }
    let mut held = off.clone();
    let pose = off.rotations_at(0).to_vec();
    (1..5).for_each(|frame| held.rotations_at_mut(frame).copy_from_slice(&pose));
    // Resampling leaves frames between the pose and the motion.
    let mut blurred = off.clone();
    let motion = off.rotations_at(2).to_vec();
    for (frame, share) in [(1, 0.3), (2, 0.8)] {
        let between = pose.iter().zip(&motion).map(|(a, b)| a.slerp(*b, share));
        let between: Vec<Quat> = between.collect();
        blurred.rotations_at_mut(frame)[1..].copy_from_slice(&between[1..]);
    }
    for (clip, frames) in [(&off, 59), (&held, 55), (&blurred, 57)] {
        let found = plain("walk.bvh", &Dialect::plain().bytes(clip));
        assert_eq!(
            (found.clip.frames(), topics(&found)),
            (frames, vec![Topic::LeadingPose])
        );
    }
    // A walk that begins with its second frame keeps it.
    let found = plain("walk.bvh", &Dialect::plain().bytes(&clip.slice(1..60).unwrap()));
    assert_eq!(found.clip.frames(), 59);
}

#[test]
fn another_rest_pose_is_refused_with_the_joint_and_the_angle() {
    let clip = walk();
    let standing = Person {
        rest: RestPose::Standing,
        ..person()
    };
    for (rest, angle) in [(standing.rest, "85"), (RestPose::A, "45")] {
        let other = Person { rest, ..person() }.skeleton();
        let options = Options {
            skeleton: Some(other),
            other_bones: true,
            ..Options::default()
        };
        let error = message("walk.bvh", text().as_bytes(), &options);
        assert!(
            error.contains("Arm_") && error.contains(&format!("{angle}°")),
            "{error}"
        );
        let options = Options {
            other_bones: false,
            ..options
        };
        let error = message("walk.bvh", text().as_bytes(), &options);
        assert!(
            error.contains("--unit") && error.contains("--other-bones"),
            "{error}"
        );
    }
    // A little off is played, and noted.
    let mut other = (*person().skeleton()).clone();
    let arm = other.joint_index("LowerArm_L").unwrap();
    other.joints[arm].offset_m = Quat::from_rotation_z(0.175) * other.joints[arm].offset_m;
    let options = Options {
        skeleton: Some(Arc::new(other)),
        other_bones: true,
        ..Options::default()
    };
    let found = with("walk.bvh", text().as_bytes(), &options).unwrap();
    let odd = &found.report.oddities[0].text;
    assert!(
        odd.contains("from UpperArm_L to LowerArm_L") && odd.contains("10° off"),
        "{odd}"
    );
    // Bones of other lengths in the same pose are allowed.
    let tall = Person {
        size: 1.1,
        ..person()
    };
    let options = Options {
        skeleton: Some(tall.skeleton()),
        other_bones: true,
        ..Options::default()
    };
    let found = with("walk.bvh", text().as_bytes(), &options).unwrap();
    assert!(found.report.oddities.is_empty(), "{:?}", found.report.oddities);
    let near = |(a, b): (&Quat, &Quat)| a.abs_diff_eq(*b, 1e-3) || a.abs_diff_eq(-*b, 1e-3);
    assert!(found.clip.rotations.iter().zip(&clip.rotations).all(near));
}

#[test]
fn a_body_that_lies_is_not_taken_for_another_up_axis() {
    // On its back along Z: rest says Y, the motion says Z, and nothing moves.
    let mut clip = walk();
    for frame in 0..clip.frames() {
        clip.root_positions[frame] = Vec3::new(0.0, 0.15, 0.0);
        clip.rotations_at_mut(frame)[0] = Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2);
    }
    let bytes = Dialect::plain().bytes(&clip);
    let error = with("lies.bvh", &bytes, &Options::default()).unwrap_err();
    assert!(
        matches!(error.kind, ReadErrorKind::Open { topic: Topic::Up, .. }),
        "{error}"
    );
    assert_eq!(error.options(), [Choice::new(OptionName::Up, &["-z", "y"])]);
    let error = error.to_string();
    assert!(error.contains("--up -z or --up y decides"), "{error}");
    // The folder decides.
    let mut agreement = Agreement::default();
    let text = text();
    survey(
        &Source::new("walk.bvh", text.as_bytes()),
        &Options::default(),
        &mut agreement,
    )
    .unwrap();
    survey(
        &Source::new("lies.bvh", &bytes),
        &Options::default(),
        &mut agreement,
    )
    .unwrap();
    assert_eq!((agreement.up(), agreement.unit_m()), (Some(Up::Y), Some(0.01)));
    let options = Options {
        agreement: Some(agreement),
        ..Options::default()
    };
    let found = with("lies.bvh", &bytes, &options).unwrap();
    assert_eq!(
        (found.report.up.value, found.report.up.basis),
        (Up::Y, Basis::Found)
    );
    assert!(
        found
            .report
            .up
            .evidence
            .contains("as the other files of the folder")
    );
}

#[test]
fn a_body_that_lies_in_a_format_with_an_up_axis_is_noted() {
    let mut clip = walk();
    for frame in 0..clip.frames() {
        let turn = Quat::from_rotation_x(std::f32::consts::FRAC_PI_2);
        clip.root_positions[frame] = turn * clip.root_positions[frame];
        let hips = &mut clip.rotations_at_mut(frame)[0];
        *hips = turn * *hips;
    }
    let found = plain("lies.glb", &write_glb(&clip).unwrap());
    assert!(topics_of_oddities(&found).contains(&Topic::Up));
    let options = Options {
        up: Some(Up::Z),
        ..Options::default()
    };
    let found = with("lies.glb", &write_glb(&clip).unwrap(), &options).unwrap();
    assert_eq!(topics_of_oddities(&found), []);
    assert!((top_m(&found.clip) - 1.51).abs() < 0.02);
}

#[test]
fn a_body_that_lies_stays_so_on_a_skeleton_of_its_bones() {
    // Bones along X, as in the human pack: at rest the body lies along X, and so it does here.
    let manifest = include_str!("../../../../models/human/pack.toml");
    let pack: Pack = toml::from_str(manifest).unwrap();
    let skeleton = Arc::new(pack.skeleton);
    let roots = (0..90).map(|frame| Vec3::new(0.0, 0.9, 0.03 * frame as f32));
    let rotations = vec![Quat::IDENTITY; 90 * skeleton.joint_count()];
    let clip = Clip::new(Arc::clone(&skeleton), 30.0, roots.collect(), rotations).unwrap();
    let bytes = Dialect::plain().bytes(&clip);
    let options = Options {
        skeleton: Some(skeleton),
        ..Options::default()
    };
    let found = with("lies.bvh", &bytes, &options).unwrap();
    assert_eq!(
        (found.report.up.value, found.report.up.basis),
        (Up::Y, Basis::Assumed)
    );
    assert!(
        topics_of_oddities(&found).contains(&Topic::Up),
        "{:?}",
        found.report.oddities
    );
    let pairs = found.clip.rotations.iter().zip(&clip.rotations);
    assert!(
        pairs
            .clone()
            .all(|(a, b)| crate::rotation::angle_between(*a, *b) < 1e-3)
    );
    // Without the skeleton nothing shows which axis points up.
    let error = with("lies.bvh", &bytes, &Options::default())
        .unwrap_err()
        .to_string();
    assert!(error.contains("--up x or --up y decides"), "{error}");
}

#[test]
fn units_are_found_by_the_height_of_people() {
    for (unit_m, name) in [(0.0254 / 0.45, "cmu"), (0.0254, "in"), (0.001, "mm"), (1.0, "m")] {
        let dialect = Dialect {
            unit_m,
            ..Dialect::plain()
        };
        let found = plain("walk.bvh", &dialect.bytes(&walk()));
        assert_eq!(topics(&found), [Topic::Unit]);
        assert!(
            (top_m(&found.clip) - 1.51).abs() < 0.02,
            "{name}: {}",
            top_m(&found.clip)
        );
    }
    // A child of 0.9 m in centimetres is a grown person in no unit.
    let child = Person {
        size: 0.52,
        ..person()
    };
    let clip = child.walk(60, 30.0, &NUMBERS);
    let found = plain("walk.bvh", &Dialect::plain().bytes(&clip));
    assert_eq!(
        (found.report.unit_m.value, found.report.unit_m.basis),
        (0.01, Basis::Assumed)
    );
    assert_eq!(found.report.oddities[0].topic, Topic::Unit);
    // One of 2.1 m in decimetres is one of 1.2 m in CMU's units.
    let far = Dialect {
        unit_m: 1e-5,
        ..Dialect::plain()
    };
    let error = message("walk.bvh", &far.bytes(&walk()), &Options::default());
    assert!(
        error.contains("the unit of length is unclear") && error.contains("--unit mm or --unit cm"),
        "{error}"
    );
}

#[test]
fn a_person_in_inches_may_be_a_small_figure_in_centimetres() {
    // 0.65 m in centimetres, and 1.65 m in inches.
    let small = Person {
        size: 0.65 / 1.72,
        ..person()
    };
    let bytes = Dialect::plain().bytes(&small.walk(60, 30.0, &NUMBERS));
    let found = plain("walk.bvh", &bytes);
    assert!((found.report.unit_m.value - 0.0254).abs() < 1e-9);
    let odd = &found.report.oddities[..];
    assert!(
        odd.len() == 1 && odd[0].topic == Topic::Unit && odd[0].text.contains("--unit cm decides"),
        "{odd:?}"
    );
    let options = Options {
        unit_m: Some(0.01),
        ..Options::default()
    };
    let found = with("walk.bvh", &bytes, &options).unwrap();
    assert!(!topics_of_oddities(&found).contains(&Topic::Unit));
    // A skeleton of the same lengths decides.
    let options = Options {
        skeleton: Some(small.skeleton()),
        ..Options::default()
    };
    let found = with("walk.bvh", &bytes, &options).unwrap();
    assert!((found.report.unit_m.value - 0.01).abs() < 1e-9);
    assert!(!topics_of_oddities(&found).contains(&Topic::Unit));
}

#[test]
fn a_root_that_is_kilometres_away_is_refused_with_the_frame() {
    for (far_m, found) in [(1e6, "(1000000, "), (1e30, "e30")] {
        let mut clip = walk();
        clip.root_positions[7].x = far_m;
        let error = message("walk.bvh", &Dialect::plain().bytes(&clip), &Options::default());
        assert!(
            error.contains("in frame 7 is") && error.contains(found) && error.contains("-10000 to 10000 m"),
            "{error}"
        );
    }
}

#[test]
fn a_clip_in_which_nothing_moves_is_noted() {
    let first = walk().slice(0..1).unwrap();
    let joints = first.skeleton.joint_count();
    let still = |frames: usize| {
        let roots = vec![first.root_positions[0]; frames];
        let rotations = (0..frames * joints).map(|nth| first.rotations[nth % joints]);
        let clip = Clip::new(first.skeleton.clone(), 30.0, roots, rotations.collect()).unwrap();
        plain("still.bvh", &Dialect::plain().bytes(&clip)).report.oddities
    };
    assert_eq!(still(1), []);
    let odd = still(20);
    assert_eq!(odd.len(), 1, "{odd:?}");
    assert_eq!(odd[0].text, "nothing moves: all 20 frames are equal");
}

#[test]
fn hips_without_length_are_kept_and_left_is_found() {
    let clip = walk();
    let mut joints: Vec<Joint> = Vec::new();
    let mut place = Vec::new();
    // A joint in the hips' place above each thigh.
    for joint in &clip.skeleton.joints {
        let parent = joint.parent.map(|parent: usize| place[parent]);
        let mut above = parent;
        if joint.name.starts_with("UpperLeg") {
            joints.push(Joint {
                name: joint.name.replace("UpperLeg", "HipJoint"),
                parent,
                offset_m: Vec3::ZERO,
            });
            above = Some(joints.len() - 1);
        }
        joints.push(Joint {
            parent: above,
            ..joint.clone()
        });
        place.push(joints.len() - 1);
    }
    let count = joints.len();
    let skeleton = Arc::new(Skeleton::new(joints, Vec3::X, 0.0, None).unwrap());
    let mut rotations = vec![Quat::IDENTITY; clip.frames() * count];
    for frame in 0..clip.frames() {
        for (from, &to) in place.iter().enumerate() {
            rotations[frame * count + to] = clip.rotations_at(frame)[from];
        }
    }
    let with_hips = Clip::new(skeleton, 30.0, clip.root_positions.clone(), rotations).unwrap();
    let found = plain("walk.bvh", &Dialect::plain().bytes(&with_hips));
    assert_eq!(topics(&found), [Topic::ZeroLength]);
    assert!(found.clip.skeleton.left_axis.abs_diff_eq(Vec3::X, 1e-5));
    assert!((found.report.unit_m.value - 0.01).abs() < 1e-9);
    let heading = |clip: &Clip| clip.root_at(30).heading;
    assert!((heading(&found.clip) - heading(&clip)).abs() < 1e-3);
}

/// A BVH whose joint moves in its parent by up to some metres.
pub(super) fn sliding(joint: &str, by_m: f64) -> Vec<u8> {
    let file = Dialect::plain().file(&walk());
    let mut joints: Vec<BvhJoint> = file.joints().to_vec();
    let which = joints.iter().position(|of| of.name == joint).unwrap();
    let before: usize = joints[..which].iter().map(|of| of.channels.len()).sum();
    let offset = joints[which].offset;
    let moves = [Channel::Xposition, Channel::Yposition, Channel::Zposition];
    joints[which].channels = [&moves[..], &joints[which].channels].concat();
    let mut values = Vec::new();
    for frame in 0..file.frames() {
        let row = file.row(frame);
        values.extend(&row[..before]);
        let share = 0.5 - 0.5 * (frame as f64 / 10.0).cos();
        values.extend([offset.x, offset.y + 100.0 * by_m * share, offset.z]);
        values.extend(&row[before..]);
    }
    write(&BvhFile::new(joints, file.frame_time_s(), values).unwrap()).into_bytes()
}

#[test]
fn small_slides_are_held_large_ones_named_and_no_limb_is_lost() {
    let whole = walk().skeleton.joint_count();
    let found = plain("walk.bvh", &sliding("Chest", 0.002));
    assert_eq!(
        (found.report.joints, topics(&found)),
        (whole, vec![Topic::Sliding])
    );
    assert!(found.report.repairs[0].text.contains("Chest"));
    let found = plain("walk.bvh", &sliding("UpperArm_L", 0.12));
    assert_eq!((found.report.joints, topics(&found)), (whole, vec![]));
    let odd = &found.report.oddities[0];
    assert!(
        odd.topic == Topic::Sliding && odd.text.contains("UpperArm_L by 0.1"),
        "{odd:?}"
    );
    let error = message("walk.bvh", &sliding("UpperArm_L", 0.9), &Options::default());
    assert!(
        error.contains("\"UpperArm_L\" moves 0.") && error.contains("Hand_L hangs on it"),
        "{error}"
    );
    assert!(error.contains("--max-slide"), "{error}");
    let options = Options {
        max_slide_m: Some(1.0),
        ..Options::default()
    };
    let found = with("walk.bvh", &sliding("UpperArm_L", 0.9), &options).unwrap();
    assert_eq!(found.report.joints, whole);
    // What carries nothing of the body may stay behind.
    let found = plain("walk.bvh", &sliding("Toes_L", 0.9));
    assert_eq!(
        (found.report.joints, topics(&found)),
        (whole - 1, vec![Topic::Bystanders])
    );
}

/// A body without words, a foot that a joint beside it steers, and what hangs on that joint.
fn steered(steering: &str, tip: &str) -> Vec<u8> {
    let joint = |name: &str, parent, y| BvhJoint {
        name: name.to_owned(),
        parent,
        offset: DVec3::new(0.0, y, 0.0),
        channels: match parent {
            None => vec![Channel::Xposition, Channel::Yposition, Channel::Zposition],
            Some(_) => vec![Channel::Zrotation, Channel::Xrotation, Channel::Yrotation],
        },
        end_sites: Vec::new(),
    };
    let mut joints = vec![
        joint("Bone", None, 0.0),
        joint("Bone.001", Some(0), 0.5),
        joint("Bone.002", Some(1), 0.5),
        joint(steering, Some(0), -0.4),
        joint(tip, Some(3), 0.1),
    ];
    joints[3].channels = joints[0].channels.clone();
    let values = (0..20).flat_map(|frame| {
        let mut row = [0.0; 15];
        (row[1], row[10], row[11]) = (1.0, -0.4, 0.1 * f64::from(frame));
        row
    });
    write(&BvhFile::new(joints, 1.0 / 30.0, values.collect()).unwrap()).into_bytes()
}

#[test]
fn joints_that_steer_a_rig_and_travel_are_left_out() {
    let options = Options {
        up: Some(Up::Y),
        unit_m: Some(1.0),
        ..Options::default()
    };
    let found = with("walk.bvh", &steered("IKFront", "IKFront_end"), &options).unwrap();
    let names: Vec<&str> = found
        .clip
        .skeleton
        .joints
        .iter()
        .map(|joint| &*joint.name)
        .collect();
    assert_eq!(names, ["Bone", "Bone.001", "Bone.002"]);
    let note = found
        .report
        .repairs
        .iter()
        .find(|note| note.topic == Topic::Bystanders);
    assert!(note.unwrap().text.contains("IKFront"), "{note:?}");
    // What is of the body is not lost with them.
    for (steering, tip) in [("IKFront", "Bone.003"), ("Bone.004", "IKFront")] {
        let error = message("walk.bvh", &steered(steering, tip), &options);
        assert!(
            error.contains("--max-slide") && error.contains(&format!("{tip} hangs on it")),
            "{error}"
        );
    }
}

#[test]
fn glb_says_its_unit_unless_no_body_has_it() {
    let mut huge = walk();
    let skeleton = Arc::make_mut(&mut huge.skeleton);
    skeleton
        .joints
        .iter_mut()
        .for_each(|joint| joint.offset_m *= 100.0);
    huge.root_positions.iter_mut().for_each(|root| *root *= 100.0);
    let found = plain("walk.glb", &write_glb(&huge).unwrap());
    assert_eq!(
        (found.report.unit_m.value, topics(&found)),
        (0.01, vec![Topic::Unit])
    );
    assert!((top_m(&found.clip) - 1.51).abs() < 0.02);
    let found = plain("walk.glb", &write_glb(&walk()).unwrap());
    assert_eq!(
        (found.report.unit_m.value, found.report.unit_m.basis),
        (1.0, Basis::Stated)
    );
}

#[test]
fn a_glb_of_no_bodys_size_is_read_in_no_unit_of_other_programs() {
    // 26 m tall, or 1.46 m in CMU's unit.
    let mut huge = walk();
    let skeleton = Arc::make_mut(&mut huge.skeleton);
    skeleton
        .joints
        .iter_mut()
        .for_each(|joint| joint.offset_m *= 15.0);
    huge.root_positions.iter_mut().for_each(|root| *root *= 15.0);
    let error = message("walk.glb", &write_glb(&huge).unwrap(), &Options::default());
    assert!(error.contains("--unit cm or --unit m decides"), "{error}");
}

#[test]
fn a_character_without_skin_and_animation_lacks_the_skin() {
    let bytes = br#"{ "asset": { "version": "2.0" }, "nodes": [{ "name": "Statue" }] }"#;
    let error = character(&Source::new("statue.gltf", bytes), &Options::default()).unwrap_err();
    assert!(error.to_string().contains("the file has no skin"), "{error}");
    let error = read(&Source::new("statue.gltf", bytes), &Options::default()).unwrap_err();
    assert!(error.kind.lacks_animation(), "{error}");
}

#[test]
fn names_have_256_bytes_at_most() {
    let named = |bytes: usize| {
        let mut clip = walk();
        let joints = &mut Arc::make_mut(&mut clip.skeleton).joints;
        joints.last_mut().unwrap().name = "x".repeat(bytes);
        write_glb(&clip).unwrap()
    };
    assert!(with("walk.glb", &named(256), &Options::default()).is_ok());
    let error = message("walk.glb", &named(257), &Options::default());
    let wanted = format!(
        "the name of joint \"{}…\" is 257 bytes long; allowed: up to 256 bytes",
        "x".repeat(32)
    );
    assert!(error.contains(&wanted), "{error}");
}

#[test]
fn files_that_are_not_read_say_what_makes_one_that_is() {
    let error = message("walk.doc", b"what", &Options::default());
    assert!(error.contains("neither its ending nor its content"), "{error}");
    assert!(message("walk.bvh", b"", &Options::default()).contains("line 1"));
    assert!(message("walk.gltf", b"{}", &Options::default()).contains("missing field `asset`"));
}

#[cfg(not(feature = "fbx"))]
#[test]
fn fbx_names_a_program_that_converts_it() {
    let error = message("walk.fbx", b"Kaydara FBX Binary  \0", &Options::default());
    assert!(
        error.starts_with("walk.fbx: FBX is not read") && error.contains("Blender"),
        "{error}"
    );
}
