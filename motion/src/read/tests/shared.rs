//! The files that programs without this reader are held to: `motion/tests/shared_files.json`.
//!
//! Each has what the reader makes of it: a motion, or an error. The Python client, which keeps its
//! own small readers, must give the same motion or refuse the file. This test writes them:
//! `UPDATE_SHARED_FILES=1 cargo test -p troupe-motion --features files shared`.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::{Quat, Vec3};
use serde_json::{Value, json};

use super::people::{Dialect, Person, encoded};
use super::robots::rows;
use crate::bvh::EulerOrder;
use crate::clip::Clip;
use crate::read::{Options, RestPose, Source, Up, read};
use crate::robot::{RobotDoc, write_csv};
use crate::rotation::{from_wxyz, to_wxyz, yaw};
use crate::skeleton::{Joint, Skeleton};

const FRAMES: usize = 5;
/// Largest difference of a number from the committed one: metres, and parts of a quaternion.
const TOLERANCE: f64 = 1e-5;

/// A file, as the other programs get it.
struct File {
    /// With the ending that decides the format.
    name: String,
    bytes: Vec<u8>,
}

fn person() -> Person {
    Person {
        words: 2,
        size: 1.0,
        spine: 1,
        rest: RestPose::T,
    }
}

fn walk(person: &Person) -> Clip {
    person.walk(FRAMES, 30.0, &[0.3, 0.8, 0.1, 0.6, 0.9, 0.2, 0.45])
}

/// A pelvis with two legs of two hinges: the order of the tree is not that of the levels.
fn robot() -> Arc<Skeleton> {
    let mut joints = vec![("pelvis".to_owned(), None, [0.0, 0.0, 0.0])];
    let mut hinges = Vec::new();
    for (side, x) in [("left", 0.1), ("right", -0.1)] {
        for (word, parent, offset, limits) in [
            ("hip", 0, [x, -0.1, 0.0], [-1.5, 0.2]),
            ("knee", joints.len(), [0.0, -0.4, 0.02], [0.0, 2.5]),
        ] {
            let name = format!("{side}_{word}");
            hinges.push(json!({
                "joint": name, "axis": [1, 0, 0], "rest": [1, 0, 0, 0],
                "lower_rad": limits[0], "upper_rad": limits[1], "max_speed_rad_per_s": 20,
            }));
            joints.push((name, Some(parent), offset));
        }
        let knee = joints.len() - 1;
        joints.push((format!("{side}_toe"), Some(knee), [0.0, -0.4, 0.1]));
    }
    let joint = |(name, parent, offset)| Joint {
        name,
        parent,
        offset_m: Vec3::from_array(offset),
    };
    let joints = joints.into_iter().map(joint).collect();
    let skeleton = Skeleton::new(joints, Vec3::X, 0.0, None).unwrap();
    let doc: RobotDoc = serde_json::from_value(json!({"name": "legs", "hinges": hinges})).unwrap();
    Arc::new(skeleton.with_robot(&doc).unwrap())
}

/// The robot walks along +Z, with knees that are bent more than hips may be.
fn steps(skeleton: &Arc<Skeleton>) -> Clip {
    let robot = skeleton.robot.as_ref().unwrap();
    let mut pose = vec![Quat::IDENTITY; skeleton.joint_count()];
    let (mut roots, mut rotations) = (Vec::new(), Vec::new());
    for frame in 0..FRAMES {
        let t = frame as f32;
        let swing = 0.2 * (0.7 * t).sin();
        robot.pose(
            yaw(0.1 * t),
            &[-0.5 + swing, 1.2 - swing, -0.5 - swing, 1.2 + swing],
            &mut pose,
        );
        rotations.extend(&pose);
        roots.push(Vec3::new(0.01 * t, 0.8, 0.4 * t));
    }
    Clip::new(Arc::clone(skeleton), 30.0, roots, rotations).unwrap()
}

fn bvh_files() -> Vec<File> {
    let clip = walk(&person());
    let plain = Dialect::plain();
    let text = String::from_utf8(plain.bytes(&clip)).unwrap();
    let time = format!("Frame Time: {}", 1.0 / 30.0_f64);
    let (head, rows) = text.split_once(&time).unwrap();
    let changed = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    };
    let first_row = rows.trim_start().lines().next().unwrap();
    let first_number = first_row.split(' ').next().unwrap();
    let with_first = |number: &str| changed(first_row, &first_row.replacen(first_number, number, 1));
    let second_root = |rows: &str| {
        let root = "ROOT Prop\n{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n}\nMOTION";
        let rows: Vec<String> = (rows.lines().skip(1))
            .map(|row| format!("{row} 0 0 0\n"))
            .collect();
        format!("{}{time}\n{}", head.replace("MOTION", root), rows.concat())
    };
    let mut rest_first = clip.clone();
    let joints = clip.skeleton.joint_count();
    rest_first.rotations_at_mut(0)[1..].fill(Quat::IDENTITY);
    for frame in 1..FRAMES {
        let arm = clip.skeleton.joint_index("UpperArm_L").unwrap();
        rest_first.rotations_at_mut(frame)[arm] = Quat::from_rotation_z(-1.2);
    }
    let lies = {
        let mut clip = clip.clone();
        for frame in 0..FRAMES {
            clip.root_positions[frame] = Vec3::new(0.0, 0.15, 0.0);
            let pose = &mut clip.rotations[frame * joints..][..joints];
            pose.fill(Quat::IDENTITY);
            pose[0] = Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2);
        }
        clip
    };
    // As in many of CMU's conversions, the hips hang in the pelvis' own place.
    let no_hips = text.replace("OFFSET 9 -5 0", "OFFSET 0 0 0");
    let no_hips = no_hips.replace("OFFSET -9 -5 0", "OFFSET 0 0 0");
    assert_ne!(no_hips, text);
    let dialect = |unit_m: f64, up: Up| Dialect {
        unit_m,
        up,
        ..Dialect::plain()
    };
    let text_of = |dialect: &Dialect| String::from_utf8(dialect.bytes(&clip)).unwrap();
    let files = [
        ("plain", plain.bytes(&clip)),
        ("byte_order_mark", encoded(&text, 1)),
        ("utf_16", encoded(&text, 2)),
        ("line_ends_of_windows", text.replace('\n', "\r\n").into_bytes()),
        (
            "rotations_x_y_z",
            Dialect {
                order: EulerOrder::XYZ,
                ..Dialect::plain()
            }
            .bytes(&clip),
        ),
        (
            "capital_position",
            changed("Xposition Yposition Zposition", "XPosition YPosition ZPosition").into_bytes(),
        ),
        (
            "one_frame_more_declared",
            changed("Frames: 5", "Frames: 6").into_bytes(),
        ),
        (
            "one_frame_fewer_declared",
            changed("Frames: 5", "Frames: 4").into_bytes(),
        ),
        (
            "many_frames_more_declared",
            changed("Frames: 5", "Frames: 50").into_bytes(),
        ),
        ("frame_time_0", changed(&time, "Frame Time: 0").into_bytes()),
        (
            "frame_time_in_ms",
            changed(&time, "Frame Time: 33.3333").into_bytes(),
        ),
        ("rate_24", changed(&time, "Frame Time: 0.0416667").into_bytes()),
        ("two_roots", second_root(rows).into_bytes()),
        (
            "positions_of_0",
            with_positions_of_0(&text, clip.skeleton.joint_count() - 1),
        ),
        ("z_up", dialect(0.01, Up::Z).bytes(&clip)),
        ("inches", dialect(0.0254, Up::Y).bytes(&clip)),
        ("metres", dialect(1.0, Up::Y).bytes(&clip)),
        ("millimetres", dialect(0.001, Up::Y).bytes(&clip)),
        ("hips_without_length", no_hips.into_bytes()),
        (
            "two_joints_of_a_name",
            text.replace("Toes_R", "Toes_L").into_bytes(),
        ),
        ("namespaces", plain.bytes(&walk(&Person { words: 0, ..person() }))),
        ("rest_pose_first", plain.bytes(&rest_first)),
        ("lies", plain.bytes(&lies)),
        (
            "z_up_with_targets_of_feet",
            with_joints(&text_of(&dialect(0.01, Up::Z)), &FOOT_TARGETS),
        ),
        (
            "z_up_with_an_arrow",
            with_joints(&text_of(&dialect(0.01, Up::Z)), &["ArrowHead"]),
        ),
        (
            "inches_with_targets_of_feet",
            with_joints(&text_of(&dialect(0.0254, Up::Y)), &FOOT_TARGETS),
        ),
        ("root_above_the_hips", below_a_still_root(&text)),
        ("faces_back", plain.bytes(&facing_back(&clip))),
        ("cut_in_the_hierarchy", text.as_bytes()[..200].to_vec()),
        ("cut_in_a_row", text.as_bytes()[..text.len() - 40].to_vec()),
        ("not_a_number", with_first("high").into_bytes()),
        ("not_finite", with_first("nan").into_bytes()),
        ("unknown_channel", changed("Xposition", "Wposition").into_bytes()),
        ("empty", Vec::new()),
    ];
    let named = |(name, bytes): (&str, Vec<u8>)| File {
        name: format!("{name}.bvh"),
        bytes,
    };
    files.into_iter().map(named).collect()
}

/// Joints that steer a rig's feet: their names have the word foot too.
const FOOT_TARGETS: [&str; 2] = ["LeftFootIK", "RightFootIK"];

/// A BVH with still joints on its root.
fn with_joints(text: &str, names: &[&str]) -> Vec<u8> {
    let (head, motion) = text.split_once("}\nMOTION").unwrap();
    let joint = |name: &&str| {
        format!(
            "\tJOINT {name}\n\t{{\n\t\tOFFSET 5 -5 5\n\t\tCHANNELS 3 Zrotation Xrotation Yrotation\n\t}}\n"
        )
    };
    let joints: String = names.iter().map(joint).collect();
    let row = |line: &str| match line.split(' ').count() {
        count if count > 6 => format!("{line}{}\n", " 0 0 0".repeat(names.len())),
        _ => format!("{line}\n"),
    };
    let motion: String = motion.lines().map(row).collect();
    format!("{head}{joints}}}\nMOTION{motion}").into_bytes()
}

/// A BVH whose hips stand still below a root that never moves.
fn below_a_still_root(text: &str) -> Vec<u8> {
    let (head, motion) = text.split_once("MOTION").unwrap();
    let head = head.replace("ROOT Hips", "JOINT Hips");
    let (start, joints) = head.split_once('\n').unwrap();
    let root = "ROOT Reference\n{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation";
    let is_row = |line: &&str| line.split(' ').count() > 6;
    let first = motion.lines().find(is_row).unwrap();
    let row = |line: &str| match is_row(&line) {
        true => format!("0 0 0 {first}\n"),
        false => format!("{line}\n"),
    };
    let motion: String = motion.lines().map(row).collect();
    format!("{start}\n{root}\n{joints}}}\nMOTION{motion}").into_bytes()
}

/// The same motion by joints that are turned about Y in themselves: left is the hips' -X.
fn facing_back(clip: &Clip) -> Clip {
    let turn = yaw(std::f32::consts::PI);
    let joints = clip.skeleton.joints.iter().map(|joint| Joint {
        offset_m: turn * joint.offset_m,
        ..joint.clone()
    });
    let skeleton = Skeleton::new(joints.collect(), Vec3::NEG_X, 0.0, None).unwrap();
    let rotations = clip.rotations.iter().enumerate().map(|(nth, &rotation)| {
        let parent = match nth % clip.skeleton.joint_count() {
            0 => Quat::IDENTITY,
            _ => turn,
        };
        parent * rotation * turn.conjugate()
    });
    let rotations = rotations.collect();
    Clip::new(
        Arc::new(skeleton),
        clip.fps,
        clip.root_positions.clone(),
        rotations,
    )
    .unwrap()
}

/// A BVH that gives each joint below the root positions relative to its OFFSET.
fn with_positions_of_0(text: &str, joints: usize) -> Vec<u8> {
    let (head, rows) = text.split_once("MOTION").unwrap();
    let head = head.replace("CHANNELS 3 ", "CHANNELS 6 Xposition Yposition Zposition ");
    let numbers = 6 + 3 * joints;
    let row = |line: &str| {
        let words: Vec<&str> = line.split(' ').collect();
        if words.len() != numbers {
            return format!("{line}\n");
        }
        let turns = words[6..]
            .chunks(3)
            .map(|turns| format!(" 0 0 0 {}", turns.join(" ")));
        format!("{}{}\n", words[..6].join(" "), turns.collect::<String>())
    };
    format!("{head}MOTION{}", rows.lines().map(row).collect::<String>()).into_bytes()
}

fn csv_files(skeleton: &Arc<Skeleton>) -> Vec<File> {
    let text = write_csv(&steps(skeleton)).unwrap();
    let rows = |change: &dyn Fn(&mut Vec<f64>)| rows(&text, change);
    let header = "x,y,z,qx,qy,qz,qw,left_hip,left_knee,right_hip,right_knee\n";
    let first = text.split(',').next().unwrap();
    let files = [
        ("plain", text.clone()),
        ("byte_order_mark", format!("\u{feff}{text}")),
        ("header", format!("{header}{text}")),
        ("blank_lines", text.replace('\n', "\n\n")),
        ("wxyz", rows(&|row| row[3..7].rotate_right(1))),
        (
            "degrees",
            rows(&|row| row[7..].iter_mut().for_each(|angle| *angle = angle.to_degrees())),
        ),
        ("order_of_levels", rows(&|row| row.swap(8, 9))),
        ("beyond_the_limits", rows(&|row| row[8] += 3.0)),
        ("another_robot", rows(&|row| row.truncate(9))),
        (
            "length_of_the_quaternion",
            rows(&|row| row[3..7].iter_mut().for_each(|n| *n *= 0.9)),
        ),
        ("not_a_number", text.replacen(first, "high", 1)),
        ("not_finite", text.replacen(first, "nan", 1)),
        ("empty", String::new()),
    ];
    let named = |(name, text): (&str, String)| File {
        name: format!("{name}.csv"),
        bytes: text.into_bytes(),
    };
    files.into_iter().map(named).collect()
}

/// A number with as many digits as matter.
fn number(value: f32) -> Value {
    json!((f64::from(value) * 1e7).round() / 1e7)
}

fn motion(clip: &Clip) -> Value {
    let joints = &clip.skeleton.joints;
    let vectors = |of: &[Vec3]| -> Vec<Value> { of.iter().flat_map(|v| v.to_array()).map(number).collect() };
    // One sign for each rotation, whatever the file had.
    let rotations = clip
        .rotations
        .iter()
        .map(|&q| to_wxyz(if q.w < 0.0 { -q } else { q }));
    let offsets: Vec<Vec3> = joints.iter().map(|joint| joint.offset_m).collect();
    json!({
        "fps": number(clip.fps),
        "joints": joints.iter().map(|joint| &*joint.name).collect::<Vec<_>>(),
        "parents": joints.iter().map(|j| j.parent.map_or(-1, |p| p as i64)).collect::<Vec<_>>(),
        "offsets_m": vectors(&offsets),
        "left_axis": vectors(&[clip.skeleton.left_axis]),
        "roots_m": vectors(&clip.root_positions),
        "rotations_wxyz": rotations.flatten().map(number).collect::<Vec<_>>(),
    })
}

/// The first motion that is the same but for rounding, or a new one of this name.
fn name_of(name: &str, found: Value, motions: &mut BTreeMap<String, Value>) -> String {
    if let Some((known, _)) = motions.iter().find(|(_, of)| differs(of, &found).is_none()) {
        return known.clone();
    }
    motions.insert(name.to_owned(), found);
    name.to_owned()
}

/// Where two values differ by more than rounding.
fn differs(a: &Value, b: &Value) -> Option<String> {
    let at = |key: String| move |below: String| format!("{key} {below}");
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => {
            let off = (a.as_f64()? - b.as_f64()?).abs();
            (off > TOLERANCE).then(|| format!("{a} and {b}"))
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            let mut pairs = a.iter().zip(b).enumerate();
            pairs.find_map(|(nth, (a, b))| differs(a, b).map(at(nth.to_string())))
        }
        (Value::Object(a), Value::Object(b)) if a.keys().eq(b.keys()) => {
            let mut pairs = a.iter().zip(b.values());
            pairs.find_map(|((key, a), b)| differs(a, b).map(at(key.clone())))
        }
        _ => (a != b).then(|| format!("{:.200} and {:.200}", a.to_string(), b.to_string())),
    }
}

/// The files with what the reader makes of them.
fn shared() -> Value {
    let skeleton = robot();
    let mut motions = BTreeMap::new();
    let mut files = Vec::new();
    for File { name, bytes } in bvh_files().into_iter().chain(csv_files(&skeleton)) {
        let options = Options {
            skeleton: name.ends_with(".csv").then(|| Arc::clone(&skeleton)),
            ..Options::default()
        };
        let content = match str::from_utf8(&bytes) {
            Ok(text) => json!({"text": text}),
            Err(_) => json!({"base64": STANDARD.encode(&bytes)}),
        };
        let outcome = match read(&Source::new(&name, &bytes), &options) {
            Ok(found) => json!({"motion": name_of(&name, motion(&found.clip), &mut motions)}),
            Err(error) => json!({"error": error.to_string()}),
        };
        files.push(json!({"name": name, "content": content, "reader": outcome}));
    }
    let robot = skeleton.robot.as_ref().unwrap();
    json!({
        "written_by": "UPDATE_SHARED_FILES=1 cargo test -p troupe-motion --features files shared",
        "robot": {
            "skeleton": &*skeleton,
            "robot": RobotDoc::from((robot, &*skeleton)),
        },
        "motions": motions,
        "files": files,
    })
}

/// Indented, but for arrays of numbers, which take a line each.
fn written(value: &Value, indent: usize) -> String {
    let pad = " ".repeat(indent);
    let is_flat = |of: &[Value]| of.iter().all(|one| !one.is_object() && !one.is_array());
    match value {
        Value::Array(of) if !is_flat(of) => {
            let rows: Vec<String> = of
                .iter()
                .map(|one| format!("{pad} {}", written(one, indent + 1)))
                .collect();
            format!("[\n{}\n{pad}]", rows.join(",\n"))
        }
        Value::Object(of) => {
            let row = |(key, one): (&String, &Value)| format!("{pad} {key:?}: {}", written(one, indent + 1));
            let rows: Vec<String> = of.iter().map(row).collect();
            format!("{{\n{}\n{pad}}}", rows.join(",\n"))
        }
        _ => value.to_string(),
    }
}

#[test]
fn shared_files_are_what_the_reader_makes_of_them() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/shared_files.json");
    let made = shared();
    if std::env::var_os("UPDATE_SHARED_FILES").is_some() {
        std::fs::write(&path, written(&made, 0) + "\n").unwrap();
    }
    let committed: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    if let Some(at) = differs(&committed, &made) {
        let command = &made["written_by"];
        panic!(
            "{} differs from what the reader makes: {at}. {command} writes it again",
            path.display()
        );
    }
}

#[test]
fn dialects_of_one_motion_are_read_as_one() {
    let made = shared();
    let reader = |name: &str| {
        let files = made["files"].as_array().unwrap();
        let file = files.iter().find(|file| file["name"] == name);
        file.unwrap_or_else(|| panic!("{name}"))["reader"].clone()
    };
    for name in [
        "byte_order_mark",
        "utf_16",
        "line_ends_of_windows",
        "rotations_x_y_z",
        "capital_position",
        "one_frame_more_declared",
        "one_frame_fewer_declared",
        "two_roots",
        "positions_of_0",
        "z_up",
        "inches",
        "metres",
        "millimetres",
    ] {
        assert_eq!(
            reader(&format!("{name}.bvh")),
            json!({"motion": "plain.bvh"}),
            "{name}"
        );
    }
    for name in [
        "byte_order_mark",
        "header",
        "blank_lines",
        "wxyz",
        "degrees",
        "order_of_levels",
    ] {
        assert_eq!(
            reader(&format!("{name}.csv")),
            json!({"motion": "plain.csv"}),
            "{name}"
        );
    }
    for (name, words) in [
        ("frame_time_0.bvh", "--fps decides"),
        ("many_frames_more_declared.bvh", "50 frames are declared"),
        ("lies.bvh", "--up"),
        ("not_a_number.bvh", "line "),
        ("beyond_the_limits.csv", "beyond its limits"),
    ] {
        let error = reader(name)["error"].as_str().unwrap_or_default().to_owned();
        assert!(
            error.starts_with(name) && error.contains(words),
            "{name}: {error}"
        );
    }
    let truth = walk(&person());
    let roots = &made["motions"]["plain.bvh"]["roots_m"];
    let far = |nth: usize, m: f32| (roots[nth].as_f64().unwrap() - f64::from(m)).abs();
    let numbers = truth.root_positions.iter().flat_map(|root| root.to_array());
    assert!(numbers.enumerate().all(|(nth, m)| far(nth, m) < 1e-4));
    let first: Vec<f32> = (0..4)
        .map(|nth| {
            made["motions"]["plain.csv"]["rotations_wxyz"][nth]
                .as_f64()
                .unwrap() as f32
        })
        .collect();
    assert!(from_wxyz([first[0], first[1], first[2], first[3]]).abs_diff_eq(Quat::IDENTITY, 1e-5));
}
