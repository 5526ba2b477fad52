//! Reads everyone's motion, and says what it understood.
//!
//! [`read`] turns a file of any format into a [`Clip`] in Troupe's axes, with a [`Report`]: format,
//! producer, skeleton, up axis, unit, rate, rest pose, contacts, each with one line of evidence. What is
//! certain is put right and noted. What a file leaves open is an error that names the option that
//! decides ([`Options`]). What only looks odd is noted and left as it is.
//!
//! Files of one folder are read in two passes: [`survey`] adds what each shows to an [`Agreement`],
//! which then decides for those that leave something open.
//!
//! Nothing here opens files: the caller brings bytes, and the bytes of files beside them.

mod adapted;
mod agreement;
mod body;
mod bvh;
mod error;
mod gltf;
mod joints;
mod leading;
mod names;
mod oddities;
mod options;
mod producer;
mod report;
mod rest;
mod stance;
mod survey;
#[cfg(test)]
mod tests;
mod text;
pub mod units;

use glam::Quat;

pub use agreement::Agreement;
pub use error::{ReadError, ReadErrorKind};
pub use options::{AngleUnit, JointOrder, LeadingPose, Options, QuaternionOrder};
pub use report::{Basis, Finding, Format, Note, Report, RestPose, Topic, Up};

use crate::clip::Clip;
use crate::glb::Beside;
use joints::Parsed;

/// A file to read.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// Name with its ending, for messages and for formats that content does not show.
    pub name: &'a str,
    /// The whole file.
    pub bytes: &'a [u8],
    /// The bytes of a file beside it, by name: what a `.gltf` points to, and the other files of a SONIC
    /// motion.
    pub beside: Beside<'a>,
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
    /// What was understood.
    pub report: Report,
}

/// Reads a file.
///
/// # Errors
/// [`ReadError`], with the file, the place in it and the option that decides.
pub fn read(source: &Source<'_>, options: &Options) -> Result<Understood, ReadError> {
    check(options)
        .and_then(|()| parse(source, options))
        .and_then(|parsed| joints::understand(source.name, parsed, options))
        .map_err(|kind| kind.of(source.name))
}

/// Adds what a file shows by itself to what its folder agrees on.
///
/// # Errors
/// [`ReadError`] if the file cannot be read at all.
pub fn survey(source: &Source<'_>, options: &Options, agreement: &mut Agreement) -> Result<(), ReadError> {
    let parsed = parse(source, options).map_err(|kind| kind.of(source.name))?;
    if let Some(stance) = survey::Survey::of(&*parsed.source).stance {
        agreement.add(&stance);
    }
    Ok(())
}

fn check(options: &Options) -> Result<(), ReadErrorKind> {
    let positive = |field: &str, value: Option<f64>| match value {
        Some(value) if !(value.is_finite() && value > 0.0) => Err(ReadErrorKind::Range {
            field: field.to_owned(),
            found: value.to_string(),
            allowed: "a number above 0".to_owned(),
            option: None,
        }),
        _ => Ok(()),
    };
    positive("--unit", options.unit_m)?;
    positive("--fps", options.fps.map(f64::from))?;
    positive("--max-slide", options.max_slide_m.map(f64::from))
}

fn parse<'a>(source: &Source<'a>, options: &Options) -> Result<Parsed<'a>, ReadErrorKind> {
    let Source { name, bytes, beside } = *source;
    let ending = name
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
    match bytes {
        [b'g', b'l', b'T', b'F', ..] => {
            let format = Finding::new(Format::Glb, Basis::Found, "it begins with \"glTF\"");
            gltf::parse(bytes, beside, format, options)
        }
        _ if bytes.starts_with(b"Kaydara FBX Binary") || ending == "fbx" => Err(NOT_FBX),
        _ if is_word("HIERARCHY") || ending == "bvh" => bvh::parse(bytes, options),
        _ if start.starts_with('{') || ending == "gltf" => {
            let format = Finding::new(Format::Gltf, Basis::Found, "it is a JSON object");
            gltf::parse(bytes, beside, format, options)
        }
        _ => Err(ReadErrorKind::Unknown),
    }
}

const NOT_FBX: ReadErrorKind = ReadErrorKind::NotRead {
    format: "FBX",
    how: "Blender reads it and writes .glb (File, Export, glTF 2.0) or .bvh",
};
