//! Arguments of `troupe film`.

use std::path::PathBuf;

use clap::Args;

use crate::failure::Failure;
use crate::take::Character;

/// Draw a character on its path, a filled gap of a clip, or a whole cast.
///
/// --path: a character follows a scripted path. The picture has the path from above, and poses at
/// equal steps of time. In a scene it also shows the things in it, and the events are printed. If
/// the character carries something away, put the scene again before another take.
///
/// --clip: the gap between frames FROM and TO is filled, as `inbetween` does it. The picture has
/// context, generated and target poses, and the clip's own poses below.
///
/// --cast: several characters live at the same time. The picture is an animated PNG, which browsers
/// and GitHub play; other programs show its first frame. Its end fades into its beginning.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe film --path examples/paths/square.toml --out square.png
  troupe film --path examples/paths/bow.toml --out bow.png --from 2 --to 8
  troupe film --path examples/paths/style-changes.toml --out styles.png --poses 20 --width 2400
  troupe film --clip examples/walk.bvh --from 30 --to 65 --out gap.png
  troupe film --cast examples/casts/plaza.toml --out crowd.png --from 3 --to 8 --fps 30")]
pub(crate) struct Film {
    #[command(flatten)]
    pub(crate) subject: Subject,

    /// PNG file to write.
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,

    /// Start of the strip of poses or of the moving picture, in seconds [default: 0; 2 with
    /// --cast]. With --clip: the last context frame.
    #[arg(long, value_name = "TIME")]
    pub(crate) from: Option<f32>,

    /// End, in seconds [default: the end of the path; 6 s after --from with --cast]. With --clip:
    /// the target keyframe.
    #[arg(long, value_name = "TIME")]
    pub(crate) to: Option<f32>,

    /// Poses in a strip, at equal steps of time [default: 16; 9 with --clip].
    #[arg(long, value_name = "3-40", value_parser = clap::value_parser!(u8).range(3..=40), conflicts_with = "cast")]
    pub(crate) poses: Option<u8>,

    /// Frames a second of a moving picture.
    #[arg(long, default_value_t = 15, value_name = "10|12|15|20|30", value_parser = rate)]
    pub(crate) fps: u16,

    /// Width of the picture in pixels [default: 1600; 1000 with --cast].
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(400..=8000))]
    pub(crate) width: Option<u32>,

    #[command(flatten)]
    pub(crate) character: Character,
}

/// What to draw: one of these.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
pub(crate) struct Subject {
    /// Scripted path of one character, in TOML.
    #[arg(long, value_name = "FILE")]
    pub(crate) path: Option<PathBuf>,

    /// Motion clip with a gap to fill: .bvh, .glb or .npz, or a robot's .csv or .npy.
    #[arg(long, value_name = "FILE", requires = "from", requires = "to")]
    pub(crate) clip: Option<PathBuf>,

    /// Several characters and their paths, in TOML.
    #[arg(long, value_name = "FILE")]
    pub(crate) cast: Option<PathBuf>,
}

impl Film {
    /// Pixels for one unit of a layout of this width.
    pub(crate) fn zoom(&self, layout_width: f32) -> f32 {
        self.width.map_or(1.0, |pixels| pixels as f32 / layout_width)
    }

    /// --from and --to as frames of a clip.
    ///
    /// # Errors
    /// [`Failure::Input`] if one is missing or no frame number.
    pub(crate) fn frames(&self) -> Result<(usize, usize), Failure> {
        let frame = |option: &str, value: Option<f32>| match value {
            Some(number) if number >= 0.0 && number.fract() == 0.0 => Ok(number as usize),
            _ => Err(Failure::Input(format!(
                "{option} must be a frame number with --clip"
            ))),
        };
        Ok((frame("--from", self.from)?, frame("--to", self.to)?))
    }
}

/// Rates that 60 frames a second are a multiple of.
fn rate(text: &str) -> Result<u16, String> {
    match text.parse::<u16>() {
        Ok(rate @ (10 | 12 | 15 | 20 | 30)) => Ok(rate),
        _ => Err("allowed: 10, 12, 15, 20, 30".to_owned()),
    }
}
