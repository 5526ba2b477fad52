//! Arguments of `troupe-eval live`.

use std::path::PathBuf;

use clap::Args;
use troupe_cli::Reading;

/// Measure live characters: how well they obey, how their feet hold the ground, how smooth they
/// are.
///
/// A character of every style goes at the speed of each of its gaits, stops, and turns by 45, 90,
/// 120 and 180 degrees, all frame by frame through the server. With --data and --list foot skate
/// and acceleration are compared with clips: those that the list names for each gait, and up to 15
/// other takes of each, which are files whose names differ in the number at the end.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Speeds are means over half a cycle, the first around 1 s after the command. Headings are measured 1 s after the command \
without the sway of the pelvis, which is learnt from the steps before the command.

Examples:
  troupe-eval live
  troupe-eval live --styles normal,proud --json live.json
  troupe-eval live --data clips/ --list models/human/styles.toml")]
pub(crate) struct Live {
    /// Only these styles.
    #[arg(long, value_delimiter = ',', value_name = "NAME,...")]
    pub(super) styles: Vec<String>,

    /// Folder of the clips that the styles were made from: .bvh, .glb or .npz, or .csv for a robot.
    #[arg(long, value_name = "DIR", requires = "list")]
    pub(super) data: Option<PathBuf>,

    /// The list that says which clip shows which gait, as for `troupe style build`.
    #[arg(long, value_name = "FILE", requires = "data")]
    pub(super) list: Option<PathBuf>,

    /// Seed of all characters.
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
