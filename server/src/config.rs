//! Configuration. Flags override environment variables, these override the configuration file, and
//! that overrides defaults.

mod check;
mod cli;
mod error;
mod fixed;
mod parts;
mod removed;
mod worst_case;

use std::net::{Ipv4Addr, SocketAddr};
use std::ops::{Deref, DerefMut};
use std::path::{Path, PathBuf};

use confique::Config as _;

use troupe_edge::guard::{Host, Origin};
use troupe_engine::{AccuracyCheck, EngineChoice};

pub use cli::{Cli, Command, DoctorArgs, HealthArgs, KeyCommand};
pub use error::ConfigError;
pub use fixed::Fixed;
pub use worst_case::{MemoryUse, WorstCase};

/// The file that is read without `--config`. It need not exist.
pub const DEFAULT_FILE: &str = "troupe.toml";

/// The server's configuration: options that the operator sets, and constants.
#[derive(Debug, Clone)]
pub struct Config {
    /// Options that the operator sets.
    pub options: Options,
    /// Constants that only tests change.
    pub fixed: Fixed,
}

impl Deref for Config {
    type Target = Options;

    fn deref(&self) -> &Options {
        &self.options
    }
}

impl DerefMut for Config {
    fn deref_mut(&mut self) -> &mut Options {
        &mut self.options
    }
}

// The text of each field is also the help of its flag, the comment in the configuration template,
// and the text on the reference page.
/// The options of a server.
#[derive(Debug, Clone, confique::Config)]
#[config(layer_attr(derive(Debug, clap::Args)))]
#[config(layer_attr(serde(deny_unknown_fields)))]
pub struct Options {
    /// Address of the one port for gRPC and HTTP. 0.0.0.0:8080 listens on all interfaces.
    #[config(
        env = "TROUPE_LISTEN",
        default = "127.0.0.1:8080",
        layer_attr(arg(long, value_name = "ADDRESS"))
    )]
    pub listen: SocketAddr,

    /// Address of a second port that only answers health checks: /healthz, /readyz and gRPC's
    /// health service, without TLS and keys. Clients on the main port cannot take its connections
    /// away. Left out: only the main port answers health checks.
    #[config(env = "TROUPE_HEALTH_LISTEN", layer_attr(arg(long, value_name = "ADDRESS")))]
    pub health_listen: Option<SocketAddr>,

    /// File of API keys (TOML): who may call what. `troupe-server key new` makes a key and its
    /// entry. With this file, every call except health checks and documentation needs a key.
    #[config(env = "TROUPE_KEYS", layer_attr(arg(long, value_name = "FILE")))]
    pub keys: Option<PathBuf>,

    /// Public keys of an identity provider (JWKS file). Then callers may also use the provider's
    /// tokens (JWT) instead of keys. Tokens are signed by RS256, ES256 or EdDSA, and have the
    /// claims `exp`, `sub`, `role` and perhaps `tenant`. The server reads the file again when it
    /// changes.
    #[config(env = "TROUPE_JWKS", layer_attr(arg(long, value_name = "FILE")))]
    pub jwks: Option<PathBuf>,

    /// Issuer that tokens must name (claim `iss`). Left out: any.
    #[config(env = "TROUPE_JWT_ISSUER", layer_attr(arg(long, value_name = "TEXT")))]
    pub jwt_issuer: Option<String>,

    /// Audience that tokens must name (claim `aud`). Left out: tokens must name none.
    #[config(env = "TROUPE_JWT_AUDIENCE", layer_attr(arg(long, value_name = "TEXT")))]
    pub jwt_audience: Option<String>,

    /// File for a key of the role metrics, for Prometheus. If the server asks for keys and the file
    /// is missing, the server makes it. Its owner and its group may read it.
    #[config(env = "TROUPE_METRICS_KEY", layer_attr(arg(long, value_name = "FILE")))]
    pub metrics_key: Option<PathBuf>,

    /// Who may use the server without keys and jwks. local: everyone on this machine; a server that
    /// listens on other than loopback addresses does not start. one-time-key: everyone with the key
    /// that the server makes at each start and prints. anyone: everyone who reaches the port.
    #[config(
        env = "TROUPE_WITHOUT_KEYS",
        default = "local",
        layer_attr(arg(long, value_name = "WHO"))
    )]
    pub without_keys: WithoutKeys,

    /// Certificate of the server (PEM file), followed by those of the authorities between it and a
    /// root. With this and tls_key the port speaks only TLS. The server reads changed files within
    /// seconds, without a restart.
    #[config(env = "TROUPE_TLS_CERTIFICATE", layer_attr(arg(long, value_name = "FILE")))]
    pub tls_certificate: Option<PathBuf>,

    /// Private key of tls_certificate (PEM file).
    #[config(env = "TROUPE_TLS_KEY", layer_attr(arg(long, value_name = "FILE")))]
    pub tls_key: Option<PathBuf>,

    /// Certificates of the authorities whose clients may connect (PEM file). With this file every
    /// client must show a certificate of one of them (mTLS), also for health checks.
    #[config(env = "TROUPE_TLS_CLIENT_CA", layer_attr(arg(long, value_name = "FILE")))]
    pub tls_client_ca: Option<PathBuf>,

    /// Origins of web pages that may use the server, beside its own pages, such as
    /// https://app.example.com. Separated by commas in the environment and in flags. Requests with
    /// another Origin header are refused.
    #[config(
        env = "TROUPE_ALLOWED_ORIGINS",
        default = [],
        parse_env = confique::env::parse::list_by_comma,
        layer_attr(arg(long, value_name = "ORIGIN", value_delimiter = ','))
    )]
    pub allowed_origins: Vec<Origin>,

    /// Host headers that the server answers, with or without a port. Without one, every port fits.
    /// A server on a loopback address always answers loopback names and addresses. It answers other
    /// hosts only if they are in this list: name those that a proxy in front of it passes on. A
    /// server on another address answers every host if this list is empty. Otherwise it answers the
    /// hosts in the list, addresses and localhost.
    #[config(
        env = "TROUPE_ALLOWED_HOSTS",
        default = [],
        parse_env = confique::env::parse::list_by_comma,
        layer_attr(arg(long, value_name = "HOST", value_delimiter = ','))
    )]
    pub allowed_hosts: Vec<Host>,

    /// Folder of the model packs: a folder that holds pack folders, or a single pack.
    #[config(
        env = "TROUPE_PACKS",
        default = "models",
        layer_attr(arg(long, value_name = "FOLDER"))
    )]
    pub packs: PathBuf,

    /// Time between two looks at the folder of packs while the server runs, in seconds. A new
    /// folder is loaded, a changed one or a newer version takes its pack's place, and the pack of a
    /// folder that is gone is unloaded. A folder counts once two looks have seen the same files. 0:
    /// packs change only when an operator asks for it, as `troupe packs load` does.
    #[config(
        env = "TROUPE_WATCH_PACKS_S",
        default = 0,
        layer_attr(arg(long, value_name = "SECONDS"))
    )]
    pub watch_packs_s: u64,

    /// Pack for requests that name none. Left out: `human` if it is loaded, otherwise the first by
    /// name.
    #[config(env = "TROUPE_DEFAULT_PACK", layer_attr(arg(long, value_name = "NAME")))]
    pub default_pack: Option<String>,

    /// Engine that runs the networks. auto: OpenVINO in bf16 if the CPU has AVX512-BF16 or AMX, the
    /// library offers OpenVINO and the pack passes its accuracy check. Otherwise ONNX Runtime's own
    /// CPU kernels in f32. If an engine is named and cannot run, the server does not start.
    /// `troupe-server doctor` shows the engine of each pack, and why.
    #[config(
        env = "TROUPE_ENGINE",
        default = "auto",
        layer_attr(arg(long, value_name = "ENGINE"))
    )]
    pub engine: EngineChoice,

    /// Accuracy check of an engine against f32. enforce: an engine that fails does not serve.
    /// report: it serves, with a warning in the log. The check is for trained packs. A pack of
    /// random weights may fail it.
    #[config(
        env = "TROUPE_ACCURACY_CHECK",
        default = "enforce",
        layer_attr(arg(long, value_name = "MODE"))
    )]
    pub accuracy_check: AccuracyCheck,

    /// Threads for inference, over all workers of a pack. 0: as many as this process may use,
    /// within container limits.
    #[config(
        env = "TROUPE_THREADS",
        default = 0,
        layer_attr(arg(long, value_name = "COUNT"))
    )]
    pub threads: usize,

    /// Workers of a pack. A worker is a thread that runs one batch at a time. 0: one for each
    /// thread, up to 8.
    #[config(
        env = "TROUPE_WORKERS",
        default = 0,
        layer_attr(arg(long, value_name = "COUNT"))
    )]
    pub workers: usize,

    /// Folder of the documentation that `make docs` builds, shown at `/docs/`. If the folder does
    /// not exist, `/docs/` says how to build it.
    #[config(
        env = "TROUPE_DOCS",
        default = "target/site",
        layer_attr(arg(long, value_name = "FOLDER"))
    )]
    pub docs: PathBuf,

    /// Cache folder for results of accuracy checks, which make the next start faster. The server
    /// also starts if it cannot write there. Left out: `troupe` in the user's cache folder, such as
    /// ~/.cache. An empty name: no cache.
    #[config(
        env = "TROUPE_CACHE",
        layer_attr(arg(long, value_name = "FOLDER", value_parser = cli::maybe_folder()))
    )]
    pub cache: Option<PathBuf>,

    /// Memory for the networks of openvino-bf16 over all packs, in MiB. Each network serves one
    /// segment length and one number of characters, and takes about 17 MiB with the packs in
    /// models/. The server opens networks in the background when requests need them, and closes
    /// the least recently used first. More memory is faster with mixed lengths. 0: 180 for each
    /// pack, and at most half of the memory that this process may use.
    #[config(
        env = "TROUPE_NETWORK_MEMORY_MIB",
        default = 0,
        layer_attr(arg(long, value_name = "MIB"))
    )]
    pub network_memory_mib: u64,

    /// GPU of the engines `cuda` and `tensorrt`: CUDA's number, from 0 on. Where GPUs differ, set
    /// `CUDA_DEVICE_ORDER=PCI_BUS_ID` in the environment, and numbers are those of `nvidia-smi`.
    #[config(
        env = "TROUPE_GPU_DEVICE",
        default = 0,
        layer_attr(arg(long, value_name = "NUMBER"))
    )]
    pub gpu_device: u32,

    /// Most memory of the GPU that networks of `cuda` may take, in MiB. Packs have equal parts,
    /// and so have the workers of a pack. A network that needs more than its part does not start.
    /// CUDA itself takes some hundred MiB besides. 0: no limit.
    #[config(
        env = "TROUPE_GPU_MEMORY_MIB",
        default = 0,
        layer_attr(arg(long, value_name = "MIB"))
    )]
    pub gpu_memory_mib: u64,

    /// Most memory that the server may take in the worst case, in MiB. `troupe-server doctor` shows
    /// the worst case and the options that decide it. A server with a larger worst case does not
    /// start. 0: no limit.
    #[config(
        env = "TROUPE_MEMORY_LIMIT_MIB",
        default = 0,
        layer_attr(arg(long, value_name = "MIB"))
    )]
    pub memory_limit_mib: u64,

    /// Most characters in one batch. 0: 32, and 16 with openvino-bf16. On CPUs, more saves hardly
    /// any time per character, and takes memory and start-up time. On GPUs, more is faster. The
    /// queue of a pack holds 16 such batches for each worker, and at least 1024 characters.
    #[config(
        env = "TROUPE_MAX_BATCH",
        default = 0,
        layer_attr(arg(long, value_name = "COUNT"))
    )]
    pub max_batch: usize,

    /// Longest wait of an InBetween call in the queue, in milliseconds. The server refuses a call
    /// at once if it would wait longer at the queue's measured speed. 0: no limit.
    #[config(
        env = "TROUPE_MAX_QUEUE_MS",
        default = 250,
        layer_attr(arg(long, value_name = "MS"))
    )]
    pub max_queue_ms: u64,

    /// Folder for everything that outlives the server: sessions, places of scene objects, and in
    /// folders of their own uploaded styles, scenes and object definitions. Only one server at a
    /// time can use it. Left out: `troupe/PORT` in the user's folder for states, such as
    /// ~/.local/state. If `listen` leaves the port to the system, nothing is kept. An empty name:
    /// nothing is kept. An address redis://HOST:PORT, or rediss:// for TLS, or with several hosts
    /// for a cluster: a Valkey or Redis, which several servers share. It has sessions, places of
    /// scene objects, and uploads. Set the address in the environment if it has a password.
    #[config(
        env = "TROUPE_STORE",
        layer_attr(arg(long, value_name = "FOLDER", value_parser = cli::maybe_folder()))
    )]
    pub store: Option<PathBuf>,

    /// HOST:PORT under which clients reach this server. Servers that share a store name it to
    /// clients who ask for a session that this server has. Left out: `listen`.
    #[config(env = "TROUPE_ADVERTISE", layer_attr(arg(long, value_name = "ADDRESS")))]
    pub advertise: Option<String>,

    /// Folder of styles beside the packs' own. It has a folder for each pack with the pack's name,
    /// and in it a JSON file for each style. Left out: in the store.
    #[config(env = "TROUPE_STYLES", layer_attr(arg(long, value_name = "FOLDER")))]
    pub styles: Option<PathBuf>,

    /// Folder of scenes. Each is a TOML or JSON file with the name of the scene. The server keeps
    /// uploaded scenes there. Left out: in the store.
    #[config(env = "TROUPE_SCENES", layer_attr(arg(long, value_name = "FOLDER")))]
    pub scenes: Option<PathBuf>,

    /// Estimated memory for all scenes, object definitions and added styles of all tenants
    /// together, in MiB. An upload without room is refused.
    #[config(
        env = "TROUPE_MAX_SCENE_MEMORY_MIB",
        default = 256,
        layer_attr(arg(long, value_name = "MIB"))
    )]
    pub max_scene_memory_mib: usize,

    /// Folder of object definitions. It has a folder for each pack with the pack's name, and in it
    /// a TOML or JSON file for each definition, with the definition's name. The server keeps
    /// uploaded definitions there. Left out: in the store.
    #[config(env = "TROUPE_OBJECTS", layer_attr(arg(long, value_name = "FOLDER")))]
    pub objects: Option<PathBuf>,

    /// Most open sessions. Further ones are refused, unless sessions that were idle for a minute
    /// make room. On a server without keys, one address may have an eighth of them.
    #[config(
        env = "TROUPE_MAX_SESSIONS",
        default = 16_384,
        layer_attr(arg(long, value_name = "COUNT"))
    )]
    pub max_sessions: usize,

    /// Most open streams, over gRPC and WebSocket together. Further ones are refused. A key may
    /// have a quarter of them, all keys of one address half. On a server without keys, one address
    /// may have an eighth.
    #[config(
        env = "TROUPE_MAX_STREAMS",
        default = 1024,
        layer_attr(arg(long, value_name = "COUNT"))
    )]
    pub max_streams: usize,

    /// Memory for requests and answers in transfer, in MiB. A request without room is refused with
    /// a retry hint. A key may take a quarter of it, all keys of one address half. On a server
    /// without keys, one address may take an eighth. 0: an eighth of the memory that this process
    /// may use, at least 256 and at most 2048.
    #[config(
        env = "TROUPE_TRANSFER_MEMORY_MIB",
        default = 0,
        layer_attr(arg(long, value_name = "MIB"))
    )]
    pub transfer_memory_mib: u64,

    /// Most open connections. One address may have half of them. A network of IPv6 (/64) counts as
    /// one address, and so do all clients behind one proxy. If all are open, connections that were
    /// idle for 2 s make room. 16 more connections get answers on
    /// /healthz, /readyz, /metrics and gRPC's health service, and 503 for all else. Further ones
    /// are closed at once. 0: 10,000, or fewer if the system's limit of open files is lower.
    #[config(
        env = "TROUPE_MAX_CONNECTIONS",
        default = 0,
        layer_attr(arg(long, value_name = "COUNT"))
    )]
    pub max_connections: usize,

    /// Timeout of a request, in milliseconds.
    #[config(
        env = "TROUPE_REQUEST_TIMEOUT_MS",
        default = 30_000,
        layer_attr(arg(long, value_name = "MS"))
    )]
    pub request_timeout_ms: u64,

    /// Time for which the server still serves everything after a signal to stop, in milliseconds.
    /// `/readyz` says 503 from the start. Behind a load balancer and in Kubernetes set it to 5000,
    /// so that new requests go elsewhere before the port closes. drain_timeout_ms comes on top.
    #[config(
        env = "TROUPE_DRAIN_DELAY_MS",
        default = 0,
        layer_attr(arg(long, value_name = "MS"))
    )]
    pub drain_delay_ms: u64,

    /// Time for requests to finish after a signal to stop and drain_delay_ms, in milliseconds. Then
    /// connections are cut.
    #[config(
        env = "TROUPE_DRAIN_TIMEOUT_MS",
        default = 10_000,
        layer_attr(arg(long, value_name = "MS"))
    )]
    pub drain_timeout_ms: u64,

    /// Collector that gets traces of requests: OTLP over gRPC, without TLS. Left out: no traces.
    #[config(env = "TROUPE_OTLP_ENDPOINT", layer_attr(arg(long, value_name = "URL")))]
    pub otlp_endpoint: Option<String>,

    /// Share of requests and of plans that are traced, from 0 to 1. For a request with a
    /// `traceparent` that header decides.
    #[config(
        env = "TROUPE_TRACE_SAMPLE_RATIO",
        default = 0.1,
        layer_attr(arg(long, value_name = "RATIO"))
    )]
    pub trace_sample_ratio: f64,

    /// What to log: a level (error, warn, info, debug, trace), or a level for each module.
    #[config(
        env = "TROUPE_LOG",
        default = "info,ort=warn",
        layer_attr(arg(long, value_name = "FILTER"))
    )]
    pub log: String,

    /// Log lines as text or as JSON.
    #[config(
        env = "TROUPE_LOG_FORMAT",
        default = "text",
        layer_attr(arg(long, value_name = "FORMAT"))
    )]
    pub log_format: LogFormat,
}

/// Who may use a server without keys and tokens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum WithoutKeys {
    /// Everyone on this machine. The server must listen on a loopback address.
    Local,
    /// Everyone with the key that the server makes at each start and prints.
    OneTimeKey,
    /// Everyone who reaches the port.
    Anyone,
}

/// Form of log lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum LogFormat {
    /// For people.
    Text,
    /// For machines.
    Json,
}

impl Config {
    /// The configuration from a command line, the environment and the configuration file.
    ///
    /// # Errors
    /// [`ConfigError`], which names the option.
    pub fn load(cli: Cli) -> Result<Self, ConfigError> {
        Self::from_layers(cli.config, cli.flags)
    }

    fn from_layers(
        file: Option<PathBuf>,
        flags: <Options as confique::Config>::Layer,
    ) -> Result<Self, ConfigError> {
        let file = match file {
            Some(file) if !file.is_file() => return Err(ConfigError::MissingFile(file)),
            Some(file) => file,
            None => PathBuf::from(DEFAULT_FILE),
        };
        removed::check_environment()?;
        removed::check_file(&file)?;
        let options = Options::builder().preloaded(flags).env().file(file).load()?;
        Self {
            options,
            fixed: Fixed::default(),
        }
        .checked()
    }

    /// The configuration that the doctor examines: the server's, with the doctor's own flags.
    ///
    /// # Errors
    /// [`ConfigError`], which names the option.
    pub fn load_for_doctor(args: &DoctorArgs) -> Result<Self, ConfigError> {
        Self::from_layers(args.config.clone(), args.layer())
    }

    /// The configuration of the server that the health check asks.
    ///
    /// # Errors
    /// [`ConfigError`], which names the option.
    pub fn load_for_health(args: &HealthArgs) -> Result<Self, ConfigError> {
        Self::from_layers(args.config.clone(), args.layer())
    }

    /// The defaults, with packs from `packs` and any free port of the loopback interface: for tests
    /// and embedding.
    ///
    /// # Errors
    /// Never for the defaults above, but the library cannot know that.
    pub fn local(packs: &Path) -> Result<Self, ConfigError> {
        let defaults = Options::builder().load()?;
        let listen = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        let options = Options {
            listen,
            packs: packs.to_owned(),
            cache: Some(PathBuf::new()),
            store: Some(PathBuf::new()),
            ..defaults
        };
        Self {
            options,
            fixed: Fixed::default(),
        }
        .checked()
    }

    /// A configuration file with every option, its meaning and its default.
    pub fn template() -> String {
        confique::toml::template::<Options>(confique::toml::FormatOptions::default())
    }
}

#[cfg(test)]
#[path = "config_tests.rs"]
mod tests;
