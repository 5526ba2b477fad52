//! Arguments of `troupe drive`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use troupe_client::Rate;

use crate::take::Character;
use crate::values::Seconds;

/// Drive a character live: with the keyboard, or along a scripted path.
///
/// Without --path the keys of this terminal drive it on the server's clock, and a view from above
/// shows where it goes. With --path it does what a file says, step by step, so that the same path
/// and seed give the same frames; the file holds commands by time or waypoints (see
/// examples/paths). Either way it may live in a scene (--scene, or the path's own) and use what is
/// there.
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
pub(crate) struct Drive {
    /// Scripted path to follow, in TOML.
    #[arg(long, value_name = "FILE")]
    pub(crate) path: Option<PathBuf>,

    /// File to write the motion to; its ending says the format: .bvh, .glb, .npz, or .csv and .npy
    /// (qpos) of a robot.
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,

    /// How long to follow the path; without it as long as the path says.
    #[arg(long, value_name = "SECONDS", requires = "path")]
    pub(crate) seconds: Option<Seconds>,

    /// Print what was done as JSON.
    #[arg(long, requires = "path")]
    pub(crate) json: bool,

    #[command(flatten)]
    pub(crate) character: Character,

    /// Frames a second.
    #[arg(long, value_enum, default_value_t = RateArgument::Hz30)]
    pub(crate) rate: RateArgument,
}

/// [`Rate`] as an argument.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum RateArgument {
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
