//! How soon live characters start, how they turn and stop, how they go aside, and how the walkers
//! of a crowd differ, beside the clips: real networks, no server.
//!
//! ```text
//! ORT_DYLIB_PATH=.runtime/libonnxruntime.so cargo run --release -p troupe-character --example starts_and_turns -- starts
//! ORT_DYLIB_PATH=.runtime/libonnxruntime.so cargo run --release -p troupe-character --example starts_and_turns -- turns
//! ORT_DYLIB_PATH=.runtime/libonnxruntime.so cargo run --release -p troupe-character --example starts_and_turns -- sides
//! ORT_DYLIB_PATH=.runtime/libonnxruntime.so cargo run --release -p troupe-character --example starts_and_turns -- crowd
//! ```

mod clips;
mod crowd;
mod sides;
mod stage;
mod starts;
mod turns;

use std::path::PathBuf;

use clap::{Parser, ValueEnum};

use self::clips::Clips;
use self::stage::Stage;

/// Measures starts, turns or steps aside.
#[derive(Debug, Parser)]
struct Args {
    /// What to measure.
    what: What,
    /// Folder of the pack.
    #[arg(long, default_value = "models/human", value_name = "FOLDER")]
    pack: PathBuf,
    /// Folder of the clips; without them only the characters are measured.
    #[arg(long, value_name = "FOLDER")]
    data: Option<PathBuf>,
    /// Lists of clips to measure against; all of the folder without one.
    #[arg(long, value_name = "FILE,..", value_delimiter = ',')]
    lists: Vec<PathBuf>,
    /// Styles; without it every style of the pack that walks.
    #[arg(long, value_name = "STYLE,..", value_delimiter = ',')]
    styles: Vec<String>,
    /// Frames from a command to its plan's first frame, at most.
    #[arg(long, default_value_t = 4, value_name = "FRAMES")]
    look_ahead: u32,
    /// Seeds of a crowd: those from 1 on.
    #[arg(long, default_value_t = 8)]
    seeds: u64,
    /// Seed of all characters.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Also each run's figures.
    #[arg(long)]
    each: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum What {
    /// From a command to go until a quarter of its speed.
    Starts,
    /// Turns, and stops of runs.
    Turns,
    /// Goes aside and backwards, facing ahead.
    Sides,
    /// Walks by several seeds.
    Crowd,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let mut stage = Stage::load(&args)?;
    let clips = match &args.data {
        Some(folder) => Some(Clips::list(folder, &args.lists, stage.skeleton())?),
        None => None,
    };
    match args.what {
        What::Starts => starts::run(&mut stage, clips.as_ref(), args.each),
        What::Turns => turns::run(&mut stage, clips.as_ref(), args.each),
        What::Crowd => crowd::run(&mut stage, clips.as_ref(), &args),
        What::Sides => sides::run(&mut stage, clips.as_ref(), &args),
    }
}

/// The value below which a share of `values` lies; NaN of none.
fn percentile(values: &[f64], share: f64) -> f64 {
    troupe_motion::metrics::percentile(values.to_vec(), share).unwrap_or(f64::NAN)
}
