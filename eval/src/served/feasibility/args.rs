//! Arguments of `troupe-eval feasibility`.

use std::path::PathBuf;

use clap::Args;

use crate::served::windows::WindowArgs;

/// Measure how often answers are right about what is feasible.
///
/// Windows are cut from clips and filled, as `troupe-eval gaps` does it: few of these answers may
/// say that they are not feasible. Then the same windows get requests that no body can fulfil, of
/// several kinds: a target far away, a body on its head or under the ground, targets that
/// contradict one another, and more. Nearly all of those answers must say that they are not
/// feasible.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe-eval feasibility --data clips/ --split training/splits/bandai-namco-test.txt
  troupe-eval feasibility --pack g1 --data robot-clips/ --split training/splits/lafan1-test.txt --json feasibility.json")]
pub(crate) struct FeasibilityEval {
    /// Frames between the last context frame and the target keyframe of real windows.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "8,15,30,45",
        value_name = "FRAMES,..."
    )]
    pub(super) gaps: Vec<usize>,

    /// Seed of all requests, and of the random parts of impossible ones.
    #[arg(long, default_value_t = 0)]
    pub(super) seed: u64,

    /// Also write everything as JSON.
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,

    /// Model pack. Default: the server's default pack.
    #[arg(long, default_value = "", hide_default_value = true, value_name = "NAME")]
    pub(super) pack: String,

    #[command(flatten)]
    pub(super) windows: WindowArgs,
}
