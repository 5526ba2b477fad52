//! `troupe-eval churn`: half an hour of sessions that come and go at 70 % of the server's capacity,
//! with calls of InBetween beside them.

mod crowd;
mod plot;

use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context as _, ensure};
use clap::Args;
use serde::Serialize;
use serde_json::{Value, json};
use tokio::sync::watch;
use tokio::task::JoinSet;
use tokio::time::{MissedTickBehavior, interval, sleep_until};
use troupe_client::Client;

use self::crowd::{ChurningCrowd, Seen, Shared};
use super::program::{self, Home, Server, metric, release, repository};
use super::{ServerBinary, gap};
use crate::Bars;
use crate::figures::{largest, mib, ms, percentile, table};

/// Time from one row to the next.
const ROW: Duration = Duration::from_secs(10);
/// Share of the capacity that is used.
const LOAD: f64 = 0.7;
/// Share of the run at its start that does not count for the slope of memory, because caches fill.
const SETTLING: f64 = 0.2;

/// Measure a server whose sessions come and go, at 70 % of its capacity.
///
/// Sessions live 10 to 60 s each, with calls of InBetween beside them. Writes churn.json and
/// churn.svg.
#[derive(Debug, Args)]
pub(crate) struct Churn {
    /// Length of the run.
    #[arg(long, default_value_t = 30.0)]
    minutes: f64,
    /// Live characters at a time. Default: 70 % of those that `troupe-loadtest search` finds.
    #[arg(long)]
    characters: Option<usize>,
    /// Streams, each on a connection of its own.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=64))]
    streams: u32,
    /// Calls of InBetween a second, each of one character over 64 frames.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    calls_per_s: u32,
    /// Seed of all random choices.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Folder for churn.json and churn.svg. Default: docs/images.
    #[arg(long, value_name = "FOLDER")]
    out: Option<PathBuf>,
    #[command(flatten)]
    server: ServerBinary,
}

/// Ten seconds of the run.
#[derive(Debug, Clone, Serialize)]
struct Row {
    /// Time from the start of the run to the end of the ten seconds.
    at_s: f64,
    memory_mib: f64,
    /// Open sessions, from the server's metrics.
    sessions: f64,
    /// Lateness of ticks.
    tick_p99_ms: f64,
    call_p99_ms: f64,
    /// From the server's metrics.
    underruns: f64,
    dropped_ticks: u64,
    opened: u64,
    closed: u64,
    faults: usize,
}

pub(crate) async fn run(arguments: Churn) -> anyhow::Result<Bars> {
    let home = arguments.server.home()?;
    let (capacity, characters) = match arguments.characters {
        Some(characters) => (None, characters),
        None => {
            let capacity = capacity(&home)?;
            eprintln!("capacity: {capacity} characters");
            (Some(capacity), (LOAD * capacity) as usize)
        }
    };
    home.forget()?;
    let mut server = home.start(&[])?;
    server.ready()?;

    let shared = Shared::default();
    let (stop, stopped) = watch::channel(false);
    let mut tasks = JoinSet::new();
    for stream in 0..arguments.streams as usize {
        let streams = arguments.streams as usize;
        let share = (stream..characters).step_by(streams).count();
        let seed = arguments.seed.wrapping_add(stream as u64);
        let crowd = ChurningCrowd::open(&home.url(), share, seed, shared.clone()).await?;
        tasks.spawn(crowd.live(stopped.clone()));
    }
    tasks.spawn(call(home.url(), arguments.calls_per_s, shared.clone(), stopped));
    let rows = watch_over(&server, &home, &arguments, &shared).await?;
    stop.send(true)?;
    tasks.join_all().await;
    server.stop()?;

    let out = arguments
        .out
        .clone()
        .unwrap_or_else(|| repository().join("docs/images"));
    std::fs::create_dir_all(&out)?;
    let run = json!({
        "characters": characters, "capacity": capacity, "calls_per_s": arguments.calls_per_s,
        "streams": arguments.streams, "seed": arguments.seed, "rows": rows,
    });
    std::fs::write(out.join("churn.json"), format!("{run:#}\n"))?;
    plot::write(&out.join("churn.svg"), &rows)?;
    Ok(report(characters, &rows))
}

/// The most live characters that the server can serve, as the load tester finds it.
fn capacity(home: &Home) -> anyhow::Result<f64> {
    let mut server = home.start(&[])?;
    server.ready()?;
    let report = home.folder().join("search.json");
    let mut search = Command::new(release("troupe-loadtest"));
    search.args([
        "search",
        "--quiet",
        "--workload",
        "drive",
        "--p99-ms",
        "33",
        "--server",
        &home.url(),
    ]);
    search.arg("--json").arg(&report).stdout(Stdio::null());
    let status = search.status().context("troupe-loadtest")?;
    ensure!(status.success(), "troupe-loadtest search: {status}");
    let report: Value = serde_json::from_slice(&std::fs::read(&report)?)?;
    server.stop()?;
    let found = report.pointer("/search/found").and_then(Value::as_f64);
    found.context("search.found is not in the load tester's report")
}

/// Calls InBetween at a steady rate, whether or not earlier calls were answered.
async fn call(url: String, per_s: u32, shared: Shared, mut stop: watch::Receiver<bool>) {
    let prepared = async {
        let client = Client::connect(&url).await?;
        let pack = client.pack("").await?;
        let gap = gap(&pack)?;
        anyhow::Ok((client, pack, gap))
    };
    let (client, pack, gap) = match prepared.await {
        Ok(prepared) => prepared,
        Err(error) => return shared.fault(format!("InBetween: {error}")),
    };
    let mut due = interval(Duration::from_secs(1) / per_s);
    due.set_missed_tick_behavior(MissedTickBehavior::Burst);
    loop {
        let at = tokio::select! {
            at = due.tick() => at,
            _ = stop.changed() => return,
        };
        let (client, pack, gap, shared) = (client.clone(), pack.clone(), gap.clone(), shared.clone());
        tokio::spawn(async move {
            match client.in_between(&pack, &gap).await {
                Ok(_) => shared.note(|seen| seen.call_ms.push(ms(at.elapsed()))),
                Err(error) => shared.fault(format!("InBetween: {error}")),
            }
        });
    }
}

/// Adds a row every ten seconds until the time is over.
async fn watch_over(
    server: &Server,
    home: &Home,
    arguments: &Churn,
    shared: &Shared,
) -> anyhow::Result<Vec<Row>> {
    let begun = tokio::time::Instant::now();
    let (mut rows, mut underruns) = (Vec::new(), 0.0);
    let count = (60.0 * arguments.minutes / ROW.as_secs_f64()).ceil() as u32;
    for nth in 1..=count {
        sleep_until(begun + ROW * nth).await;
        let address = home.address();
        let page = tokio::task::spawn_blocking(move || program::get(address, "/metrics")).await??;
        let seen = shared.take();
        for fault in seen.faults.iter().take(3) {
            eprintln!("{fault}");
        }
        let all = metric(&page, "troupe_underruns_total");
        let row = row(begun.into_std(), server, &page, &seen, all - underruns)?;
        underruns = all;
        eprintln!("{row:?}");
        rows.push(row);
    }
    Ok(rows)
}

fn row(begun: Instant, server: &Server, page: &str, seen: &Seen, underruns: f64) -> anyhow::Result<Row> {
    Ok(Row {
        at_s: begun.elapsed().as_secs_f64(),
        memory_mib: mib(server.memory_bytes()?),
        sessions: metric(page, "troupe_sessions_active"),
        // 0 without a tick or call.
        tick_p99_ms: percentile(&seen.late_ms, 0.99).max(0.0),
        call_p99_ms: percentile(&seen.call_ms, 0.99).max(0.0),
        underruns,
        dropped_ticks: seen.dropped,
        opened: seen.opened,
        closed: seen.closed,
        faults: seen.faults.len(),
    })
}

/// Prints the run in short. The bar is a run without an underrun or a fault.
fn report(characters: usize, rows: &[Row]) -> Bars {
    let of = |value: fn(&Row) -> f64| rows.iter().map(value).collect::<Vec<f64>>();
    let three = |value: fn(&Row) -> f64| {
        let values = of(value);
        let cells = [
            percentile(&values, 0.0),
            percentile(&values, 0.5),
            largest(&values),
        ];
        cells.map(|value| format!("{value:.1}")).join(" / ")
    };
    let sum = |value: fn(&Row) -> f64| of(value).iter().sum::<f64>();
    let bad = sum(|row| row.underruns) + sum(|row| row.faults as f64);
    let lines = [
        ("live characters at a time", characters.to_string()),
        (
            "minutes",
            format!("{:.1}", rows.last().map_or(0.0, |row| row.at_s / 60.0)),
        ),
        ("sessions opened", format!("{:.0}", sum(|row| row.opened as f64))),
        ("memory: least / median / most (MiB)", three(|row| row.memory_mib)),
        (
            "growth of memory after the first fifth (MiB an hour)",
            format!("{:+.1}", growth(rows)),
        ),
        (
            "p99 of ticks' lateness in 10 s: least / median / most (ms)",
            three(|row| row.tick_p99_ms),
        ),
        (
            "p99 of InBetween in 10 s: least / median / most (ms)",
            three(|row| row.call_p99_ms),
        ),
        ("underruns", format!("{:.0}", sum(|row| row.underruns))),
        (
            "ticks dropped",
            format!("{:.0}", sum(|row| row.dropped_ticks as f64)),
        ),
        ("faults", format!("{:.0}", sum(|row| row.faults as f64))),
    ];
    let lines = lines.map(|(what, value)| vec![what.to_owned(), value]);
    println!("{}", table(&["", "measured"], 1, &lines));
    Bars::from(bad == 0.0)
}

/// The slope of memory by least squares, MiB an hour; 0 of fewer than two rows.
fn growth(rows: &[Row]) -> f64 {
    let settled = &rows[(SETTLING * rows.len() as f64) as usize..];
    let count = settled.len() as f64;
    let mean = |of: fn(&Row) -> f64| settled.iter().map(of).sum::<f64>() / count;
    let (hour, memory) = (mean(|row| row.at_s / 3600.0), mean(|row| row.memory_mib));
    let from = |row: &Row| (row.at_s / 3600.0 - hour, row.memory_mib - memory);
    let both: f64 = settled.iter().map(from).map(|(x, y)| x * y).sum();
    let square: f64 = settled.iter().map(from).map(|(x, _)| x * x).sum();
    if square > 0.0 { both / square } else { 0.0 }
}
