//! Codes of calls, and the last error of each thread.

use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::io;

use troupe_client::ClientError;

use crate::sized::{Versioned, write};

/// What a call came to. Errors are negative; `troupe_last_error` says more about them.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TroupeStatus {
    /// It worked.
    Ok = 0,
    /// Nothing new has come: no frame, or no note. This is no error.
    Empty = 1,
    /// An argument cannot be used: `field` names it, `allowed` says what can.
    Argument = -1,
    /// The handle is zero, of another kind, or closed.
    Handle = -2,
    /// Another thread is in a call with this handle.
    Busy = -3,
    /// The address of the server cannot be used.
    Address = -4,
    /// A certificate or its key cannot be read.
    Certificate = -5,
    /// No server answers, or the connection broke.
    Unreachable = -6,
    /// The server did not answer in time.
    TimedOut = -7,
    /// The server refused the call: `field` and `allowed` say what to change.
    Refused = -8,
    /// A session is gone, or another client advances it.
    Session = -9,
    /// The server ended the stream. Open another crowd.
    StreamEnded = -10,
    /// The request cannot be built.
    Request = -11,
    /// The answer of the server cannot be read: client and server are of different versions.
    Answer = -12,
    /// Too many commands of a character wait to be sent.
    Full = -13,
    /// The system has no thread or socket for a connection.
    System = -14,
    /// A defect of the library. Close the handle.
    Panic = -15,
}

/// The last error of a thread. Its texts are UTF-8, never null, and hold until the next call of
/// this thread that fails.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct TroupeError {
    /// `sizeof(TroupeError)`.
    pub size: u32,
    /// Code of the error; `TROUPE_STATUS_OK` if no call of this thread has failed.
    pub status: TroupeStatus,
    /// What is wrong, and what to do about it.
    pub message: *const c_char,
    /// The argument or the field of the request that is at fault. Empty: none.
    pub field: *const c_char,
    /// Allowed values of the field. Empty: see the message.
    pub allowed: *const c_char,
    /// The server's word for the kind of error, such as `UNKNOWN_STYLE`. Empty: none.
    pub reason: *const c_char,
    /// Id of the request, which the server's log lines show. Empty: none.
    pub request_id: *const c_char,
}

impl Versioned for TroupeError {
    const NAME: &'static str = "TroupeError";
}

/// Why a call failed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    /// An argument is null.
    #[error("{0} is null: give an address")]
    Null(&'static str),
    /// A text is not UTF-8.
    #[error("{0} is not UTF-8: convert the text first")]
    Utf8(&'static str),
    /// A value is outside its range.
    #[error("{field} is {got}, but must be {allowed}")]
    Range {
        field: &'static str,
        got: String,
        allowed: String,
    },
    /// A structure of an unknown size.
    #[error("{field} is {got}: set it to sizeof({name}), which is {allowed} in this library's header")]
    Size {
        field: &'static str,
        name: &'static str,
        got: u32,
        allowed: usize,
    },
    /// A structure of a newer header uses fields that this library does not know.
    #[error("{name} has fields that this library does not know: take a newer library, or leave them zero")]
    Newer { name: &'static str },
    /// The handle names nothing of this kind.
    #[error("the handle is no open {kind}: it is zero, of another kind, or closed")]
    Handle { kind: &'static str },
    /// Another thread has the handle.
    #[error("another thread is in a call with this {kind}: call from one thread at a time")]
    Busy { kind: &'static str },
    /// A crowd on the other clock.
    #[error(
        "the crowd is on the server's clock: read its frames, or open it with TROUPE_CLOCK_CALLER to step it"
    )]
    NotSteppable,
    /// Commands that are not sent yet.
    #[error(
        "{waiting} commands of character {character} wait to be sent: step or read the crowd, or command less often"
    )]
    Full { character: u32, waiting: usize },
    /// No thread or socket.
    #[error("the system refuses a thread or socket for the connection: {0}")]
    System(#[from] io::Error),
    /// An error of the client library.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// The stream of a crowd ended before.
    #[error("the crowd has ended: {message}; close it, and open another")]
    Ended { status: TroupeStatus, message: String },
    /// A panic that was caught.
    #[error("a defect of the library: {0}; close the handle, and please report this")]
    Panic(String),
}

impl Failure {
    /// The code of the error.
    pub(crate) fn status(&self) -> TroupeStatus {
        match self {
            Self::Null(_) | Self::Utf8(_) | Self::Range { .. } | Self::Size { .. } | Self::Newer { .. } => {
                TroupeStatus::Argument
            }
            Self::NotSteppable => TroupeStatus::Argument,
            Self::Handle { .. } => TroupeStatus::Handle,
            Self::Busy { .. } => TroupeStatus::Busy,
            Self::Full { .. } => TroupeStatus::Full,
            Self::System(_) => TroupeStatus::System,
            Self::Client(error) => of_client(error),
            Self::Ended { status, .. } => *status,
            Self::Panic(_) => TroupeStatus::Panic,
        }
    }

    fn parts(&self) -> Parts {
        let mut parts = Parts::default();
        match self {
            Self::Null(field) | Self::Utf8(field) => parts.field = (*field).to_owned(),
            Self::Range { field, allowed, .. } => {
                (parts.field, parts.allowed) = ((*field).to_owned(), allowed.clone());
            }
            Self::Size { field, allowed, .. } => {
                (parts.field, parts.allowed) = ((*field).to_owned(), allowed.to_string());
            }
            Self::NotSteppable => parts.field = "options.clock".to_owned(),
            Self::Client(error) => parts = Parts::of_client(error),
            _ => {}
        }
        parts
    }
}

/// What an error says beside its message.
#[derive(Default)]
struct Parts {
    field: String,
    allowed: String,
    reason: String,
    request_id: String,
}

impl Parts {
    fn of_client(error: &ClientError) -> Self {
        match error {
            ClientError::Refused(refused) => {
                let first = refused.violations.first().cloned();
                let (field, allowed) = first.map(|of| (of.field, of.allowed)).unwrap_or_default();
                Self {
                    field,
                    allowed: allowed.unwrap_or_default(),
                    reason: refused.reason.clone().unwrap_or_default(),
                    request_id: refused.request_id.clone().unwrap_or_default(),
                }
            }
            ClientError::Session(of) => Self {
                field: of.problem.field.clone().unwrap_or_default(),
                allowed: of.problem.allowed.clone().unwrap_or_default(),
                reason: String::new(),
                request_id: of.request_id.clone().unwrap_or_default(),
            },
            ClientError::Address { .. } => Self {
                field: "options.url".to_owned(),
                ..Self::default()
            },
            _ => Self::default(),
        }
    }
}

/// The code of a client's error.
pub(crate) fn of_client(error: &ClientError) -> TroupeStatus {
    match error {
        ClientError::Address { .. } => TroupeStatus::Address,
        ClientError::Certificate { .. } => TroupeStatus::Certificate,
        ClientError::Unreachable { .. } => TroupeStatus::Unreachable,
        ClientError::TimedOut { .. } => TroupeStatus::TimedOut,
        ClientError::Refused(_) => TroupeStatus::Refused,
        ClientError::Session(_) => TroupeStatus::Session,
        ClientError::StreamEnded(_) => TroupeStatus::StreamEnded,
        ClientError::Request(_) => TroupeStatus::Request,
        ClientError::Answer(_) => TroupeStatus::Answer,
    }
}

/// The last error of a thread, with texts as C has them.
struct Last {
    status: TroupeStatus,
    message: CString,
    field: CString,
    allowed: CString,
    reason: CString,
    request_id: CString,
}

thread_local! {
    static LAST: RefCell<Option<Last>> = const { RefCell::new(None) };
}

/// Keeps a failure as the last of this thread, and returns its code.
pub(crate) fn keep(failure: &Failure) -> TroupeStatus {
    let Parts {
        field,
        allowed,
        reason,
        request_id,
    } = failure.parts();
    let last = Last {
        status: failure.status(),
        message: text(&failure.to_string()),
        field: text(&field),
        allowed: text(&allowed),
        reason: text(&reason),
        request_id: text(&request_id),
    };
    // A thread that ends has no place for it any more.
    let _ = LAST.try_with(|kept| *kept.borrow_mut() = Some(last));
    failure.status()
}

/// A text as C has it. It ends at its first NUL.
pub(crate) fn text(of: &str) -> CString {
    let until = of.find('\0').unwrap_or(of.len());
    CString::new(&of[..until]).unwrap_or_default()
}

/// What failed last on this thread. The texts are never null.
///
/// It fails itself if `out` is null, or if its size is unknown; then it returns
/// `TROUPE_STATUS_ARGUMENT`, and the last error stays as it was.
///
/// # Safety
/// `out` is null, or points to a `TroupeError` whose `size` is set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn troupe_last_error(out: *mut TroupeError) -> TroupeStatus {
    let empty = c"".as_ptr();
    let none = TroupeError {
        size: 0,
        status: TroupeStatus::Ok,
        message: empty,
        field: empty,
        allowed: empty,
        reason: empty,
        request_id: empty,
    };
    let error = LAST.try_with(|kept| match &*kept.borrow() {
        Some(last) => TroupeError {
            size: 0,
            status: last.status,
            message: last.message.as_ptr(),
            field: last.field.as_ptr(),
            allowed: last.allowed.as_ptr(),
            reason: last.reason.as_ptr(),
            request_id: last.request_id.as_ptr(),
        },
        None => none,
    });
    // SAFETY: the caller vouches for `out`.
    match unsafe { write("out", out, error.unwrap_or(none)) } {
        Ok(()) => TroupeStatus::Ok,
        Err(failure) => failure.status(),
    }
}
