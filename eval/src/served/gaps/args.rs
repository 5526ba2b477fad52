//! Arguments of `troupe-eval gaps`.

use std::path::PathBuf;

use clap::Args;
use troupe_cli::{Sampling, positive};

use crate::served::windows::WindowArgs;

/// Measure how a pack fills gaps in held-out clips, beside ground truth and interpolation.
///
/// Every clip of the split is cut into windows: four context frames, the gap, and one target
/// keyframe with full pose and root. The server fills the gap, and so does interpolation (linear
/// root, slerp of joint rotations). Diversity comes from some windows that are filled with several
/// seeds at temperature 1. FID, MMD and latent diversity are measured in the latent space of a
/// motion autoencoder, the `evaluator.onnx` that `troupe-train evaluator` makes. Each figure comes
/// with a 95 % interval.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe-eval gaps --data clips/
  troupe-eval gaps --data clips/ --split training/splits/bandai-namco-test.txt --json eval.json
  troupe-eval gaps --data clips/ --gaps 30 --stride 60 --max-windows 200 --seed 1
  troupe-eval gaps --data clips/ --evaluator models/human/evaluator.onnx --seeds 0")]
pub(crate) struct GapEval {
    /// Frames between the last context frame and the target keyframe.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "15,30,45",
        value_name = "FRAMES,..."
    )]
    pub(crate) gaps: Vec<usize>,

    /// Motion autoencoder to measure FID, MMD and latent diversity with: a file, or a pack's folder
    /// with evaluator.onnx in it. Default: that of models/PACK, if it exists.
    #[arg(long, value_name = "FILE")]
    pub(crate) evaluator: Option<PathBuf>,

    /// Takes of a window that diversity is measured over. Below 2 it is not measured.
    #[arg(long, default_value_t = 20, value_name = "N", value_parser = clap::value_parser!(u32).range(..=1000))]
    pub(crate) seeds: u32,

    /// Windows of each gap that diversity is measured on, spread evenly over all.
    #[arg(long, default_value_t = 100, value_name = "N", value_parser = positive)]
    pub(crate) diversity_windows: usize,

    /// Move the root of the pack's motion in the middle of the gap by this distance to the left of
    /// the character (a root override), and measure the motion that comes back. Diversity is
    /// measured without it.
    #[arg(
        long,
        default_value_t = 0.0,
        value_name = "METRES",
        allow_negative_numbers = true
    )]
    pub(crate) bend: f32,

    /// Also write everything as JSON.
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) windows: WindowArgs,

    #[command(flatten)]
    pub(crate) sampling: Sampling,
}
