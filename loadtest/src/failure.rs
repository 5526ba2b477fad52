//! Failures of a load test, and their exit codes.

use std::path::Path;
use std::process::ExitCode;

use troupe_client::ClientError;

/// Exit code if a stated bound was missed.
pub const BOUND_MISSED: u8 = 5;

/// Why a load test failed.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// Arguments or files cannot be used.
    #[error("{0}")]
    Input(String),
    /// The server cannot be reached, or refused the preparation of the load.
    #[error("{0}")]
    Client(#[from] ClientError),
    /// There is no answer at the server's address.
    #[error("{0}")]
    Unreachable(String),
    /// Another failure, such as a file that cannot be written.
    #[error("{0}")]
    Other(String),
}

impl Failure {
    /// Makes the error of an option's value that cannot be used, with the allowed ones.
    pub fn option(option: &str, found: impl std::fmt::Display, allowed: impl std::fmt::Display) -> Self {
        Self::Input(format!("{option} is {found}; allowed: {allowed}"))
    }

    /// Makes the error of a file that cannot be used.
    pub fn file(path: &Path, why: impl std::fmt::Display) -> Self {
        Self::Input(format!("{}: {why}", path.display()))
    }

    /// Makes the error of a file that cannot be written.
    pub fn output(path: &Path, why: impl std::fmt::Display) -> Self {
        Self::Other(format!("cannot write {}: {why}", path.display()))
    }

    /// The exit code. `troupe-loadtest --help` documents it.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(self.exit())
    }

    /// The exit code as a number.
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
