//! The formats that motion is written in, and NumPy's files.

mod beyond_mimic;
pub(crate) mod npz;
#[cfg(test)]
mod tests;

use std::path::Path;

pub use beyond_mimic::write_beyond_mimic;
pub use npz::{NumpyError, write_npz, write_qpos};

/// Rate of files that do not say theirs (a robot's CSV and `qpos`), Hz.
pub const DEFAULT_FPS: f32 = 30.0;

/// A format that is written.
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
}
