//! The reader and the retargeter of `troupe-motion` for the viewer, as WebAssembly.
//!
//! Options come as JSON, and so does the report. Axes are Troupe's. Quaternions are (x, y, z, w),
//! as three.js has them.

mod body;
mod options;
mod retargeter;

use glam::Vec3;
use js_sys::{Error, Reflect};
use serde::Serialize;
use troupe_motion::convert::ConvertError;
use troupe_motion::glb::animation_names;
use troupe_motion::read::{
    self as reader, OptionName, Options, ReadError, ReadErrorKind, Source, Takes, Understood,
};
use wasm_bindgen::prelude::*;

/// A file that was read.
#[wasm_bindgen]
pub struct Read {
    understood: Understood,
}

/// Reads a file on its own skeleton, or on the one that `options` (JSON) has.
///
/// # Errors
/// An `Error` with the reader's own words, or with what is wrong with the options. If the file is
/// wrong, its property `options` is JSON: a list of the options that decide, each with the values
/// that fit. `is_other_body` is set if the file has another skeleton than the given one.
#[wasm_bindgen]
pub fn read(name: &str, bytes: &[u8], options: &str) -> Result<Read, JsValue> {
    let options = options::parse(options).map_err(|error| JsError::new(&error))?;
    let read = reader::read(&Source::new(name, bytes), &options);
    let understood = read.map_err(|error| refused(&error))?;
    Ok(Read { understood })
}

/// Reads a character's file: its joints at rest, as one frame, if it is glTF with a skin. Other
/// files are read with their motion.
///
/// # Errors
/// As [`read`].
#[wasm_bindgen]
pub fn character(name: &str, bytes: &[u8]) -> Result<Read, JsValue> {
    let read = reader::character(&Source::new(name, bytes), &Options::default());
    let understood = read.map_err(|error| refused(&error))?;
    Ok(Read { understood })
}

fn refused(error: &ReadError) -> JsValue {
    let refused = Error::new(&error.to_string());
    // Setting a property of a new object does not fail.
    let set = |name: &str, value: JsValue| {
        let _ = Reflect::set(&refused, &name.into(), &value);
    };
    if let Ok(options) = serde_json::to_string(&error.options()) {
        set("options", options.into());
    }
    let is_other_body = matches!(
        &error.kind,
        ReadErrorKind::Convert {
            error: ConvertError::MissingJoints(_) | ConvertError::OtherRest { .. },
            ..
        }
    );
    set("is_other_body", is_other_body.into());
    refused.into()
}

/// An option of the reader, as the viewer shows it.
#[derive(Serialize)]
struct Shown {
    name: OptionName,
    takes: Takes,
    values: Vec<&'static str>,
    is_of_robots: bool,
}

/// The reader's options, as JSON: their names, and what they take.
///
/// # Errors
/// None that is known: options are text.
#[wasm_bindgen]
pub fn options() -> Result<String, JsError> {
    let options = OptionName::all().map(|option| Shown {
        name: option,
        takes: option.takes(),
        values: option.values(),
        is_of_robots: option.is_of_robots(),
    });
    Ok(serde_json::to_string(&options.collect::<Vec<_>>())?)
}

/// Names of a glTF file's animations.
///
/// # Errors
/// If the file is not glTF.
#[wasm_bindgen]
pub fn animations(bytes: &[u8]) -> Result<Vec<String>, JsError> {
    Ok(animation_names(bytes)?)
}

#[wasm_bindgen]
impl Read {
    /// Frames a second.
    #[wasm_bindgen(getter)]
    pub fn fps(&self) -> f32 {
        self.understood.clip.fps
    }

    /// Number of frames, at least 1.
    #[wasm_bindgen(getter)]
    pub fn frames(&self) -> usize {
        self.understood.clip.frames()
    }

    /// 3 a frame: world places of joint 0, metres.
    #[wasm_bindgen(getter)]
    pub fn roots(&self) -> Vec<f32> {
        flat(&self.understood.clip.root_positions)
    }

    /// 4 a joint a frame: joint 0 in the world, others relative to their parents.
    #[wasm_bindgen(getter)]
    pub fn rotations(&self) -> Vec<f32> {
        let mut flat = Vec::with_capacity(4 * self.understood.clip.rotations.len());
        let quaternions = self.understood.clip.rotations.iter();
        quaternions.for_each(|q| flat.extend(q.to_array()));
        flat
    }

    /// Names of the joints.
    #[wasm_bindgen(getter)]
    pub fn names(&self) -> Vec<String> {
        let joints = self.understood.clip.skeleton.joints.iter();
        joints.map(|joint| joint.name.clone()).collect()
    }

    /// Index of each joint's parent, -1 for the root.
    #[wasm_bindgen(getter)]
    pub fn parents(&self) -> Vec<i16> {
        let joints = self.understood.clip.skeleton.joints.iter();
        joints
            .map(|joint| joint.parent.map_or(-1, |parent| parent as i16))
            .collect()
    }

    /// 3 a joint: places in the parents at rest, metres.
    #[wasm_bindgen(getter)]
    pub fn offsets(&self) -> Vec<f32> {
        let joints = self.understood.clip.skeleton.joints.iter();
        flat(&joints.map(|joint| joint.offset_m).collect::<Vec<_>>())
    }

    /// The body's left in joint 0's own frame of reference, unit length.
    #[wasm_bindgen(getter)]
    pub fn left_axis(&self) -> Vec<f32> {
        self.understood.clip.skeleton.left_axis.to_array().to_vec()
    }

    /// What was understood, as JSON: rows of what, its value, and one line of evidence.
    ///
    /// # Errors
    /// None that is known: rows are text.
    #[wasm_bindgen(getter)]
    pub fn table(&self) -> Result<String, JsError> {
        Ok(serde_json::to_string(&self.understood.report.rows())?)
    }
}

fn flat(vectors: &[Vec3]) -> Vec<f32> {
    let mut flat = Vec::with_capacity(3 * vectors.len());
    vectors.iter().for_each(|v| flat.extend(v.to_array()));
    flat
}
