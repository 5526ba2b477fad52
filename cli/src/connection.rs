//! Which server to ask, and how: options that every command has.

use std::path::PathBuf;

use clap::Args;
use troupe_client::{ApiKey, ClientCertificate, ConnectOptions, TlsOptions};

use crate::context::Context;
use crate::term::Term;
use crate::values::Seconds;

const HEADING: &str = "Server and notes";

/// The server, the key and certificates for it, and how much goes to standard error.
#[derive(Debug, Args)]
pub struct Connection {
    /// Address of the server.
    #[arg(
        long,
        global = true,
        env = "TROUPE_SERVER",
        default_value = "http://127.0.0.1:8080",
        value_name = "URL",
        help_heading = HEADING
    )]
    server: String,

    /// API key, if the server asks for one.
    #[arg(long, global = true, env = "TROUPE_KEY", hide_env_values = true, value_name = "KEY", help_heading = HEADING)]
    key: Option<ApiKey>,

    /// Certificates of the authorities to trust with an https:// address (PEM file). Default: those
    /// of the system.
    #[arg(long, global = true, env = "TROUPE_CA", value_name = "FILE", help_heading = HEADING)]
    ca: Option<PathBuf>,

    /// Certificate to show to a server that asks for one (PEM file).
    #[arg(long, global = true, env = "TROUPE_CLIENT_CERTIFICATE", requires = "client_key", value_name = "FILE", help_heading = HEADING)]
    client_certificate: Option<PathBuf>,

    /// Private key of that certificate (PEM file).
    #[arg(long, global = true, env = "TROUPE_CLIENT_KEY", requires = "client_certificate", value_name = "FILE", help_heading = HEADING)]
    client_key: Option<PathBuf>,

    /// Longest wait for one answer, in seconds.
    #[arg(long, global = true, default_value = "60", value_name = "SECONDS", help_heading = HEADING)]
    timeout: Seconds,

    /// Print no notes and no progress bar on standard error, only errors.
    #[arg(long, short, global = true, help_heading = HEADING)]
    quiet: bool,
}

impl From<Connection> for Context {
    fn from(given: Connection) -> Self {
        let both = given.client_certificate.zip(given.client_key);
        Self {
            url: given.server,
            options: ConnectOptions {
                request_timeout: given.timeout.into(),
                key: given.key,
                tls: TlsOptions {
                    ca: given.ca,
                    client: both.map(|(certificate, key)| ClientCertificate { certificate, key }),
                },
                ..ConnectOptions::default()
            },
            term: Term::new(given.quiet),
        }
    }
}
