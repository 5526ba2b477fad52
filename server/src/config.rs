//! Configuration: flags before environment variables before the configuration file before defaults.

mod check;
mod cli;
mod error;
mod parts;
mod worst_case;

use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};

use confique::Config as _;

use troupe_edge::guard::{Host, Origin};
use troupe_engine::{AccuracyCheck, EngineChoice};

pub use cli::{Cli, Command, DoctorArgs, HealthArgs, KeyCommand};
pub use error::ConfigError;
pub use worst_case::{Part, WorstCase};

/// The file that is read where `--config` names none; it need not exist.
pub const DEFAULT_FILE: &str = "troupe.toml";

// The text on each field is the configuration template's, the flag's help and the documentation in
// one.
/// The server's configuration.
#[derive(Debug, Clone, confique::Config)]
#[config(layer_attr(derive(Debug, clap::Args)))]
#[config(layer_attr(serde(deny_unknown_fields)))]
pub struct Config {
    /// Address of the one port for gRPC and HTTP. 0.0.0.0:8080 listens on all interfaces.
    #[config(
        env = "TROUPE_LISTEN",
        default = "127.0.0.1:8080",
        layer_attr(arg(long, value_name = "ADDRESS"))
    )]
    pub listen: SocketAddr,

    /// File of API keys (TOML): who may call what. `troupe-server key new` makes a key and its
    /// entry. With it every call but health checks and documentation needs a key.
    #[config(env = "TROUPE_KEYS", layer_attr(arg(long, value_name = "FILE")))]
    pub keys: Option<PathBuf>,

    /// Public keys of an identity provider (JWKS file). With it the provider's tokens (JWT) let
    /// callers in, beside keys. Signed by RS256, ES256 or EdDSA, with the claims `exp`, `sub`,
    /// `role` and perhaps `tenant`. Read again when it changes.
    #[config(env = "TROUPE_JWKS", layer_attr(arg(long, value_name = "FILE")))]
    pub jwks: Option<PathBuf>,

    /// Issuer that tokens must name (claim `iss`). Left out: any.
    #[config(env = "TROUPE_JWT_ISSUER", layer_attr(arg(long, value_name = "TEXT")))]
    pub jwt_issuer: Option<String>,

    /// Audience that tokens must name (claim `aud`). Left out: tokens must name none.
    #[config(env = "TROUPE_JWT_AUDIENCE", layer_attr(arg(long, value_name = "TEXT")))]
    pub jwt_audience: Option<String>,

    /// File for a key of the role metrics, for Prometheus. The server makes it where there is none,
    /// if it asks for keys. Its owner and its group may read it.
    #[config(env = "TROUPE_METRICS_KEY", layer_attr(arg(long, value_name = "FILE")))]
    pub metrics_key: Option<PathBuf>,

    /// Whether the server makes itself a key for one run and prints it, if there is no file of keys
    /// and allow_anonymous is false.
    #[config(
        env = "TROUPE_ONE_TIME_KEY",
        default = false,
        layer_attr(arg(long, value_name = "BOOL", num_args = 0..=1, default_missing_value = "true"))
    )]
    pub one_time_key: bool,

    /// Whether everybody who reaches the port may use the server, if there is no file of keys.
    /// Without it a server that listens on other than loopback addresses starts only with keys.
    #[config(
        env = "TROUPE_ALLOW_ANONYMOUS",
        default = false,
        layer_attr(arg(long, value_name = "BOOL", num_args = 0..=1, default_missing_value = "true"))
    )]
    pub allow_anonymous: bool,

    /// Certificate of the server (PEM file), with those of the authorities between it and a root.
    /// With it and tls_key the port speaks TLS only. Changed files are read again within seconds,
    /// without a restart.
    #[config(env = "TROUPE_TLS_CERTIFICATE", layer_attr(arg(long, value_name = "FILE")))]
    pub tls_certificate: Option<PathBuf>,

    /// Private key of tls_certificate (PEM file).
    #[config(env = "TROUPE_TLS_KEY", layer_attr(arg(long, value_name = "FILE")))]
    pub tls_key: Option<PathBuf>,

    /// Certificates of the authorities whose clients may connect (PEM file). With it every client
    /// must show a certificate of one of them (mTLS), health checks too.
    #[config(env = "TROUPE_TLS_CLIENT_CA", layer_attr(arg(long, value_name = "FILE")))]
    pub tls_client_ca: Option<PathBuf>,

    /// Origins of web pages that may use the server, beside its own pages, such as
    /// https://app.example.com. In the environment and in flags separated by commas. Requests with
    /// another Origin header are refused.
    #[config(
        env = "TROUPE_ALLOWED_ORIGINS",
        default = [],
        parse_env = confique::env::parse::list_by_comma,
        layer_attr(arg(long, value_name = "ORIGIN", value_delimiter = ','))
    )]
    pub allowed_origins: Vec<Origin>,

    /// Hosts that requests may be for (their Host header), with or without a port; without one
    /// every port fits. A server that listens on a loopback address always answers to loopback
    /// names and addresses, and to no others unless they are listed here: name those that a proxy
    /// in front of it passes on. Any other server answers to every host if none is listed, else to
    /// those listed, to addresses and to localhost.
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

    /// Pack that answers requests which name none. Left out: `human` where there is one, else the
    /// first by name.
    #[config(env = "TROUPE_DEFAULT_PACK", layer_attr(arg(long, value_name = "NAME")))]
    pub default_pack: Option<String>,

    /// The ONNX Runtime library. `make runtime` fetches one and `cargo run` finds it.
    #[config(env = "ORT_DYLIB_PATH", layer_attr(arg(long, value_name = "FILE")))]
    pub onnx_runtime: Option<PathBuf>,

    /// What runs the networks. auto: OpenVINO in bf16 where the CPU has AVX512-BF16 or AMX, the
    /// library offers OpenVINO and the pack passes its accuracy check, else ONNX Runtime's own CPU
    /// kernels in f32. An engine that is named and cannot run is an error. `troupe-server doctor`
    /// says what each pack gets, and why.
    #[config(
        env = "TROUPE_ENGINE",
        default = "auto",
        layer_attr(arg(long, value_name = "ENGINE"))
    )]
    pub engine: EngineChoice,

    /// Accuracy check of an engine against f32. enforce: an engine that fails does not serve;
    /// report: it serves, with a warning in the log. The check is for trained packs. A pack of
    /// random weights may fail it.
    #[config(
        env = "TROUPE_ACCURACY_CHECK",
        default = "enforce",
        layer_attr(arg(long, value_name = "MODE"))
    )]
    pub accuracy_check: AccuracyCheck,

    /// Threads for inference, over all workers of a pack. 0: as many as this process may use,
    /// container limits included.
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

    /// Whether idle inference threads spin before they sleep: a little faster where the CPU has
    /// nothing else to do.
    #[config(
        env = "TROUPE_SPIN",
        default = false,
        layer_attr(arg(long, value_name = "BOOL"))
    )]
    pub spin: bool,

    /// Folder of the documentation, as `make docs` builds it: `/docs/` shows it. While the folder
    /// does not exist, `/docs/` says how to build it.
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
    /// models/. Networks open in the background when requests need them; the least recently used
    /// close first. More is faster with mixed lengths. 0: 180 for each pack, and at most half of
    /// the memory that this process may use.
    #[config(
        env = "TROUPE_NETWORK_MEMORY_MIB",
        default = 0,
        layer_attr(arg(long, value_name = "MIB"))
    )]
    pub network_memory_mib: u64,

    /// Most memory that the server may take at worst, whatever its clients do, in MiB.
    /// `troupe-server doctor` shows the worst case and which options make it; a server whose worst
    /// case is larger does not start. 0: no limit.
    #[config(
        env = "TROUPE_MEMORY_LIMIT_MIB",
        default = 0,
        layer_attr(arg(long, value_name = "MIB"))
    )]
    pub memory_limit_mib: u64,

    /// Most characters in one batch. 0: 32, and 16 with openvino-bf16. More saves hardly any time a
    /// character, and takes memory and start-up time.
    #[config(
        env = "TROUPE_MAX_BATCH",
        default = 0,
        layer_attr(arg(long, value_name = "COUNT"))
    )]
    pub max_batch: usize,

    /// Most characters of InBetween calls that may wait for a pack; calls beyond are refused at
    /// once. Live characters have room of their own: one place for each session of max_sessions.
    #[config(
        env = "TROUPE_MAX_QUEUED_CHARACTERS",
        default = 1024,
        layer_attr(arg(long, value_name = "COUNT"))
    )]
    pub max_queued_characters: usize,

    /// An InBetween call is refused at once if it would wait longer than this in the queue, by the
    /// queue's measured speed, in milliseconds. 0: no limit.
    #[config(
        env = "TROUPE_MAX_QUEUE_MS",
        default = 250,
        layer_attr(arg(long, value_name = "MS"))
    )]
    pub max_queue_ms: u64,

    /// Longest time of a batch, by the engine's measured speed, in milliseconds, so that no plan of
    /// a live character waits long behind it. 0: no limit.
    #[config(
        env = "TROUPE_MAX_BATCH_MS",
        default = 66,
        layer_attr(arg(long, value_name = "MS"))
    )]
    pub max_batch_ms: u64,

    /// How long an idle worker spins before it parks, in microseconds. A lone caller's next request
    /// then finds the core awake. The spinning worker yields to any other thread. 0: it parks at
    /// once.
    #[config(
        env = "TROUPE_WORKER_SPIN_US",
        default = 800,
        layer_attr(arg(long, value_name = "US"))
    )]
    pub worker_spin_us: u64,

    /// Most characters in one request.
    #[config(
        env = "TROUPE_MAX_CHARACTERS_PER_REQUEST",
        default = 256,
        layer_attr(arg(long, value_name = "COUNT"))
    )]
    pub max_characters_per_request: usize,

    /// Folder of what outlives the server: sessions, where the objects of scenes are, and, in
    /// folders of their own, uploaded styles, scenes and object definitions. One server at a time
    /// has it. Left out: `troupe/PORT` in the user's folder for states, such as ~/.local/state, or
    /// nothing where `listen` leaves the port to the system. An empty name: nothing is kept.
    #[config(
        env = "TROUPE_STORE",
        layer_attr(arg(long, value_name = "FOLDER", value_parser = cli::maybe_folder()))
    )]
    pub store: Option<PathBuf>,

    /// How often sessions are written to the store, in milliseconds: what happened since then is
    /// lost where the server is killed. Where there are so many sessions that it would take more
    /// than a tenth of a core, it is less often.
    #[config(
        env = "TROUPE_SNAPSHOT_INTERVAL_MS",
        default = 250,
        layer_attr(arg(long, value_name = "MS"))
    )]
    pub snapshot_interval_ms: u64,

    /// Folder of styles beside the packs' own: a folder for each pack, named as the pack, with one
    /// JSON file a style. Left out: in the store.
    #[config(env = "TROUPE_STYLES", layer_attr(arg(long, value_name = "FOLDER")))]
    pub styles: Option<PathBuf>,

    /// Folder of scenes, a TOML or JSON file each, named for the scene. Uploaded ones are kept
    /// there. Left out: in the store.
    #[config(env = "TROUPE_SCENES", layer_attr(arg(long, value_name = "FOLDER")))]
    pub scenes: Option<PathBuf>,

    /// Memory for all scenes, object definitions and added styles together, of all tenants, in MiB,
    /// as it is estimated. An upload that finds no room is refused.
    #[config(
        env = "TROUPE_MAX_SCENE_MEMORY_MIB",
        default = 256,
        layer_attr(arg(long, value_name = "MIB"))
    )]
    pub max_scene_memory_mib: usize,

    /// Most tenants at a time. A tenant of a key or token has sessions, scenes, object definitions
    /// and added styles of its own, which do not exist for others. What it uploads lies in the
    /// store, in tenants/NAME.
    #[config(
        env = "TROUPE_MAX_TENANTS",
        default = 64,
        layer_attr(arg(long, value_name = "COUNT"))
    )]
    pub max_tenants: usize,

    /// Folder of object definitions: a folder for each pack, named as the pack, with one TOML or
    /// JSON file a definition, named for it. Uploaded ones are kept there. Left out: in the store.
    #[config(env = "TROUPE_OBJECTS", layer_attr(arg(long, value_name = "FOLDER")))]
    pub objects: Option<PathBuf>,

    /// Most open sessions; further ones are refused.
    #[config(
        env = "TROUPE_MAX_SESSIONS",
        default = 16_384,
        layer_attr(arg(long, value_name = "COUNT"))
    )]
    pub max_sessions: usize,

    /// Most sessions of one request to create sessions or to step them.
    #[config(
        env = "TROUPE_MAX_SESSIONS_PER_REQUEST",
        default = 1024,
        layer_attr(arg(long, value_name = "COUNT"))
    )]
    pub max_sessions_per_request: usize,

    /// Most sessions on one stream.
    #[config(
        env = "TROUPE_MAX_SESSIONS_PER_STREAM",
        default = 4096,
        layer_attr(arg(long, value_name = "COUNT"))
    )]
    pub max_sessions_per_stream: usize,

    /// Most open streams, over gRPC and WebSocket together; further ones are refused.
    #[config(
        env = "TROUPE_MAX_STREAMS",
        default = 1024,
        layer_attr(arg(long, value_name = "COUNT"))
    )]
    pub max_streams: usize,

    /// Most open streams of one client: a key, or without keys a connection. All clients of one
    /// address may have twice as many.
    #[config(
        env = "TROUPE_MAX_STREAMS_PER_CLIENT",
        default = 256,
        layer_attr(arg(long, value_name = "COUNT"))
    )]
    pub max_streams_per_client: usize,

    /// Time without a command, step or stream after which a session expires, in milliseconds. A
    /// session may set its own.
    #[config(
        env = "TROUPE_SESSION_TTL_MS",
        default = 60_000,
        layer_attr(arg(long, value_name = "MS"))
    )]
    pub session_ttl_ms: u32,

    /// A stream whose reader takes nothing for this long is closed, in milliseconds.
    #[config(
        env = "TROUPE_DRIVE_STALL_TIMEOUT_MS",
        default = 30_000,
        layer_attr(arg(long, value_name = "MS"))
    )]
    pub drive_stall_timeout_ms: u64,

    /// Most bytes of one request, as protobuf or as JSON.
    #[config(
        env = "TROUPE_MAX_MESSAGE_BYTES",
        default = 16_777_216,
        layer_attr(arg(long, value_name = "BYTES"))
    )]
    pub max_message_bytes: usize,

    /// Memory for requests and answers on their way, in MiB: one that finds no room is refused with
    /// a hint. All clients of one address may take half of it, one client (a key, or without keys a
    /// connection) a quarter. 0: an eighth of the memory that this process may use, but 256 to
    /// 2048.
    #[config(
        env = "TROUPE_TRANSFER_MEMORY_MIB",
        default = 0,
        layer_attr(arg(long, value_name = "MIB"))
    )]
    pub transfer_memory_mib: u64,

    /// An answer of which its reader takes nothing for this long is given up, in milliseconds.
    #[config(
        env = "TROUPE_WRITE_TIMEOUT_MS",
        default = 30_000,
        layer_attr(arg(long, value_name = "MS"))
    )]
    pub write_timeout_ms: u64,

    /// Most open connections. 16 more are answered on /healthz, /readyz, /metrics and gRPC's health
    /// service only, and get 503 for all else; further ones are closed at once. 0: 10,000, or fewer
    /// if the system's limit of open files is lower.
    #[config(
        env = "TROUPE_MAX_CONNECTIONS",
        default = 0,
        layer_attr(arg(long, value_name = "COUNT"))
    )]
    pub max_connections: usize,

    /// Most open connections from one address; further ones are closed at once. A network of IPv6
    /// (/64) counts as one address, and so do all clients behind one proxy. 0: no limit.
    #[config(
        env = "TROUPE_MAX_CONNECTIONS_PER_ADDRESS",
        default = 1024,
        layer_attr(arg(long, value_name = "COUNT"))
    )]
    pub max_connections_per_address: usize,

    /// Most calls and streams at a time on one HTTP/2 connection; further ones wait in the client.
    /// One such connection may be all that a game server has.
    #[config(
        env = "TROUPE_MAX_CALLS_PER_CONNECTION",
        default = 1024,
        layer_attr(arg(long, value_name = "COUNT"))
    )]
    pub max_calls_per_connection: u32,

    /// Timeout of a request, in milliseconds.
    #[config(
        env = "TROUPE_REQUEST_TIMEOUT_MS",
        default = 30_000,
        layer_attr(arg(long, value_name = "MS"))
    )]
    pub request_timeout_ms: u64,

    /// How long the server still serves everybody after a signal to stop, in milliseconds, while
    /// `/readyz` says 503 already. A load balancer needs that time to notice: give it 5000 there
    /// and in Kubernetes, where drain_timeout_ms comes on top.
    #[config(
        env = "TROUPE_DRAIN_DELAY_MS",
        default = 0,
        layer_attr(arg(long, value_name = "MS"))
    )]
    pub drain_delay_ms: u64,

    /// How long requests may still finish after a signal to stop and drain_delay_ms, in
    /// milliseconds. Then connections are cut.
    #[config(
        env = "TROUPE_DRAIN_TIMEOUT_MS",
        default = 10_000,
        layer_attr(arg(long, value_name = "MS"))
    )]
    pub drain_timeout_ms: u64,

    /// Silence after which a connection is pinged, in milliseconds.
    #[config(
        env = "TROUPE_KEEPALIVE_MS",
        default = 20_000,
        layer_attr(arg(long, value_name = "MS"))
    )]
    pub keepalive_ms: u64,

    /// A connection without a call for this long is closed, in milliseconds. Open streams are
    /// calls.
    #[config(
        env = "TROUPE_IDLE_TIMEOUT_MS",
        default = 300_000,
        layer_attr(arg(long, value_name = "MS"))
    )]
    pub idle_timeout_ms: u64,

    /// Collector that gets traces of requests: OTLP over gRPC, without TLS. Left out: no traces.
    #[config(env = "TROUPE_OTLP_ENDPOINT", layer_attr(arg(long, value_name = "URL")))]
    pub otlp_endpoint: Option<String>,

    /// Share of requests and of plans that are traced, from 0 to 1. A request that comes with a
    /// `traceparent` is traced if that says so.
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

/// How log lines look.
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
        flags: <Self as confique::Config>::Layer,
    ) -> Result<Self, ConfigError> {
        let file = match file {
            Some(file) if !file.is_file() => return Err(ConfigError::MissingFile(file)),
            Some(file) => file,
            None => PathBuf::from(DEFAULT_FILE),
        };
        let config = Self::builder().preloaded(flags).env().file(file).load()?;
        config.checked()
    }

    /// The configuration that the doctor looks at: the server's, with the doctor's own flags.
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
    /// Never for the defaults above; the library cannot know that.
    pub fn local(packs: &Path) -> Result<Self, ConfigError> {
        let defaults = Self::builder().load()?;
        let listen = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        let onnx_runtime = std::env::var_os(troupe_engine::onnx::LIBRARY_VARIABLE).map(PathBuf::from);
        Self {
            listen,
            packs: packs.to_owned(),
            onnx_runtime,
            cache: Some(PathBuf::new()),
            store: Some(PathBuf::new()),
            ..defaults
        }
        .checked()
    }

    /// A configuration file with every option, its meaning and its default.
    pub fn template() -> String {
        confique::toml::template::<Self>(confique::toml::FormatOptions::default())
    }
}

#[cfg(test)]
#[path = "config_tests.rs"]
mod tests;
