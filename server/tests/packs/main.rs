//! The server and its parts with a real pack: `models/human`, or the folder that the environment
//! variable TROUPE_TEST_PACK names. They need the ONNX Runtime library (`make runtime` fetches it).

#![allow(clippy::unwrap_used, reason = "these are tests, their helpers too")]

#[path = "../common/calls.rs"]
#[allow(dead_code, reason = "the tests over the wire use the rest")]
mod calls;
mod virtual_time;

mod engines;
mod live;
mod objects;
mod onnx;
mod performances;
mod program;
mod sessions;
mod walks;
mod words;

use std::path::{Path, PathBuf};

use troupe_engine::pack::MANIFEST_FILE;

/// The folder of the pack to test with.
fn pack_folder() -> PathBuf {
    let named = std::env::var_os("TROUPE_TEST_PACK").map(PathBuf::from);
    let folder = named.unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/human"));
    assert!(
        folder.join(MANIFEST_FILE).is_file(),
        "there is no pack in {}",
        folder.display()
    );
    folder
}
