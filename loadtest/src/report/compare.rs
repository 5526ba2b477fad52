//! Reports side by side: figures of each, and their ratios to the first report.

use comfy_table::{CellAlignment, Table, presets};

use super::Report;
use crate::figures::Figures;

/// A figure to compare, if a run has it.
type Figure = (&'static str, fn(&Figures) -> Option<f64>);

/// The figures to compare. Higher is better for throughput, lower for latencies, processors and
/// memory.
const FIGURES: [Figure; 18] = [
    ("requests/s", |f| Some(f.throughput.requests_per_s)),
    ("characters/s", |f| Some(f.throughput.characters_per_s)),
    ("frames/s", |f| Some(f.throughput.frames_per_s)),
    ("mean ms", |f| Some(f.latency_ms.mean)),
    ("p50 ms", |f| Some(f.latency_ms.p50)),
    ("p90 ms", |f| Some(f.latency_ms.p90)),
    ("p99 ms", |f| Some(f.latency_ms.p99)),
    ("p99.9 ms", |f| Some(f.latency_ms.p99_9)),
    ("longest ms", |f| Some(f.latency_ms.max)),
    ("refused", |f| Some(f.counts.refused as f64)),
    ("failed", |f| Some(f.counts.failed as f64)),
    ("dropped by client", |f| Some(f.counts.dropped as f64)),
    ("underruns", |f| f.live.map(|l| l.plans.underruns as f64)),
    ("plans/s and character", |f| {
        f.live.map(|l| l.plans_per_s_and_character)
    }),
    ("server processors", |f| f.server.map(|s| s.cpus_busy)),
    ("server memory, MiB", |f| {
        f.server.map(|s| s.rss_peak_bytes as f64 / 1_048_576.0)
    }),
    ("batch, mean", |f| f.server.map(|s| s.batch_mean)),
    ("client processors", |f| Some(f.client.cpus_busy)),
];

/// A table of medians. Each has its ratio to the first report and, with several repetitions, their
/// minimum and maximum.
pub fn compare(reports: &[Report]) -> String {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    let name = |(nth, report): (usize, &Report)| {
        let label = if report.label.is_empty() {
            format!("report {}", nth + 1)
        } else {
            report.label.clone()
        };
        format!("{label} ({})", report.runs.len())
    };
    let header = std::iter::once(String::new()).chain(reports.iter().enumerate().map(name));
    table.set_header(header);
    for (name, figure) in FIGURES {
        let first = reports.first().and_then(|report| figure(&report.median));
        if reports.iter().all(|report| figure(&report.median).is_none()) {
            continue;
        }
        let cells = reports
            .iter()
            .enumerate()
            .map(|(nth, report)| cell(nth, report, figure, first));
        table.add_row(std::iter::once(name.to_owned()).chain(cells));
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let lines = table.lines().map(|line| line.trim_end().to_owned() + "\n");
    lines.collect()
}

fn cell(nth: usize, report: &Report, figure: fn(&Figures) -> Option<f64>, first: Option<f64>) -> String {
    let Some(value) = figure(&report.median) else {
        return "-".to_owned();
    };
    let values = report.runs.iter().filter_map(|run| figure(&run.figures));
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    let mut text = number(value);
    if report.runs.len() > 1 {
        text += &format!(" [{} .. {}]", number(low), number(high));
    }
    match first {
        Some(first) if nth > 0 && first != 0.0 => text += &format!("  x {:.3}", value / first),
        _ => {}
    }
    text
}

fn number(value: f64) -> String {
    if value.abs() >= 1000.0 || value == value.trunc() {
        format!("{value:.0}")
    } else {
        format!("{value:.2}")
    }
}
