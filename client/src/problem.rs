//! Problems of one session or stream, while others go on.

use std::fmt;

use troupe_proto::v1;

/// A session that could not be served, or whose command was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("session `{session}`: {problem}{}", of_request(.request_id.as_deref()))]
pub struct SessionError {
    /// Name of the session. Empty if the server did not name it.
    pub session: String,
    /// Kind, message and field of the problem.
    pub problem: Problem,
    /// Id of the failed request, which the server's log lines show. None for a part of an answer.
    pub request_id: Option<String>,
}

fn of_request(id: Option<&str>) -> String {
    id.map(|id| format!(" (request {id})")).unwrap_or_default()
}

/// Why the server could not serve one of many.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// Kind of the problem.
    pub kind: ProblemKind,
    /// Message of the server.
    pub message: String,
    /// Path of the field at fault, if any.
    pub field: Option<String>,
    /// Allowed values of the field.
    pub allowed: Option<String>,
}

/// Kinds of problems with sessions and streams.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ProblemKind {
    /// No call used the session within its time to live, and the server closed it.
    SessionExpired,
    /// The server has no session of that name.
    UnknownSession,
    /// The server has a session of that name already.
    SessionExists,
    /// Another client advances the session.
    SessionBusy,
    /// Another server has the session, or the scene that it is in. [`Problem::allowed`] names that
    /// server.
    SessionElsewhere,
    /// Another server has taken the session over.
    SessionMoved,
    /// The store that servers share does not answer, so it is unknown which server has the session.
    StoreUnreachable,
    /// The session was closed.
    SessionClosed,
    /// The client took the session off the stream.
    Detached,
    /// The server has no room for another session.
    TooManySessions,
    /// The pack has no such style.
    UnknownStyle,
    /// The server has no such scene.
    UnknownScene,
    /// The session is in no scene.
    NoScene,
    /// The scene has no such object.
    UnknownObject,
    /// Another character has reserved or holds the object.
    ObjectTaken,
    /// Something is in the way to the object.
    Blocked,
    /// The client was done with the stream.
    ClientDone,
    /// The server is stopping.
    Draining,
    /// The client read nothing from the stream for too long.
    SlowReader,
    /// Another kind, by the server's name for it.
    Other(String),
}

impl ProblemKind {
    /// Whether the session is gone for good.
    pub fn is_gone(&self) -> bool {
        matches!(
            self,
            Self::SessionExpired | Self::UnknownSession | Self::SessionClosed
        )
    }

    /// The kind with this name on the server.
    pub(crate) fn from_reason(reason: &str) -> Self {
        match reason {
            "SESSION_EXPIRED" => Self::SessionExpired,
            "UNKNOWN_SESSION" => Self::UnknownSession,
            "SESSION_EXISTS" => Self::SessionExists,
            "SESSION_BUSY" => Self::SessionBusy,
            "SESSION_ELSEWHERE" => Self::SessionElsewhere,
            "SESSION_MOVED" => Self::SessionMoved,
            "STORE_UNREACHABLE" => Self::StoreUnreachable,
            "SESSION_CLOSED" => Self::SessionClosed,
            "DETACHED" => Self::Detached,
            "TOO_MANY_SESSIONS" => Self::TooManySessions,
            "UNKNOWN_STYLE" => Self::UnknownStyle,
            "UNKNOWN_SCENE" => Self::UnknownScene,
            "NO_SCENE" => Self::NoScene,
            "UNKNOWN_OBJECT" => Self::UnknownObject,
            "OBJECT_TAKEN" => Self::ObjectTaken,
            "BLOCKED" => Self::Blocked,
            "CLIENT_DONE" => Self::ClientDone,
            "DRAINING" => Self::Draining,
            "SLOW_READER" => Self::SlowReader,
            other => Self::Other(other.to_owned()),
        }
    }

    /// Whether an error answer of this kind is about one session rather than the request.
    pub(crate) fn is_about_a_session(&self) -> bool {
        matches!(
            self,
            Self::SessionExpired
                | Self::UnknownSession
                | Self::SessionExists
                | Self::SessionBusy
                | Self::SessionElsewhere
                | Self::SessionMoved
                | Self::SessionClosed
        )
    }

    /// Whether the session is there, and may be resumed a little later.
    pub(crate) fn may_pass(&self) -> bool {
        matches!(
            self,
            Self::SessionBusy | Self::SessionElsewhere | Self::SessionMoved | Self::StoreUnreachable
        )
    }
}

impl From<v1::Problem> for Problem {
    fn from(problem: v1::Problem) -> Self {
        let given = |text: String| Some(text).filter(|text| !text.is_empty());
        Self {
            kind: ProblemKind::from_reason(&problem.reason),
            message: problem.message,
            field: given(problem.field),
            allowed: given(problem.allowed),
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.message.is_empty() {
            return write!(f, "{:?}", self.kind);
        }
        f.write_str(&self.message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn problems_of_many_are_read() {
        let problem = Problem::from(v1::Problem {
            reason: "UNKNOWN_STYLE".to_owned(),
            message: "no style `wlak`".to_owned(),
            field: "commands[0].locomote.style".to_owned(),
            allowed: "idle, walk".to_owned(),
        });
        assert_eq!(problem.kind, ProblemKind::UnknownStyle);
        assert_eq!(problem.allowed.as_deref(), Some("idle, walk"));
        assert_eq!(problem.to_string(), "no style `wlak`");
        let other = Problem::from(v1::Problem {
            reason: "NEW_ONE".to_owned(),
            ..v1::Problem::default()
        });
        assert_eq!(other.kind, ProblemKind::Other("NEW_ONE".to_owned()));
        assert!(other.field.is_none() && !other.kind.is_gone());
    }
}
