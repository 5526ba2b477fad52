//! The command line.

use std::path::PathBuf;

use clap::Parser;
use confique::Layer as _;

use super::Config;
use troupe_engine::EngineChoice;

type Layer = <Config as confique::Config>::Layer;

/// The command line.
#[derive(Debug, Parser)]
#[command(
    name = "troupe-server",
    version,
    about = "Serves live characters and motion in-betweening over gRPC, HTTP and WebSocket, on one port",
    args_conflicts_with_subcommands = true
)]
pub struct Cli {
    /// What to do instead of serving.
    #[command(subcommand)]
    pub command: Option<Command>,

    /// Configuration file (TOML). Left out: `troupe.toml` in the working directory, where there is one.
    #[arg(long, env = "TROUPE_CONFIG", value_name = "FILE")]
    pub(super) config: Option<PathBuf>,

    /// Print a configuration file with every option, its meaning and its default, and exit.
    #[arg(long)]
    pub print_config: bool,

    #[command(flatten)]
    pub(super) flags: Layer,
}

/// What the server's command does instead of serving.
#[derive(Debug, Clone, clap::Subcommand)]
pub enum Command {
    /// Say what this machine and the library offer, which engine each pack gets and why, and how fast it is. Takes a few
    /// seconds for each pack.
    Doctor(DoctorArgs),
}

/// Options of the doctor. Those that it shares with the server come from the same environment and configuration file.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct DoctorArgs {
    /// Print one JSON document instead of text.
    #[arg(long)]
    pub json: bool,
    /// Configuration file (TOML). Left out: `troupe.toml` in the working directory, where there is one.
    #[arg(long, env = "TROUPE_CONFIG", value_name = "FILE")]
    pub(super) config: Option<PathBuf>,
    /// Folder of the model packs, or a single pack.
    #[arg(long, value_name = "FOLDER")]
    packs: Option<PathBuf>,
    /// The ONNX Runtime library.
    #[arg(long, value_name = "FILE")]
    onnx_runtime: Option<PathBuf>,
    /// The engine.
    #[arg(long, value_name = "ENGINE")]
    engine: Option<EngineChoice>,
    /// Threads for inference over all lanes of a pack; 0 is automatic.
    #[arg(long, value_name = "COUNT")]
    threads: Option<usize>,
    /// Lanes of a pack; 0 is automatic.
    #[arg(long, value_name = "COUNT")]
    lanes: Option<usize>,
}

impl DoctorArgs {
    /// The flags that are the server's too.
    pub(super) fn layer(&self) -> Layer {
        Layer {
            packs: self.packs.clone(),
            onnx_runtime: self.onnx_runtime.clone(),
            engine: self.engine,
            threads: self.threads,
            lanes: self.lanes,
            ..Layer::empty()
        }
    }
}
