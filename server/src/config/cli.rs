//! The command line.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use clap::Parser;
use clap::builder::{OsStringValueParser, TypedValueParser};
use clap::error::{ContextKind, ContextValue};
use confique::Layer as _;
use http::Uri;

use super::{ConfigError, Options, removed};
use crate::health::{HealthTls, READY};
use troupe_edge::clients::Role;
use troupe_engine::EngineChoice;

type Layer = <Options as confique::Config>::Layer;

/// The command line.
#[derive(Debug, Parser)]
#[command(
    name = "troupe-server",
    version,
    about = "Serves live characters and motion in-betweening over gRPC, HTTP and WebSocket, on one port",
    args_conflicts_with_subcommands = true
)]
pub struct Cli {
    /// A command to run instead of the server.
    #[command(subcommand)]
    pub command: Option<Command>,

    /// Configuration file (TOML). Left out: `troupe.toml` in the working directory, if it exists.
    #[arg(long, env = "TROUPE_CONFIG", value_name = "FILE")]
    pub(super) config: Option<PathBuf>,

    /// Print a configuration file with every option, its meaning and its default, and exit.
    #[arg(long)]
    pub print_config: bool,

    #[command(flatten)]
    pub(super) flags: Layer,
}

impl Cli {
    /// The error for a flag of an option that this version does not have, if `error` is about one.
    pub fn removed_flag(error: &clap::Error) -> Option<ConfigError> {
        match error.get(ContextKind::InvalidArg) {
            Some(ContextValue::String(flag)) => removed::of_flag(flag),
            _ => None,
        }
    }
}

/// Commands other than serving.
#[derive(Debug, Clone, clap::Subcommand)]
pub enum Command {
    /// Show what this machine and the library offer, the engine of each pack and the reason for it,
    /// and its speed. Takes a few seconds for each pack.
    Doctor(DoctorArgs),
    /// Ask a running server whether it is ready, and exit with 0 if it is, else with 1. For a
    /// container's health check.
    Health(HealthArgs),
    /// Make API keys for the file that `keys` names.
    #[command(subcommand)]
    Key(KeyCommand),
    /// Write manual pages: troupe-server.1, and one for each command.
    Man {
        /// Folder to write them to. It is made if it does not exist.
        #[arg(long, value_name = "FOLDER")]
        out: PathBuf,
    },
}

/// Commands for keys.
#[derive(Debug, Clone, clap::Subcommand)]
pub enum KeyCommand {
    /// Make a key. Prints the key, which is shown only this once, and its entry for the file of
    /// keys.
    New {
        /// Name of the key's owner.
        #[arg(long, value_name = "NAME")]
        name: String,
        /// Role of the key. drive: ask for motion, drive sessions, read. author: also write styles,
        /// scenes and object definitions. admin: also read metrics. metrics: only read metrics.
        #[arg(long, value_name = "ROLE")]
        role: Role,
        /// Tenant of the key. The sessions, scenes, definitions and styles of one tenant do not
        /// exist for another, nor for keys without a tenant.
        #[arg(long, value_name = "NAME")]
        tenant: Option<String>,
    },
}

/// Parses a folder. An empty name means none.
pub(super) fn maybe_folder() -> impl TypedValueParser<Value = PathBuf> {
    OsStringValueParser::new().map(PathBuf::from)
}

/// Options of the doctor. Those that it shares with the server come from the same environment and
/// configuration file.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct DoctorArgs {
    /// Print one JSON document instead of text.
    #[arg(long)]
    pub json: bool,
    /// Configuration file (TOML). Left out: `troupe.toml` in the working directory, if it exists.
    #[arg(long, env = "TROUPE_CONFIG", value_name = "FILE")]
    pub(super) config: Option<PathBuf>,
    /// Folder of the model packs, or a single pack.
    #[arg(long, value_name = "FOLDER")]
    packs: Option<PathBuf>,
    /// Engine that runs the networks.
    #[arg(long, value_name = "ENGINE")]
    engine: Option<EngineChoice>,
    /// Threads for inference over all workers of a pack; 0 is automatic.
    #[arg(long, value_name = "COUNT")]
    threads: Option<usize>,
    /// Workers of a pack; 0 is automatic.
    #[arg(long, value_name = "COUNT")]
    workers: Option<usize>,
}

impl DoctorArgs {
    /// The flags that the doctor shares with the server.
    pub(super) fn layer(&self) -> Layer {
        Layer {
            packs: self.packs.clone(),
            engine: self.engine,
            threads: self.threads,
            workers: self.workers,
            ..Layer::empty()
        }
    }
}

/// Options of the health check. Without a URL it asks the address that the server's own
/// configuration names.
#[derive(Debug, Clone, clap::Args)]
pub struct HealthArgs {
    /// Server to ask, with or without a path. Left out: the address that the configuration listens
    /// on. Without a path: `/readyz`.
    #[arg(long, value_name = "URL", value_parser = server_url)]
    pub url: Option<Uri>,
    /// How long to wait for the answer, in milliseconds.
    #[arg(long, value_name = "MS", default_value_t = 2000)]
    timeout_ms: u64,
    /// Configuration file (TOML). Left out: `troupe.toml` in the working directory, if it exists.
    #[arg(long, env = "TROUPE_CONFIG", value_name = "FILE")]
    pub(super) config: Option<PathBuf>,
    /// Address that the server listens on.
    #[arg(long, value_name = "ADDRESS")]
    listen: Option<SocketAddr>,
    /// Certificates of the authorities to trust (PEM file), for an https URL. Left out and without
    /// a URL: the server's own certificate, as tls_certificate names it.
    #[arg(long, env = "TROUPE_CA", value_name = "FILE")]
    ca: Option<PathBuf>,
    /// Certificate to show to a server that asks for one, as with tls_client_ca (PEM file).
    #[arg(
        long,
        env = "TROUPE_CLIENT_CERTIFICATE",
        value_name = "FILE",
        requires = "client_key"
    )]
    client_certificate: Option<PathBuf>,
    /// Private key of that certificate (PEM file).
    #[arg(
        long,
        env = "TROUPE_CLIENT_KEY",
        value_name = "FILE",
        requires = "client_certificate"
    )]
    client_key: Option<PathBuf>,
}

impl HealthArgs {
    /// How long to wait for the answer.
    pub fn timeout(&self) -> Duration {
        Duration::from_millis(self.timeout_ms)
    }

    /// How to ask a server that speaks TLS and shows the certificate in `own`.
    pub fn tls(&self, own: Option<PathBuf>) -> HealthTls {
        let client = self.client_certificate.clone().zip(self.client_key.clone());
        HealthTls {
            ca: self.ca.clone(),
            own,
            client,
        }
    }

    /// The flags that the health check shares with the server.
    pub(super) fn layer(&self) -> Layer {
        Layer {
            listen: self.listen,
            ..Layer::empty()
        }
    }
}

/// Parses a URL with scheme http or https. Without a path it gets the path of the readiness page.
fn server_url(text: &str) -> Result<Uri, String> {
    let allowed = "allowed: http://HOST:PORT or https://HOST:PORT, with or without a path";
    let url: Uri = text.parse().map_err(|error| format!("{error}; {allowed}"))?;
    let mut parts = url.into_parts();
    if !matches!(
        parts.scheme.as_ref().map(http::uri::Scheme::as_str),
        Some("http" | "https")
    ) {
        return Err(allowed.to_owned());
    }
    if parts.path_and_query.as_ref().is_none_or(|path| path == "/") {
        parts.path_and_query = Some(http::uri::PathAndQuery::from_static(READY));
    }
    Uri::from_parts(parts).map_err(|error| format!("{error}; {allowed}"))
}
