//! Handles: numbers instead of addresses, so that a closed one is an error and no crash.

use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, LazyLock, PoisonError, RwLock};

use crate::connection::Connection;
use crate::crowd::Crowd;
use crate::pack::OpenPack;
use crate::status::{Failure, TroupeStatus, keep};

/// What a handle may name.
#[derive(Clone)]
pub(crate) enum Open {
    Connection(Arc<Connection>),
    Pack(Arc<OpenPack>),
    Crowd(Arc<Crowd>),
}

/// Everything that is open. No number is used twice.
static OPEN: LazyLock<RwLock<HashMap<u64, Open>>> = LazyLock::new(RwLock::default);
static NEXT: AtomicU64 = AtomicU64::new(1);

/// Keeps something open, and returns the number of its handle.
pub(crate) fn insert(of: Open) -> u64 {
    let id = NEXT.fetch_add(1, Ordering::Relaxed);
    let mut open = OPEN.write().unwrap_or_else(PoisonError::into_inner);
    open.insert(id, of);
    id
}

/// A kind of thing that a handle may name.
pub(crate) trait Kind: Sized {
    /// What it is called in messages.
    const KIND: &'static str;
    /// The thing, if it is of this kind.
    fn of(open: &Open) -> Option<&Arc<Self>>;
}

impl Kind for Connection {
    const KIND: &'static str = "connection";
    fn of(open: &Open) -> Option<&Arc<Self>> {
        match open {
            Open::Connection(of) => Some(of),
            _ => None,
        }
    }
}

impl Kind for OpenPack {
    const KIND: &'static str = "pack";
    fn of(open: &Open) -> Option<&Arc<Self>> {
        match open {
            Open::Pack(of) => Some(of),
            _ => None,
        }
    }
}

impl Kind for Crowd {
    const KIND: &'static str = "crowd";
    fn of(open: &Open) -> Option<&Arc<Self>> {
        match open {
            Open::Crowd(of) => Some(of),
            _ => None,
        }
    }
}

/// What a handle names.
pub(crate) fn get<T: Kind>(id: u64) -> Result<Arc<T>, Failure> {
    let open = OPEN.read().unwrap_or_else(PoisonError::into_inner);
    let found = open.get(&id).and_then(T::of).cloned();
    found.ok_or(Failure::Handle { kind: T::KIND })
}

/// Takes what a handle names out of the open things.
pub(crate) fn remove<T: Kind>(id: u64) -> Result<Arc<T>, Failure> {
    let found = get::<T>(id)?;
    let mut open = OPEN.write().unwrap_or_else(PoisonError::into_inner);
    match open.remove(&id) {
        Some(_) => Ok(found),
        None => Err(Failure::Handle { kind: T::KIND }),
    }
}

/// Runs a call from C. Its failure becomes the thread's last error. A panic ends here, except in a
/// build whose panics abort.
pub(crate) fn entry(call: impl FnOnce() -> Result<TroupeStatus, Failure>) -> TroupeStatus {
    let outcome = catch_unwind(AssertUnwindSafe(call));
    let failure = match outcome {
        Ok(Ok(status)) => return status,
        Ok(Err(failure)) => failure,
        Err(panic) => Failure::Panic(said(&*panic)),
    };
    keep(&failure)
}

fn said(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    text.unwrap_or_else(|| "a panic without a message".to_owned())
}

#[cfg(test)]
mod tests {
    use std::ffi::CStr;
    use std::ptr;

    use super::*;
    use crate::status::{TroupeError, troupe_last_error};

    #[test]
    fn a_panic_becomes_the_last_error() {
        let status = entry(|| panic!("the {} is lost", "thread"));
        assert_eq!(status, TroupeStatus::Panic);
        let mut error = TroupeError {
            size: u32::try_from(size_of::<TroupeError>()).unwrap(),
            status: TroupeStatus::Ok,
            message: ptr::null(),
            field: ptr::null(),
            allowed: ptr::null(),
            reason: ptr::null(),
            request_id: ptr::null(),
        };
        assert_eq!(unsafe { troupe_last_error(&raw mut error) }, TroupeStatus::Ok);
        let message = unsafe { CStr::from_ptr(error.message) }.to_str().unwrap();
        assert!(message.contains("the thread is lost"), "{message}");
        assert_eq!(error.status, TroupeStatus::Panic);
    }

    #[test]
    fn a_closed_handle_is_an_error() {
        let failure = get::<Connection>(u64::MAX).err().unwrap();
        assert_eq!(failure.status(), TroupeStatus::Handle);
        assert!(remove::<Crowd>(0).is_err());
    }
}
