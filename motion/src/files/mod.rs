//! Reads files of motion in every format that Troupe supports, NumPy's included.

mod beyond_mimic;
pub(crate) mod npz;
#[cfg(test)]
mod tests;

use std::path::Path;
use std::sync::Arc;

use crate::bvh::{self, BvhError, BvhOptions};
use crate::clip::Clip;
use crate::convert::ConvertError;
use crate::glb::{self, GlbOptions, GlbReadError};
use crate::robot::{CsvError, read_csv};
use crate::skeleton::Skeleton;

pub use beyond_mimic::write_beyond_mimic;
pub use npz::{NumpyError, read_npz, read_qpos, write_npz, write_qpos};

/// Rate of files without one (a robot's CSV and `qpos`), Hz.
pub const DEFAULT_FPS: f32 = 30.0;

/// A format that can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Biovision hierarchy.
    Bvh,
    /// Binary glTF 2.0.
    Glb,
    /// A robot's root and hinge angles, as Unitree publishes them.
    Csv,
    /// Named arrays of NumPy.
    Npz,
    /// An array of a robot's `qpos`.
    Npy,
}

impl Format {
    /// Every format once.
    pub const ALL: [Self; 5] = [Self::Bvh, Self::Glb, Self::Csv, Self::Npz, Self::Npy];

    /// Ending of its files, without the dot.
    pub fn ending(self) -> &'static str {
        match self {
            Self::Bvh => "bvh",
            Self::Glb => "glb",
            Self::Csv => "csv",
            Self::Npz => "npz",
            Self::Npy => "npy",
        }
    }

    /// Whether it holds hinge angles, so only a robot's motion.
    pub fn is_for_robots(self) -> bool {
        matches!(self, Self::Csv | Self::Npy)
    }

    /// The format for a file's ending, in any case.
    pub fn of_ending(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        Self::ALL.into_iter().find(|format| format.ending() == ending)
    }

    /// The format that the first bytes identify. CSV cannot be identified.
    pub fn of_content(bytes: &[u8]) -> Option<Self> {
        let text = bytes.trim_ascii_start();
        match bytes {
            [b'g', b'l', b'T', b'F', ..] => Some(Self::Glb),
            [b'P', b'K', 3, 4, ..] => Some(Self::Npz),
            [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => Some(Self::Npy),
            _ if text.len() >= 9 && text[..9].eq_ignore_ascii_case(b"HIERARCHY") => Some(Self::Bvh),
            _ => None,
        }
    }
}

/// Options for reading a file.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadOptions {
    /// Metres a unit of a BVH file; 0.01 (centimetres) by default. All other formats are in metres.
    pub bvh_unit_m: f32,
    /// Farthest that a joint may be from the skeleton's offset, metres; 0.02 by default. A larger
    /// value plays the rotations on bones of other lengths.
    pub max_offset_error_m: f32,
    /// Rate at which a glb's animation is sampled, Hz. `None`: that of its keys.
    pub glb_fps: Option<f32>,
    /// Name of a glb's animation. `None`: the only one.
    pub animation: Option<String>,
    /// Rate of files without one, Hz; 30 by default.
    pub default_fps: f32,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            bvh_unit_m: 0.01,
            max_offset_error_m: 0.02,
            glb_fps: None,
            animation: None,
            default_fps: DEFAULT_FPS,
        }
    }
}

/// Why a file was not read. Messages name the place in the file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file system's error.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// Neither the ending nor the content is that of a known format.
    #[error(
        "neither its ending nor its content is that of a clip: .bvh, .glb or .npz, or .csv or .npy of a robot"
    )]
    Unknown,
    /// An animation is named, but the format has no animations.
    #[error("animation {0:?}: only .glb files have animations with names")]
    Animation(String),
    /// A CSV file that is not UTF-8.
    #[error("no text: byte {0} is no UTF-8")]
    Text(usize),
    /// An error in a BVH text.
    #[error(transparent)]
    Bvh(#[from] BvhError),
    /// The motion of a BVH file does not fit the skeleton.
    #[error(transparent)]
    Convert(#[from] ConvertError),
    /// An error in a glTF file.
    #[error(transparent)]
    Glb(#[from] GlbReadError),
    /// An error in a robot's CSV file.
    #[error(transparent)]
    Csv(#[from] CsvError),
    /// An error in a NumPy file.
    #[error(transparent)]
    Numpy(#[from] NumpyError),
}

impl ReadError {
    /// Whether the file's bones differ from the skeleton's in length or direction.
    pub fn is_offset_mismatch(&self) -> bool {
        matches!(
            self,
            Self::Convert(ConvertError::OffsetMismatch { .. })
                | Self::Glb(GlbReadError::Convert(ConvertError::OffsetMismatch { .. }))
        )
    }
}

/// Reads a file of any format onto a skeleton. Joints are matched by name, angles by the robot's
/// hinges. The clip keeps the file's rate.
///
/// The format is that of the content if it can be identified, otherwise that of the ending.
///
/// # Errors
/// [`ReadError`], with the place in the file.
pub fn read_clip(path: &Path, skeleton: &Arc<Skeleton>, options: &ReadOptions) -> Result<Clip, ReadError> {
    let bytes = std::fs::read(path)?;
    let format = Format::of_content(&bytes).or_else(|| Format::of_ending(path));
    read_bytes(&bytes, format.ok_or(ReadError::Unknown)?, skeleton, options)
}

/// As [`read_clip`], for the bytes of a file of a known format.
///
/// # Errors
/// [`ReadError`], with the place in the file.
pub fn read_bytes(
    bytes: &[u8],
    format: Format,
    skeleton: &Arc<Skeleton>,
    options: &ReadOptions,
) -> Result<Clip, ReadError> {
    if let (Some(animation), true) = (&options.animation, format != Format::Glb) {
        return Err(ReadError::Animation(animation.clone()));
    }
    Ok(match format {
        Format::Bvh => {
            let options = BvhOptions {
                scale_to_metres: options.bvh_unit_m,
                max_offset_error_m: options.max_offset_error_m,
                ..BvhOptions::default()
            };
            bvh::parse_bytes(bytes)?.to_clip_on(skeleton, &options)?
        }
        Format::Glb => {
            let options = GlbOptions {
                fps: options.glb_fps,
                animation: options.animation.clone(),
                max_offset_error_m: options.max_offset_error_m,
                ..GlbOptions::default()
            };
            glb::parse(bytes, &options)?.to_clip_on(skeleton, &options)?
        }
        Format::Csv => {
            let text = str::from_utf8(bytes).map_err(|e| ReadError::Text(e.valid_up_to()))?;
            read_csv(text, skeleton, options.default_fps)?
        }
        Format::Npz => read_npz(bytes, skeleton)?,
        Format::Npy => read_qpos(bytes, skeleton, options.default_fps)?,
    })
}
