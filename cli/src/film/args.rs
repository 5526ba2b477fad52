//! Arguments of `troupe film`.

use std::path::PathBuf;

use clap::Args;

use crate::take::Character;
use crate::values::Seconds;

/// Draw a character that follows a scripted path: the path from above, and poses at equal steps of
/// time.
///
/// In a scene (--scene, or the path's own) the picture shows what is there too, and what happened
/// is printed. What the character carries away stays where it was put: put the scene again before
/// another take.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe film --path examples/paths/square.toml --out square.png
  troupe film --path examples/paths/style-changes.toml --out styles.png --poses 20 --width 2400
  troupe film --path examples/paths/bow.toml --out bow.png --from 2 --to 8")]
pub(crate) struct Film {
    /// Scripted path to follow, in TOML.
    #[arg(long, value_name = "FILE")]
    pub(crate) path: PathBuf,

    /// PNG file to write.
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,

    /// How long to follow the path; without it as long as the path says.
    #[arg(long, value_name = "SECONDS")]
    pub(crate) seconds: Option<Seconds>,

    /// Time at which the strip begins; without it the start.
    #[arg(long, value_name = "SECONDS")]
    pub(crate) from: Option<f32>,

    /// Time at which the strip ends; without it the end.
    #[arg(long, value_name = "SECONDS")]
    pub(crate) to: Option<f32>,

    /// Poses in the strip, at equal steps of time.
    #[arg(long, default_value_t = 16, value_name = "4-40", value_parser = clap::value_parser!(u8).range(4..=40))]
    pub(crate) poses: u8,

    /// Width of the picture in pixels; its height follows.
    #[arg(long, default_value_t = 1600, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(400..=8000))]
    pub(crate) width: u32,

    /// Line above the picture; without it the path's title.
    #[arg(long, value_name = "TEXT")]
    pub(crate) title: Option<String>,

    #[command(flatten)]
    pub(crate) character: Character,
}
