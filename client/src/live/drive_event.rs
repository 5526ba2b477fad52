//! What a stream tells beside frames.

use troupe_proto::v1;

use super::session::Session;
use crate::problem::Problem;

/// Something that happened to a stream's sessions.
#[derive(Debug)]
pub enum DriveEvent {
    /// The session is on the stream now.
    Attached {
        /// Its name.
        session: String,
    },
    /// The stream broke, and the session is taken up again: its next frame is the one behind the
    /// last that came. What it should do is told again. What it was told to do once
    /// ([`Drive::act`](super::Drive::act)) is not, and may be lost.
    Resumed {
        /// Its name.
        session: String,
        /// The frame that it is at.
        frame: u64,
        /// The server was started again and had kept the session. Else only the connection broke.
        restored: bool,
        /// Commands that this client gave and the server does not know.
        lost_commands: u64,
    },
    /// The session could not be taken onto the stream. It is given back, unless it is gone.
    NotAttached {
        /// Its name.
        id: String,
        /// It.
        session: Option<Box<Session>>,
        /// Why.
        problem: Problem,
    },
    /// Something happened to a character in a scene. It comes before the tick in which it did.
    Happened {
        /// Its session.
        session: String,
        /// What, in order.
        events: Vec<v1::SessionEvent>,
        /// Events of the session that were dropped so far, because this client was slow to take
        /// them.
        dropped: u64,
    },
    /// The session left the stream: detached, closed or expired. It is given back, unless it is
    /// gone.
    Left {
        /// Its name.
        id: String,
        /// It.
        session: Option<Box<Session>>,
        /// Why.
        problem: Problem,
    },
    /// What the session should do was refused; it goes on as before.
    Refused {
        /// Its name.
        session: String,
        /// Why.
        problem: Problem,
    },
}
