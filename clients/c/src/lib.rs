//! A C interface to the client of the Troupe motion server. `include/troupe.h` is its header, and
//! says how to use it; cbindgen makes it from this crate.
//!
//! Handles are numbers, so that a wrong or closed one is an error and no crash. Structures begin
//! with their size, so that header and library may be of different versions ([`sized`]). Each call
//! runs in [`handles::entry`], where panics end. Each crowd's frames go through buffers that are
//! filled again and again ([`crowd`]).

#![allow(unsafe_code, reason = "C gives addresses")]

mod connection;
mod crowd;
mod handles;
mod pack;
mod sized;
mod status;

use std::ffi::c_char;

pub use connection::*;
pub use crowd::*;
pub use pack::*;
pub use status::*;

/// Version of this interface. Functions and fields are added with the same version. Any other
/// change gives another version.
pub const TROUPE_ABI_VERSION: u32 = 1;

/// The `TROUPE_ABI_VERSION` of the library. Compare it with that of the header before all else.
#[unsafe(no_mangle)]
pub extern "C" fn troupe_abi_version() -> u32 {
    TROUPE_ABI_VERSION
}

/// The version of the library, such as `0.1.0`. The text holds for ever.
#[unsafe(no_mangle)]
pub extern "C" fn troupe_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}
