//! Keeps threads out of OpenVINO while the process exits.
//!
//! At exit, the destructors of the C++ libraries free compiled kernels. A thread that runs one then
//! crashes, and the process ends with a signal. So every call into OpenVINO holds a read lock. A
//! handler that runs before those destructors takes the write lock and keeps it: it waits for calls
//! under way, and no other begins.

use std::ops::{Deref, DerefMut};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{PoisonError, RwLock, RwLockReadGuard};

static CALLS: RwLock<()> = RwLock::new(());

/// The lock to hold during a call into OpenVINO. A thread must not take it twice: it could wait for
/// itself at exit.
pub(super) fn enter() -> RwLockReadGuard<'static, ()> {
    CALLS.read().unwrap_or_else(PoisonError::into_inner)
}

/// Registers the handler. Handlers and destructors run in the reverse order of their registration,
/// and libraries create objects when they first run. So call this once a network of a new shape has
/// run.
pub(super) fn register() {
    #[allow(unsafe_code, reason = "the standard library has no exit handlers")]
    // SAFETY: the handler does not unwind.
    let failed = unsafe { libc::atexit(close) };
    if failed != 0 {
        tracing::warn!("no exit handler: the process may crash at its exit");
    }
}

extern "C" fn close() {
    static CLOSED: AtomicBool = AtomicBool::new(false);
    if !CLOSED.swap(true, Ordering::Relaxed) {
        std::mem::forget(CALLS.write().unwrap_or_else(PoisonError::into_inner));
    }
}

/// A value of OpenVINO. Dropping it is a call, too.
pub(super) struct Owned<T>(Option<T>);

impl<T> Owned<T> {
    pub(super) fn new(value: T) -> Self {
        Self(Some(value))
    }
}

impl<T> Deref for Owned<T> {
    type Target = T;

    #[allow(clippy::expect_used, reason = "it is there until it is dropped")]
    fn deref(&self) -> &T {
        self.0.as_ref().expect("the value is there until it is dropped")
    }
}

impl<T> DerefMut for Owned<T> {
    #[allow(clippy::expect_used, reason = "it is there until it is dropped")]
    fn deref_mut(&mut self) -> &mut T {
        self.0.as_mut().expect("the value is there until it is dropped")
    }
}

impl<T> Drop for Owned<T> {
    fn drop(&mut self) {
        let _call = enter();
        self.0 = None;
    }
}
