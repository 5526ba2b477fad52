//! Errors of a configuration.

use std::path::PathBuf;

/// An unusable configuration.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// `--config` names a file that does not exist.
    #[error("there is no configuration file at {}", .0.display())]
    MissingFile(PathBuf),
    /// A value of the wrong form, or a file that does not parse.
    #[error("{0:#}")]
    Load(#[from] confique::Error),
    /// An option that this version does not have.
    #[error("{option} is no longer an option: {instead}")]
    Removed {
        /// Name in a configuration file.
        option: &'static str,
        /// What replaced it.
        instead: &'static str,
    },
    /// A value out of its range.
    #[error("{option} is {found}; allowed: {allowed}")]
    Value {
        /// Name in a configuration file.
        option: &'static str,
        /// The value as text.
        found: String,
        /// The range.
        allowed: String,
    },
}
