//! Measures how takes of a walk differ, for the characters of a crowd: `cargo run -p troupe-motion
//! --example list_takes -- PACK.toml FOLDER [LIST-OF-CLIPS-TO-LEAVE-OUT] > models/PACK/takes.json`.
//!
//! It reads takes named `SET_walk_STYLE_NUMBER` whose set has at least three of the style. For each
//! it gives the mean turn of the joints above the legs relative to the mean of these takes, and the
//! cadence of its steps for its speed.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use troupe_motion::bvh::{BvhOptions, parse_bytes};
use troupe_motion::gait::{ClosedCycle, CycleOptions, find_cycles};
use troupe_motion::rotation::align_sign;
use troupe_motion::{Clip, Quat, Skeleton};

/// Steps a second grow with this power of the speed.
const RATE_POWER: f32 = 0.3;
/// Fewest takes for a mean.
const FEWEST: usize = 3;

#[derive(Deserialize)]
struct Manifest {
    skeleton: Skeleton,
}

#[derive(Serialize)]
struct Listed {
    joints: Vec<String>,
    takes: Vec<Row>,
}

#[derive(Serialize)]
struct Row {
    clip: String,
    style: String,
    cadence: f32,
    turns: Vec<[f32; 3]>,
}

struct Take {
    clip: String,
    mean: Vec<Quat>,
    cadence: f32,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [pack, folder, without @ ..] = &arguments[..] else {
        return Err("usage: list_takes PACK.toml FOLDER [LIST-OF-CLIPS-TO-LEAVE-OUT]".into());
    };
    let manifest: Manifest = toml::from_str(&std::fs::read_to_string(pack)?)?;
    let skeleton = Arc::new(manifest.skeleton);
    let left_out = without.first().map(std::fs::read_to_string).transpose()?;
    let left_out = left_out.unwrap_or_default();
    let mut paths: Vec<_> = std::fs::read_dir(folder)?
        .map(|entry| entry.map(|entry| entry.path()))
        .collect::<Result<_, _>>()?;
    paths.sort();
    let mut styles: BTreeMap<(String, String), Vec<Take>> = BTreeMap::new();
    for path in paths {
        let name = path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let Some((set, of)) = name.split_once("_walk_") else {
            continue;
        };
        let style = of.rsplit_once('_').map_or(of, |(style, _)| style);
        // Each set has its own performers.
        let of_set = (set.to_owned(), style.to_owned());
        let kept = left_out.lines().all(|line| line.trim_end_matches(".bvh") != name);
        if kept && let Some(take) = read(&path, &name, &skeleton)? {
            styles.entry(of_set).or_default().push(take);
        }
    }
    let above = above_the_legs(&skeleton);
    let mut rows = Vec::new();
    for ((_, style), takes) in styles.iter().filter(|(_, takes)| takes.len() >= FEWEST) {
        rows.extend(rows_of(style, takes, &above));
    }
    let joints = above.iter().map(|&joint| skeleton.joints[joint].name.clone());
    let listed = Listed {
        joints: joints.collect(),
        takes: rows,
    };
    println!("{}", serde_json::to_string(&listed)?.replace("},{", "},\n{"));
    Ok(())
}

/// The takes of a style relative to their mean.
fn rows_of(style: &str, takes: &[Take], joints: &[usize]) -> Vec<Row> {
    let cadence = takes.iter().map(|take| take.cadence).sum::<f32>() / takes.len() as f32;
    let of = |joint: usize| mean(takes.iter().map(|take| take.mean[joint]));
    let means: Vec<Quat> = joints.iter().map(|&joint| of(joint)).collect();
    let row = |take: &Take| Row {
        clip: take.clip.clone(),
        style: style.to_owned(),
        cadence: rounded(take.cadence / cadence),
        turns: joints
            .iter()
            .zip(&means)
            .map(|(&joint, &mean)| turn(take.mean[joint], mean))
            .collect(),
    };
    takes.iter().map(row).collect()
}

/// A take's steadiest cycle; none if it has no cycle.
fn read(path: &Path, name: &str, skeleton: &Arc<Skeleton>) -> Result<Option<Take>, Box<dyn Error>> {
    let clip: Clip = parse_bytes(&std::fs::read(path)?)?.to_clip_on(skeleton, &BvhOptions::default())?;
    let Ok(cycles) = find_cycles(&clip, &CycleOptions::default()) else {
        return Ok(None);
    };
    let closed = ClosedCycle::new(&clip, &cycles[0]);
    let poses: Vec<Vec<Quat>> = (0..closed.frames())
        .map(|frame| closed.at(frame as f32).1)
        .collect();
    let joints = 0..skeleton.joint_count();
    Ok(Some(Take {
        clip: name.to_owned(),
        mean: joints
            .map(|joint| mean(poses.iter().map(|pose| pose[joint])))
            .collect(),
        cadence: clip.fps / closed.frames() as f32 / cycles[0].speed_mps().powf(RATE_POWER),
    }))
}

fn mean(rotations: impl Iterator<Item = Quat>) -> Quat {
    let mut first = None;
    let sum = rotations.fold(Quat::from_xyzw(0.0, 0.0, 0.0, 0.0), |sum, q| {
        sum + align_sign(q, *first.get_or_insert(q))
    });
    sum.normalize()
}

/// The turn from a mean to a take, in the parent's frame of reference.
fn turn(take: Quat, mean: Quat) -> [f32; 3] {
    let turn = align_sign(take * mean.conjugate(), Quat::IDENTITY);
    turn.to_scaled_axis().to_array().map(rounded)
}

fn rounded(value: f32) -> f32 {
    (value * 1e4).round() / 1e4
}

/// All joints but the pelvis and the ancestors of contact joints.
fn above_the_legs(skeleton: &Skeleton) -> Vec<usize> {
    let contacts = skeleton.contacts.iter().flat_map(|contacts| &contacts.joints);
    let mut legs = vec![false; skeleton.joint_count()];
    for &joint in contacts {
        for at in std::iter::successors(Some(joint), |&at| skeleton.joints[at].parent) {
            legs[at] = true;
        }
    }
    (1..skeleton.joint_count())
        .filter(|&joint| !legs[joint])
        .collect()
}
