//! Arguments of `troupe animate`.

use std::path::PathBuf;

use clap::Args;

/// Draw characters that live at the same time as a moving picture.
///
/// The cast file says who they are and what each is told to do. All are sessions of the server,
/// stepped together. The picture is an animated PNG: browsers and GitHub play it, and what cannot
/// shows its first frame. Its end fades into its beginning.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe animate --cast examples/casts/plaza.toml --out crowd.png
  troupe animate --cast examples/casts/plaza.toml --out crowd.png --from 3 --seconds 5 --fps 30")]
pub(crate) struct Animate {
    /// Characters and their paths, in TOML.
    #[arg(long, value_name = "FILE")]
    pub(crate) cast: PathBuf,

    /// PNG file to write.
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,

    /// Time at which the picture begins, at least half a second.
    #[arg(long, default_value_t = 2.0, value_name = "SECONDS", value_parser = start)]
    pub(crate) from: f32,

    /// How long it is.
    #[arg(long, default_value_t = 6.0, value_name = "SECONDS", value_parser = length)]
    pub(crate) seconds: f32,

    /// Frames a second.
    #[arg(long, default_value_t = 15, value_name = "10|12|15|20|30", value_parser = rate)]
    pub(crate) fps: u16,

    /// Width of the picture in pixels; its height follows.
    #[arg(long, default_value_t = 1000, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(400..=4000))]
    pub(crate) width: u32,

    /// Line above the picture; without it the cast's title.
    #[arg(long, value_name = "TEXT")]
    pub(crate) title: Option<String>,
}

fn within(text: &str, least: f32, most: f32) -> Result<f32, String> {
    let number = text.parse::<f32>().map_err(|e| e.to_string())?;
    match (least..=most).contains(&number) {
        true => Ok(number),
        false => Err(format!("allowed: {least} to {most}")),
    }
}

fn start(text: &str) -> Result<f32, String> {
    within(text, 0.5, 600.0)
}

fn length(text: &str) -> Result<f32, String> {
    within(text, 1.0, 60.0)
}

/// Rates that 60 frames a second hold evenly.
fn rate(text: &str) -> Result<u16, String> {
    match text.parse::<u16>() {
        Ok(rate @ (10 | 12 | 15 | 20 | 30)) => Ok(rate),
        _ => Err("allowed: 10, 12, 15, 20, 30".to_owned()),
    }
}
