//! Why a command failed, and the exit code that says so.

use std::path::Path;
use std::process::ExitCode;

use troupe_client::{ClientError, RequestError};

/// A failed command.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// The arguments or files given do not work.
    #[error("{0}")]
    Input(String),
    /// The server cannot be reached or did not take the request.
    #[error("{0}")]
    Client(#[from] ClientError),
    /// Anything else.
    #[error("{0}")]
    Other(String),
}

impl Failure {
    /// A file that cannot be used, and why.
    pub fn file(path: &Path, why: impl std::fmt::Display) -> Self {
        Self::Input(format!("{}: {why}", path.display()))
    }

    /// A file that cannot be written, and why.
    pub fn output(path: &Path, why: impl std::fmt::Display) -> Self {
        Self::Other(format!("cannot write {}: {why}", path.display()))
    }

    /// The exit code, as `troupe --help` documents it.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(match self {
            Self::Input(_)
            | Self::Client(
                ClientError::Address { .. } | ClientError::Certificate { .. } | ClientError::Request(_),
            ) => 2,
            Self::Client(ClientError::Unreachable { .. } | ClientError::TimedOut { .. }) => 3,
            Self::Client(ClientError::Refused(_) | ClientError::Session(_) | ClientError::StreamEnded(_)) => {
                4
            }
            Self::Client(ClientError::Answer(_)) | Self::Other(_) => 1,
        })
    }
}

impl From<RequestError> for Failure {
    fn from(error: RequestError) -> Self {
        Self::Client(error.into())
    }
}
