//! Errors of the node.

use ros2_client::{CreateError, NodeCreateError};
use troupe_client::ClientError;

/// Why the node does not start.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Ros2Error {
    /// A robot's pack or body is no robot.
    #[error(
        "robot {robot}: pack {pack}{body} has no hinges; allowed: packs and bodies with a robot (`troupe packs` lists them)"
    )]
    NoRobot {
        /// Name of the robot.
        robot: String,
        /// The pack in its entry or argument.
        pack: String,
        /// `/` and its body, or nothing.
        body: String,
    },
    /// A call to the server failed for one robot.
    #[error("robot {robot}: {error}")]
    Robot {
        /// Name of the robot.
        robot: String,
        /// The server's answer.
        error: ClientError,
    },
    /// A call to the server failed.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// DDS refused a topic, a reader or a writer.
    #[error("cannot join ROS: {0}")]
    Dds(#[from] CreateError),
    /// ROS refused a node.
    #[error("cannot join ROS: {0}")]
    Node(#[from] NodeCreateError),
    /// ROS refused a name.
    #[error("cannot join ROS: {name:?} is no name there: {reason}")]
    Name {
        /// A namespace or topic.
        name: String,
        /// The library's reason.
        reason: String,
    },
}
