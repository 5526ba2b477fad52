//! Arguments of the `troupe` command line: those of all commands, and which command.

use std::path::PathBuf;

use clap::{Parser, Subcommand};

use crate::animate::Animate;
use crate::describe::Describe;
use crate::draw::Draw;
use crate::drive::Drive;
use crate::eval::Eval;
use crate::film::Film;
use crate::generate::Generate;
use crate::inbetween::Inbetween;
use crate::object::Object;
use crate::packs::Packs;
use crate::say::Say;
use crate::scene::Scene;
use crate::sessions::Sessions;
use crate::shell::{Completions, Man};
use crate::style::Style;
use crate::top::Top;
use crate::values::Seconds;
use troupe_client::{ApiKey, ClientCertificate, TlsOptions};

/// Drive characters and fill gaps in motion clips on a Troupe server, and measure how well it does.
#[derive(Debug, Parser)]
#[command(name = "troupe", version, propagate_version = true, max_term_width = 110, after_long_help = AFTER)]
pub(crate) struct Arguments {
    /// Address of the server.
    #[arg(
        long,
        global = true,
        env = "TROUPE_SERVER",
        default_value = "http://127.0.0.1:8080",
        value_name = "URL",
        help_heading = COMMON
    )]
    pub(crate) server: String,

    /// API key, where the server asks for one.
    #[arg(long, global = true, env = "TROUPE_KEY", hide_env_values = true, value_name = "KEY", help_heading = COMMON)]
    pub(crate) key: Option<ApiKey>,

    #[command(flatten)]
    pub(crate) tls: TlsArgs,

    /// Longest wait for one answer, in seconds.
    #[arg(long, global = true, default_value = "60", value_name = "SECONDS", help_heading = COMMON)]
    pub(crate) timeout: Seconds,

    /// No notes and no progress bar on standard error; errors are still told.
    #[arg(long, short, global = true, help_heading = COMMON)]
    pub(crate) quiet: bool,

    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Certificates, for https:// addresses.
#[derive(Debug, clap::Args)]
pub(crate) struct TlsArgs {
    /// Certificates of the authorities to trust with an https:// address (PEM file). Left out:
    /// those of the system.
    #[arg(long, global = true, env = "TROUPE_CA", value_name = "FILE", help_heading = COMMON)]
    ca: Option<PathBuf>,

    /// Certificate to show to a server that asks for one (PEM file).
    #[arg(long, global = true, env = "TROUPE_CLIENT_CERTIFICATE", requires = "client_key", value_name = "FILE", help_heading = COMMON)]
    client_certificate: Option<PathBuf>,

    /// Private key of that certificate (PEM file).
    #[arg(long, global = true, env = "TROUPE_CLIENT_KEY", requires = "client_certificate", value_name = "FILE", help_heading = COMMON)]
    client_key: Option<PathBuf>,
}

impl From<TlsArgs> for TlsOptions {
    fn from(args: TlsArgs) -> Self {
        let both = args.client_certificate.zip(args.client_key);
        Self {
            ca: args.ca,
            client: both.map(|(certificate, key)| ClientCertificate { certificate, key }),
        }
    }
}

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
  troupe generate --skeleton g1 --path examples/paths/square.toml --out walk.csv
  troupe say \"an elderly man waves\" --out wave.glb
  troupe describe walk.bvh
  troupe drive
  troupe drive --path examples/paths/square.toml --out square.bvh
  troupe film --path examples/paths/square.toml --out square.png
  troupe object put examples/objects/*.toml
  troupe scene put examples/scenes/courtyard.toml
  troupe top";

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Inbetween(Inbetween),
    Generate(Box<Generate>),
    Say(Box<Say>),
    Describe(Describe),
    Packs(Packs),
    Eval(Box<Eval>),
    Draw(Draw),
    Drive(Drive),
    Film(Film),
    Animate(Animate),
    Sessions(Sessions),
    Style(Style),
    Scene(Scene),
    Object(Object),
    Top(Top),
    Completions(Completions),
    Man(Man),
}
