//! `troupe-eval costs`: what keys, TLS, snapshots and traces cost. Servers with an option and
//! without it run in turns, under `troupe-loadtest`.

mod options;

use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::{Context as _, ensure};
use clap::Args;
use serde_json::Value;

use self::options::{Given, OPTIONS, Setup};
use super::ServerBinary;
use super::program::{Home, Server, release};
use crate::figures::{percentile, table};

/// Warm-up of the load tester, seconds.
const WARM_UP_S: u64 = 2;
/// Time after the start and before the end of a load in which processor time is not measured.
const MARGIN: Duration = Duration::from_secs(1);

/// Measure what keys, TLS, snapshots and traces cost.
#[derive(Debug, Args)]
pub(crate) struct Costs {
    /// Options to measure. Default: all.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    only: Vec<String>,
    /// Turns, each with two measurements: without the option and with it.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=100))]
    turns: u32,
    /// Time of each measurement.
    #[arg(long, default_value_t = 10, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(4..=600))]
    seconds: u64,
    /// Live characters whose processor time is measured.
    #[arg(long, default_value_t = 100)]
    characters: u32,
    #[command(flatten)]
    server: ServerBinary,
}

/// Figures of one server.
#[derive(Debug, Clone, Copy)]
struct Turn {
    /// Requests a second of 32 clients, each of which waits for its answer.
    saturated_per_s: f64,
    /// Processor time of the server for a second of a live character, ms.
    live_cpu_ms: f64,
    /// The part of it that no network took.
    beside_cpu_ms: f64,
    /// Median latency of one client that waits for its answers, ms.
    lone_ms: f64,
}

pub(crate) fn run(arguments: &Costs) -> anyhow::Result<()> {
    for name in &arguments.only {
        let names = OPTIONS.map(|option| option.name).join(", ");
        ensure!(
            OPTIONS.iter().any(|option| option.name == name),
            "--only {name}: allowed are {names}"
        );
    }
    let home = arguments.server.home()?;
    let setup = Setup::new(&home)?;
    let (mut rows, all) = (Vec::new(), arguments.only.is_empty());
    for option in OPTIONS
        .iter()
        .filter(|o| all || arguments.only.iter().any(|name| name == o.name))
    {
        let (without, with) = (setup.without(), (option.given)(&setup)?);
        let mut turns = Vec::new();
        for turn in 1..=arguments.turns {
            let pair = (
                measure(&home, &without, arguments)?,
                measure(&home, &with, arguments)?,
            );
            eprintln!(
                "{}, turn {turn}: without {:.2?}, with {:.2?}",
                option.name, pair.0, pair.1
            );
            turns.push(pair);
        }
        rows.extend(compare(option.name, &turns));
    }
    println!(
        "{}",
        table(
            &[
                "option",
                "figure",
                "without",
                "with",
                "cost (least to most)",
                "bar"
            ],
            2,
            &rows
        )
    );
    Ok(())
}

/// Starts a server and measures it.
fn measure(home: &Home, given: &Given, arguments: &Costs) -> anyhow::Result<Turn> {
    home.forget()?;
    let flags: Vec<&str> = given.flags.iter().map(String::as_str).collect();
    let mut server = home.start(&flags)?;
    let url = given.url(home);
    match &given.ca {
        None => server.ready()?,
        Some(ca) => server.ready_by(|| home.output(&["health", "--url", &url, "--ca", ca]).is_ok())?,
    };
    let tester = Tester {
        arguments,
        given,
        url,
        report: home.folder().join("loadtest.json"),
    };
    let saturated = tester.run(&["--clients", "32"])?;
    let (live_cpu_s, beside_cpu_s, live_s) = tester.live(&server)?;
    let lone = tester.run(&["--clients", "1"])?;
    server.stop()?;
    let figure = |report: &Value, path: &str| {
        let found = report.pointer(path).and_then(Value::as_f64);
        found.with_context(|| format!("{path} is not in the load tester's report"))
    };
    let of_a_character = |seconds: f64| 1e3 * seconds / (live_s * f64::from(arguments.characters));
    Ok(Turn {
        saturated_per_s: figure(&saturated, "/median/throughput/requests_per_s")?,
        live_cpu_ms: of_a_character(live_cpu_s),
        beside_cpu_ms: of_a_character(beside_cpu_s),
        lone_ms: figure(&lone, "/median/latency_ms/p50")?,
    })
}

/// `troupe-loadtest` against one server.
struct Tester<'a> {
    arguments: &'a Costs,
    given: &'a Given,
    url: String,
    report: PathBuf,
}

impl Tester<'_> {
    fn command(&self, load: &[&str]) -> Command {
        let mut command = Command::new(release("troupe-loadtest"));
        let warm_up = WARM_UP_S.to_string();
        command.args(["run", "--quiet", "--server", &self.url, "--warmup", &warm_up]);
        command
            .args(["--duration", &self.arguments.seconds.to_string()])
            .args(load);
        command
            .args(["--expect-zero-failures", "--json"])
            .arg(&self.report);
        if let Some(key) = &self.given.key {
            command.env("TROUPE_KEY", key);
        }
        if let Some(ca) = &self.given.ca {
            command.env("TROUPE_CA", ca);
        }
        command.stdout(Stdio::null());
        command
    }

    /// Carries out a load, and gives the report.
    fn run(&self, load: &[&str]) -> anyhow::Result<Value> {
        let status = self.command(load).status().context("troupe-loadtest")?;
        ensure!(status.success(), "troupe-loadtest {load:?}: {status}");
        Ok(serde_json::from_slice(&std::fs::read(&self.report)?)?)
    }

    /// Has characters live, and measures the server for a part of that time. Gives its processor
    /// time, the part of it that no network took, and the time of the measurement, all in seconds.
    fn live(&self, server: &Server) -> anyhow::Result<(f64, f64, f64)> {
        let characters = self.arguments.characters.to_string();
        let load = ["--workload", "drive", "--characters", &characters];
        let mut child = self.command(&load).spawn().context("troupe-loadtest")?;
        sleep(Duration::from_secs(WARM_UP_S) + MARGIN);
        let (before, beside) = (server.cpu_seconds()?, server.cpu_seconds_beside_networks()?);
        let begun = Instant::now();
        sleep(Duration::from_secs(self.arguments.seconds) - 2 * MARGIN);
        let taken = (
            server.cpu_seconds()? - before,
            server.cpu_seconds_beside_networks()? - beside,
            begun.elapsed().as_secs_f64(),
        );
        let status = child.wait()?;
        ensure!(status.success(), "troupe-loadtest {load:?}: {status}");
        Ok(taken)
    }
}

/// Rows of an option: medians without and with it, and the cost: of the medians, and the least and
/// the most of all turns.
fn compare(name: &str, turns: &[(Turn, Turn)]) -> Vec<Vec<String>> {
    let is_tls = name == "tls";
    let ratio = |of: fn(&Turn) -> f64, more_is_worse: bool| {
        let cost = move |without: f64, with: f64| match more_is_worse {
            true => 100.0 * (with / without - 1.0),
            false => 100.0 * (without / with - 1.0),
        };
        spread(turns, of, cost)
    };
    let (saturated, saturated_cost) = ratio(|turn| turn.saturated_per_s, false);
    let (live, live_cost) = ratio(|turn| turn.live_cpu_ms, true);
    let (beside, beside_cost) = spread(
        turns,
        |turn| turn.beside_cpu_ms,
        |without_ms, with_ms| 100.0 * (with_ms - without_ms) / live.0,
    );
    let (lone, lone_cost) = spread(turns, |turn| turn.lone_ms, |without, with| with - without);
    let row =
        |figure: &str, (without, with): (f64, f64), [cost, least, most]: [f64; 3], unit: &str, bar: &str| {
            vec![
                name.to_owned(),
                figure.to_owned(),
                format!("{without:.2}"),
                format!("{with:.2}"),
                format!("{cost:+.2} {unit} ({least:+.2} to {most:+.2})"),
                bar.to_owned(),
            ]
        };
    vec![
        row(
            "requests/s of 32 clients",
            saturated,
            saturated_cost,
            "%",
            "≤ 5 %",
        ),
        row(
            "server CPU for a second of a character (ms)",
            live,
            live_cost,
            "%",
            "≤ 5 %",
        ),
        row(
            "the part that no network takes (ms); cost as a share of all",
            beside,
            beside_cost,
            "%",
            "≤ 5 %",
        ),
        row(
            "latency of one client, p50 (ms)",
            lone,
            lone_cost,
            "ms",
            if is_tls { "" } else { "≤ 0.1 ms" },
        ),
    ]
}

/// Medians without and with an option. Then the cost: of these medians, and the least and the most
/// of single turns.
fn spread(
    turns: &[(Turn, Turn)],
    of: fn(&Turn) -> f64,
    cost: impl Fn(f64, f64) -> f64,
) -> ((f64, f64), [f64; 3]) {
    let median = |values: Vec<f64>| percentile(&values, 0.5);
    let without = median(turns.iter().map(|(without, _)| of(without)).collect());
    let with = median(turns.iter().map(|(_, with)| of(with)).collect());
    let each = || turns.iter().map(|(without, with)| cost(of(without), of(with)));
    let (least, most) = (
        each().fold(f64::INFINITY, f64::min),
        each().fold(f64::NEG_INFINITY, f64::max),
    );
    ((without, with), [cost(without, with), least, most])
}
