//! Arguments of the `troupe` command line.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};

use super::eval::{Live, Wander};
use super::live_args::{Drive, Film, Sessions};
use super::object::Object;
use super::scene::Scene;
use super::style::Style;

/// Drive characters and fill gaps in motion clips on a Troupe server, and measure how well it does.
#[derive(Debug, Parser)]
#[command(name = "troupe", version, propagate_version = true, max_term_width = 110, after_long_help = AFTER)]
pub(super) struct Arguments {
    /// Address of the server.
    #[arg(
        long,
        global = true,
        env = "TROUPE_SERVER",
        default_value = "http://127.0.0.1:8080",
        value_name = "URL",
        help_heading = COMMON
    )]
    pub(super) server: String,

    /// Longest wait for one answer, in seconds.
    #[arg(long, global = true, default_value = "60", value_name = "SECONDS", help_heading = COMMON)]
    pub(super) timeout: Seconds,

    /// No notes and no progress bar on standard error; errors are still told.
    #[arg(long, short, global = true, help_heading = COMMON)]
    pub(super) quiet: bool,

    #[command(subcommand)]
    pub(super) command: Command,
}

const SAMPLING: &str = "Pack and sampling";
const BVH: &str = "BVH files";
const COMMON: &str = "Server and notes";

const AFTER: &str = "\
Exit codes:
  0  done
  1  an output file could not be written, the server's answer made no sense, or what a path
     waits for did not come
  2  wrong arguments, or a file that cannot be used
  3  no server answers at the address, or not in time
  4  the server refused the request

Examples:
  troupe packs
  troupe inbetween --clip walk.bvh --from 60 --to 95 --out filled.bvh
  troupe eval --data clips/ --split test.txt --json eval.json
  troupe draw --clip walk.bvh --from 60 --to 106 --out picture.png
  troupe drive
  troupe drive --path examples/paths/square.toml --out square.bvh
  troupe film --path examples/paths/square.toml --out square.png
  troupe object put examples/objects/*.toml
  troupe scene put examples/scenes/courtyard.toml";

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    Inbetween(Inbetween),
    Packs(Packs),
    Eval(Box<Eval>),
    Draw(Draw),
    Drive(Drive),
    Film(Film),
    Sessions(Sessions),
    Style(Style),
    Scene(Scene),
    Object(Object),
}

/// Replace what lies between two frames of a clip by generated motion.
///
/// FROM and the three frames in front of it are the context, TO is the target keyframe. Both stay as they are; the
/// frames between them are generated. Joints are mapped by name onto the pack's skeleton, and a clip at another rate
/// is resampled to the pack's first, so FROM and TO count frames at the pack's rate.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe inbetween --clip walk.bvh --from 60 --to 95 --out filled.bvh
  troupe inbetween --clip walk.bvh --from 60 --to 95 --out filled.glb --temperature 0.8 --seed 3
  troupe inbetween --clip walk.bvh --from 60 --to 95 --out gap.bvh --free-timing --only-gap")]
pub(super) struct Inbetween {
    #[command(flatten)]
    pub(super) gap: Gap,

    /// File to write; its ending, .bvh, .glb or (of a robot) .csv, says the format.
    #[arg(long, value_name = "FILE")]
    pub(super) out: PathBuf,

    /// Frames from the first context frame to the last target keyframe, where the gap is to be filled faster or slower
    /// than in the clip.
    #[arg(long, value_name = "FRAMES", conflicts_with = "free_timing")]
    pub(super) frame_count: Option<u32>,

    /// Let the model choose how many frames the gap takes.
    #[arg(long)]
    pub(super) free_timing: bool,

    /// Write the generated frames alone, without the clip before and after.
    #[arg(long)]
    pub(super) only_gap: bool,

    /// Print what was done as JSON.
    #[arg(long)]
    pub(super) json: bool,
}

/// Which gap of which clip to fill, and how.
#[derive(Debug, Args)]
pub(super) struct Gap {
    /// Motion clip in BVH format, or a robot's as CSV: root x y z qx qy qz qw, then the hinges' angles.
    #[arg(long, value_name = "FILE")]
    pub(super) clip: PathBuf,

    /// Last context frame; the first frame of the clip is 0.
    #[arg(long, value_name = "FRAME")]
    pub(super) from: usize,

    /// Target keyframe.
    #[arg(long, value_name = "FRAME")]
    pub(super) to: usize,

    /// How many consecutive frames from TO on are target keyframes.
    #[arg(long, default_value_t = 1, value_name = "1-4", value_parser = clap::value_parser!(u8).range(1..=4))]
    pub(super) target_frames: u8,

    #[command(flatten)]
    pub(super) sampling: Sampling,

    #[command(flatten)]
    pub(super) scale: Scale,
}

/// Pack and sampling.
#[derive(Debug, Args)]
pub(super) struct Sampling {
    /// Model pack; without it the server's default.
    #[arg(long, help_heading = SAMPLING, default_value = "", hide_default_value = true, value_name = "NAME")]
    pub(super) pack: String,

    /// The same seed, clip and pack give the same frames.
    #[arg(long, help_heading = SAMPLING, default_value_t = 0)]
    pub(super) seed: u64,

    /// 0 takes the most likely motion; above, up to 2, motion is sampled with the seed.
    #[arg(long, help_heading = SAMPLING, default_value_t = 0.0, value_name = "0-2")]
    pub(super) temperature: f32,

    /// Passes of the pose module, 1 to 10.
    #[arg(long, help_heading = SAMPLING, default_value_t = 1, value_name = "1-10")]
    pub(super) pose_steps: u32,

    /// Leave feet as the networks make them; those that stand are held still otherwise.
    #[arg(long, help_heading = SAMPLING)]
    pub(super) free_feet: bool,
}

/// How BVH files relate to the pack's skeleton.
#[derive(Debug, Clone, Copy, Args)]
pub(super) struct Scale {
    /// Length unit of the BVH files.
    #[arg(long, help_heading = BVH, value_enum, default_value_t = Unit::Cm)]
    pub(super) unit: Unit,

    /// Also take clips whose bones have other lengths; their rotations are played on the pack's bones.
    #[arg(long, help_heading = BVH)]
    pub(super) other_bones: bool,
}

/// A length unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Unit {
    /// Millimetres.
    Mm,
    /// Centimetres.
    Cm,
    /// Metres.
    M,
    /// Inches.
    In,
}

impl Unit {
    /// Metres in one unit.
    pub(super) fn metres(self) -> f32 {
        match self {
            Self::Mm => 0.001,
            Self::Cm => 0.01,
            Self::M => 1.0,
            Self::In => 0.0254,
        }
    }
}

/// List the packs that the server has loaded, or describe one.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe packs
  troupe packs human
  troupe packs human --json | jq .figures")]
pub(super) struct Packs {
    /// Describe this pack: skeleton, limits, licence, credits, training and evaluation figures.
    pub(super) name: Option<String>,

    /// Print JSON.
    #[arg(long)]
    pub(super) json: bool,
}

/// Measure the pack on held-out clips, beside ground truth and interpolation.
///
/// Every clip of the split is cut into windows: four context frames, the gap, and one target keyframe with full pose
/// and root. The server fills the gap; so does interpolation (linear root, slerp of joint rotations). Diversity comes from some
/// windows, filled with several seeds at temperature 1. FID, MMD and latent diversity are measured in the latent space of a
/// motion autoencoder, the `evaluator.onnx` that `troupe-train evaluator` makes. Each figure comes with a 95 % interval.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe eval --data clips/
  troupe eval --data clips/ --split training/splits/bandai-namco-test.txt --json eval.json
  troupe eval --data clips/ --gaps 30 --stride 60 --max-windows 200 --seed 1
  troupe eval --data clips/ --evaluator models/human/evaluator.onnx --seeds 0")]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(super) struct Eval {
    #[command(subcommand)]
    pub(super) what: Option<EvalWhat>,

    #[command(flatten)]
    pub(super) gaps: GapEval,
}

/// What else can be measured.
#[derive(Debug, Subcommand)]
pub(super) enum EvalWhat {
    Live(Live),
    Wander(Wander),
}

/// Measuring on held-out clips.
#[derive(Debug, Args)]
pub(super) struct GapEval {
    /// Folder of clips: BVH files.
    #[arg(long, value_name = "DIR", required = true)]
    data: Option<PathBuf>,

    /// File with the names of the clips to use, one a line; without it every clip of the folder.
    #[arg(long, value_name = "FILE")]
    pub(super) split: Option<PathBuf>,

    /// Frames between the last context frame and the target keyframe.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "15,30,45",
        value_name = "FRAMES,..."
    )]
    pub(super) gaps: Vec<usize>,

    /// Frames from the start of one window to the start of the next.
    #[arg(long, default_value_t = 30, value_name = "FRAMES", value_parser = positive)]
    pub(super) stride: usize,

    /// Use at most so many windows for each gap, spread evenly over all.
    #[arg(long, value_name = "N", value_parser = positive)]
    pub(super) max_windows: Option<usize>,

    /// Motion autoencoder to measure FID, MMD and latent diversity with, or a pack's folder that has one as evaluator.onnx.
    /// Without it that of models/PACK, if it is there.
    #[arg(long, value_name = "FILE")]
    pub(super) evaluator: Option<PathBuf>,

    /// Takes of a window that diversity is measured over; below 2 it is not.
    #[arg(long, default_value_t = 20, value_name = "N", value_parser = clap::value_parser!(u32).range(..=1000))]
    pub(super) seeds: u32,

    /// Windows of each gap that diversity is measured on, spread evenly over all.
    #[arg(long, default_value_t = 100, value_name = "N", value_parser = positive)]
    pub(super) diversity_windows: usize,

    /// Requests in flight at the same time.
    #[arg(long, default_value_t = 32, value_name = "N", value_parser = positive)]
    pub(super) concurrency: usize,

    /// Also write everything as JSON.
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,

    #[command(flatten)]
    pub(super) sampling: Sampling,

    #[command(flatten)]
    pub(super) scale: Scale,
}

impl GapEval {
    /// Folder of clips. It is there: only a subcommand goes without.
    pub(super) fn data(&self) -> &Path {
        self.data.as_deref().unwrap_or(Path::new("."))
    }
}

/// Draw a filled gap as a picture: context, generated and target poses, and the clip's own below.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe draw --clip walk.bvh --from 60 --to 106 --out picture.png
  troupe draw --clip walk.bvh --from 60 --to 106 --out picture.png --poses 8 --width 1200")]
pub(super) struct Draw {
    #[command(flatten)]
    pub(super) gap: Gap,

    /// PNG file to write.
    #[arg(long, value_name = "FILE")]
    pub(super) out: PathBuf,

    /// Generated poses to draw, spread evenly over the gap.
    #[arg(long, default_value_t = 9, value_name = "3-24", value_parser = clap::value_parser!(u8).range(3..=24))]
    pub(super) poses: u8,

    /// Width of the picture in pixels; its height follows.
    #[arg(long, default_value_t = 1600, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(400..=8000))]
    pub(super) width: u32,

    /// Line above the picture; without it the clip's name.
    #[arg(long, value_name = "TEXT")]
    pub(super) title: Option<String>,
}

/// A time span above zero, given in seconds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seconds(Duration);

impl From<Seconds> for Duration {
    fn from(seconds: Seconds) -> Self {
        seconds.0
    }
}

impl FromStr for Seconds {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let seconds = text.parse::<f64>().map_err(|e| e.to_string())?;
        let span = Duration::try_from_secs_f64(seconds).map_err(|e| e.to_string())?;
        if span.is_zero() {
            Err("must be above 0".to_owned())
        } else {
            Ok(Self(span))
        }
    }
}

pub(super) fn positive(text: &str) -> Result<usize, String> {
    match text.parse::<usize>() {
        Ok(0) => Err("must be 1 or more".to_owned()),
        Ok(number) => Ok(number),
        Err(e) => Err(e.to_string()),
    }
}
