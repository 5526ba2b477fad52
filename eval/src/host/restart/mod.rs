//! `troupe-eval restart`: a server that ends and starts again under live characters. Measures when
//! and where they go on, and which commands are lost.

mod crowd;

use std::time::{Duration, Instant};

use anyhow::Context as _;
use clap::{Args, ValueEnum};
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use troupe_client::{Client, SessionOptions};
use troupe_motion::Vec3;

use self::crowd::{Followed, Follower};
use super::ServerBinary;
use crate::Bars;
use crate::figures::{largest, ms, percentile, table};

/// Longest wait from ready until all characters go on.
const PATIENCE: Duration = Duration::from_secs(20);
/// Bar: time from ready until all sessions are resumed.
const RESUMED_MS: f64 = 2000.0;
/// Bar: age of the oldest lost command at the signal.
const LOST_MS: f64 = 250.0;
/// Distance between characters.
const APART_M: f32 = 3.0;

/// Measure what a restart of the server costs live characters.
#[derive(Debug, Args)]
pub(crate) struct Restart {
    /// Live characters.
    #[arg(long, default_value_t = 300)]
    sessions: usize,
    /// Connections, each with a stream of its own.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=64))]
    streams: u32,
    /// How the server ends.
    #[arg(long, value_enum, default_value_t = Stop::Kill)]
    stop: Stop,
    /// Time that they live before that.
    #[arg(long, default_value_t = 10, value_name = "SECONDS")]
    seconds: u64,
    /// Time between two commands of a character.
    #[arg(long, default_value_t = 500, value_name = "MS")]
    command_every_ms: u64,
    #[command(flatten)]
    server: ServerBinary,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Stop {
    /// By SIGKILL.
    Kill,
    /// By SIGTERM, which lets it finish.
    Term,
}

/// Moments of a restart.
#[derive(Debug, Clone, Copy)]
struct Moments {
    stopped: Instant,
    ended: Instant,
    ready: Instant,
}

pub(crate) async fn run(arguments: Restart) -> anyhow::Result<Bars> {
    let home = arguments.server.home()?;
    let mut server = home.start(&[])?;
    server.ready()?;

    let (done, mut dones) = mpsc::channel(64);
    let mut tasks = JoinSet::new();
    for crowd in open(&home.url(), &arguments).await? {
        tasks.spawn(crowd.follow(done.clone()));
    }
    drop(done);
    tokio::time::sleep(Duration::from_secs(arguments.seconds)).await;

    let (server, moments) = tokio::task::spawn_blocking(move || {
        let stopped = Instant::now();
        match arguments.stop {
            Stop::Kill => server.kill()?,
            Stop::Term => drop(server.stop()?),
        }
        let ended = Instant::now();
        let mut server = home.start(&[])?;
        let ready = server.ready()?;
        let moments = Moments {
            stopped,
            ended,
            ready,
        };
        anyhow::Ok(((server, home), moments))
    })
    .await??;
    let all = async {
        for _ in 0..arguments.streams {
            dones.recv().await;
        }
    };
    let in_time = tokio::time::timeout(PATIENCE, all).await.is_ok();
    if !in_time {
        eprintln!("not all went on within {PATIENCE:?} of ready");
    }
    // The crowds stop once this end of the channel is closed.
    drop(dones);
    let mut followers = Vec::new();
    for of_stream in tasks.join_all().await {
        followers.extend(of_stream?);
    }
    drop(server);
    let bars_hold = report(&arguments, &followers, moments);
    Ok(Bars::from(bars_hold && in_time))
}

/// Opens the sessions, and a stream for each share of them.
async fn open(url: &str, arguments: &Restart) -> anyhow::Result<Vec<Followed>> {
    let mut crowds = Vec::new();
    for stream in 0..arguments.streams as usize {
        let client = Client::connect(url).await?;
        let pack = client.pack("").await?;
        let numbers: Vec<_> = (stream..arguments.sessions)
            .step_by(arguments.streams as usize)
            .collect();
        let options: Vec<_> = numbers
            .iter()
            .map(|&number| {
                let place = Vec3::new((number % 20) as f32, 0.0, (number / 20) as f32) * APART_M;
                SessionOptions::new()
                    .id(format!("hero-{number}"))
                    .seed(number as u64)
                    .at(place, 0.0)
            })
            .collect();
        let sessions = client
            .open_sessions(&pack, &options)
            .await
            .context("the sessions")?;
        let every = Duration::from_millis(arguments.command_every_ms);
        crowds.push(Followed::open(&client, sessions, every).await?);
    }
    Ok(crowds)
}

/// Prints the table, and gives whether the bars were met.
fn report(arguments: &Restart, followers: &[Follower], moments: Moments) -> bool {
    let since = |from: Instant| move |at: Instant| ms(at.saturating_duration_since(from));
    let resumed: Vec<_> = followers.iter().filter_map(|one| one.resumed.as_ref()).collect();
    let resumed_ms: Vec<f64> = resumed.iter().map(|one| since(moments.ready)(one.at)).collect();
    let restored = resumed.iter().filter(|one| one.restored).count();
    let first: Vec<_> = followers
        .iter()
        .filter_map(|one| one.first_after.as_ref())
        .collect();
    let after_stop: Vec<f64> = first.iter().map(|one| since(moments.stopped)(one.at)).collect();
    let after_ready: Vec<f64> = first.iter().map(|one| since(moments.ready)(one.at)).collect();
    let jumps_m: Vec<f64> = first.iter().map(|one| f64::from(one.jump_m)).collect();
    let steps: Vec<f64> = first
        .iter()
        .map(|one| f64::from(one.jump_m / one.largest_step_m))
        .collect();
    let back: u64 = followers.iter().map(|one| one.went_back).sum();
    let lost: Vec<f64> = followers
        .iter()
        .filter_map(|one| one.lost_ms(moments.stopped))
        .collect();
    let lost_commands: u64 = resumed.iter().map(|one| one.lost_commands).sum();

    let three = |values: &[f64]| {
        let cells = [percentile(values, 0.5), percentile(values, 0.99), largest(values)];
        cells.map(|value| format!("{value:.0}")).join(" / ")
    };
    let all = followers.len();
    let rows = [
        ("how it ended", format!("{:?}", arguments.stop), ""),
        ("sessions, streams", format!("{all}, {}", arguments.streams), ""),
        (
            "from the signal to its end (ms)",
            format!("{:.0}", since(moments.stopped)(moments.ended)),
            "",
        ),
        (
            "from the signal to ready again (ms)",
            format!("{:.0}", since(moments.stopped)(moments.ready)),
            "",
        ),
        (
            "resumed, of them restored",
            format!("{}, {restored}", resumed.len()),
            "all",
        ),
        (
            "from ready until all are resumed (ms)",
            format!("{:.0}", largest(&resumed_ms)),
            "≤ 2000",
        ),
        (
            "first frame after the signal: p50 / p99 / most (ms)",
            three(&after_stop),
            "",
        ),
        (
            "first frame after ready: p50 / p99 / most (ms)",
            three(&after_ready),
            "",
        ),
        ("frame numbers that went back", back.to_string(), "0"),
        (
            "largest jump of a root (m)",
            format!("{:.3}", largest(&jumps_m)),
            "",
        ),
        (
            "the same ÷ the largest step of that character before",
            format!("{:.2}", largest(&steps)),
            "",
        ),
        (
            "commands lost, by the client's count",
            lost_commands.to_string(),
            "",
        ),
        ("sessions that lost commands", lost.len().to_string(), ""),
        (
            "oldest lost command: p50 / p99 / most (ms before the signal)",
            three(&lost),
            "≤ 250",
        ),
    ];
    let rows = rows.map(|(what, value, bar)| vec![what.to_owned(), value, bar.to_owned()]);
    println!("{}", table(&["", "measured", "bar"], 1, &rows));
    resumed.len() == all
        && first.len() == all
        && back == 0
        && largest(&resumed_ms) <= RESUMED_MS
        && largest(&lost) <= LOST_MS
}
