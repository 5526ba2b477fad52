//! `troupe-eval attacks`: what attackers cost others. Each attack of docs/security.md runs against
//! a server that was just started. A victim drives a character, and asks for `/healthz` and for
//! in-betweens. Attackers and victim have connections and addresses of their own.

#[allow(
    clippy::unwrap_used,
    reason = "an attack runs as a task, and a panic in it becomes its outcome"
)]
mod attackers;
#[allow(
    clippy::unwrap_used,
    dead_code,
    reason = "shared with the server's tests, which use all of it"
)]
mod common;
mod victim;

use std::pin::Pin;
use std::time::{Duration, Instant};

use anyhow::{Context as _, ensure};
use clap::Args;

use self::common::TestServer;
use self::victim::{Phase, Victim};
use super::ServerBinary;
use super::program::{Home, repository};
use crate::Bars;
use crate::figures::{mib, table};

/// Longest that `/healthz` may take, ms.
const HEALTH_MS: f64 = 100.0;
/// Time after an attack until memory is read.
const AFTER: Duration = Duration::from_secs(10);
/// Time for the victim to begin before anything is measured.
const WARM_UP: Duration = Duration::from_secs(2);

/// Measure what attackers cost others: a victim beside each attack of docs/security.md.
#[derive(Debug, Args)]
pub(crate) struct Attacks {
    /// Attacks to try. Default: all.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    only: Vec<String>,
    /// Time of each attack. The victim alone is measured for a quarter of it before.
    #[arg(long, default_value_t = 20, value_name = "SECONDS")]
    seconds: u64,
    #[command(flatten)]
    server: ServerBinary,
}

type Attack = fn(TestServer, Duration) -> Pin<Box<dyn Future<Output = String> + Send>>;

macro_rules! attack {
    ($name:literal, $what:literal, $of:path) => {
        (
            $name,
            $what,
            (|server, time| Box::pin($of(server, time))) as Attack,
        )
    };
}

const ATTACKS: [(&str, &str, Attack); 13] = [
    attack!(
        "hulls",
        "two streams of 256 sessions in 512 hulls on each other",
        attackers::hulls
    ),
    attack!(
        "streams",
        "128 streams of 4 sessions in the same scene, all of an address",
        attackers::streams
    ),
    attack!(
        "interact",
        "steps of 512 interactions among 2,048 objects",
        attackers::interact
    ),
    attack!(
        "long-step",
        "steps of 1,024 sessions over 30 frames in a full scene",
        attackers::long_step
    ),
    attack!(
        "large-answers",
        "8 clients ask for a large step as JSON and read nothing",
        attackers::large_answers
    ),
    attack!(
        "unread",
        "8 clients ask for a large step over gRPC and read nothing",
        attackers::unread
    ),
    attack!(
        "bodies",
        "100 bodies held open on one HTTP/2 connection",
        attackers::bodies
    ),
    attack!("scenes", "256 full scenes", attackers::many_scenes),
    attack!("sessions", "16,384 sessions for a day each", attackers::sessions),
    attack!(
        "slow-headers",
        "1,000 connections that send headers letter by letter",
        attackers::slow_headers
    ),
    attack!(
        "flood",
        "connections beyond those of an address",
        attackers::flood
    ),
    attack!("idle", "1,000 idle HTTP/2 connections", attackers::idle),
    attack!(
        "origins",
        "requests from a page of another site",
        attackers::origins
    ),
];

/// What the victim saw of an attack.
struct Outcome {
    name: &'static str,
    /// Before, during and after.
    phases: [Phase; 3],
    /// Before, at most during, and after, bytes.
    memory: [u64; 3],
    /// What the attacker achieved.
    got: String,
}

pub(crate) fn run(arguments: &Attacks) -> anyhow::Result<Bars> {
    for name in &arguments.only {
        let names = ATTACKS.map(|(name, ..)| name).join(", ");
        ensure!(
            ATTACKS.iter().any(|(known, ..)| known == name),
            "--only {name}: allowed are {names}"
        );
    }
    rlimit::increase_nofile_limit(8192).context("the limit of open files")?;
    let home = arguments.server.home()?;
    let worst_bytes = worst_case(&home)?;
    let mut outcomes = Vec::new();
    for (name, what, attack) in ATTACKS {
        if !arguments.only.is_empty() && !arguments.only.iter().any(|only| only == name) {
            continue;
        }
        eprintln!("{name}: {what}");
        let outcome = meet(&home, name, attack, Duration::from_secs(arguments.seconds))?;
        eprintln!("  {}", outcome.got);
        for (when, phase) in WHEN.iter().zip(&outcome.phases) {
            for fault in phase.faults.iter().take(3) {
                eprintln!("  {when} it ({} faults): {fault}", phase.faults.len());
            }
        }
        outcomes.push(outcome);
    }
    let rows: Vec<_> = outcomes
        .iter()
        .flat_map(|outcome| outcome.rows(worst_bytes))
        .collect();
    println!("{}", table(&HEADS, 2, &rows));
    println!("Bars: no dropped tick and no fault, `/healthz` within {HEALTH_MS} ms,");
    println!(
        "memory within {:.0} MiB, the worst case by `troupe-server doctor`.",
        mib(worst_bytes)
    );
    let broken = outcomes
        .iter()
        .filter(|outcome| !outcome.holds(worst_bytes))
        .count();
    Ok(Bars::from(broken == 0))
}

/// The most memory that a server may take with default limits, as its `doctor` says.
fn worst_case(home: &Home) -> anyhow::Result<u64> {
    let packs = repository().join("models/human");
    let packs = packs.to_str().context("the path of the packs")?;
    let report: serde_json::Value =
        serde_json::from_str(&home.output(&["doctor", "--json", "--packs", packs])?)?;
    let total = &report["memory"]["total_bytes"];
    total
        .as_u64()
        .with_context(|| format!("memory.total_bytes is {total}"))
}

/// Starts a server and a victim, and attacks.
fn meet(home: &Home, name: &'static str, attack: Attack, time: Duration) -> anyhow::Result<Outcome> {
    home.forget()?;
    let mut server = home.start(&[])?;
    server.ready()?;
    let victim = Victim::start(&home.url());
    std::thread::sleep(WARM_UP);
    let before = Instant::now();
    std::thread::sleep(time / 4);
    let memory_before = server.memory_bytes()?;
    server.forget_peak()?;
    let begun = Instant::now();
    let got = carry_out(attack(TestServer::new(home.address(), 0), time))?;
    let ended = Instant::now();
    let memory_most = server.peak_bytes()?;
    std::thread::sleep(AFTER);
    let over = Instant::now();
    let memory_after = server.memory_bytes()?;
    let seen = victim.stop()?;
    server.stop()?;
    Ok(Outcome {
        name,
        phases: [
            seen.between(before, begun),
            seen.between(begun, ended),
            seen.between(ended, over),
        ],
        memory: [memory_before, memory_most, memory_after],
        got,
    })
}

/// Runs an attack to its end on threads of its own, and ends its connections.
fn carry_out(attack: Pin<Box<dyn Future<Output = String> + Send>>) -> anyhow::Result<String> {
    let mut runtime = tokio::runtime::Builder::new_multi_thread();
    let runtime = runtime.worker_threads(2).enable_all().build()?;
    let got = runtime.block_on(async { tokio::spawn(attack).await });
    runtime.shutdown_background();
    Ok(got.unwrap_or_else(|error| format!("the attack broke off: {error}")))
}

const WHEN: [&str; 3] = ["before", "during", "after"];
const HEADS: [&str; 9] = [
    "attack",
    "",
    "ticks",
    "dropped",
    "underruns",
    "faults",
    "`/healthz` p99 / worst (ms)",
    "InBetween p99 / worst (ms)",
    "memory (MiB)",
];

impl Outcome {
    fn holds(&self, worst_bytes: u64) -> bool {
        let quiet = |phase: &Phase| {
            let healthy = phase.health_ms.is_some_and(|(_, worst)| worst <= HEALTH_MS);
            healthy && phase.dropped == 0 && phase.faults.is_empty() && phase.ticks > 0
        };
        self.phases.iter().all(quiet) && self.memory.iter().all(|&bytes| bytes <= worst_bytes)
    }

    fn rows(&self, worst_bytes: u64) -> Vec<Vec<String>> {
        let name = match self.holds(worst_bytes) {
            true => self.name.to_owned(),
            false => format!("{} (**beyond a bar**)", self.name),
        };
        let names = [name, String::new(), String::new()].into_iter();
        let pair = |times: Option<(f64, f64)>| {
            times.map_or("–".to_owned(), |(p99, worst)| format!("{p99:.1} / {worst:.1}"))
        };
        let cells = |(((name, when), phase), bytes): (((String, &str), &Phase), &u64)| {
            vec![
                name,
                when.to_owned(),
                phase.ticks.to_string(),
                phase.dropped.to_string(),
                phase.underruns.to_string(),
                phase.faults.len().to_string(),
                pair(phase.health_ms),
                pair(phase.call_ms),
                format!("{:.0}", mib(*bytes)),
            ]
        };
        let lines = names.zip(WHEN).zip(&self.phases).zip(&self.memory);
        lines.map(cells).collect()
    }
}
