//! Events of a stream.

use troupe_proto::v1;

use super::session::Session;
use crate::problem::Problem;

/// An event of a stream's sessions.
#[derive(Debug)]
pub enum DriveEvent {
    /// The session is on the stream now.
    Attached {
        /// Id of the session.
        session: String,
    },
    /// The stream broke, and the session is resumed: its next frame is the one after the last that
    /// came. Its intent is sent again. Actions ([`Drive::act`](super::Drive::act)) are not, and may
    /// be lost.
    Resumed {
        /// Id of the session.
        session: String,
        /// Its current frame.
        frame: u64,
        /// Whether the server was restarted and had kept the session. Else only the connection
        /// broke.
        restored: bool,
        /// Commands of this client that the server does not know.
        lost_commands: u64,
    },
    /// The session could not be taken onto the stream. It comes back, unless it is gone.
    NotAttached {
        /// Id of the session.
        id: String,
        /// The session itself.
        session: Option<Box<Session>>,
        /// The reason.
        problem: Problem,
    },
    /// A character had events in its scene. They come before the tick in which they happened.
    Happened {
        /// Id of its session.
        session: String,
        /// The events, in order.
        events: Vec<v1::SessionEvent>,
        /// Events of the session that were dropped so far, because this client was slow.
        dropped: u64,
    },
    /// The session left the stream: detached, closed or expired. It comes back, unless it is gone.
    Left {
        /// Id of the session.
        id: String,
        /// The session itself.
        session: Option<Box<Session>>,
        /// The reason.
        problem: Problem,
    },
    /// The server refused the session's command. The session goes on as before.
    Refused {
        /// Id of the session.
        session: String,
        /// The reason.
        problem: Problem,
    },
}
