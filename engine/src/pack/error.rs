//! The errors of loading a pack.

use std::path::PathBuf;

use troupe_motion::feasibility::LimitsError;
use troupe_motion::model::BodyError;
use troupe_motion::robot::RobotError;

/// A pack that cannot be used, and its folder.
#[derive(Debug, thiserror::Error)]
#[error("model pack {}: {problem}", folder.display())]
pub struct PackError {
    /// The pack's folder, as it was given or found.
    pub folder: PathBuf,
    /// The first problem that loading found.
    pub problem: PackProblem,
}

/// Why a pack cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PackProblem {
    /// A file or folder that cannot be read.
    #[error("cannot read {}: {cause}", path.display())]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// What the operating system says.
        cause: std::io::Error,
    },
    /// The packs folder holds no folder with a manifest.
    #[error("no pack here: expected folders that hold a pack.toml")]
    NoPacks,
    /// A manifest that is not valid TOML, or lacks or misspells a field. The text names the line.
    #[error("pack.toml: {0}")]
    Parse(#[from] toml::de::Error),
    /// A manifest of a format that this server does not know.
    #[error("pack.toml: format {found} is not supported (this server reads formats 1 to {supported})")]
    Format {
        /// `format` of the manifest.
        found: u32,
        /// The newest format that this server reads.
        supported: u32,
    },
    /// A field out of its range.
    #[error("pack.toml: {field} is {found}; allowed: {allowed}")]
    Field {
        /// The field's path in the manifest, with dots.
        field: &'static str,
        /// The field's value, as text.
        found: String,
        /// The allowed values, as text.
        allowed: String,
    },
    /// Hinges that do not fit the skeleton.
    #[error("pack.toml: {0}")]
    Robot(#[from] RobotError),
    /// Limits that are out of range, or name joints that the skeleton does not have.
    #[error("pack.toml: {0}")]
    Limits(#[from] LimitsError),
    /// The same problem in the limits of one body.
    #[error("bodies/{body}.toml: {problem}")]
    BodyLimits {
        /// Its name, as in the folder `bodies`.
        body: String,
        /// What the limits violate.
        problem: Box<LimitsError>,
    },
    /// A body's file that is not valid TOML, or lacks or misspells a field. The text names the
    /// line.
    #[error("bodies/{body}.toml: {cause}")]
    BodyFile {
        /// Its name, as in the folder `bodies`.
        body: String,
        /// What the TOML reader says.
        cause: Box<toml::de::Error>,
    },
    /// A body whose values contradict each other.
    #[error("bodies/{body}.toml: {problem}")]
    Body {
        /// Its name, as in the folder `bodies`.
        body: String,
        /// What the body violates.
        problem: Box<BodyError>,
    },
    /// A `tokenizer.json` that the tokenizer library cannot read.
    #[error("tokenizer.json: {0}")]
    Tokenizer(String),
    /// The ONNX files have another hash than the manifest says.
    #[error("the ONNX files do not match the manifest: content_hash is {expected}, the files have {found}")]
    ContentHash {
        /// `content_hash` of the manifest.
        expected: String,
        /// The hash of the files in the folder.
        found: String,
    },
    /// A model family that this server cannot run.
    #[error("pack.toml: family is {found:?}; allowed: {}", known.join(", "))]
    Family {
        /// `family` of the manifest.
        found: String,
        /// Names of the families that this server runs.
        known: Vec<&'static str>,
    },
    /// Another pack has this name already.
    #[error("the name {0:?} is taken by another pack")]
    DuplicateName(String),
}
