//! What can be wrong with a pack.

use std::path::PathBuf;

use troupe_motion::feasibility::LimitsError;
use troupe_motion::model::BodyError;
use troupe_motion::robot::RobotError;

/// A pack that cannot be used, and its folder.
#[derive(Debug, thiserror::Error)]
#[error("model pack {}: {problem}", folder.display())]
pub struct PackError {
    /// The pack's folder.
    pub folder: PathBuf,
    /// What is wrong with it.
    pub problem: PackProblem,
}

/// What is wrong with a pack.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PackProblem {
    /// A file or folder that cannot be read.
    #[error("cannot read {}: {cause}", path.display())]
    Read {
        /// What was to be read.
        path: PathBuf,
        /// Why it failed.
        cause: std::io::Error,
    },
    /// No folder with a manifest below the packs folder.
    #[error("no pack here: expected folders that hold a pack.toml")]
    NoPacks,
    /// A manifest that is not valid TOML, or lacks or misspells a field. The text shows the line.
    #[error("pack.toml: {0}")]
    Parse(#[from] toml::de::Error),
    /// A manifest of a format that this server does not know.
    #[error("pack.toml: format {found} is not supported (this server reads formats 1 to {supported})")]
    Format {
        /// The manifest's format.
        found: u32,
        /// The newest supported format.
        supported: u32,
    },
    /// A field out of its range.
    #[error("pack.toml: {field} is {found}; allowed: {allowed}")]
    Field {
        /// The field's path in the manifest.
        field: &'static str,
        /// What it holds.
        found: String,
        /// What it may hold.
        allowed: String,
    },
    /// Hinges that do not make a robot of the skeleton.
    #[error("pack.toml: {0}")]
    Robot(#[from] RobotError),
    /// Limits out of their range, or of other joints.
    #[error("pack.toml: {0}")]
    Limits(#[from] LimitsError),
    /// Limits of a body.
    #[error("bodies/{body}.toml: {problem}")]
    BodyLimits {
        /// Its name, as in the folder `bodies`.
        body: String,
        /// What is wrong with them.
        problem: Box<LimitsError>,
    },
    /// A body's file that is not valid TOML, or lacks or misspells a field. The text shows the
    /// line.
    #[error("bodies/{body}.toml: {cause}")]
    BodyFile {
        /// Its name, as in the folder `bodies`.
        body: String,
        /// What is wrong with it.
        cause: Box<toml::de::Error>,
    },
    /// A body that contradicts itself.
    #[error("bodies/{body}.toml: {problem}")]
    Body {
        /// Its name, as in the folder `bodies`.
        body: String,
        /// What is wrong with it.
        problem: Box<BodyError>,
    },
    /// Text pieces that the library does not read.
    #[error("tokenizer.json: {0}")]
    Tokenizer(String),
    /// The ONNX files are not those that the manifest speaks of.
    #[error("the ONNX files do not match the manifest: content_hash is {expected}, the files have {found}")]
    ContentHash {
        /// The manifest's hash.
        expected: String,
        /// The files' hash.
        found: String,
    },
    /// A model family that this server does not host.
    #[error("pack.toml: family is {found:?}; allowed: {}", known.join(", "))]
    Family {
        /// The manifest's family.
        found: String,
        /// The families that this server hosts.
        known: Vec<&'static str>,
    },
    /// A second pack of the same name.
    #[error("the name {0:?} is taken by another pack")]
    DuplicateName(String),
}
