//! Arguments of `troupe eval` for gaps.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::files::Scale;
use crate::fill::Sampling;
use crate::values::positive;

/// Measuring on held-out clips.
#[derive(Debug, Args)]
pub(crate) struct GapEval {
    /// Folder of clips: .bvh, .glb or .npz, or .csv for a robot.
    #[arg(long, value_name = "DIR", required = true)]
    data: Option<PathBuf>,

    /// File with the names of the clips to use, one a line; without it every clip of the folder.
    #[arg(long, value_name = "FILE")]
    pub(crate) split: Option<PathBuf>,

    /// Frames between the last context frame and the target keyframe.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "15,30,45",
        value_name = "FRAMES,..."
    )]
    pub(crate) gaps: Vec<usize>,

    /// Frames from the start of one window to the start of the next.
    #[arg(long, default_value_t = 30, value_name = "FRAMES", value_parser = positive)]
    pub(crate) stride: usize,

    /// Most windows for each gap, spread evenly over all.
    #[arg(long, value_name = "N", value_parser = positive)]
    pub(crate) max_windows: Option<usize>,

    /// Motion autoencoder to measure FID, MMD and latent diversity with, or a pack's folder that
    /// has one as evaluator.onnx. Without it that of models/PACK, if it is there.
    #[arg(long, value_name = "FILE")]
    pub(crate) evaluator: Option<PathBuf>,

    /// Takes of a window that diversity is measured over; below 2 it is not.
    #[arg(long, default_value_t = 20, value_name = "N", value_parser = clap::value_parser!(u32).range(..=1000))]
    pub(crate) seeds: u32,

    /// Windows of each gap that diversity is measured on, spread evenly over all.
    #[arg(long, default_value_t = 100, value_name = "N", value_parser = positive)]
    pub(crate) diversity_windows: usize,

    /// Have the pack's motion pass beside its own way: its root in the middle of the gap is moved
    /// to the left of the character by so many metres (a root override), and what comes is
    /// measured. Diversity stays that of motions without.
    #[arg(
        long,
        default_value_t = 0.0,
        value_name = "METRES",
        allow_negative_numbers = true
    )]
    pub(crate) bend: f32,

    /// Requests in flight at the same time.
    #[arg(long, default_value_t = 32, value_name = "N", value_parser = positive)]
    pub(crate) concurrency: usize,

    /// Also write everything as JSON.
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,

    #[command(flatten)]
    pub(crate) sampling: Sampling,

    #[command(flatten)]
    pub(crate) scale: Scale,
}

impl GapEval {
    /// Folder of clips. It is there: only a subcommand goes without.
    pub(crate) fn data(&self) -> &Path {
        self.data.as_deref().unwrap_or(Path::new("."))
    }
}
