//! Arguments of `troupe film`.

use std::path::PathBuf;

use clap::Args;

use crate::failure::Failure;
use crate::hero::OntoHero;
use crate::reading::Reading;
use crate::take::Character;

const FPS_HELP: &str = "\
Frames a second of a moving picture: 10, 12, 15, 20 or 30 [default: 15]. With --clip: of the clip's \
file, as it says by default; 30 for a robot's .csv and .npy";
/// Rates of moving pictures.
const PICTURE_FPS: [f32; 5] = [10.0, 12.0, 15.0, 20.0, 30.0];

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
#[command(mut_arg("fps", |arg| arg.help(FPS_HELP).long_help(FPS_HELP)), after_long_help = "\
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

    /// Width of the picture in pixels [default: 1600; 1000 with --cast].
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(400..=8000))]
    pub(crate) width: Option<u32>,

    #[command(flatten)]
    pub(crate) character: Character,

    #[command(flatten)]
    pub(crate) onto: OntoHero,

    #[command(flatten)]
    pub(crate) reading: Reading,
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

    /// Frames a second of a moving picture, of which 60 are a multiple.
    ///
    /// # Errors
    /// [`Failure::Input`] with the rates that are allowed.
    pub(crate) fn picture_fps(&self) -> Result<u16, Failure> {
        let wanted = self.reading.fps.unwrap_or(PICTURE_FPS[2]);
        match PICTURE_FPS.contains(&wanted) {
            true => Ok(wanted as u16),
            false => Err(Failure::Input(format!(
                "--fps is {wanted}; allowed with --cast: 10, 12, 15, 20, 30"
            ))),
        }
    }

    /// Checks that no option is given that only clips have.
    ///
    /// # Errors
    /// [`Failure::Input`] if one is given without a clip.
    pub(crate) fn check(&self) -> Result<(), Failure> {
        if self.onto.onto.is_some() && self.subject.cast.is_some() {
            return Err(Failure::Input("--onto needs --path or --clip".to_owned()));
        }
        let without_fps = Reading {
            fps: None,
            ..self.reading.clone()
        };
        let has_rate = self.subject.path.is_none() || self.reading.fps.is_none();
        match self.subject.clip.is_some() || (has_rate && without_fps == Reading::default()) {
            true => Ok(()),
            false => Err(Failure::Input(
                "the options of clip files need --clip; --fps needs --clip or --cast".to_owned(),
            )),
        }
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
