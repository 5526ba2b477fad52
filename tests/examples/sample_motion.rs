//! Writes the files in `examples/`: the synthetic walk as BVH on a pack's skeleton, and a request made of it as JSON.
//!
//! ```text
//! cargo run -p troupe-tests --example sample_motion -- models/human examples
//! ```

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Context;
use serde::Deserialize;
use serde_json::json;
use troupe_client::Key;
use troupe_motion::bvh::{BvhFile, BvhWriteOptions, write};
use troupe_motion::skeleton::Skeleton;
use troupe_tests::walk::Walk;

/// Frames of the walk.
const FRAMES: usize = 120;
/// The request's context is `CONTEXT - 3 ..= CONTEXT`.
const CONTEXT: usize = 33;
/// The request's target keyframe.
const TARGET: usize = 64;

#[derive(Deserialize)]
struct Manifest {
    skeleton: Skeleton,
}

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let (pack, out) = (arguments.next(), arguments.next());
    let (pack, out) = pack
        .zip(out)
        .context("usage: sample_motion PACK_FOLDER OUT_FOLDER")?;

    let manifest = std::fs::read_to_string(pack.join("pack.toml")).context("reading pack.toml")?;
    let skeleton = Arc::new(toml::from_str::<Manifest>(&manifest)?.skeleton);
    let walk = Walk {
        frames: FRAMES,
        turn_rps: 0.4,
        ..Walk::default()
    };
    let clip = walk.on(&skeleton);
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
    let file = BvhFile::from_clip(&clip, &BvhWriteOptions::default())?;
    std::fs::write(out.join("walk.bvh"), write(&file))?;
    std::fs::write(out.join("request.json"), format!("{request}\n"))?;
    Ok(())
}
