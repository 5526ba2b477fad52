//! What is wrong with a configuration.

use std::path::PathBuf;

/// A configuration that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// `--config` names a file that is not there.
    #[error("there is no configuration file at {}", .0.display())]
    MissingFile(PathBuf),
    /// A value of the wrong form, or a file that does not parse.
    #[error("{0:#}")]
    Load(#[from] confique::Error),
    /// A value out of its range.
    #[error("{option} is {found}; allowed: {allowed}")]
    Value {
        /// The option.
        option: &'static str,
        /// Its value.
        found: String,
        /// What it may be.
        allowed: String,
    },
}
