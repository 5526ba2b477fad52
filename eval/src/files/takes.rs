//! `troupe-eval takes`: how the takes of a walk differ from each other, for the walkers of a crowd.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use troupe_engine::pack::Pack;
use troupe_motion::clip::Clip;
use troupe_motion::gait::{ClosedCycle, CycleOptions, find_cycles};
use troupe_motion::rotation::align_sign;
use troupe_motion::{Quat, Skeleton};

use crate::clips::{BvhFolder, clip_names};

/// Steps a second grow with this power of the speed.
const RATE_POWER: f32 = 0.3;
/// Fewest takes of a style in a set.
const FEWEST: usize = 3;

/// List how the takes of a walk differ from each other, for models/PACK/takes.json.
///
/// A take is a clip named SET_walk_STYLE_NUMBER. Takes count if the set has at least three of their
/// style. The list has how the joints above the legs are turned on average against the mean of
/// these takes, and how quick the steps are for their speed.
#[derive(Debug, Args)]
pub(crate) struct Takes {
    /// Folder of the pack.
    pack: PathBuf,
    /// Folder of BVH files.
    data: PathBuf,
    /// List of clips to leave out, such as the test split.
    #[arg(long, value_name = "FILE")]
    without: Option<PathBuf>,
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

pub(crate) fn run(asked: &Takes) -> anyhow::Result<()> {
    let skeleton = Pack::load(&asked.pack)?.rig.skeleton.clone();
    let left_out = match &asked.without {
        Some(list) => clip_names(&asked.data, Some(list))?,
        None => Vec::new(),
    };
    let folder = BvhFolder::list(&asked.data, None, skeleton.clone())?;
    let is_take = |name: &str| name.contains("_walk_") && left_out.iter().all(|other| other != name);
    // By set too, because each set has its own performers.
    let mut styles: BTreeMap<(String, String), Vec<Take>> = BTreeMap::new();
    for clip in folder.read(is_take) {
        let (name, clip) = clip?;
        let Some((set, of)) = name.split_once("_walk_") else {
            continue;
        };
        let style = of.rsplit_once('_').map_or(of, |(style, _)| style);
        if let Some(take) = take(name, &clip) {
            let of_set = (set.to_owned(), style.to_owned());
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

/// How the takes of a style differ from their mean.
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

/// The steadiest cycle of a take, if it has any.
fn take(name: &str, clip: &Clip) -> Option<Take> {
    let cycles = find_cycles(clip, &CycleOptions::default()).ok()?;
    let closed = ClosedCycle::new(clip, &cycles[0]);
    let poses: Vec<Vec<Quat>> = (0..closed.frames())
        .map(|frame| closed.at(frame as f32).1)
        .collect();
    let joints = 0..clip.skeleton.joint_count();
    Some(Take {
        clip: name.to_owned(),
        mean: joints
            .map(|joint| mean(poses.iter().map(|pose| pose[joint])))
            .collect(),
        cadence: clip.fps / closed.frames() as f32 / cycles[0].speed_mps().powf(RATE_POWER),
    })
}

fn mean(rotations: impl Iterator<Item = Quat>) -> Quat {
    let mut first = None;
    let sum = rotations.fold(Quat::from_xyzw(0.0, 0.0, 0.0, 0.0), |sum, q| {
        sum + align_sign(q, *first.get_or_insert(q))
    });
    sum.normalize()
}

/// The rotation from a mean to a take in the frame of the parent joint, as a rotation vector.
fn turn(take: Quat, mean: Quat) -> [f32; 3] {
    let turn = align_sign(take * mean.conjugate(), Quat::IDENTITY);
    turn.to_scaled_axis().to_array().map(rounded)
}

fn rounded(value: f32) -> f32 {
    (value * 1e4).round() / 1e4
}

/// All joints except the pelvis and those between it and a contact joint.
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
