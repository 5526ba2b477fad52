//! Real motion capture, if it is present: the BVH files below the folder that TROUPE_DATA names,
//! otherwise below `target/data/bandai-namco`, where `make test` unpacks them. Without them, a test
//! says so and passes; the small motions of the unit tests remain.

#![allow(clippy::unwrap_used, reason = "these are tests, their helpers too")]

mod clips;
mod gaits;
mod ik;

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Deserialize;
use troupe_motion::bvh::{self, BvhOptions};
use troupe_motion::{Clip, Skeleton};

/// A file or folder of the repository.
fn in_repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

/// The folder of clips: `asked`, otherwise the one that `make test` fills.
fn folder_or_default(asked: Option<OsString>) -> PathBuf {
    asked.map_or_else(|| in_repository("target/data/bandai-namco"), PathBuf::from)
}

/// The folder of clips.
fn data_folder() -> PathBuf {
    folder_or_default(std::env::var_os("TROUPE_DATA"))
}

/// The default pack's skeleton.
fn skeleton() -> Arc<Skeleton> {
    #[derive(Deserialize)]
    struct Manifest {
        skeleton: Skeleton,
    }
    let text = std::fs::read_to_string(in_repository("models/human/pack.toml")).unwrap();
    Arc::new(toml::from_str::<Manifest>(&text).unwrap().skeleton)
}

/// A BVH file on that skeleton, if it is present.
fn read(path: &Path) -> Option<Clip> {
    let text = std::fs::read_to_string(path).ok()?;
    let file = bvh::parse(&text).unwrap();
    Some(file.to_clip_on(&skeleton(), &BvhOptions::default()).unwrap())
}
