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
        /// Events of the session that were dropped so far, because this client was slow to take them.
        dropped: u64,
    },
    /// The session left the stream: detached, closed or expired. It is given back, unless it is gone.
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
