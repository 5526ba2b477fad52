//! The report for a terminal.

use std::fmt::Write as _;

use comfy_table::{CellAlignment, Table, presets};

use super::Report;
use crate::figures::{Figures, LiveFigures, Percentiles, ServerFigures, StageResult};
use crate::overload::OverloadReport;
use crate::plan::Workload;
use crate::search::{Aim, SearchReport};

/// A row of the table. A row without cells is the heading of a group.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Row {
    /// Name of the figure.
    pub name: String,
    /// With several repetitions, one value for each. The last cell is the median.
    pub cells: Vec<String>,
}

/// The whole report.
pub fn report(report: &Report) -> String {
    let mut text = String::new();
    if let Some(extra) = extra(report) {
        text += &extra;
        text += "\n";
    }
    text += &figures(report);
    if let Some(run) = report.runs.last() {
        text += &stages(&run.stages);
        for (code, count) in &run.codes {
            let example = run
                .examples
                .get(code)
                .map(|m| format!(": {m}"))
                .unwrap_or_default();
            let _ = writeln!(text, "{count} x {code}{example}");
        }
    }
    for note in notes(report) {
        let _ = writeln!(text, "note: {note}");
    }
    for bound in &report.bounds {
        let verdict = if bound.kept { "kept" } else { "MISSED" };
        let _ = writeln!(
            text,
            "{} {verdict}: found {:.2}, allowed {:.2}",
            bound.bound, bound.found, bound.allowed
        );
    }
    text
}

fn figures(report: &Report) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    let mut header = vec![String::new()];
    if report.runs.len() > 1 {
        header.extend((1..=report.runs.len()).map(|nth| format!("run {nth}")));
        header.push("median".to_owned());
        table.set_header(header);
    }
    for row in rows(report) {
        let name = if row.cells.is_empty() {
            row.name
        } else {
            format!("  {}", row.name)
        };
        table.add_row(std::iter::once(name).chain(row.cells));
    }
    aligned(table)
}

fn aligned(mut table: Table) -> String {
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let lines = table.lines().map(|line| line.trim_end().to_owned() + "\n");
    lines.collect()
}

/// Reads a figure and formats it.
type Shown = Box<dyn Fn(&Figures) -> String>;

/// All rows, each with a value for every repetition and the median.
pub fn rows(report: &Report) -> Vec<Row> {
    let several = report.runs.len() > 1;
    let all = report.runs.iter().map(|run| &run.figures).filter(|_| several);
    let columns = all.chain(std::iter::once(&report.median)).collect::<Vec<_>>();
    shown(report)
        .into_iter()
        .map(|(name, value)| Row {
            name,
            cells: value.map_or_else(Vec::new, |value| columns.iter().map(|f| value(f)).collect()),
        })
        .collect()
}

fn shown(report: &Report) -> Vec<(String, Option<Shown>)> {
    let mut rows: Vec<(String, Option<Shown>)> = Vec::new();
    let what = match report.plan.workload {
        Workload::Calls { .. } => "answers",
        Workload::Drive(_) => "ticks",
        Workload::Step(_) => "steps",
        Workload::Idle { .. } => "",
    };
    if !what.is_empty() {
        calls(&mut rows, report, what);
    }
    if report.median.split_ms.is_some() {
        split(&mut rows);
    }
    if report.median.live.is_some() {
        live(&mut rows, what.is_empty());
    }
    if report.median.server.is_some() {
        server(&mut rows, report);
    }
    group(&mut rows, "load tester");
    row(&mut rows, "processors busy", |f| {
        format!("{:.2}", f.client.cpus_busy)
    });
    row(&mut rows, "peak memory, MiB", |f| mib(f.client.peak_rss_bytes));
    rows
}

fn group(rows: &mut Vec<(String, Option<Shown>)>, name: &str) {
    rows.push((name.to_owned(), None));
}

fn row(
    rows: &mut Vec<(String, Option<Shown>)>,
    name: &str,
    value: impl Fn(&Figures) -> String + Copy + 'static,
) {
    rows.push((name.to_owned(), Some(Box::new(value))));
}

fn calls(rows: &mut Vec<(String, Option<Shown>)>, report: &Report, what: &str) {
    group(rows, "throughput, a second");
    row(rows, what, |f| rate(f.throughput.requests_per_s));
    row(rows, "characters", |f| rate(f.throughput.characters_per_s));
    row(rows, "frames", |f| rate(f.throughput.frames_per_s));
    group(
        rows,
        &format!("latency, ms, counted {}", report.latency_of.words()),
    );
    percentiles(rows, |f| f.latency_ms);
    group(rows, &format!("{what} in the measured time"));
    row(rows, "right", |f| f.counts.right.to_string());
    row(rows, "refused", |f| f.counts.refused.to_string());
    row(rows, "failed", |f| f.counts.failed.to_string());
    row(rows, "dropped by this client", |f| f.counts.dropped.to_string());
    row(rows, "fully checked", |f| f.verified.to_string());
    if matches!(report.plan.workload, Workload::Calls { .. }) {
        row(rows, "most in flight", |f| f.in_flight_max.to_string());
        row(rows, "sent over 1 ms late", |f| f.late_sends.to_string());
    }
}

fn percentiles(
    rows: &mut Vec<(String, Option<Shown>)>,
    of: impl Fn(&Figures) -> Percentiles + Copy + 'static,
) {
    row(rows, "mean", move |f| ms(of(f).mean));
    row(rows, "p50", move |f| ms(of(f).p50));
    row(rows, "p90", move |f| ms(of(f).p90));
    row(rows, "p99", move |f| ms(of(f).p99));
    row(rows, "p99.9", move |f| ms(of(f).p99_9));
    row(rows, "p99.99", move |f| ms(of(f).p99_99));
    row(rows, "longest", move |f| ms(of(f).max));
}

fn split(rows: &mut Vec<(String, Option<Shown>)>) {
    group(rows, "parts of the mean latency, ms");
    let of = |f: &Figures| f.split_ms.unwrap_or_default();
    row(rows, "waiting at the client", move |f| ms(of(f).client));
    row(rows, "network and transport", move |f| ms(of(f).transport));
    row(rows, "server, other", move |f| ms(of(f).server_other));
    row(rows, "queue", move |f| ms(of(f).queue));
    row(rows, "assemble", move |f| ms(of(f).assemble));
    row(rows, "inference", move |f| ms(of(f).inference));
    row(rows, "scatter", move |f| ms(of(f).scatter));
}

fn live(rows: &mut Vec<(String, Option<Shown>)>, idle: bool) {
    group(rows, "live characters");
    let of = |f: &Figures| -> LiveFigures { f.live.unwrap_or_default() };
    row(rows, "characters", move |f| of(f).characters.to_string());
    if idle {
        return;
    }
    row(rows, "streams or groups", move |f| of(f).streams.to_string());
    row(rows, "underruns", move |f| of(f).plans.underruns.to_string());
    row(rows, "frames slowed", move |f| of(f).slowed_frames.to_string());
    row(rows, "frames missing", move |f| of(f).missing_frames.to_string());
    row(rows, "ticks missed", move |f| of(f).missed_ticks.to_string());
    row(rows, "ticks over a period late", move |f| {
        of(f).late_ticks.to_string()
    });
    row(rows, "tick jitter p99, ms", move |f| ms(of(f).jitter_ms.p99));
    row(rows, "late plans", move |f| of(f).plans.late.to_string());
    row(rows, "plans a second and character", move |f| {
        format!("{:.2}", of(f).plans_per_s_and_character)
    });
    row(rows, "command to motion p50, ms", move |f| {
        ms(of(f).command_to_motion_ms.p50)
    });
    row(rows, "command to motion p99, ms", move |f| {
        ms(of(f).command_to_motion_ms.p99)
    });
    row(rows, "performances begun", move |f| {
        of(f).performances.started.to_string()
    });
    row(rows, "performances late or failed", move |f| {
        let all = of(f).performances;
        (all.late + all.failed).to_string()
    });
    row(rows, "lost or refused", move |f| of(f).faults.to_string());
}

fn server(rows: &mut Vec<(String, Option<Shown>)>, report: &Report) {
    let engine = report
        .runs
        .last()
        .map(|run| run.engine.as_str())
        .unwrap_or_default();
    let engine = if engine.is_empty() {
        String::new()
    } else {
        format!(", engine {engine}")
    };
    group(rows, &format!("server, by its metrics{engine}"));
    let of = |f: &Figures| -> ServerFigures { f.server.unwrap_or_default() };
    row(rows, "processors busy", move |f| {
        format!("{:.2}", of(f).cpus_busy)
    });
    row(rows, "memory before, MiB", move |f| mib(of(f).rss_before_bytes));
    row(rows, "peak memory, MiB", move |f| mib(of(f).rss_peak_bytes));
    if report.median.live.is_some() {
        row(rows, "memory per session, KiB", move |f| {
            format!("{:.1}", of(f).rss_per_session_bytes / 1024.0)
        });
    }
    if matches!(report.plan.workload, Workload::Idle { .. }) {
        return;
    }
    row(rows, "frames generated a second", move |f| {
        rate(of(f).frames_generated_per_s)
    });
    row(rows, "characters in a batch, mean", move |f| {
        format!("{:.1}", of(f).batch_mean)
    });
    row(rows, "padding", move |f| {
        format!("{:.1} %", of(f).padding * 100.0)
    });
    row(rows, "workers busy, mean", move |f| {
        let of = of(f);
        match of.workers {
            0.0 => format!("{:.2}", of.busy_workers),
            workers => format!("{:.2} of {workers}", of.busy_workers),
        }
    });
    if report.median.live.is_some() {
        row(rows, "plans requested a second", move |f| {
            rate(of(f).replans_per_s)
        });
        row(rows, "crowd pressure, maximum", move |f| {
            format!("{:.2}", of(f).pressure_max)
        });
    }
    row(rows, "batch in root, ms", move |f| ms(of(f).stage_ms.root));
    row(rows, "batch in pose, ms", move |f| ms(of(f).stage_ms.pose));
    row(rows, "batch in decoder, ms", move |f| ms(of(f).stage_ms.decoder));
}

fn stages(stages: &[StageResult]) -> String {
    if stages.is_empty() {
        return String::new();
    }
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_header([
        "stage", "right/s", "p50 ms", "p99 ms", "max ms", "refused", "failed", "dropped",
    ]);
    for of in stages {
        table.add_row([
            of.stage.clone(),
            rate(of.right_per_s),
            ms(of.latency_ms.p50),
            ms(of.latency_ms.p99),
            ms(of.latency_ms.max),
            of.counts.refused.to_string(),
            of.counts.failed.to_string(),
            of.counts.dropped.to_string(),
        ]);
    }
    aligned(table)
}

/// The result of a search or an overload, in words.
pub fn extra(report: &Report) -> Option<String> {
    let search = report.search.as_ref().map(search);
    let overload = report.overload.as_ref().map(overload);
    search.or(overload)
}

fn search(of: &SearchReport) -> String {
    let unit = match of.aim {
        Aim::Characters => "characters",
        Aim::Rate => "requests/s",
    };
    let mut text = match of.found {
        Some(found) => format!("most {unit} with p99 <= {} ms: {found}\n", of.goal.p99_ms),
        None => format!(
            "even the lowest level of {unit} misses p99 <= {} ms\n",
            of.goal.p99_ms
        ),
    };
    if of.at_limit {
        text += "this is the upper limit of the search, which --most can raise\n";
    }
    for step in &of.steps {
        let verdict = if step.kept {
            "holds".to_owned()
        } else {
            step.why.join(", ")
        };
        let again = if step.confirms { " again" } else { "" };
        let _ = writeln!(
            text,
            "{:>10} {unit}{again}: p99 {} ms; {verdict}",
            step.level,
            ms(step.p99_ms)
        );
    }
    text
}

fn overload(of: &OverloadReport) -> String {
    let found = if of.capacity_found { "found" } else { "given" };
    let mut text = format!("capacity ({found}): {} requests/s\n", rate(of.capacity_per_s));
    let _ = writeln!(
        text,
        "p99 of admitted requests at {} times the capacity: {} ms, which is {:.2} times the {} ms at 90 %",
        of.factor,
        ms(of.during.latency_ms.p99),
        of.p99_ratio,
        ms(of.before.latency_ms.p99),
    );
    let _ = writeln!(
        text,
        "answered in the overload: {} a second; refused: {:.1} %; failed: {}; dropped by this client: {}",
        rate(of.during.right_per_s),
        of.refused_share * 100.0,
        of.during.counts.failed,
        of.during.counts.dropped,
    );
    match of.recovery_s {
        Some(seconds) => {
            let _ = writeln!(text, "recovered {seconds:.1} s after the overload");
        }
        None => text += "NOT recovered by the end of the test\n",
    }
    if let Some(memory) = &of.memory {
        let _ = writeln!(
            text,
            "server memory: {} MiB at first, {} MiB at most, {} MiB at the end; \
             {:+.1} MiB late in the overload",
            mib(memory.begin),
            mib(memory.peak),
            mib(memory.end),
            memory.growth_late as f64 / 1_048_576.0,
        );
    }
    if let Some(beside) = &of.beside {
        let _ = writeln!(
            text,
            "{} live characters: {} frames slowed before, {} in the overload, {} after; {} missing; \
             ticks p99 {} ms late",
            beside.characters,
            beside.slowed_before,
            beside.slowed_during,
            beside.slowed_after,
            beside.missing,
            ms(beside.tick_p99_ms),
        );
    }
    text
}

/// Warnings about the figures.
fn notes(report: &Report) -> Vec<String> {
    let mut notes = Vec::new();
    let of = &report.median;
    if of.counts.dropped > 0 {
        notes.push(format!(
            "{} requests were due but never sent, because too many were in flight (--max-in-flight)",
            of.counts.dropped
        ));
    }
    let due = of.counts.right.max(1);
    if of.late_sends * 100 > due {
        notes.push(format!(
            "{:.1} % of requests were sent over 1 ms late, because this client was slow \
             (--processes, another machine)",
            of.late_sends as f64 * 100.0 / due as f64
        ));
    }
    let cpus = f64::from(report.machine.cpus);
    if of.client.cpus_busy > 0.8 * cpus {
        notes.push("the load tester kept most of this machine's processors busy".to_owned());
    }
    notes
}

/// A rate as text: two digits after the point below 100, none above.
fn rate(value: f64) -> String {
    if value < 100.0 {
        format!("{value:.2}")
    } else {
        format!("{value:.0}")
    }
}

fn ms(value: f64) -> String {
    format!("{value:.2}")
}

fn mib(bytes: u64) -> String {
    format!("{:.0}", bytes as f64 / 1_048_576.0)
}
