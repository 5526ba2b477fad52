//! Arguments of the command line.

use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};

use troupe_client::ApiKey;

use crate::access::Access;
use crate::arrivals::Stages;

/// Put load on a Troupe server and measure its answers.
#[derive(Debug, Parser)]
#[command(name = "troupe-loadtest", version, propagate_version = true, max_term_width = 110, after_long_help = AFTER)]
pub(super) struct Arguments {
    #[command(subcommand)]
    pub(super) command: Command,
}

const AFTER: &str = "\
Exit codes:
  0  done, and all stated bounds were kept
  1  an output file could not be written, or something broke
  2  wrong arguments, or a file that cannot be used
  3  no server answers at the address
  4  the server refused to let the load begin
  5  a stated bound was missed, or a search found nothing

Examples:
  troupe-loadtest run --clients 32
  troupe-loadtest run --rate 200 --arrivals poisson --duration 60s --html report.html
  troupe-loadtest run --stages 50:10,50-300:30 --json ramp.json
  troupe-loadtest run --workload drive --characters 200 --duration 5m --expect-zero-underruns
  troupe-loadtest run --workload idle --characters 10000
  troupe-loadtest search --workload drive --p99-ms 33
  troupe-loadtest search --p99-ms 50
  troupe-loadtest overload --factor 5 --seconds 120 --beside-characters 50
  troupe-loadtest compare before.json after.json";

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    Run(Box<Run>),
    Search(Box<Search>),
    Overload(Box<Overload>),
    Compare(Compare),
    Report(ReportArgs),
    /// Print the JSON Schema of reports.
    Schema,
    /// Write manual pages: troupe-loadtest.1, and one for each command.
    Man {
        /// Folder to write them to. It is created if needed.
        #[arg(long, value_name = "FOLDER")]
        out: PathBuf,
    },
}

/// Run a load, once or several times.
///
/// Single requests come from clients that wait for their answers (--clients, a closed loop), or at
/// fixed times that do not depend on answers (--rate, an open loop). In an open loop, latency
/// counts from the time at which a request was due.
#[derive(Debug, Args)]
pub(super) struct Run {
    #[command(flatten)]
    pub(super) common: Common,
    #[command(flatten)]
    pub(super) time: Time,
    #[command(flatten)]
    pub(super) load: LoadArgs,
    #[command(flatten)]
    pub(super) requests: RequestArgs,
    #[command(flatten)]
    pub(super) live: LiveArgs,
    #[command(flatten)]
    pub(super) bounds: BoundArgs,
    #[command(flatten)]
    pub(super) output: Output,
    /// Number of runs. The report has each run and the medians.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000), value_name = "TIMES")]
    pub(super) repeat: u32,
}

/// Search for the highest load of a server: characters without an underrun, or requests a second.
///
/// The search doubles the level until it does not hold, then halves the distance, then confirms the
/// result. With --workload drive or step the level is the number of characters, which must have
/// no underrun and miss no frame. With other workloads it is the rate of an open loop.
#[derive(Debug, Args)]
pub(super) struct Search {
    #[command(flatten)]
    pub(super) common: Common,
    #[command(flatten)]
    pub(super) time: Time,
    /// 99 % of latencies must be at most this, milliseconds.
    #[arg(long, value_name = "MS")]
    pub(super) p99_ms: f64,
    /// Minimum number of plans a second that each character must get on average.
    #[arg(long, default_value_t = 0.0, value_name = "PLANS")]
    pub(super) min_plans: f64,
    /// Minimum share of requests with a right answer.
    #[arg(long, default_value_t = 0.999, value_name = "SHARE")]
    pub(super) right_share: f64,
    /// First level to try [default: 16 characters, 10 requests/s].
    #[arg(long, value_name = "LEVEL")]
    pub(super) first: Option<f64>,
    /// Highest level to try [default: 16384 characters, 100000 requests/s].
    #[arg(long, value_name = "LEVEL")]
    pub(super) most: Option<f64>,
    /// Precision of the result, as a share of it.
    #[arg(long, default_value_t = 0.05, value_name = "SHARE")]
    pub(super) within: f64,
    /// Number of further runs in which the result must hold.
    #[arg(long, default_value_t = 2, value_name = "TIMES")]
    pub(super) confirm: u32,
    /// Number of failed runs after which a level counts as too high. Above 1 it ignores single
    /// disturbances of the machine.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=100), value_name = "TIMES")]
    pub(super) tries: u32,
    #[command(flatten)]
    pub(super) arrivals: ArrivalArgs,
    #[command(flatten)]
    pub(super) requests: RequestArgs,
    #[command(flatten)]
    pub(super) live: LiveArgs,
    #[command(flatten)]
    pub(super) output: Output,
}

/// Send several times as many requests as a server can answer, and measure its answers.
///
/// Finds the capacity in requests/s. Then sends 90 % of the capacity, a multiple of it (--factor),
/// and half of it, as an open loop with Poisson arrivals.
#[derive(Debug, Args)]
pub(super) struct Overload {
    #[command(flatten)]
    pub(super) common: Common,
    /// Time before measuring begins.
    #[arg(long, default_value = "3s", value_name = "TIME")]
    pub(super) warmup: Time1,
    /// Requests a second that the server can answer. Default: measured with clients that wait for
    /// their answers.
    #[arg(long, value_name = "RATE")]
    pub(super) capacity: Option<f64>,
    /// Number of clients that measure the capacity.
    #[arg(long, default_value_t = 64, value_name = "CLIENTS")]
    pub(super) probe_clients: u32,
    /// Time to measure the capacity.
    #[arg(long, default_value = "10s", value_name = "TIME")]
    pub(super) probe: Time1,
    /// Arrivals as a multiple of the capacity.
    #[arg(long, default_value_t = 5.0, value_name = "TIMES")]
    pub(super) factor: f64,
    /// Time at 90 % of capacity.
    #[arg(long, default_value = "20s", value_name = "TIME")]
    pub(super) before: Time1,
    /// Time of the overload.
    #[arg(long, default_value = "120s", value_name = "TIME")]
    pub(super) seconds: Time1,
    /// Time after the overload.
    #[arg(long, default_value = "20s", value_name = "TIME")]
    pub(super) after: Time1,
    /// Arrivals after the overload, as a share of the capacity.
    #[arg(long, default_value_t = 0.5, value_name = "SHARE")]
    pub(super) after_share: f64,
    /// Maximum number of requests in flight per process. Further requests are dropped and counted.
    #[arg(long, default_value_t = 8192, value_parser = clap::value_parser!(u32).range(1..=1_000_000), value_name = "REQUESTS")]
    pub(super) max_in_flight: u32,
    /// Number of live characters in addition to the requests, on one stream at 30 Hz.
    #[arg(long, default_value_t = 0, value_name = "CHARACTERS")]
    pub(super) beside_characters: u32,
    /// Maximum p99 under overload, as a multiple of the p99 at 90 % of capacity.
    #[arg(long, value_name = "TIMES", help_heading = BOUNDS)]
    pub(super) expect_p99_ratio: Option<f64>,
    /// Maximum time until the server recovers, seconds.
    #[arg(long, value_name = "SECONDS", help_heading = BOUNDS)]
    pub(super) expect_recovery_s: Option<f64>,
    /// No live character may slow down.
    #[arg(long, help_heading = BOUNDS)]
    pub(super) expect_zero_underruns: bool,
    #[command(flatten)]
    pub(super) requests: RequestArgs,
    #[command(flatten)]
    pub(super) output: Output,
}

/// Put reports side by side: medians, and their ratios to the first report.
#[derive(Debug, Args)]
pub(super) struct Compare {
    /// Reports that --json wrote.
    #[arg(required = true, num_args = 2.., value_name = "REPORT")]
    pub(super) reports: Vec<PathBuf>,
}

/// Show a report that --json wrote, or write it as a page.
#[derive(Debug, Args)]
pub(super) struct ReportArgs {
    /// A report that --json wrote.
    pub(super) report: PathBuf,
    /// Write the report as one self-contained page with plots.
    #[arg(long, value_name = "FILE")]
    pub(super) html: Option<PathBuf>,
}

const SERVER: &str = "Server and machine";
const LOAD: &str = "When requests are sent";
const REQUESTS: &str = "What requests hold";
const LIVE: &str = "Live characters";
const BOUNDS: &str = "Bounds: exit code 5 if one is missed";
const OUTPUT: &str = "Output";

/// The kind of requests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum WorkloadArg {
    /// Single in-betweening requests over gRPC.
    Inbetween,
    /// Single in-betweening requests as JSON over HTTP/1.1.
    Json,
    /// POST requests with prepared bytes to any HTTP server. Needs --requests.
    Http,
    /// Live characters that wander about, on streams with the server's clock.
    Drive,
    /// Live characters that wander about, in steps with this client's clock.
    Step,
    /// Open sessions without any calls.
    Idle,
}

#[derive(Debug, Args)]
pub(super) struct Common {
    /// Address of the server. With --workload http, the full URL of the POST requests.
    #[arg(long, visible_alias = "url", env = "TROUPE_SERVER", default_value = "http://127.0.0.1:8080", value_name = "URL", help_heading = SERVER)]
    pub(super) server: String,
    #[command(flatten)]
    pub(super) access: AccessArgs,
    /// Kind of requests.
    #[arg(long, value_enum, default_value_t = WorkloadArg::Inbetween, value_name = "WORKLOAD", help_heading = SERVER)]
    pub(super) workload: WorkloadArg,
    /// gRPC connections per process. HTTP/1.1 uses one connection per request in flight.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1024), value_name = "COUNT", help_heading = SERVER)]
    pub(super) connections: u32,
    /// Number of processes that share the load.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=256), value_name = "COUNT", help_heading = SERVER)]
    pub(super) processes: u32,
    /// Maximum wait for one answer.
    #[arg(long, default_value = "30s", value_name = "TIME", help_heading = SERVER)]
    pub(super) timeout: Time1,
    /// Seed of all random choices.
    #[arg(long, default_value_t = 0, value_name = "NUMBER", help_heading = SERVER)]
    pub(super) seed: u64,
}

/// Key and certificates of the load tester.
#[derive(Debug, Clone, Args)]
pub(super) struct AccessArgs {
    /// API key, if the server asks for one. With a key of the role admin, the report includes the
    /// server's metrics.
    #[arg(long, env = "TROUPE_KEY", hide_env_values = true, value_name = "KEY", help_heading = SERVER)]
    key: Option<ApiKey>,
    /// PEM file with the authorities to trust for an https:// address. Default: the authorities of
    /// the system.
    #[arg(long, env = "TROUPE_CA", value_name = "FILE", help_heading = SERVER)]
    ca: Option<PathBuf>,
    /// PEM file with a client certificate, for servers that ask for one.
    #[arg(long, env = "TROUPE_CLIENT_CERTIFICATE", requires = "client_key", value_name = "FILE", help_heading = SERVER)]
    client_certificate: Option<PathBuf>,
    /// PEM file with the private key of the client certificate.
    #[arg(long, env = "TROUPE_CLIENT_KEY", requires = "client_certificate", value_name = "FILE", help_heading = SERVER)]
    client_key: Option<PathBuf>,
}

impl From<AccessArgs> for Access {
    fn from(args: AccessArgs) -> Self {
        Self {
            key: args.key.map(|key| key.as_str().to_owned()),
            ca: args.ca,
            client: args.client_certificate.zip(args.client_key),
        }
    }
}

#[derive(Debug, Args)]
pub(super) struct Time {
    /// Time before measuring begins.
    #[arg(long, default_value = "3s", value_name = "TIME", help_heading = LOAD)]
    pub(super) warmup: Time1,
    /// Measured time, such as 90s, 5m or a number of seconds. With stages, it is the sum of their
    /// times.
    #[arg(long, default_value = "15s", value_name = "TIME", help_heading = LOAD)]
    pub(super) duration: Time1,
}

/// Distribution of arrivals over time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum ArrivalsArg {
    /// At equal intervals.
    Constant,
    /// Independent of each other, like those of many users.
    #[default]
    Poisson,
    /// Many at one moment, then none until the next burst. See --burst-size and --burst-period.
    Bursty,
}

#[derive(Debug, Args)]
pub(super) struct ArrivalArgs {
    /// Distribution of the arrivals of an open loop over time.
    #[arg(long, value_enum, default_value_t, value_name = "PROCESS", help_heading = LOAD)]
    pub(super) arrivals: ArrivalsArg,
    /// Number of arrivals in a burst. The rate decides how often bursts come.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1_000_000), conflicts_with = "burst_period", value_name = "COUNT", help_heading = LOAD)]
    pub(super) burst_size: Option<u32>,
    /// Time from burst to burst. The rate decides how large bursts are.
    #[arg(long, value_name = "TIME", help_heading = LOAD)]
    pub(super) burst_period: Option<Time1>,
    /// Open loop: maximum number of requests in flight per process. Further requests are dropped
    /// and counted.
    #[arg(long, default_value_t = 4096, value_parser = clap::value_parser!(u32).range(1..=1_000_000), value_name = "REQUESTS", help_heading = LOAD)]
    pub(super) max_in_flight: u32,
}

#[derive(Debug, Args)]
pub(super) struct LoadArgs {
    /// Closed loop: number of clients, each of which waits for its answer [default: 8].
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=100_000), conflicts_with_all = ["rate", "stages", "client_stages"], value_name = "COUNT", help_heading = LOAD)]
    pub(super) clients: Option<u32>,
    /// Closed loop with a changing number of clients: stages CLIENTS:SECONDS or FROM-TO:SECONDS,
    /// separated by commas.
    #[arg(long, conflicts_with_all = ["rate", "stages"], value_name = "STAGES", help_heading = LOAD)]
    pub(super) client_stages: Option<Stages>,
    /// Time from an answer to a client's next request.
    #[arg(long, default_value = "0s", value_name = "TIME", help_heading = LOAD)]
    pub(super) think: Time0,
    /// Open loop: requests a second.
    #[arg(long, conflicts_with = "stages", value_name = "RATE", help_heading = LOAD)]
    pub(super) rate: Option<f64>,
    /// Open loop with a changing rate: stages RATE:SECONDS or FROM-TO:SECONDS, separated by commas,
    /// such as 50:10,50-200:30.
    #[arg(long, value_name = "STAGES", help_heading = LOAD)]
    pub(super) stages: Option<Stages>,
    #[command(flatten)]
    pub(super) arrivals: ArrivalArgs,
}

#[derive(Debug, Args)]
pub(super) struct RequestArgs {
    /// Prepared requests: a folder with requests.json (see the documentation).
    #[arg(long, value_name = "FOLDER", help_heading = REQUESTS)]
    pub(super) requests: Option<PathBuf>,
    /// BVH clip, in centimetres, from which keyframes are taken. Default: a built-in walk.
    #[arg(long, value_name = "FILE", help_heading = REQUESTS)]
    pub(super) clip: Option<PathBuf>,
    /// Name of the pack. Default: the server's default pack.
    #[arg(long, default_value = "", hide_default_value = true, value_name = "NAME", help_heading = REQUESTS)]
    pub(super) pack: String,
    /// Number of characters in a request.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=4096), value_name = "COUNT", help_heading = REQUESTS)]
    pub(super) per_request: u32,
    /// Frames of a character's segment, context and target included.
    #[arg(long, default_value_t = 64, value_name = "FRAMES", help_heading = REQUESTS)]
    pub(super) frames: u32,
    /// Sampling temperature, 0 to 2.
    #[arg(long, default_value_t = 0.0, value_name = "NUMBER", help_heading = REQUESTS)]
    pub(super) temperature: f32,
    /// Number of different requests, which are sent in turn.
    #[arg(long, default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=65_536), value_name = "COUNT", help_heading = REQUESTS)]
    pub(super) variants: u32,
    /// Fully decode and check one in this many answers, or ticks of live characters; 0 for none. Of
    /// the other answers, only status, frame count and timing are read.
    #[arg(long, default_value_t = 100, value_name = "COUNT", help_heading = REQUESTS)]
    pub(super) verify_every: u32,
    /// Additional header for --workload http. May be given several times.
    #[arg(long, value_name = "NAME:VALUE", help_heading = REQUESTS)]
    pub(super) header: Vec<Header>,
}

#[derive(Debug, Args)]
pub(super) struct LiveArgs {
    /// Number of characters.
    #[arg(long, visible_alias = "sessions", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=1_000_000), value_name = "COUNT", help_heading = LIVE)]
    pub(super) characters: u32,
    /// Number of streams that the characters share, or of groups that are stepped together.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=65_536), value_name = "COUNT", help_heading = LIVE)]
    pub(super) streams: u32,
    /// Frames a second: 30, 50 or 60.
    #[arg(long, default_value_t = 30, value_parser = hz, value_name = "RATE", help_heading = LIVE)]
    pub(super) hz: u32,
    /// Ask for 32-bit floats instead of compact frames.
    #[arg(long, help_heading = LIVE)]
    pub(super) floats: bool,
    /// File of a character, such as hero.glb, whose skeleton the characters wear.
    #[arg(long, value_name = "FILE", help_heading = LIVE)]
    pub(super) skeleton: Option<PathBuf>,
    /// Names of styles. Default: all styles of the pack that move from place to place.
    #[arg(long, value_delimiter = ',', value_name = "STYLES", help_heading = LIVE)]
    pub(super) styles: Vec<String>,
    /// Mean time between two commands of a character; 0 for one command at the start.
    #[arg(long, default_value = "2.5s", value_name = "TIME", help_heading = LIVE)]
    pub(super) command_every: Time0,
    /// Frames from the cursor to the start of a new plan. Default: the server's default.
    #[arg(long, value_name = "FRAMES", help_heading = LIVE)]
    pub(super) look_ahead: Option<u32>,
    /// Give characters different priorities, spread evenly from 0 to 1.
    #[arg(long, help_heading = LIVE)]
    pub(super) spread_priorities: bool,
    /// Share of the characters that act out sentences, 0 to 1. A sentence takes 3 s, and the next
    /// follows after 6 s on average. The server needs a pack that turns words into motion for the
    /// characters' skeleton.
    #[arg(long, default_value_t = 0.0, value_name = "SHARE", help_heading = LIVE)]
    pub(super) performers: f64,
    /// Step again as soon as frames arrive, instead of at the time of each frame.
    #[arg(long, help_heading = LIVE)]
    pub(super) unpaced: bool,
}

#[derive(Debug, Args)]
pub(super) struct BoundArgs {
    /// 99 % of latencies must be at most this, milliseconds, in every repetition.
    #[arg(long, value_name = "MS", help_heading = BOUNDS)]
    pub(super) expect_p99_ms: Option<f64>,
    /// No character may slow down because of a late plan, or miss a frame.
    #[arg(long, help_heading = BOUNDS)]
    pub(super) expect_zero_underruns: bool,
    /// No request may fail or be dropped by this client. Refusals are allowed.
    #[arg(long, help_heading = BOUNDS)]
    pub(super) expect_zero_failures: bool,
    /// Minimum number of right answers a second.
    #[arg(long, value_name = "RATE", help_heading = BOUNDS)]
    pub(super) expect_rate: Option<f64>,
}

#[derive(Debug, Args)]
pub(super) struct Output {
    /// Write the report as JSON.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(super) json: Option<PathBuf>,
    /// Write the report as one self-contained page with plots.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(super) html: Option<PathBuf>,
    /// A name for the report, shown in comparisons.
    #[arg(long, default_value = "", hide_default_value = true, value_name = "TEXT", help_heading = OUTPUT)]
    pub(super) label: String,
    /// Show no progress on standard error.
    #[arg(long, short, help_heading = OUTPUT)]
    pub(super) quiet: bool,
}

fn hz(text: &str) -> Result<u32, String> {
    match text {
        "30" => Ok(30),
        "50" => Ok(50),
        "60" => Ok(60),
        other => Err(format!("{other} is not 30, 50 or 60")),
    }
}

/// A time above 0, such as `90s`, `1m 30s` or a number of seconds; at most a day.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Time1(pub(super) Duration);

/// A time as [`Time1`], or 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Time0(pub(super) Duration);

fn time(text: &str) -> Result<Duration, String> {
    const ALLOWED: &str = "allowed: a time such as 90s, 1m 30s or 250ms, or a number of seconds, up to a day";
    let seconds = text.parse::<f64>().ok();
    let parsed = match seconds {
        Some(seconds) => Duration::try_from_secs_f64(seconds).ok(),
        None => humantime::parse_duration(text).ok().or_else(|| decimal(text)),
    };
    parsed
        .filter(|time| *time <= Duration::from_secs(86_400))
        .ok_or_else(|| format!("{text:?} is not a time; {ALLOWED}"))
}

/// Reads decimal seconds such as `2.5s`, which the library does not accept.
fn decimal(text: &str) -> Option<Duration> {
    let seconds = text.strip_suffix('s')?.parse::<f64>().ok()?;
    Duration::try_from_secs_f64(seconds).ok()
}

impl FromStr for Time1 {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let time = time(text)?;
        if time.is_zero() {
            return Err("allowed: a time above 0".to_owned());
        }
        Ok(Self(time))
    }
}

impl FromStr for Time0 {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        time(text).map(Self)
    }
}

/// A header of a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Header(pub(super) String, pub(super) String);

impl FromStr for Header {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, value) = text
            .split_once(':')
            .ok_or_else(|| format!("{text:?} is not a header; allowed: NAME:VALUE"))?;
        Ok(Self(name.trim().to_owned(), value.trim().to_owned()))
    }
}
