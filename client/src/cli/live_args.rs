//! Arguments of the commands for live characters: `drive`, `film` and `sessions`.

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use super::args::{Seconds, Unit};
use crate::live::{Encoding, Rate};

const CHARACTER: &str = "Character";

/// Drive a character live: with the keyboard, or along a scripted path.
///
/// Without --path the keys of this terminal drive it on the server's clock, and a view from above shows where it goes. With
/// --path it does what a file says, step by step, so that the same path and seed give the same frames; the file holds
/// commands by time or waypoints (see examples/paths). Either way it may live in a scene (--scene, or the path's own) and use
/// what is there.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Keys:
  W A S D, arrows  go up, left, down, right in the view from above
  Q E              turn where it faces to the left, to the right
  F                face where it goes
  1 to 9           style
  + -              faster, slower
  space            stand
  R                start or stop recording, written to --out
  U X G            in a scene: use the nearest object ahead, end what is held, put it down
  Esc, Ctrl-C      leave

Examples:
  troupe drive
  troupe drive --style elderly --rate 60 --out take.bvh
  troupe drive --scene courtyard
  troupe drive --path examples/paths/square.toml --out square.bvh
  troupe drive --path examples/paths/sit.toml --json
  troupe drive --path examples/paths/reversal.toml --seed 3 --out reversal.glb")]
pub(super) struct Drive {
    /// Scripted path to follow, in TOML.
    #[arg(long, value_name = "FILE")]
    pub(super) path: Option<PathBuf>,

    /// File to write the motion to; its ending, .bvh, .glb or (of a robot) .csv, says the format.
    #[arg(long, value_name = "FILE")]
    pub(super) out: Option<PathBuf>,

    /// How long to follow the path; without it as long as the path says.
    #[arg(long, value_name = "SECONDS", requires = "path")]
    pub(super) seconds: Option<Seconds>,

    /// Print what was done as JSON.
    #[arg(long, requires = "path")]
    pub(super) json: bool,

    #[command(flatten)]
    pub(super) character: Character,

    /// Frames a second.
    #[arg(long, value_enum, default_value_t = RateArgument::Hz30)]
    pub(super) rate: RateArgument,

    /// How frames come over the wire.
    #[arg(long, value_enum, default_value_t = EncodingArgument::F32)]
    pub(super) encoding: EncodingArgument,

    /// Length unit of a BVH file.
    #[arg(long, value_enum, default_value_t = Unit::Cm)]
    pub(super) unit: Unit,
}

/// Which character.
#[derive(Debug, Args)]
pub(super) struct Character {
    /// Model pack; without it the server's default.
    #[arg(long, help_heading = CHARACTER, default_value = "", hide_default_value = true, value_name = "NAME")]
    pub(super) pack: String,

    /// Scene of the server to live in; without it the path's, or none.
    #[arg(long, help_heading = CHARACTER, value_name = "NAME")]
    pub(super) scene: Option<String>,

    /// Style to begin with; without it the path's or the pack's.
    #[arg(long, help_heading = CHARACTER, value_name = "NAME")]
    pub(super) style: Option<String>,

    /// The same seed, path and pack give the same frames; without it the path's, or 0.
    #[arg(long, help_heading = CHARACTER)]
    pub(super) seed: Option<u64>,

    /// 0 takes the most likely poses; above, up to 2, they are sampled with the seed.
    #[arg(long, help_heading = CHARACTER, default_value_t = 0.0, value_name = "0-2")]
    pub(super) temperature: f32,

    /// Frames between the cursor and the point where a new plan takes over; without it the server's.
    #[arg(long, help_heading = CHARACTER, value_name = "2-12")]
    pub(super) look_ahead: Option<u32>,
}

/// Draw a character that follows a scripted path: the path from above, and poses at equal steps of time.
///
/// In a scene (--scene, or the path's own) the picture shows what is there too, and what happened is printed. What the character
/// carries away stays where it was put: put the scene again before another take.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  troupe film --path examples/paths/square.toml --out square.png
  troupe film --path examples/paths/style-changes.toml --out styles.png --poses 20 --width 2400
  troupe film --path examples/paths/bow.toml --out bow.png --from 2 --to 8")]
pub(super) struct Film {
    /// Scripted path to follow, in TOML.
    #[arg(long, value_name = "FILE")]
    pub(super) path: PathBuf,

    /// PNG file to write.
    #[arg(long, value_name = "FILE")]
    pub(super) out: PathBuf,

    /// How long to follow the path; without it as long as the path says.
    #[arg(long, value_name = "SECONDS")]
    pub(super) seconds: Option<Seconds>,

    /// Time at which the strip begins; without it the start.
    #[arg(long, value_name = "SECONDS")]
    pub(super) from: Option<f32>,

    /// Time at which the strip ends; without it the end.
    #[arg(long, value_name = "SECONDS")]
    pub(super) to: Option<f32>,

    /// Poses in the strip, at equal steps of time.
    #[arg(long, default_value_t = 16, value_name = "4-40", value_parser = clap::value_parser!(u8).range(4..=40))]
    pub(super) poses: u8,

    /// Width of the picture in pixels; its height follows.
    #[arg(long, default_value_t = 1600, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(400..=8000))]
    pub(super) width: u32,

    /// Line above the picture; without it the path's title.
    #[arg(long, value_name = "TEXT")]
    pub(super) title: Option<String>,

    #[command(flatten)]
    pub(super) character: Character,
}

/// List the sessions that are open on the server, or close some.
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_long_help = "\
Examples:
  troupe sessions
  troupe sessions --json | jq '.[].id'
  troupe sessions close guard-1 guard-2
  troupe sessions close --all"
)]
pub(super) struct Sessions {
    /// Print JSON.
    #[arg(long)]
    pub(super) json: bool,

    #[command(subcommand)]
    pub(super) command: Option<SessionsCommand>,
}

#[derive(Debug, Subcommand)]
pub(super) enum SessionsCommand {
    /// Close sessions. Closing one that is gone is no error.
    Close {
        /// Their names.
        #[arg(required_unless_present = "all", value_name = "NAME")]
        ids: Vec<String>,

        /// All that are open, whoever opened them.
        #[arg(long, conflicts_with = "ids")]
        all: bool,
    },
}

/// [`Rate`] as an argument.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum RateArgument {
    /// The rate of the networks.
    #[value(name = "30")]
    Hz30,
    /// Interpolated.
    #[value(name = "50")]
    Hz50,
    /// Interpolated.
    #[value(name = "60")]
    Hz60,
}

impl From<RateArgument> for Rate {
    fn from(rate: RateArgument) -> Self {
        match rate {
            RateArgument::Hz30 => Self::Hz30,
            RateArgument::Hz50 => Self::Hz50,
            RateArgument::Hz60 => Self::Hz60,
        }
    }
}

/// [`Encoding`] as an argument.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum EncodingArgument {
    /// 32-bit floats.
    F32,
    /// 16-bit rotations and a root in tenths of a millimetre.
    Compact,
    /// MuJoCo's qpos, of a robot.
    Qpos,
}

impl From<EncodingArgument> for Encoding {
    fn from(encoding: EncodingArgument) -> Self {
        match encoding {
            EncodingArgument::F32 => Self::F32,
            EncodingArgument::Compact => Self::Compact,
            EncodingArgument::Qpos => Self::Qpos,
        }
    }
}
