//! Arguments of `troupe eval wander`.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::files::Scale;
use crate::values::positive;

/// Measure characters that wander for a minute: foot skate and jitter, beside those of
/// in-betweening.
///
/// Characters of all styles go where chance has them go: every second to four of them somewhere
/// else at 0.7 to 1.2 times their style's speed, now and then facing aside, now and then they
/// stand. They are measured from the first second on. With --against foot skate and jitter are set
/// against those of the gaps that the same pack filled; those of walking clips compare like with
/// like, for bows and waves skate less.
#[derive(Debug, Args)]
#[command(after_long_help = "\
With several --replan the same characters wander with each interval (MotionBricks, figure 15), all with the look-ahead of the \
shortest, at most 4. FID is that of their windows of 35 frames to those of the clips in --data, so it tells intervals \
apart and says nothing else: characters wander, and clips do all sorts of things.

Examples:
  troupe eval wander --against eval.json
  troupe eval wander --replan 3,4,5,6,7,8 --json replan.json
  troupe eval wander --replan 3,6,9 --evaluator models/human --data clips/ --split test.txt")]
pub(crate) struct Wander {
    /// What `troupe eval --json` wrote of the same pack.
    #[arg(long, value_name = "FILE")]
    pub(super) against: Option<PathBuf>,

    /// Frames between plans, where not as the styles say: 3 to 30. Each is measured by itself.
    #[arg(long, value_delimiter = ',', value_name = "FRAMES,...", value_parser = clap::value_parser!(u32).range(1..=30))]
    pub(super) replan: Vec<u32>,

    /// How long they wander.
    #[arg(long, default_value_t = 60, value_name = "SECONDS", value_parser = clap::value_parser!(u32).range(5..=600))]
    pub(super) seconds: u32,

    /// Characters; without it two of each style.
    #[arg(long, value_name = "N", value_parser = positive)]
    pub(super) characters: Option<usize>,

    /// Only these styles.
    #[arg(long, value_delimiter = ',', value_name = "NAME,...")]
    pub(super) styles: Vec<String>,

    /// Motion autoencoder to measure FID with, or a pack's folder that has one as evaluator.onnx.
    #[arg(long, value_name = "FILE", requires = "data")]
    pub(super) evaluator: Option<PathBuf>,

    /// Folder of clips that FID is measured to: .bvh, .glb or .npz, or .csv for a robot.
    #[arg(long, value_name = "DIR", requires = "evaluator")]
    pub(super) data: Option<PathBuf>,

    /// File with the names of the clips to use, one a line; without it every clip of the folder.
    #[arg(long, value_name = "FILE", requires = "data")]
    pub(super) split: Option<PathBuf>,

    /// Seed of all characters and of their ways.
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

impl Wander {
    /// Evaluator and clips for FID, where both were given.
    pub(super) fn distribution(&self) -> Option<(&Path, &Path)> {
        self.evaluator.as_deref().zip(self.data.as_deref())
    }
}
