//! `troupe-eval requests` and `troupe-eval sample-request`: requests for in-betweens of a clip.
//!
//! The requests of the benchmarks come in three forms: a gRPC message, JSON, and a plain binary
//! body for other servers of the same networks. The body holds what the networks read, so that
//! those servers need no code for segment frames and features; `bench/troupe_bench/body.py`
//! describes it.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::{Context as _, ensure};
use clap::Args;
use prost::Message as _;
use serde_json::json;
use troupe_character::Path as FieldPath;
use troupe_cli::{Failure, Reading, read_clip_on};
use troupe_client::{CONTEXT_FRAMES, Key};
use troupe_engine::pack::Pack;
use troupe_motion::Clip;
use troupe_motion::model::{Dims, GLOBAL_ROOT, LOCAL_ROOT, SIX_D};
use troupe_motion::model::{KeyTensors, KeyframeTask};
use troupe_proto::v1;
use troupe_service::inbetween::{RequestLimits, prepare};

/// Make the requests of the benchmarks, which `troupe-loadtest --requests` sends.
#[derive(Debug, Args)]
pub(crate) struct RequestSet {
    #[command(flatten)]
    source: Source,
    /// Folder to write.
    out: PathBuf,
    /// Frames of a segment, such as 64. With two numbers, such as 12-64, lengths between them take
    /// turns.
    lengths: Lengths,
    /// Number of requests.
    count: usize,
}

/// Print a request as JSON: examples/request.json is one for examples/walk.bvh.
#[derive(Debug, Args)]
pub(crate) struct SampleRequest {
    #[command(flatten)]
    source: Source,
}

/// The motion of the requests.
#[derive(Debug, Args)]
struct Source {
    /// Folder of the pack.
    pack: PathBuf,
    /// BVH file, in centimetres.
    clip: PathBuf,
}

impl Source {
    fn read(&self) -> anyhow::Result<(Pack, Clip)> {
        let pack = Pack::load(&self.pack)?;
        let clip = read_clip_on(&self.clip, &pack.rig.skeleton, &Reading::default(), None);
        Ok((pack, clip.map_err(|why| Failure::file(&self.clip, why))?))
    }
}

/// Frames of a segment: the least and the most.
#[derive(Debug, Clone, Copy)]
struct Lengths(usize, usize);

impl FromStr for Lengths {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (low, high) = text.split_once('-').unwrap_or((text, text));
        let number = |text: &str| text.parse().map_err(|e| format!("{text:?}: {e}"));
        let (low, high) = (number(low)?, number(high)?);
        match low <= high {
            true => Ok(Self(low, high)),
            false => Err("allowed: a number, or two, the smaller first".to_owned()),
        }
    }
}

/// First bytes of a body: its format and version.
const MAGIC: &[u8; 4] = b"TBQ1";
/// Bytes before the arrays of an answer: magic, tokens and frames.
const ANSWER_HEADER: usize = 12;
/// Frames of the clip that the sample takes: the last context frame and the target keyframe.
const SAMPLE: (usize, usize) = (33, 64);

pub(crate) fn run(asked: &RequestSet) -> anyhow::Result<()> {
    let (pack, clip) = asked.source.read()?;
    let Lengths(low, high) = asked.lengths;
    let allowed = pack.rig.dims.min_frames()..=pack.rig.dims.max_frames().min(clip.frames());
    ensure!(
        allowed.contains(&low) && allowed.contains(&high),
        "lengths {low} to {high}; allowed: {} to {}",
        allowed.start(),
        allowed.end()
    );
    std::fs::create_dir_all(&asked.out)?;
    let mut listed = Vec::with_capacity(asked.count);
    for index in 0..asked.count {
        // Steps of a prime go through all lengths and places in an order without pattern.
        let frames = low + index * 7 % (high - low + 1);
        let places = clip.frames() - frames + 1;
        let last_context = CONTEXT_FRAMES - 1 + index * 13 % places;
        listed.push(write_request(
            &pack,
            &clip,
            &asked.out,
            index,
            last_context,
            frames,
        )?);
    }
    let lengths = if low == high {
        low.to_string()
    } else {
        format!("{low}-{high}")
    };
    let set = json!({"version": 1, "pack": pack.name(), "lengths": lengths, "requests": listed});
    std::fs::write(asked.out.join("requests.json"), serde_json::to_vec_pretty(&set)?)?;
    println!(
        "{} requests of {lengths} frames in {}",
        asked.count,
        asked.out.display()
    );
    Ok(())
}

pub(crate) fn print_sample(asked: &SampleRequest) -> anyhow::Result<()> {
    let (_, clip) = asked.source.read()?;
    let (last_context, target) = SAMPLE;
    let first = last_context + 1 - CONTEXT_FRAMES;
    let request = json!({
        "characters": [{
            "id": "example",
            "context": context(&clip, last_context)?,
            "targets": [Key::from_clip(&clip, target)?.to_message()],
            "frame_count": target - first + 1,
            "seed": 7,
        }]
    });
    println!("{request}");
    Ok(())
}

/// The context frames of which this is the last.
fn context(clip: &Clip, last: usize) -> anyhow::Result<Vec<v1::Keyframe>> {
    let frames = last + 1 - CONTEXT_FRAMES..=last;
    let keys = frames.map(|frame| Ok(Key::from_clip(clip, frame)?.to_message()));
    keys.collect()
}

/// Writes one request in its three forms, and gives its entry in the list.
fn write_request(
    pack: &Pack,
    clip: &Clip,
    out: &Path,
    index: usize,
    last_context: usize,
    frames: usize,
) -> anyhow::Result<serde_json::Value> {
    let target = last_context - CONTEXT_FRAMES + frames;
    let character = v1::Character {
        id: format!("{index:03}"),
        context: context(clip, last_context)?,
        targets: vec![Key::from_clip(clip, target)?.to_message()],
        frame_count: Some(frames as u32),
        seed: index as u64,
        ..v1::Character::default()
    };
    let request = v1::InBetweenRequest {
        pack: String::new(),
        characters: vec![character],
        skeleton: String::new(),
    };
    let limits = RequestLimits { max_characters: 1 };
    let (items, _) = prepare(&FieldPath::root(), &request, &pack.rig, limits)?;
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

/// The binary body: a header, then one column after the other over context and targets. All numbers
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
