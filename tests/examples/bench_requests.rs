//! Writes the requests of the benchmarks: in-betweens of a clip, each as a gRPC message for the
//! server, as JSON, and as a plain binary body for other servers of the same networks. The body
//! holds what the networks read, so that those servers need no code for segment frames and
//! features; `bench/troupe_bench/body.py` describes it.
//!
//! ```text
//! cargo run -p troupe-tests --example bench_requests -- PACK_FOLDER CLIP.bvh OUT_FOLDER LENGTHS COUNT
//! ```
//! LENGTHS are the frames of a segment, such as `64`, or two numbers such as `12-64` for lengths
//! between them in turn.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use prost::Message;
use serde_json::json;
use troupe_client::Key;
use troupe_engine::pack::Pack;
use troupe_motion::Clip;
use troupe_motion::bvh::{self, BvhOptions};
use troupe_motion::model::{Dims, GLOBAL_ROOT, LOCAL_ROOT, SIX_D};
use troupe_motion::model::{KeyTensors, KeyframeTask};
use troupe_proto::v1;
use troupe_server::inbetween::{RequestLimits, prepare};

/// First bytes of a body: its format and version.
const MAGIC: &[u8; 4] = b"TBQ1";
/// Bytes in front of an answer's arrays: magic, tokens and frames.
const ANSWER_HEADER: usize = 12;
/// The context frames in front of a gap.
const CONTEXT: usize = 4;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [pack, clip, out, lengths, count] = arguments.as_slice() else {
        bail!("usage: bench_requests PACK_FOLDER CLIP.bvh OUT_FOLDER LENGTHS COUNT");
    };
    let pack = Pack::load(Path::new(pack))?;
    let clip = read_clip(Path::new(clip), &pack)?;
    let (low, high) = match lengths.split_once('-') {
        Some((low, high)) => (low.parse()?, high.parse()?),
        None => (lengths.parse()?, lengths.parse()?),
    };
    let allowed = pack.rig.dims.min_frames()..=pack.rig.dims.max_frames();
    ensure!(
        low <= high && allowed.contains(&low) && allowed.contains(&high),
        "LENGTHS {lengths}: allowed are {} to {}",
        allowed.start(),
        allowed.end()
    );
    let count: usize = count.parse().context("COUNT is no number")?;

    let out = PathBuf::from(out);
    std::fs::create_dir_all(&out)?;
    let mut listed = Vec::with_capacity(count);
    for index in 0..count {
        // Steps of a prime go through all lengths and places in an order without pattern.
        let frames = low + index * 7 % (high - low + 1);
        let places = clip.frames() - frames + 1;
        let last_context = CONTEXT - 1 + index * 13 % places;
        listed.push(write_request(&pack, &clip, &out, index, last_context, frames)?);
    }
    let set = json!({"version": 1, "pack": pack.name(), "lengths": lengths, "requests": listed});
    std::fs::write(out.join("requests.json"), serde_json::to_vec_pretty(&set)?)?;
    println!("{count} requests of {lengths} frames in {}", out.display());
    Ok(())
}

fn read_clip(path: &Path, pack: &Pack) -> anyhow::Result<Clip> {
    let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
    Ok(bvh::parse_bytes(&bytes)?.to_clip_on(&pack.rig.skeleton, &BvhOptions::default())?)
}

/// Writes one request in its three forms and gives its entry in the list.
fn write_request(
    pack: &Pack,
    clip: &Clip,
    out: &Path,
    index: usize,
    last_context: usize,
    frames: usize,
) -> anyhow::Result<serde_json::Value> {
    let first = last_context + 1 - CONTEXT;
    let target = first + frames - 1;
    let key = |frame| Key::from_clip(clip, frame).map(|key| key.to_message());
    let character = v1::Character {
        id: format!("{index:03}"),
        context: (first..=last_context).map(key).collect::<Result<_, _>>()?,
        targets: vec![key(target)?],
        frame_count: Some(frames as u32),
        seed: index as u64,
        ..v1::Character::default()
    };
    let request = v1::InBetweenRequest {
        pack: String::new(),
        characters: vec![character],
    };
    let (items, _) = prepare(&request, &pack.rig, RequestLimits { max_characters: 1 })?;
    let item = items.first().context("no work item")?;

    let name = |ending: &str| format!("{index:03}.{ending}");
    std::fs::write(out.join(name("pb")), request.encode_to_vec())?;
    std::fs::write(out.join(name("json")), serde_json::to_vec(&request)?)?;
    std::fs::write(out.join(name("bin")), body(item, &pack.rig.dims))?;
    Ok(json!({
        "grpc": name("pb"),
        "json": name("json"),
        "body": name("bin"),
        "frames": frames,
        "answer_bytes": ANSWER_HEADER + 4 * frames * (pack.rig.dims.joints * SIX_D + GLOBAL_ROOT + pack.rig.dims.contacts),
    }))
}

/// The binary body: header, then one column after the other over context and targets. All numbers
/// are little-endian.
fn body(item: &KeyframeTask, dims: &Dims) -> Vec<u8> {
    let keys: Vec<&KeyTensors> = item.context.iter().chain(&item.targets).collect();
    let mut bytes = MAGIC.to_vec();
    let allowed = item
        .allowed_counts
        .iter()
        .enumerate()
        .fold(0_u32, |bits, (index, &may)| bits | u32::from(may) << index);
    for number in [
        item.frames.unwrap_or(0) as u32,
        item.targets.len() as u32,
        allowed,
    ] {
        bytes.extend(number.to_le_bytes());
    }
    let mut column = |width: usize, value: &dyn Fn(&KeyTensors) -> Option<Vec<f32>>| {
        for key in &keys {
            let row = value(key).unwrap_or_else(|| vec![0.0; width]);
            bytes.extend(row.into_iter().flat_map(f32::to_le_bytes));
        }
    };
    column(3, &|key| {
        let given = [
            key.local_root.is_some(),
            key.global_root.is_some(),
            key.pose.is_some(),
        ];
        Some(given.map(f32::from).to_vec())
    });
    column(LOCAL_ROOT, &|key| key.local_root.map(Vec::from));
    column(GLOBAL_ROOT, &|key| key.global_root.map(Vec::from));
    column(dims.pose(), &|key| key.pose.as_deref().map(Vec::from));
    bytes
}
