//! Reads everyone's motion, and says what it understood.
//!
//! [`read`] turns a file of any format into a [`Clip`] in Troupe's axes, with a [`Report`]: format,
//! producer, skeleton, up axis, unit, rate, rest pose, contacts, each with one line of evidence.
//! What is certain is put right and noted. What a file leaves open is an error that names the
//! option that decides ([`Options`]). What only looks odd is noted and left as it is.
//!
//! Files of one folder are read in two passes: [`survey`] adds what each shows to an [`Agreement`],
//! which then decides for those that leave something open.
//!
//! The caller brings bytes, and the bytes of files beside them. [`beside`] has those of the disk.

mod adapted;
mod agreement;
mod archive;
pub mod beside;
mod bvh;
mod choices;
mod error;
#[cfg(feature = "fbx")]
mod fbx;
mod figure;
mod followers;
mod gltf;
mod header;
mod joints;
mod kimodo;
mod leading;
mod neutral;
mod oddities;
mod options;
mod producer;
mod rehang;
mod report;
mod rest;
mod robot;
mod robot_checks;
mod root;
mod slides;
mod smpl;
mod stance;
mod survey;
mod table;
mod tables;
#[cfg(test)]
pub(crate) mod tests;
mod text;
mod unique;
pub mod units;

use std::collections::BTreeMap;

use glam::Quat;

pub use agreement::Agreement;
pub use choices::{Advice, Choice, OptionName, Takes};
pub use error::{ReadError, ReadErrorKind};
pub use options::{AngleUnit, JointOrder, LeadingPose, Options, QuaternionOrder};
pub use report::{Basis, Finding, Format, Note, Report, RestPose, Topic, Up};

use crate::anatomy::PartsDoc;
use crate::clip::Clip;
use crate::glb::{Beside, FileJoints, GlbReadError, animation_names_beside, human_bones};
use joints::Parsed;

/// Endings of files of joints, in small letters. With a skeleton these may be a robot's too.
pub const ENDINGS: [&str; 5] = ["bvh", "fbx", "glb", "gltf", "npz"];
/// Endings of files of motion that are not read; the error says what makes one that is. In small
/// letters.
pub const UNREAD_ENDINGS: [&str; 12] = [
    "amc", "asf", "blend", "c3d", "dae", "pickle", "pkl", "trc", "usd", "usda", "usdc", "usdz",
];
/// Endings of robots' files, in small letters.
pub const ROBOT_ENDINGS: [&str; 3] = ["csv", "npy", "npz"];

/// A file to read.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// Name with its ending, for messages and for formats that content does not show.
    pub name: &'a str,
    /// The whole file.
    pub bytes: &'a [u8],
    /// The bytes of a file beside it, by name: what a `.gltf` points to, and the other files of a
    /// SONIC motion.
    pub beside: Beside<'a>,
}

impl Understood {
    /// Where the clip's joints are in the file, for an animation that is added to it.
    pub fn file_joints(&self) -> FileJoints {
        FileJoints {
            unit_m: self.report.unit_m.value,
            nodes: self.report.nodes.clone(),
        }
    }
}

impl<'a> Source<'a> {
    /// A file that needs no other.
    pub fn new(name: &'a str, bytes: &'a [u8]) -> Self {
        Self {
            name,
            bytes,
            beside: &|_| None,
        }
    }
}

/// A file that was read.
#[derive(Clone, Debug)]
pub struct Understood {
    /// The motion: native axes, metres.
    pub clip: Clip,
    /// The file's rest pose on the clip's joints: joint 0 in the world, others relative to their
    /// parents. None for a clip on a given skeleton.
    pub rest: Option<Vec<Quat>>,
    /// Height of joint 0 in the rest pose, metres in the world, if the file has joints' places.
    pub rest_root_y_m: Option<f32>,
    /// Parts of the body that the file itself names: VRM does. Empty otherwise.
    pub parts: PartsDoc,
    /// What was understood.
    pub report: Report,
}

/// Reads a file.
///
/// # Errors
/// [`ReadError`], with the file, the place in it and the option that decides.
pub fn read(source: &Source<'_>, options: &Options) -> Result<Understood, ReadError> {
    read_kind(source, options).map_err(|kind| kind.of(source.name))
}

fn read_kind(source: &Source<'_>, options: &Options) -> Result<Understood, ReadErrorKind> {
    check(options)?;
    let Source { name, bytes, .. } = *source;
    let kind = kind(source)?;
    let has_animations = matches!(kind, Kind::Joints(Format::Glb | Format::Gltf | Format::Fbx));
    if let Some(animation) = options.animation.as_ref().filter(|_| !has_animations) {
        return Err(ReadErrorKind::NoAnimations(animation.clone()));
    }
    match kind {
        Kind::Joints(format) => {
            let found = joints::understand(name, parse(source, format, options)?, options)?;
            let bones = match format {
                Format::Glb | Format::Gltf => human_bones(bytes),
                _ => BTreeMap::new(),
            };
            let parts = PartsDoc::of_bones(&bones, &found.clip.skeleton).unwrap_or_default();
            Ok(Understood { parts, ..found })
        }
        Kind::Archive => archive::read(name, bytes, options),
        Kind::Csv => tables::read_csv(name, bytes, options),
        Kind::Qpos => tables::read_qpos(name, bytes, options),
        Kind::Sonic => archive::sonic(source, options),
    }
}

/// Reads the file of a character: the skins' joints at rest if it is glTF with a skin, otherwise as
/// [`read`] does.
///
/// # Errors
/// As [`read`].
pub fn character(source: &Source<'_>, options: &Options) -> Result<Understood, ReadError> {
    let at_rest = Options {
        at_rest: true,
        animation: None,
        ..options.clone()
    };
    let is_of = |error: &ReadError, wanted: GlbReadError| match &error.kind {
        ReadErrorKind::Glb { error, .. } => *error == wanted,
        _ => false,
    };
    match read(source, &at_rest) {
        Err(no_skin) if is_of(&no_skin, GlbReadError::NoSkin) => {
            let moving = read(source, options);
            // A character needs no animation: what it lacks is the skin.
            moving.map_err(|error| match is_of(&error, GlbReadError::NoAnimation) {
                true => no_skin,
                false => error,
            })
        }
        found => found,
    }
}

/// Names of a file's animations. Empty for formats that hold one motion without a name.
///
/// # Errors
/// [`ReadError`] if the file cannot be read at all.
pub fn animations(source: &Source<'_>) -> Result<Vec<String>, ReadError> {
    let names = kind(source).and_then(|kind| match kind {
        Kind::Joints(Format::Glb | Format::Gltf) => animation_names_beside(source.bytes, source.beside)
            .map_err(|error| ReadErrorKind::Glb { error, option: None }),
        #[cfg(feature = "fbx")]
        Kind::Joints(Format::Fbx) => fbx::animations(source.bytes),
        _ => Ok(Vec::new()),
    });
    names.map_err(|kind| kind.of(source.name))
}

/// Adds what a file shows by itself to what its folder agrees on. Robots' files leave nothing open.
///
/// # Errors
/// [`ReadError`] if the file cannot be read at all.
pub fn survey(source: &Source<'_>, options: &Options, agreement: &mut Agreement) -> Result<(), ReadError> {
    let parsed = kind(source).and_then(|kind| match kind {
        Kind::Joints(format) => parse(source, format, options).map(Some),
        _ => Ok(None),
    });
    let Some(parsed) = parsed.map_err(|kind| kind.of(source.name))? else {
        return Ok(());
    };
    joints::check_size(&*parsed.source).map_err(|kind| kind.of(source.name))?;
    if let Some(stance) = survey::Survey::of(&*parsed.source).stance {
        agreement.add(&stance);
    }
    Ok(())
}

fn check(options: &Options) -> Result<(), ReadErrorKind> {
    let positive = |option: OptionName, value: Option<f64>| match value {
        Some(value) if !(value.is_finite() && value > 0.0) => Err(ReadErrorKind::Range {
            field: option.flag().to_owned(),
            found: value.to_string(),
            allowed: "a number above 0".to_owned(),
            option: None,
        }),
        _ => Ok(()),
    };
    positive(OptionName::Unit, options.unit_m)?;
    positive(OptionName::Fps, options.fps.map(f64::from))?;
    positive(OptionName::MaxSlide, options.max_slide_m.map(f64::from))
}

/// Which reader a file goes to.
enum Kind {
    Joints(Format),
    Archive,
    Csv,
    Qpos,
    Sonic,
}

/// The reader of a file: by its content if that shows it, otherwise by its ending.
fn kind(source: &Source<'_>) -> Result<Kind, ReadErrorKind> {
    let Source { name, bytes, .. } = *source;
    let file = name.rsplit(['/', '\\']).next().unwrap_or(name);
    let ending = file
        .rsplit_once('.')
        .map_or("", |(_, ending)| ending)
        .to_ascii_lowercase();
    let start = text::decode(bytes.get(..64).unwrap_or(bytes)).text;
    let start = start.trim_start();
    let is_word = |word: &str| {
        start
            .get(..word.len())
            .is_some_and(|begin| begin.eq_ignore_ascii_case(word))
    };
    Ok(match bytes {
        [b'g', b'l', b'T', b'F', ..] => Kind::Joints(Format::Glb),
        [b'P', b'K', 3, 4, ..] => Kind::Archive,
        [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => Kind::Qpos,
        _ if bytes.starts_with(b"Kaydara FBX Binary") || is_word("; FBX") => Kind::Joints(Format::Fbx),
        _ if is_word("HIERARCHY") => Kind::Joints(Format::Bvh),
        _ if start.starts_with('{') => Kind::Joints(Format::Gltf),
        _ => match &*ending {
            "bvh" => Kind::Joints(Format::Bvh),
            "gltf" => Kind::Joints(Format::Gltf),
            "glb" => Kind::Joints(Format::Glb),
            "npz" => Kind::Archive,
            "npy" => Kind::Qpos,
            "csv" if file == "joint_pos.csv" => Kind::Sonic,
            "csv" => Kind::Csv,
            "fbx" => Kind::Joints(Format::Fbx),
            "pkl" | "pickle" | "pt" | "pth" => return Err(NOT_PICKLE),
            "usd" | "usda" | "usdc" | "usdz" | "blend" | "dae" => return Err(NOT_SCENE),
            "c3d" | "trc" => return Err(NOT_MARKERS),
            "amc" | "asf" => return Err(NOT_ACCLAIM),
            _ => return Err(ReadErrorKind::Unknown),
        },
    })
}

/// A file of joints.
fn parse<'a>(source: &Source<'a>, format: Format, options: &Options) -> Result<Parsed<'a>, ReadErrorKind> {
    let evidence = match format {
        Format::Glb => "it begins with \"glTF\"",
        _ => "it is a JSON object",
    };
    match format {
        Format::Bvh => bvh::parse(source.bytes, options),
        #[cfg(feature = "fbx")]
        Format::Fbx => fbx::parse(source.bytes, options),
        #[cfg(not(feature = "fbx"))]
        Format::Fbx => Err(NOT_FBX),
        format => {
            let format = Finding::new(format, Basis::Found, evidence);
            gltf::parse(source.bytes, source.beside, format, options)
        }
    }
}

#[cfg(not(feature = "fbx"))]
const NOT_FBX: ReadErrorKind = ReadErrorKind::NotRead {
    format: "FBX",
    how: "this program was built without its library; Blender reads it and writes .glb (File, Export, glTF 2.0) or .bvh",
};
const NOT_PICKLE: ReadErrorKind = ReadErrorKind::NotRead {
    format: "a Python pickle",
    how: "it can run any program when it is opened; np.savez writes its arrays as .npz",
};
const NOT_SCENE: ReadErrorKind = ReadErrorKind::NotRead {
    format: "this scene format",
    how: "Blender reads it and writes .glb (File, Export, glTF 2.0) or .bvh",
};
const NOT_MARKERS: ReadErrorKind = ReadErrorKind::NotRead {
    format: "a file of markers",
    how: "it has no joints; a solver such as Mokka, MotionBuilder or Theia makes a skeleton's .bvh or .fbx of it",
};
const NOT_ACCLAIM: ReadErrorKind = ReadErrorKind::NotRead {
    format: "Acclaim's motion (ASF, AMC)",
    how: "amc2bvh and Blender's importer make .bvh of it",
};
