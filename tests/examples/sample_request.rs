//! Prints a request as JSON: a gap in a BVH clip on a pack's skeleton, such as
//! `examples/request.json` of `examples/walk.bvh`.
//!
//! ```text
//! cargo run -p troupe-tests --example sample_request -- models/human examples/walk.bvh > examples/request.json
//! ```

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context, bail};
use serde::Deserialize;
use serde_json::json;
use troupe_client::Key;
use troupe_motion::bvh::{self, BvhOptions};
use troupe_motion::skeleton::Skeleton;

/// The request's context is `CONTEXT - 3 ..= CONTEXT`.
const CONTEXT: usize = 33;
/// The request's target keyframe.
const TARGET: usize = 64;

#[derive(Deserialize)]
struct Manifest {
    skeleton: Skeleton,
}

fn main() -> anyhow::Result<()> {
    let arguments: Vec<_> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [pack, clip] = arguments.as_slice() else {
        bail!("usage: sample_request PACK_FOLDER CLIP.bvh");
    };
    let manifest = std::fs::read_to_string(pack.join("pack.toml")).context("reading pack.toml")?;
    let skeleton = Arc::new(toml::from_str::<Manifest>(&manifest)?.skeleton);
    let bytes = std::fs::read(clip).with_context(|| clip.display().to_string())?;
    let clip = bvh::parse_bytes(&bytes)?.to_clip_on(&skeleton, &BvhOptions::default())?;

    let key = |frame| Key::from_clip(&clip, frame).map(|key| key.to_message());
    let context = (CONTEXT - 3..=CONTEXT).map(key).collect::<Result<Vec<_>, _>>()?;
    let request = json!({
        "characters": [{
            "id": "example",
            "context": context,
            "targets": [key(TARGET)?],
            "frame_count": TARGET - CONTEXT + 4,
            "seed": 7,
        }]
    });
    println!("{request}");
    Ok(())
}
