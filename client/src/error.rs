//! Errors of calls. They name the field at fault, so that the caller knows what to change.

use std::fmt;
use std::time::Duration;

use tonic::Code;
use tonic_types::StatusExt as _;
use troupe_motion::clip::ClipError;

use crate::problem::{Problem, ProblemKind, SessionError};

/// Why a call has no answer.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// The address cannot be used.
    #[error("`{url}` is not a server address ({reason}); an address looks like http://127.0.0.1:8080")]
    Address {
        /// The address that the caller gave.
        url: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A certificate or its key cannot be read.
    #[error("{}: {reason}", path.display())]
    Certificate {
        /// Path of the file.
        path: std::path::PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// Nothing answers at the address, or the connection broke.
    #[error("no Troupe server answers at {url}: {reason}")]
    Unreachable {
        /// The server's address.
        url: String,
        /// Message of the transport.
        reason: String,
    },
    /// The server did not answer within
    /// [`ConnectOptions::request_timeout`](crate::ConnectOptions::request_timeout).
    #[error("the server at {url} did not answer within {} s", after.as_secs_f32())]
    TimedOut {
        /// The server's address.
        url: String,
        /// The limit that passed.
        after: Duration,
    },
    /// The server answered with an error.
    #[error("the server refused: {0}")]
    Refused(#[from] Box<RefusedCall>),
    /// The server cannot serve this session: it expired, is unknown, or another client advances it.
    #[error("{0}")]
    Session(#[from] Box<SessionError>),
    /// The server ended the stream.
    #[error("the server ended the stream: {0}")]
    StreamEnded(Box<Problem>),
    /// The request cannot be built.
    #[error(transparent)]
    Request(#[from] RequestError),
    /// The answer breaks the contract.
    #[error("the server's answer is broken: {0}")]
    Answer(#[from] AnswerError),
}

/// An error answer of the server: its code, its message, and the fields at fault.
#[derive(Debug, Clone)]
pub struct RefusedCall {
    /// The gRPC status code.
    pub code: Code,
    /// Message of the server.
    pub message: String,
    /// The fields at fault, from `google.rpc.BadRequest`.
    pub violations: Vec<Violation>,
    /// The server's name for this kind of error, from `google.rpc.ErrorInfo`.
    pub reason: Option<String>,
    /// When another try may succeed, from `google.rpc.RetryInfo`.
    pub retry_after: Option<Duration>,
    /// The request's id, which the server's log lines show.
    pub request_id: Option<String>,
}

/// A field of a request that the server did not accept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Violation {
    /// Path of the field, such as `characters[0].frame_count`.
    pub field: String,
    /// What is wrong, and what is allowed.
    pub description: String,
    /// The allowed values, such as `12 to 64`, if the server sends them apart from the description.
    pub allowed: Option<String>,
}

/// A request that cannot be built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RequestError {
    /// A route whose name cannot be sent.
    #[error("the route {name:?} must be 1 or more visible ASCII characters, such as `guard-7`")]
    Route {
        /// The id of a session or name of a scene, as the caller gave it.
        name: String,
    },
    /// A body that the pack does not have.
    #[error("pack {pack} has no body {body:?}; it has: {}", if bodies.is_empty() { "one skeleton alone".to_owned() } else { bodies.join(", ") })]
    UnknownBody {
        /// Name of the pack.
        pack: String,
        /// The unknown name.
        body: String,
        /// Names of the pack's bodies.
        bodies: Vec<String>,
    },
    /// A frame that the clip does not have.
    #[error("{what} {frame} is outside the clip, whose frames are 0 to {last}")]
    FrameOutside {
        /// The argument, such as `from` or `to`.
        what: &'static str,
        /// Number of the frame, from 0.
        frame: usize,
        /// The clip's last frame.
        last: usize,
    },
    /// Too few frames before the gap.
    #[error(
        "from is {from}, but must be {least} or more: it and the {least} frames in front of it are the context"
    )]
    ContextCut {
        /// The last context frame of the request.
        from: usize,
        /// The smallest frame that works.
        least: usize,
    },
    /// The clip has no frames.
    #[error("the clip has no frames")]
    EmptyClip,
    /// The target does not follow the context.
    #[error("to is {to}, but must come after from, which is {from}")]
    Order {
        /// Last context frame.
        from: usize,
        /// First target keyframe.
        to: usize,
    },
    /// The segment is shorter or longer than the pack can fill.
    #[error(
        "the gap from {from} to {to} makes a segment of {frames} frames, but pack `{pack}` fills {min} to {max}: \
         with from {from}, to must be {least_to} to {most_to}"
    )]
    Span {
        /// Last context frame.
        from: usize,
        /// Target keyframe.
        to: usize,
        /// Frames from the first context frame to the target.
        frames: usize,
        /// The pack's name.
        pack: String,
        /// The pack's least segment.
        min: usize,
        /// The pack's longest segment.
        max: usize,
        /// Least `to` for this `from`.
        least_to: usize,
        /// Greatest `to` for this `from`.
        most_to: usize,
    },
    /// The clip runs at another rate than the pack.
    #[error("the clip runs at {clip} frames per second, the pack at {pack}: resample the clip first")]
    FrameRate {
        /// The clip's rate.
        clip: f32,
        /// The pack's rate.
        pack: f32,
    },
    /// The clip is on another skeleton than the pack.
    #[error(
        "the clip has {clip} joints, the pack's skeleton {pack}: map the clip onto the pack's skeleton first"
    )]
    Joints {
        /// Joints of the clip.
        clip: usize,
        /// Joints of the pack.
        pack: usize,
    },
}

/// An answer that breaks the contract of `motion.proto`.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AnswerError {
    /// A part is missing.
    #[error("`{0}` is missing")]
    Missing(&'static str),
    /// An array of the wrong length.
    #[error("`{field}` has {got} numbers instead of {expected}")]
    Length {
        /// Path of the field.
        field: &'static str,
        /// Numbers that came.
        got: usize,
        /// Numbers that should have come.
        expected: usize,
    },
    /// The frames cannot be a motion.
    #[error("the frames are no motion: {0}")]
    Frames(#[from] ClipError),
    /// The pack's skeleton is invalid.
    #[error("the skeleton of pack `{pack}`: {reason}")]
    Skeleton {
        /// The pack's name.
        pack: String,
        /// What is wrong.
        reason: String,
    },
}

impl ClientError {
    /// The fields at fault, if the server refused the call; empty for all other errors.
    pub fn violations(&self) -> &[Violation] {
        match self {
            Self::Refused(refusal) => &refusal.violations,
            _ => &[],
        }
    }

    /// The problem of a session, if that is the error.
    pub fn session_problem(&self) -> Option<&Problem> {
        match self {
            Self::Session(error) => Some(&error.problem),
            _ => None,
        }
    }

    /// Whether the session expired, because no call used it within its time to live. A new one can
    /// take its place.
    pub fn is_session_expired(&self) -> bool {
        self.session_problem()
            .is_some_and(|problem| problem.kind == ProblemKind::SessionExpired)
    }

    /// The problem of one session.
    pub(crate) fn session(session: &str, problem: Problem) -> Self {
        Self::Session(Box::new(SessionError {
            session: session.to_owned(),
            problem,
            request_id: None,
        }))
    }

    /// Sorts a failed call into unreachable, timed out, a session's problem or refused.
    pub(crate) fn from_status(status: &tonic::Status, url: &str, timeout: Duration) -> Self {
        let source_is_transport = std::error::Error::source(status).is_some_and(|source| {
            source.is::<tonic::transport::Error>() || source.is::<tonic::ConnectError>()
        });
        // Unknown: the connection broke during the call, for instance because the client showed no
        // certificate. If it breaks under a stream, such as when the server is killed, the status
        // has no source, while one from a server would have metadata. Cancelled: it broke before
        // the call was sent, or a router lost its server.
        let timed_out = std::error::Error::source(status).is_some_and(|s| s.is::<tonic::TimeoutExpired>())
            || (status.code() == Code::Cancelled && status.message() == "Timeout expired");
        let broken = match status.code() {
            Code::Cancelled => (source_is_transport || status.metadata().is_empty()) && !timed_out,
            Code::Unavailable => source_is_transport,
            Code::Unknown => source_is_transport || status.metadata().is_empty(),
            _ => false,
        };
        if broken {
            return Self::Unreachable {
                url: url.to_owned(),
                reason: deepest(status),
            };
        }
        if timed_out {
            return Self::TimedOut {
                url: url.to_owned(),
                after: timeout,
            };
        }
        let refusal = RefusedCall::from_status(status);
        match refusal.session_error(status) {
            Some(error) => Self::Session(Box::new(error)),
            None => Self::Refused(Box::new(refusal)),
        }
    }
}

/// The id of the request that a status answers.
fn request_id(status: &tonic::Status) -> Option<String> {
    let sent = status.metadata().get("x-request-id")?;
    sent.to_str().ok().map(str::to_owned)
}

/// The innermost cause. It says "connection refused" while the outer ones say "transport error".
pub(crate) fn deepest(error: &dyn std::error::Error) -> String {
    let mut cause = error;
    while let Some(inner) = cause.source() {
        cause = inner;
    }
    cause.to_string()
}

impl RefusedCall {
    /// Reads a status and its `google.rpc` details.
    fn from_status(status: &tonic::Status) -> Self {
        let details = status.get_error_details();
        let info = details.error_info();
        let about = |key: &str| info.and_then(|info| info.metadata.get(key)).cloned();
        let fields = details
            .bad_request()
            .map(|bad| &bad.field_violations[..])
            .unwrap_or_default();
        let mut violations = fields
            .iter()
            .map(|of| Violation {
                field: of.field.clone(),
                description: of.description.clone(),
                allowed: about("allowed").filter(|_| about("field").as_ref() == Some(&of.field)),
            })
            .collect::<Vec<_>>();
        // Only invalid arguments come with a bad request, but other errors may be about a field
        // too.
        if let (true, Some(field)) = (violations.is_empty(), about("field")) {
            let description = status.message().to_owned();
            violations.push(Violation {
                field,
                description,
                allowed: about("allowed"),
            });
        }
        Self {
            code: status.code(),
            message: status.message().to_owned(),
            violations,
            reason: info.map(|i| i.reason.clone()),
            retry_after: details.retry_info().and_then(|retry| retry.retry_delay),
            request_id: request_id(status),
        }
    }

    /// The refusal as the problem of a session, if it is one.
    fn session_error(&self, status: &tonic::Status) -> Option<SessionError> {
        let kind = ProblemKind::from_reason(self.reason.as_deref()?);
        if !kind.is_about_a_session() {
            return None;
        }
        let details = status.get_error_details();
        let session = details
            .error_info()
            .and_then(|info| info.metadata.get("session"))
            .cloned();
        let first = self.violations.first();
        Some(SessionError {
            session: session.unwrap_or_default(),
            problem: Problem {
                kind,
                message: self.message.clone(),
                field: first.map(|v| v.field.clone()),
                allowed: first.and_then(|v| v.allowed.clone()),
            },
            request_id: self.request_id.clone(),
        })
    }
}

impl fmt::Display for RefusedCall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({:?}", self.message, self.code)?;
        if let Some(id) = &self.request_id {
            write!(f, ", request {id}")?;
        }
        f.write_str(")")?;
        // Mostly the message names the field already.
        for violation in self
            .violations
            .iter()
            .filter(|v| !self.message.contains(&v.field) && v.description != self.message)
        {
            write!(f, "\n  {}: {}", violation.field, violation.description)?;
        }
        Ok(())
    }
}

impl std::error::Error for RefusedCall {}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use tonic_types::{ErrorDetails, FieldViolation, StatusExt as _};

    use super::*;

    fn refused(details: ErrorDetails) -> ClientError {
        let status = tonic::Status::with_error_details(Code::InvalidArgument, "bad request", details);
        ClientError::from_status(&status, "http://x", Duration::from_secs(1))
    }

    #[test]
    fn a_connection_that_breaks_under_a_stream_is_no_refusal() {
        let mut status = tonic::Status::unknown("h2 protocol error: error reading a body from connection");
        let sort =
            |status: &tonic::Status| ClientError::from_status(status, "http://x", Duration::from_secs(1));
        assert!(matches!(sort(&status), ClientError::Unreachable { .. }));
        status.metadata_mut().insert("x-request-id", "a".parse().unwrap());
        assert!(matches!(sort(&status), ClientError::Refused(_)));
    }

    #[test]
    fn a_stream_that_a_router_cancels_is_no_refusal() {
        let mut status = tonic::Status::cancelled("h2 protocol error: stream reset by the remote end");
        let sort =
            |status: &tonic::Status| ClientError::from_status(status, "http://x", Duration::from_secs(1));
        assert!(matches!(sort(&status), ClientError::Unreachable { .. }));
        let late = tonic::Status::cancelled("Timeout expired");
        assert!(matches!(sort(&late), ClientError::TimedOut { .. }));
        status.metadata_mut().insert("x-request-id", "a".parse().unwrap());
        assert!(matches!(sort(&status), ClientError::Refused(_)));
    }

    #[test]
    fn fields_and_what_they_may_be_are_read() {
        let info = HashMap::from([
            ("field".to_owned(), "characters[0].frame_count".to_owned()),
            ("allowed".to_owned(), "12 to 64".to_owned()),
        ]);
        let mut details = ErrorDetails::new();
        details
            .set_bad_request(vec![FieldViolation::new(
                "characters[0].frame_count",
                "is 9, must be 12 to 64",
            )])
            .set_error_info("INVALID_FIELD", "troupe", info);
        let error = refused(details);
        let expected = Violation {
            field: "characters[0].frame_count".to_owned(),
            description: "is 9, must be 12 to 64".to_owned(),
            allowed: Some("12 to 64".to_owned()),
        };
        assert_eq!(error.violations(), [expected]);
        let text = error.to_string();
        assert!(
            text.contains("characters[0].frame_count: is 9, must be 12 to 64"),
            "{text}"
        );
    }

    #[test]
    fn an_expired_session_has_its_own_error() {
        let failed = |reason: &str| {
            let mut details = ErrorDetails::new();
            details.set_error_info(reason, "troupe", HashMap::new());
            refused(details)
        };
        let error = failed("SESSION_EXPIRED");
        assert!(error.is_session_expired(), "{error:?}");
        let busy = failed("SESSION_BUSY");
        assert_eq!(busy.session_problem().unwrap().kind, ProblemKind::SessionBusy);
        assert!(!busy.is_session_expired());
        // An error of the request remains a refusal with its fields.
        for reason in ["INVALID_FIELD", "UNKNOWN_STYLE", "TOO_MANY_SESSIONS"] {
            assert!(matches!(failed(reason), ClientError::Refused(_)), "{reason}");
        }
    }

    #[test]
    fn a_refusal_without_details_keeps_its_code() {
        let error = refused(ErrorDetails::new());
        let ClientError::Refused(refusal) = error else {
            panic!("{error}")
        };
        assert_eq!((refusal.code, refusal.reason), (Code::InvalidArgument, None));
        assert!(refusal.violations.is_empty());
    }

    #[test]
    fn when_to_try_again_is_read() {
        let pause = Duration::from_millis(250);
        let mut details = ErrorDetails::new();
        details.set_retry_info(Some(pause));
        let ClientError::Refused(refusal) = refused(details) else {
            panic!("no refusal")
        };
        assert_eq!(refusal.retry_after, Some(pause));
    }

    #[test]
    fn the_requests_id_is_shown() {
        let with_id = |reason| {
            let mut details = ErrorDetails::new();
            details.set_error_info(reason, "troupe", HashMap::new());
            let mut status = tonic::Status::with_error_details(Code::NotFound, "there is none", details);
            status
                .metadata_mut()
                .insert("x-request-id", "abc-1".parse().unwrap());
            ClientError::from_status(&status, "http://x", Duration::from_secs(1)).to_string()
        };
        assert_eq!(
            with_id("UNKNOWN_STYLE"),
            "the server refused: there is none (NotFound, request abc-1)"
        );
        assert_eq!(
            with_id("SESSION_EXPIRED"),
            "session ``: there is none (request abc-1)"
        );
    }

    #[test]
    fn a_server_that_says_unavailable_was_reached() {
        let status = tonic::Status::unavailable("the queue is full");
        let error = ClientError::from_status(&status, "http://x", Duration::from_secs(1));
        assert!(matches!(error, ClientError::Refused(_)), "{error}");
    }
}
