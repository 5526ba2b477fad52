//! The targets of fuzzing. Each function takes any bytes, reads them as Troupe would, and panics if
//! the reader breaks a promise.
//!
//! `fuzz_targets/` passes the targets to libFuzzer. `tests/corpus.rs` runs them on the corpus and
//! on changed copies of it, on any toolchain.

mod calls;
mod clips;
mod home;
mod mutate;
mod snapshot;
mod websocket;

use std::path::Path;
use std::sync::{Arc, OnceLock};

use prost::Message as _;
use serde::Serialize;
use serde::de::DeserializeOwned;
use troupe_character::Path as FieldPath;
use troupe_character::document::{DocumentError, Format};
use troupe_character::object::{self, Definition, Definitions};
use troupe_character::scene::NamedScene;
use troupe_engine::pack::{Manifest, Pack};
use troupe_motion::codec;
use troupe_motion::rotation::angle_between;
use troupe_motion::{Joint, Skeleton, Vec3};
use troupe_proto::v1;
use troupe_server::api::testing::Reader;
use troupe_server::config::Config;
use troupe_service::inbetween::{RequestLimits, prepare, prepare_describe, prepare_prompt};

pub use calls::{CALLS, Call, calls};
pub use clips::{bvh, csv, fbx, glb, gltf, npy, npz, sonic};
pub use home::{Local, STOOL, YARD, options};
pub use mutate::mutate;
pub use snapshot::{HEAD_BYTES, snapshot};
pub use websocket::{SEPARATOR, websocket};

/// A target: its name and its function.
pub type Target = (&'static str, fn(&[u8]));

/// Every target, in the order of the names.
pub const TARGETS: [Target; 19] = [
    ("bvh", bvh),
    ("calls", calls),
    ("codec", codec),
    ("csv", csv),
    ("describe", describe),
    ("drive", drive),
    ("fbx", fbx),
    ("generate", generate),
    ("glb", glb),
    ("gltf", gltf),
    ("inbetween", inbetween),
    ("manifest", manifest),
    ("npy", npy),
    ("npz", npz),
    ("object", object),
    ("scene", scene),
    ("snapshot", snapshot),
    ("sonic", sonic),
    ("websocket", websocket),
];

/// Changes the input in place: libFuzzer changes a quarter of the inputs, [`mutate`] the others.
/// Returns the new length of the input in `data`.
pub fn mutated(data: &mut [u8], size: usize, max_size: usize, seed: u32) -> usize {
    if seed.is_multiple_of(4) {
        return libfuzzer_sys::fuzzer_mutate(data, size, max_size);
    }
    let changed = mutate(&data[..size], seed.into());
    let length = changed.len().min(max_size);
    data[..length].copy_from_slice(&changed[..length]);
    length
}

/// Expands to the `main` of a target for libFuzzer.
#[macro_export]
macro_rules! target {
    ($name:ident) => {
        libfuzzer_sys::fuzz_target!(|bytes: &[u8]| $crate::$name(bytes));
        libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
            $crate::mutated(data, size, max_size, seed)
        });
    };
}

/// With the feature `planted`: a bug that the fuzzer must find. It panics if all `steps` hold; each
/// is a condition on the input that was read.
fn planted<const COUNT: usize>(steps: impl FnOnce() -> [bool; COUNT]) {
    if cfg!(feature = "planted") {
        climb(&steps());
    }
}

/// Panics if all steps hold. Each step that holds is an edge of its own, so the fuzzer sees that it
/// came closer. Without the marks the compiler would make one comparison of all steps, hence one
/// edge.
fn climb(steps: &[bool]) {
    let marks: [fn(); 3] = [mark::<1>, mark::<2>, mark::<3>];
    for (step, mark) in steps.iter().zip(marks) {
        if !step {
            return;
        }
        mark();
    }
    panic!("a planted bug");
}

#[inline(never)]
fn mark<const STEP: u8>() {
    std::hint::black_box(STEP);
}

/// The packs without their networks, and the example definitions for the first pack.
struct Home {
    pack: Pack,
    robot: Pack,
    /// With a language model of random weights.
    words: Pack,
    definitions: Definitions,
    reader: Reader,
}

fn home() -> &'static Home {
    static HOME: OnceLock<Home> = OnceLock::new();
    HOME.get_or_init(|| {
        let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let pack = |text: &str| {
            let manifest = Manifest::parse(text).expect("a manifest");
            Pack::from_manifest(manifest, Path::new("unused")).expect("a pack")
        };
        let robot = pack(include_str!("../../models/g1/pack.toml"));
        let pack = pack(include_str!("../../models/human/pack.toml"));
        let examples = object::load_folder(&top.join("examples/objects"), &pack.rig).expect("definitions");
        let config = Config::local(Path::new("unused")).expect("a configuration");
        Home {
            definitions: Definitions::new(examples).expect("different names"),
            reader: Reader::new(&config.api_limits()),
            pack,
            robot,
            words: Pack::load(&top.join("engine/tests/vermo")).expect("a pack"),
        }
    })
}

/// The skeleton of the robot.
pub fn robot() -> Arc<Skeleton> {
    Arc::clone(&home().robot.rig.skeleton)
}

/// A skeleton of two joints.
///
/// # Panics
/// If the skeleton is invalid, which tests rule out.
pub fn two_joints() -> Skeleton {
    let joint = |name: &str, parent, offset_m| Joint {
        name: name.to_owned(),
        parent,
        offset_m,
    };
    let joints = vec![
        joint("Hips", None, Vec3::ZERO),
        joint("Foot", Some(0), Vec3::NEG_Y),
    ];
    Skeleton::new(joints, Vec3::X, 0.0, None).expect("a skeleton")
}

/// Frames in compact form. For any bytes, rotations have unit length and survive another
/// round.
pub fn codec(bytes: &[u8]) {
    let (mut rotations, mut roots) = (Vec::new(), Vec::new());
    codec::read_rotations(bytes, &mut rotations);
    codec::read_roots(bytes, &mut roots);
    assert_eq!(rotations.len(), bytes.len() / codec::BYTES_PER_ROTATION);
    assert_eq!(roots.len(), bytes.len() / codec::BYTES_PER_ROOT);
    for rotation in rotations {
        assert!((rotation.length() - 1.0).abs() < 1e-5, "{rotation}");
        let again = codec::decode_rotation(codec::encode_rotation(rotation));
        let error = angle_between(rotation, again);
        assert!(error <= codec::MAX_ROTATION_ERROR_RAD, "{rotation}: {error}");
    }
    for root in roots {
        let again = codec::decode_root(codec::encode_root(root));
        assert!(
            root.is_finite() && again.abs_diff_eq(root, 0.05),
            "{root}: {again}"
        );
        planted(|| [root.x > 100.0, root.z < -100.0, root.y.abs() < 1.0]);
    }
}

/// A message of a client on a stream, as text and as protobuf.
pub fn drive(bytes: &[u8]) {
    if let Ok(request) = home().reader.json::<v1::DriveRequest>(bytes) {
        survives(&request);
        if let Some(v1::drive_request::Message::Command(request)) = &request.message {
            for command in &request.commands {
                planted(|| planted_command(command));
            }
        }
    }
    if let Ok(request) = home().reader.drive(bytes) {
        let again = v1::DriveRequest::decode(request.encode_to_vec().as_slice());
        // Compares the texts, because NaN differs from itself.
        assert_eq!(
            format!("{:?}", again.expect("what was written is read")),
            format!("{request:?}")
        );
    }
}

fn planted_command(command: &v1::Command) -> [bool; 2] {
    let Some(v1::command::Intent::Locomote(locomote)) = &command.intent else {
        return [false; 2];
    };
    let height = locomote.height.unwrap_or_default();
    let priority = command.priority.unwrap_or_default();
    [height > 10.0, priority > 1.0]
}

/// The body of a request to generate, and its checks. The pack has a language model.
pub fn generate(bytes: &[u8]) {
    let Ok(request) = home().reader.json::<v1::GenerateRequest>(bytes) else {
        return;
    };
    survives(&request);
    let Some(v1::generate_request::Goal::Prompt(prompt)) = &request.goal else {
        return;
    };
    match prepare_prompt(&FieldPath::root(), &request, prompt, &home().words) {
        Ok(_) => planted(|| {
            let sampling = request.sampling.unwrap_or_default();
            [
                prompt.frame_count.is_some_and(|count| count > 99),
                sampling.temperature.is_some_and(|temperature| temperature > 1.0),
            ]
        }),
        Err(error) => assert!(!error.field.is_empty() && !error.to_string().is_empty()),
    }
}

/// The body of a request to describe a motion, and its checks.
pub fn describe(bytes: &[u8]) {
    let Ok(request) = home().reader.json::<v1::DescribeRequest>(bytes) else {
        return;
    };
    survives(&request);
    match prepare_describe(&request, &home().words) {
        Ok(_) => planted(|| [request.frames.len() > 7, !request.others.is_empty()]),
        Err(error) => assert!(!error.field.is_empty() && !error.to_string().is_empty()),
    }
}

/// The body of an in-between request, and its checks.
pub fn inbetween(bytes: &[u8]) {
    let Ok(request) = home().reader.json::<v1::InBetweenRequest>(bytes) else {
        return;
    };
    survives(&request);
    let limits = RequestLimits { max_characters: 256 };
    match prepare(&FieldPath::root(), &request, &home().pack.rig, limits) {
        Ok((items, plans)) => {
            assert_eq!(items.len(), plans.len());
            let characters = &request.characters;
            for one in characters {
                let steps = one.pose_steps.unwrap_or_default();
                let frames = one.frame_count.unwrap_or_default();
                planted(|| [steps > 2, frames > 40]);
            }
        }
        Err(error) => assert!(!error.field.is_empty() && !error.to_string().is_empty()),
    }
}

/// A pack's manifest. An accepted one survives writing and reading again.
pub fn manifest(bytes: &[u8]) {
    let Ok(manifest) = std::str::from_utf8(bytes).map(Manifest::parse) else {
        return;
    };
    let manifest = match manifest {
        Ok(manifest) => manifest,
        Err(problem) => return assert!(!problem.to_string().is_empty()),
    };
    match Pack::from_manifest(manifest, Path::new("unused")) {
        Ok(pack) => {
            let text = toml::to_string(&pack.manifest).expect("a manifest is TOML");
            Manifest::parse(&text).expect("what was written is read");
            let dims = &pack.rig.dims;
            planted(|| [dims.min_tokens > 3, dims.max_tokens > 16, dims.codes < 100]);
        }
        Err(problem) => assert!(!problem.to_string().is_empty()),
    }
}

/// An object definition, as TOML and as JSON. An accepted one survives writing and reading again.
pub fn object(bytes: &[u8]) {
    let rig = &home().pack.rig;
    for (text, format) in texts(bytes) {
        match Definition::read(text, format, rig) {
            Ok(definition) => {
                let text = definition.doc.to_toml().expect("a definition is TOML");
                Definition::from_toml(&text, rig).expect("what was written is read");
                let doc = &definition.doc;
                let heavy = doc.variants.iter().any(|variant| variant.weight > 100.0);
                planted(|| [doc.name.len() > 9, heavy]);
            }
            Err(error) => explained(&error),
        }
    }
}

/// A scene with objects of the example definitions, as TOML and as JSON.
pub fn scene(bytes: &[u8]) {
    let definitions = home().definitions.snapshot();
    for (text, format) in texts(bytes) {
        match NamedScene::read(text, format, &*definitions) {
            Ok(named) => {
                assert!(named.scene.instances().all(|object| !object.id.is_empty()));
                let heights = || named.scene.instances().map(|object| object.transform.position.y);
                planted(|| {
                    [
                        heights().any(|height| height > 1.0),
                        heights().any(|height| height < -1.0),
                    ]
                });
            }
            Err(error) => explained(&error),
        }
    }
}

/// The bytes as a document in each format.
fn texts(bytes: &[u8]) -> impl Iterator<Item = (&str, Format)> {
    let text = std::str::from_utf8(bytes).ok();
    let formats = [Format::Toml, Format::Json];
    text.into_iter()
        .flat_map(move |text| formats.map(|format| (text, format)))
}

fn explained(error: &DocumentError) {
    assert!(!error.message.is_empty() && !error.to_string().is_empty());
}

/// Asserts that a message survives JSON. Infinity is left out: a number too large for `f32` reads
/// as infinity, JSON cannot write it, and validation refuses it.
fn survives<T: Serialize + DeserializeOwned + PartialEq + std::fmt::Debug>(message: &T) {
    if format!("{message:?}").contains("inf") {
        return;
    }
    let text = serde_json::to_string(message).expect("a message is JSON");
    let again: T = serde_json::from_str(&text).expect("what was written is read");
    assert_eq!(&again, message);
}
