//! Errors of the bridge.

use std::net::SocketAddr;

use troupe_client::ClientError;

/// Why a bridge does not open.
#[derive(Debug, thiserror::Error)]
pub enum SonicError {
    /// The pack moves no G1.
    #[error("pack {0} moves no G1 with 29 hinges in MuJoCo's order, which SONIC's controller needs")]
    NoG1(String),
    /// A port that cannot be bound.
    #[error("cannot listen on {address}: {error}")]
    Listen {
        /// Where the robot would connect to.
        address: SocketAddr,
        /// Message of the system.
        error: std::io::Error,
    },
    /// The thread that sends does not start.
    #[error("cannot start a thread: {0}")]
    Thread(std::io::Error),
    /// A call to the server failed.
    #[error(transparent)]
    Client(#[from] ClientError),
}
