//! Arguments of the `troupe` command line: those of all commands, and which command.

use clap::{Parser, Subcommand};

use crate::bridge::Bridge;
use crate::clip::ClipFiles;
use crate::connection::Connection;
use crate::describe::Describe;
use crate::drive::Drive;
use crate::film::Film;
use crate::generate::Generate;
use crate::inbetween::Inbetween;
use crate::object::Object;
use crate::packs::Packs;
use crate::replay::Replay;
use crate::retarget::Retarget;
use crate::say::Say;
use crate::scene::Scene;
use crate::sessions::Sessions;
use crate::shell::{Completions, Man};
use crate::style::Style;
use crate::top::Top;

/// Drive and film characters on a Troupe server, and fill gaps in motion clips.
#[derive(Debug, Parser)]
#[command(name = "troupe", version, propagate_version = true, max_term_width = 110, after_long_help = AFTER)]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(crate) connection: Connection,

    #[command(subcommand)]
    pub(crate) command: Command,
}

const AFTER: &str = "\
Exit codes:
  0  done
  1  an output file could not be written, the server's answer made no sense, the moment that
     a path waits for did not come, `clip check` found a file that is odd or refused, or
     `replay` found a difference
  2  wrong arguments, or a file that cannot be used
  3  no server answers at the address, or not in time
  4  the server refused the request

Examples:
  troupe packs
  troupe inbetween --clip walk.bvh --from 60 --to 95 --out filled.bvh
  troupe generate --skeleton g1 --path examples/paths/square.toml --out walk.csv
  troupe say \"an elderly man waves\" --out wave.glb
  troupe describe walk.bvh
  troupe clip info walk.bvh
  troupe drive
  troupe drive --path examples/paths/square.toml --out square.bvh
  troupe film --path examples/paths/square.toml --out square.png
  troupe object put examples/objects/*.toml
  troupe scene put examples/scenes/courtyard.toml
  troupe replay guard.jsonl
  troupe top
  troupe bridge sonic examples/robots/two.toml";

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Inbetween(Inbetween),
    Generate(Box<Generate>),
    Say(Box<Say>),
    Describe(Describe),
    Clip(Box<ClipFiles>),
    Retarget(Box<Retarget>),
    Packs(Packs),
    Drive(Drive),
    Film(Film),
    Sessions(Sessions),
    Replay(Replay),
    Style(Style),
    Scene(Scene),
    Object(Object),
    Top(Top),
    Bridge(Bridge),
    Completions(Completions),
    Man(Man),
}
