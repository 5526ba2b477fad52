//! Why a load test could not be done, and the exit code that says so.

use std::path::Path;
use std::process::ExitCode;

use troupe_client::ClientError;

/// The exit code where a stated bound was missed.
pub const BOUND_MISSED: u8 = 5;

/// A load test that could not be done.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The arguments or files given do not work.
    #[error("{0}")]
    Input(String),
    /// The server cannot be reached, or refused to let the load begin.
    #[error("{0}")]
    Client(#[from] ClientError),
    /// No server answers there.
    #[error("{0}")]
    Unreachable(String),
    /// Anything else, such as a file that cannot be written.
    #[error("{0}")]
    Other(String),
}

impl Failure {
    /// A value of an option that cannot be used, and what it may be.
    pub fn option(option: &str, found: impl std::fmt::Display, allowed: impl std::fmt::Display) -> Self {
        Self::Input(format!("{option} is {found}; allowed: {allowed}"))
    }

    /// A file that cannot be used, and why.
    pub fn file(path: &Path, why: impl std::fmt::Display) -> Self {
        Self::Input(format!("{}: {why}", path.display()))
    }

    /// A file that cannot be written, and why.
    pub fn output(path: &Path, why: impl std::fmt::Display) -> Self {
        Self::Other(format!("cannot write {}: {why}", path.display()))
    }

    /// The exit code, as `troupe-loadtest --help` documents it.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(self.exit())
    }

    /// The same as a number.
    pub fn exit(&self) -> u8 {
        match self {
            Self::Input(_)
            | Self::Client(
                ClientError::Address { .. } | ClientError::Certificate { .. } | ClientError::Request(_),
            ) => 2,
            Self::Unreachable(_)
            | Self::Client(ClientError::Unreachable { .. } | ClientError::TimedOut { .. }) => 3,
            Self::Client(ClientError::Refused(_) | ClientError::Session(_) | ClientError::StreamEnded(_)) => {
                4
            }
            Self::Client(ClientError::Answer(_)) | Self::Other(_) => 1,
        }
    }
}
