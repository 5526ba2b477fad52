//! Arguments of `troupe-eval wander`.

use std::path::{Path, PathBuf};

use clap::Args;
use troupe_cli::{Reading, positive};

/// Measure characters that wander for a minute: foot skate and jitter, beside those of
/// in-betweening.
///
/// Every second to four of them each character gets a new command: to go another way at 0.7 to 1.2
/// times its style's speed, now and then facing aside, now and then to stand. They are measured
/// from the first second on. --against compares foot skate and jitter with those of the gaps that
/// the same pack filled. Use gaps of walking clips, because bows and waves skate less.
#[derive(Debug, Args)]
#[command(after_long_help = "\
With several --replan the same characters wander with each interval (MotionBricks, figure 15), all with the look-ahead of the \
shortest, at most 4. FID is between their windows of 35 frames and those of the clips in --data. It compares intervals and says \
nothing else, because characters wander and clips show all sorts of motion.

Examples:
  troupe-eval wander --against eval.json
  troupe-eval wander --replan 3,4,5,6,7,8 --json replan.json
  troupe-eval wander --replan 3,6,9 --evaluator models/human --data clips/ --split test.txt")]
pub(crate) struct Wander {
    /// What `troupe-eval gaps --json` wrote of the same pack.
    #[arg(long, value_name = "FILE")]
    pub(super) against: Option<PathBuf>,

    /// Frames between plans, 3 to 30; each is measured by itself. Default: those of the styles.
    #[arg(long, value_delimiter = ',', value_name = "FRAMES,...", value_parser = clap::value_parser!(u32).range(1..=30))]
    pub(super) replan: Vec<u32>,

    /// How long they wander.
    #[arg(long, default_value_t = 60, value_name = "SECONDS", value_parser = clap::value_parser!(u32).range(5..=600))]
    pub(super) seconds: u32,

    /// Characters. Default: two of each style.
    #[arg(long, value_name = "N", value_parser = positive)]
    pub(super) characters: Option<usize>,

    /// Only these styles.
    #[arg(long, value_delimiter = ',', value_name = "NAME,...")]
    pub(super) styles: Vec<String>,

    /// Motion autoencoder to measure FID with: a file, or a pack's folder with evaluator.onnx in
    /// it.
    #[arg(long, value_name = "FILE", requires = "data")]
    pub(super) evaluator: Option<PathBuf>,

    /// Folder of the clips for FID: .bvh, .glb or .npz, or .csv for a robot.
    #[arg(long, value_name = "DIR", requires = "evaluator")]
    pub(super) data: Option<PathBuf>,

    /// File with the names of the clips to use, one a line. Default: every clip of the folder.
    #[arg(long, value_name = "FILE", requires = "data")]
    pub(super) split: Option<PathBuf>,

    /// Seed of all characters and of their ways.
    #[arg(long, default_value_t = 0)]
    pub(super) seed: u64,

    /// Also write everything as JSON.
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,

    /// Model pack. Default: the server's default pack.
    #[arg(long, default_value = "", hide_default_value = true, value_name = "NAME")]
    pub(super) pack: String,

    #[command(flatten)]
    pub(super) reading: Reading,
}

impl Wander {
    /// Evaluator and clips for FID, if both were given.
    pub(super) fn distribution(&self) -> Option<(&Path, &Path)> {
        self.evaluator.as_deref().zip(self.data.as_deref())
    }
}
