//! What fuzzing runs: each function takes any bytes, reads them as Troupe would, and panics where a promise is broken.
//!
//! `fuzz_targets/` hands them to libFuzzer; `tests/corpus.rs` runs the corpus and changed copies of it on any toolchain.

use std::path::Path;
use std::sync::OnceLock;

use prost::Message as _;
use serde::Serialize;
use serde::de::DeserializeOwned;
use troupe_character::document::{DocumentError, Format};
use troupe_character::object::{self, Definition, Definitions};
use troupe_character::scene::NamedScene;
use troupe_engine::pack::{Manifest, Pack};
use troupe_motion::bvh::{self, BvhFile, BvhOptions, BvhWriteOptions};
use troupe_motion::codec;
use troupe_motion::rotation::angle_between;
use troupe_proto::v1;
use troupe_server::api::testing::Reader;
use troupe_server::config::Config;
use troupe_server::inbetween::{RequestLimits, prepare, prepare_generate};

/// A target's name and function.
pub type Target = (&'static str, fn(&[u8]));

/// Every target, by its name.
pub const TARGETS: [Target; 8] = [
    ("bvh", bvh),
    ("codec", codec),
    ("drive", drive),
    ("generate", generate),
    ("inbetween", inbetween),
    ("manifest", manifest),
    ("object", object),
    ("scene", scene),
];

/// The default pack without its networks, and the example definitions for it.
struct Home {
    pack: Pack,
    definitions: Definitions,
    reader: Reader,
}

fn home() -> &'static Home {
    static HOME: OnceLock<Home> = OnceLock::new();
    HOME.get_or_init(|| {
        let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let manifest = Manifest::parse(include_str!("../../models/human/pack.toml")).expect("a manifest");
        let pack = Pack::from_manifest(manifest, Path::new("unused")).expect("a pack");
        let examples = object::load_folder(&top.join("examples/objects"), &pack.rig).expect("definitions");
        let config = Config::local(Path::new("unused")).expect("a configuration");
        Home {
            definitions: Definitions::new(examples).expect("different names"),
            reader: Reader::new(&config.api_limits()),
            pack,
        }
    })
}

/// A BVH file. What is read survives writing and reading again, and conversion to a clip and back.
pub fn bvh(bytes: &[u8]) {
    let Ok(file) = bvh::parse_bytes(bytes) else { return };
    // Numbers are written to six decimals, so it is the structure that must be the same.
    let again = bvh::parse(&bvh::write(&file)).expect("what was written is read");
    assert_eq!(again.frames(), file.frames());
    assert_eq!(again.joints().len(), file.joints().len());
    let mut pairs = again.joints().iter().zip(file.joints());
    assert!(pairs.all(|(a, b)| a.name == b.name && a.parent == b.parent));
    if let Ok(clip) = file.to_clip(&BvhOptions::default())
        && let Ok(written) = BvhFile::from_clip(&clip, &BvhWriteOptions::default())
    {
        bvh::parse(&bvh::write(&written)).expect("a clip's file is read");
    }
}

/// Frames in compact form. Whatever the bytes, rotations have unit length and survive another round.
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
    }
}

/// A message of a client on a stream, as text and as protobuf.
pub fn drive(bytes: &[u8]) {
    if let Ok(request) = home().reader.json::<v1::DriveRequest>(bytes) {
        survives(&request);
    }
    if let Ok(request) = home().reader.drive(bytes) {
        let again = v1::DriveRequest::decode(request.encode_to_vec().as_slice());
        // Compared as text, because a number that is none differs from itself.
        assert_eq!(
            format!("{:?}", again.expect("what was written is read")),
            format!("{request:?}")
        );
    }
}

/// The body of a request to generate, and its checks.
pub fn generate(bytes: &[u8]) {
    let Ok(request) = home().reader.json::<v1::GenerateRequest>(bytes) else {
        return;
    };
    survives(&request);
    if let Err(error) = prepare_generate(&request, &home().pack.rig) {
        assert!(!error.field.is_empty() && !error.to_string().is_empty());
    }
}

/// The body of an in-between request, and its checks.
pub fn inbetween(bytes: &[u8]) {
    let Ok(request) = home().reader.json::<v1::InBetweenRequest>(bytes) else {
        return;
    };
    survives(&request);
    match prepare(&request, &home().pack.rig, RequestLimits { max_characters: 256 }) {
        Ok((items, plans)) => assert_eq!(items.len(), plans.len()),
        Err(error) => assert!(!error.field.is_empty() && !error.to_string().is_empty()),
    }
}

/// A pack's manifest. One that is read can be written and read again.
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
        }
        Err(problem) => assert!(!problem.to_string().is_empty()),
    }
}

/// An object definition, as TOML and as JSON. One that is accepted is accepted again as it is written.
pub fn object(bytes: &[u8]) {
    let rig = &home().pack.rig;
    for (text, format) in texts(bytes) {
        match Definition::read(text, format, rig) {
            Ok(definition) => {
                let text = definition.doc.to_toml().expect("a definition is TOML");
                Definition::from_toml(&text, rig).expect("what was written is read");
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
            Ok(named) => assert!(named.scene.instances().all(|object| !object.id.is_empty())),
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

/// Asserts that a message is the same after a round of JSON. A number too large for `f32` is read as infinity, which JSON
/// cannot write; validation refuses it.
fn survives<T: Serialize + DeserializeOwned + PartialEq + std::fmt::Debug>(message: &T) {
    if format!("{message:?}").contains("inf") {
        return;
    }
    let text = serde_json::to_string(message).expect("a message is JSON");
    let again: T = serde_json::from_str(&text).expect("what was written is read");
    assert_eq!(&again, message);
}
