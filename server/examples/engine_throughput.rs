//! How many plans a second the engine makes of a pack on this machine, by batch size and segment length, and where the
//! time goes: the networks alone, without requests around them.
//!
//! ```text
//! cargo run --release -p troupe-server --example engine_throughput -- [PACK_FOLDER [SECONDS_A_ROW]]
//! ```

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::Context;
use troupe_server::config::Config;
use troupe_server::engine::onnx::{OnnxStages, Runtime};
use troupe_server::engine::{KeyTensors, Pipeline, StageTimes, WorkItem};
use troupe_server::pack::{Dims, Pack};

const BATCHES: [usize; 5] = [1, 8, 16, 32, 64];

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args_os().skip(1);
    let folder = arguments
        .next()
        .map_or_else(|| PathBuf::from("models/human"), PathBuf::from);
    let seconds = match arguments.next() {
        Some(text) => text
            .to_string_lossy()
            .parse()
            .context("seconds a row is no number")?,
        None => 2.0,
    };

    let config = Config::local(Path::new("."))?;
    let pack = Pack::load(&folder)?;
    let dims = pack.dims;
    let stages = OnnxStages::load(&Runtime::new(&config.runtime_options())?, &pack)?;
    let mut pipeline = Pipeline::new(dims, Box::new(stages), BATCHES[BATCHES.len() - 1]);
    let started = Instant::now();
    pipeline.warm_up()?;
    println!("warm-up {:.2} s", started.elapsed().as_secs_f32());

    // A live session plans about a second ahead; the second column is the longest segment, the third a mix of all.
    let usual = 34.clamp(dims.min_frames(), dims.max_frames());
    let longest = dims.max_frames();
    for (name, lengths) in [
        (format!("{usual} frames"), vec![usual]),
        (format!("{longest} frames"), vec![longest]),
        (
            "mixed lengths".to_owned(),
            (dims.min_frames()..=longest).collect(),
        ),
    ] {
        println!("{name:>14}   plans/s   ms/batch   root %  pose %  decoder %");
        for batch in BATCHES {
            let items: Vec<WorkItem> = (0..batch)
                .map(|index| walk(&dims, lengths[index * 7 % lengths.len()]))
                .collect();
            measure(&mut pipeline, &items, Duration::from_secs_f32(seconds))?;
        }
    }
    Ok(())
}

/// Runs batches of `items` for `time`, and prints a row of the table.
fn measure(pipeline: &mut Pipeline, items: &[WorkItem], time: Duration) -> anyhow::Result<()> {
    let (mut batches, mut sum) = (0, StageTimes::default());
    let started = Instant::now();
    while started.elapsed() < time {
        let (answers, times) = pipeline.run(items)?;
        for answer in answers {
            answer?;
        }
        batches += 1;
        sum.root += times.root;
        sum.pose += times.pose;
        sum.decoder += times.decoder;
    }
    let took = started.elapsed().as_secs_f64();
    let share = |stage: Duration| 100.0 * stage.as_secs_f64() / took;
    println!(
        "    batch {:>4} {:>9.1} {:>10.2} {:>8.1} {:>7.1} {:>10.1}",
        items.len(),
        f64::from(batches) * items.len() as f64 / took,
        1000.0 * took / f64::from(batches),
        share(sum.root),
        share(sum.pose),
        share(sum.decoder),
    );
    Ok(())
}

/// A straight walk of `frames` frames towards one target, with a neutral pose at each keyframe.
fn walk(dims: &Dims, frames: usize) -> WorkItem {
    const SPEED_MPS: f32 = 1.2;
    let tokens = dims.tokens_for(frames);
    let key = |frame: usize| {
        let z = SPEED_MPS * (frame as f32 - (dims.context_frames as f32 - 1.0)) / 30.0;
        KeyTensors {
            local_root: Some([0.0, SPEED_MPS, 0.0, 0.9]),
            global_root: Some([0.0, 0.9, z, 1.0, 0.0]),
            pose: Some(vec![0.1; dims.pose()].into()),
        }
    };
    WorkItem {
        context: (0..dims.context_frames).map(key).collect(),
        targets: vec![key(frames - 1)],
        frames: Some(frames),
        allowed_counts: (dims.min_tokens..=dims.max_tokens)
            .map(|count| count == tokens)
            .collect(),
        seed: 1,
        temperature: 0.0,
        pose_steps: 1,
        root_guide: None,
        gap_poses: Vec::new(),
    }
}
