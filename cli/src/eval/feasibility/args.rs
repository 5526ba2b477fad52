//! Arguments of `troupe eval feasibility`.

use std::path::PathBuf;

use clap::Args;

use crate::files::Scale;
use crate::values::positive;

/// Measure how well answers tell what is not feasible.
///
/// Windows are cut from clips and filled, as `troupe eval` does it: few of these answers may say
/// that they are not feasible. Then the same windows are asked for what nobody can do, in several
/// kinds: a target far away, a body on its head or under the ground, targets that contradict one
/// another, and more. Nearly all of those answers must say so.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe eval feasibility --data clips/ --split training/splits/bandai-namco-test.txt
  troupe eval feasibility --pack g1 --data robot-clips/ --split training/splits/lafan1-test.txt --json feasibility.json")]
pub(crate) struct FeasibilityEval {
    /// Folder of clips: .bvh, .glb or .npz, or .csv for a robot.
    #[arg(long, value_name = "DIR")]
    pub(super) data: PathBuf,

    /// File with the names of the clips to use, one a line; without it every clip of the folder.
    #[arg(long, value_name = "FILE")]
    pub(super) split: Option<PathBuf>,

    /// Frames between the last context frame and the target keyframe of real windows.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "8,15,30,45",
        value_name = "FRAMES,..."
    )]
    pub(super) gaps: Vec<usize>,

    /// Frames from the start of one window to the start of the next.
    #[arg(long, default_value_t = 30, value_name = "FRAMES", value_parser = positive)]
    pub(super) stride: usize,

    /// Most real windows for each gap, and most requests of each kind, spread evenly over all
    /// windows.
    #[arg(long, value_name = "N", value_parser = positive)]
    pub(super) max_windows: Option<usize>,

    /// Requests in flight at the same time.
    #[arg(long, default_value_t = 32, value_name = "N", value_parser = positive)]
    pub(super) concurrency: usize,

    /// Seed of all requests, and of what is random about impossible ones.
    #[arg(long, default_value_t = 0)]
    pub(super) seed: u64,

    /// Also write everything as JSON.
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,

    /// Model pack; without it the server's default.
    #[arg(long, default_value = "", hide_default_value = true, value_name = "NAME")]
    pub(super) pack: String,

    #[command(flatten)]
    pub(super) scale: Scale,
}
