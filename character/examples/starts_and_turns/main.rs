//! Compares live characters with clips: how soon they start, how they turn, stop and walk sideways,
//! and how the walks of a crowd differ. With real networks, without a server.
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
mod simulation;
mod starts;
mod turns;

use std::path::PathBuf;

use clap::{Parser, ValueEnum};

use self::clips::Clips;
use self::simulation::Simulation;

/// Measures starts, turns, steps aside, or the walks of a crowd.
#[derive(Debug, Parser)]
struct Args {
    /// What to measure.
    what: What,
    /// Folder of the pack.
    #[arg(long, default_value = "models/human", value_name = "FOLDER")]
    pack: PathBuf,
    /// Folder of the clips. Without it only the characters are measured.
    #[arg(long, value_name = "FOLDER")]
    data: Option<PathBuf>,
    /// Lists of the clips to compare with, one name a line. Without one: all clips of the folder.
    #[arg(long, value_name = "FILE,..", value_delimiter = ',')]
    lists: Vec<PathBuf>,
    /// Styles. Without one: every style of the pack that walks.
    #[arg(long, value_name = "STYLE,..", value_delimiter = ',')]
    styles: Vec<String>,
    /// Most frames from a command to the first frame of its plan.
    #[arg(long, default_value_t = 4, value_name = "FRAMES")]
    look_ahead: u32,
    /// Size of a crowd: its seeds count from 1.
    #[arg(long, default_value_t = 8)]
    seeds: u64,
    /// Seed of all characters.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Print the figures of each run too.
    #[arg(long)]
    each: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum What {
    /// Time from a command to a quarter of its speed.
    Starts,
    /// Turns, and stops from a run.
    Turns,
    /// Steps aside and backwards, facing ahead.
    Sides,
    /// One walk by several seeds.
    Crowd,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let mut simulation = Simulation::load(&args)?;
    let clips = match &args.data {
        Some(folder) => Some(Clips::list(folder, &args.lists, simulation.skeleton())?),
        None => None,
    };
    match args.what {
        What::Starts => starts::run(&mut simulation, clips.as_ref(), args.each),
        What::Turns => turns::run(&mut simulation, clips.as_ref(), args.each),
        What::Crowd => crowd::run(&mut simulation, clips.as_ref(), &args),
        What::Sides => sides::run(&mut simulation, clips.as_ref(), &args),
    }
}

/// The value below which this share of `values` lies; NaN without values.
fn percentile(values: &[f64], share: f64) -> f64 {
    troupe_motion::metrics::percentile(values.to_vec(), share).unwrap_or(f64::NAN)
}
