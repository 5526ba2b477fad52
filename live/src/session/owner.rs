//! The owner of a session, and how a session ended.

use troupe_proto::v1;

/// The kind of call that advances a session.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Owner {
    /// No call at the moment.
    Free = 0,
    /// A `Step` call: frames come when the client asks.
    Step = 1,
    /// A `Drive` stream: frames come at a fixed rate.
    Drive = 2,
}

impl Owner {
    pub(super) fn of(value: u8) -> Self {
        match value {
            1 => Self::Step,
            2 => Self::Drive,
            _ => Self::Free,
        }
    }
}

impl From<Owner> for v1::Clock {
    fn from(owner: Owner) -> Self {
        match owner {
            Owner::Free => Self::Free,
            Owner::Step => Self::Step,
            Owner::Drive => Self::Drive,
        }
    }
}

/// How a session ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum End {
    /// A client closed it.
    Closed = 1,
    /// Its time to live ran out.
    Expired = 2,
    /// It was idle when the server had no room for a new session.
    MadeRoom = 3,
    /// Another server has taken it over.
    Moved = 4,
}
