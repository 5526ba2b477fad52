//! Broken files of every format are errors, never panics.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use glam::{DQuat, DVec3, Quat, Vec3};
use proptest::prelude::*;

use super::people::{Dialect, Person};
use crate::bvh::{BvhFile, BvhJoint, Channel, write};
use crate::clip::Clip;
use crate::files::{write_beyond_mimic, write_npz, write_qpos};
use crate::glb::write_glb;
use crate::read::adapted::Arrays;
use crate::read::joints::check_size;
use crate::read::{Agreement, Options, RestPose, Source, read, survey};
use crate::robot::testing::g1;
use crate::robot::{description, write_csv};
use crate::skeleton::{Joint, MAX_JOINTS, Skeleton};

/// A small file of each format, with its name.
fn files() -> &'static [(&'static str, Vec<u8>)] {
    static FILES: OnceLock<Vec<(&'static str, Vec<u8>)>> = OnceLock::new();
    FILES.get_or_init(|| {
        let person = Person {
            words: 2,
            size: 1.0,
            spine: 1,
            rest: RestPose::A,
        };
        let walk = person.walk(4, 30.0, &[0.3, 0.8, 0.1, 0.6, 0.9, 0.2, 0.45]);
        let robot = super::robots::walk(4, 30.0, 0.5);
        let glb = write_glb(&walk).unwrap();
        let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
        vec![
            ("a.bvh", Dialect::plain().bytes(&walk)),
            ("a.gltf", glb[20..20 + length].to_vec()),
            ("a.glb", glb),
            ("a.npz", write_npz(&walk).unwrap()),
            ("b.npz", super::archives::amass(4, 72, Some("fps"), false)),
            ("c.npz", super::archives::kimodo(30).0),
            ("d.npz", write_beyond_mimic(&robot).unwrap()),
            ("a.csv", write_csv(&robot).unwrap().into_bytes()),
            ("a.npy", write_qpos(&robot).unwrap()),
        ]
    })
}

/// Reads a file as a person's and as a robot's.
fn try_all(name: &str, bytes: &[u8]) {
    let source = Source::new(name, bytes);
    let robot = Options {
        skeleton: Some(g1()),
        ..Options::default()
    };
    for options in [Options::default(), robot] {
        if let Ok(found) = read(&source, &options) {
            assert!(found.clip.root_positions.iter().all(|root| root.is_finite()));
            assert!(!found.report.rows().is_empty());
        }
        let _ = survey(&source, &options, &mut Agreement::default());
    }
}

/// Names of joints that the reader treats in their own ways.
const WORDS: [&str; 14] = [
    "Hips",
    "Spine",
    "Head",
    "LeftHand",
    "RightHand",
    "LeftFoot",
    "RightFoot",
    "LeftAnkle",
    "LeftA",
    "RightA",
    "LeftFootIK",
    "LeftLeg",
    "RightLeg",
    "Tail",
];

/// A tree of joints that slide: for each joint a word, the parent, and the place of its offset on a
/// small grid.
fn tree(joints: &[(usize, prop::sample::Index, [i8; 3])], slides: bool) -> Vec<u8> {
    let moves = [Channel::Xposition, Channel::Yposition, Channel::Zposition];
    let turns = [Channel::Zrotation, Channel::Xrotation, Channel::Yrotation];
    let made = joints
        .iter()
        .enumerate()
        .map(|(nth, (word, parent, at))| BvhJoint {
            name: format!("{}.{nth}", WORDS[word % WORDS.len()]),
            parent: (nth > 0).then(|| parent.index(nth)),
            offset: DVec3::from_array(at.map(f64::from)),
            channels: [&moves[..], &turns].concat(),
            end_sites: Vec::new(),
        });
    let made: Vec<BvhJoint> = depth_first(&made.collect::<Vec<_>>());
    let mut values = Vec::new();
    for frame in 0..3 {
        for joint in &made {
            let slide = if slides { f64::from(frame) } else { 0.0 };
            values.extend((joint.offset + slide * DVec3::X).to_array());
            values.extend([0.0, 10.0 * f64::from(frame), 0.0]);
        }
    }
    let file = BvhFile::new(made, 1.0 / 30.0, values).unwrap();
    write(&file).into_bytes()
}

/// The joints in the order in which a file has them.
fn depth_first(joints: &[BvhJoint]) -> Vec<BvhJoint> {
    let mut made: Vec<BvhJoint> = Vec::new();
    let mut open = vec![(0, None)];
    while let Some((joint, parent)) = open.pop() {
        let children = (0..joints.len()).filter(|&child| joints[child].parent == Some(joint));
        open.extend(children.map(|child| (child, Some(made.len()))));
        made.push(BvhJoint {
            parent,
            ..joints[joint].clone()
        });
    }
    made
}

/// A chain of joints, each with another that hangs on it, in Troupe's archive. All turn.
fn comb(joints: usize) -> Vec<u8> {
    let joint = |nth: usize| Joint {
        name: format!("Left{}{nth}", ["Bone", "Hand"][nth % 2]),
        parent: nth.checked_sub(1).map(|before| before - before % 2),
        offset_m: Vec3::new(0.01, 0.02, 0.0),
    };
    let skeleton = Skeleton::new((0..joints).map(joint).collect(), Vec3::X, 0.0, None).unwrap();
    let turn = |frame: usize| Quat::from_rotation_z(0.01 * frame as f32);
    let rotations = (0..3 * joints).map(|nth| turn(nth / joints)).collect();
    let clip = Clip::new(skeleton.into(), 30.0, vec![Vec3::Y; 3], rotations).unwrap();
    write_glb(&clip).unwrap()
}

/// As [`comb`], with nodes that all slide, in a glTF file.
fn sliding_comb(nodes: usize) -> Vec<u8> {
    let node = |nth: usize| {
        let children: Vec<usize> = match nth % 2 {
            0 => (nth + 1..nodes.min(nth + 3)).collect(),
            _ => Vec::new(),
        };
        match children.is_empty() {
            true => serde_json::json!({"name": format!("n{nth}")}),
            false => serde_json::json!({"name": format!("n{nth}"), "children": children}),
        }
    };
    let channel =
        |nth: usize| serde_json::json!({"sampler": 0, "target": {"node": nth, "path": "translation"}});
    let floats = [0.0_f32, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0];
    let bytes: Vec<u8> = floats.iter().flat_map(|number| number.to_le_bytes()).collect();
    let uri = format!(
        "data:application/octet-stream;base64,{}",
        base64::Engine::encode(&base64::engine::general_purpose::STANDARD, bytes)
    );
    let file = serde_json::json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": (0..nodes).map(node).collect::<Vec<_>>(),
        "buffers": [{"byteLength": 32, "uri": uri}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 8},
            {"buffer": 0, "byteOffset": 8, "byteLength": 24},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [1]},
            {"bufferView": 1, "componentType": 5126, "count": 2, "type": "VEC3"},
        ],
        "animations": [{
            "samplers": [{"input": 0, "output": 1}],
            "channels": (0..nodes).map(channel).collect::<Vec<_>>(),
        }],
    });
    serde_json::to_vec(&file).unwrap()
}

/// Far above what a test without optimisation takes, and far below what work by the square or the
/// cube of the joints does.
const SOON: Duration = Duration::from_secs(20);

#[test]
fn many_joints_are_read_or_refused_soon() {
    let began = Instant::now();
    let most = comb(MAX_JOINTS);
    let found = read(&Source::new("comb.glb", &most), &Options::default()).unwrap();
    assert_eq!(found.report.joints, MAX_JOINTS);
    let options = Options {
        max_slide_m: Some(100.0),
        ..Options::default()
    };
    let found = read(&Source::new("comb.gltf", &sliding_comb(MAX_JOINTS)), &options).unwrap();
    assert_eq!(found.report.joints, MAX_JOINTS);
    let error = read(&Source::new("comb.gltf", &sliding_comb(8_000)), &options).unwrap_err();
    assert!(error.to_string().contains("at most 512 are supported"), "{error}");
    assert!(began.elapsed() < SOON, "{:?}", began.elapsed());
}

#[test]
fn more_joints_than_any_format_has_are_refused_at_once() {
    let joints = 100_000;
    let source = Arrays {
        names: (0..joints).map(|nth| format!("j{nth}")).collect(),
        parents: (0..joints).map(|nth: usize| nth.checked_sub(1)).collect(),
        offsets: vec![DVec3::Y; joints],
        roots: vec![DVec3::ZERO],
        rotations: vec![DQuat::IDENTITY; joints],
        fps: 30.0,
    };
    let error = check_size(&source).unwrap_err().to_string();
    assert_eq!(error, "the number of joints is 100000; allowed: up to 16384");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn odd_trees_do_not_panic(
        joints in proptest::collection::vec(
            (0..WORDS.len(), any::<prop::sample::Index>(), [-1..2_i8, -1..2_i8, -1..2_i8]),
            1..14,
        ),
        tall in 1..120_i8,
        slides: bool,
    ) {
        // One long bone makes the others near to each other.
        let mut joints = joints;
        let (_, parent, _) = joints[0];
        joints.push((1, parent, [0, tall, 0]));
        try_all("tree.bvh", &tree(&joints, slides));
    }

    #[test]
    fn changed_files_do_not_panic(
        which in 0..9_usize,
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12),
        cut in proptest::option::weighted(0.2, any::<prop::sample::Index>()),
    ) {
        let (name, bytes) = &files()[which];
        let mut bytes = bytes.clone();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        try_all(name, &bytes);
    }

    #[test]
    fn changed_numbers_do_not_panic(
        which in prop_oneof![Just(0_usize), Just(1), Just(7)],
        at in any::<prop::sample::Index>(),
        number in prop_oneof![Just("1e308"), Just("-1e300"), Just("1e-320"), Just("0"), Just("99999999999"), Just("-1")],
    ) {
        // One number of a text is replaced.
        let (name, bytes) = &files()[which];
        let text = String::from_utf8(bytes.clone()).unwrap();
        let starts: Vec<usize> = text
            .char_indices()
            .filter(|&(nth, c)| c.is_ascii_digit() && !text[..nth].ends_with(|c: char| c.is_ascii_digit() || c == '.'))
            .map(|(nth, _)| nth)
            .collect();
        let start = starts[at.index(starts.len())];
        let rest = text[start..].trim_start_matches(|c: char| c.is_ascii_digit() || c == '.');
        let changed = format!("{}{number}{rest}", &text[..start]);
        try_all(name, changed.as_bytes());
    }

    #[test]
    fn descriptions_do_not_panic(
        changes in proptest::collection::vec((any::<prop::sample::Index>(), "[a-z0-9<>\"/= .-]"), 1..6), mjcf: bool,
    ) {
        let urdf = "<robot name=\"a\"><link name=\"b\"/><link name=\"left_c\"><collision><geometry><sphere radius=\"0.1\"/>\
                    </geometry></collision></link><link name=\"right_c\"/><joint name=\"left_c\" type=\"revolute\"><parent link=\"b\"/>\
                    <child link=\"left_c\"/><limit lower=\"-1\" upper=\"1\"/></joint><joint name=\"right_c\" type=\"fixed\">\
                    <parent link=\"b\"/><child link=\"right_c\"/></joint></robot>";
        let mujoco = "<mujoco><worldbody><body name=\"b\"><freejoint/><body name=\"left_c\" euler=\"1 2 3\"><joint name=\"left_c\" \
                      range=\"-1 1\"/><geom type=\"box\" size=\"1 1 1\"/></body></body></worldbody></mujoco>";
        let mut text = if mjcf { mujoco } else { urdf }.to_owned();
        for (at, with) in changes {
            let at = at.index(text.len());
            text.replace_range(at..=at, &with);
        }
        if let Ok(read) = description::read(&text, &|_| None) {
            let _ = description::build(&read, &description::BuildOptions::default());
        }
    }
}
