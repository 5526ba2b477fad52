//! The report as one self-contained page with plots.

use std::path::Path;

use askama::Template;

use super::Report;
use super::plots::{self, PlotError};
use super::table::{self, Row};
use crate::failure::Failure;
use crate::figures::{Run, Split};

/// A plot and its caption.
struct Plot {
    title: &'static str,
    svg: String,
}

/// A part of the mean latency.
struct LatencyPart {
    name: &'static str,
    ms: String,
    percent: String,
    colour: &'static str,
}

#[derive(Template)]
#[template(path = "report.html")]
struct Page<'a> {
    report: &'a Report,
    title: String,
    plan: String,
    rows: Vec<Row>,
    extra: Option<String>,
    parts: Vec<LatencyPart>,
    plots: Vec<Plot>,
}

/// The whole report as HTML.
///
/// # Errors
/// [`Failure::Other`] if a plot cannot be drawn.
pub fn page(report: &Report) -> Result<String, Failure> {
    let plan = serde_json::to_string_pretty(&report.plan).map_err(|e| Failure::Other(e.to_string()))?;
    let plots = plots(&report.runs).map_err(|e| Failure::Other(e.to_string()))?;
    let page = Page {
        title: if report.label.is_empty() {
            "Load test".to_owned()
        } else {
            report.label.clone()
        },
        plan,
        rows: table::rows(report),
        extra: table::extra(report),
        parts: report.median.split_ms.as_ref().map(parts).unwrap_or_default(),
        plots,
        report,
    };
    page.render()
        .map_err(|e| Failure::Other(format!("cannot write the page: {e}")))
}

/// Writes the page into a file.
///
/// # Errors
/// [`Failure::Other`] if a plot cannot be drawn or the file cannot be written.
pub fn write(report: &Report, path: &Path) -> Result<(), Failure> {
    std::fs::write(path, page(report)?).map_err(|e| Failure::output(path, e))
}

/// All plots. Percentiles show every repetition, the other plots only the last one.
fn plots(runs: &[Run]) -> Result<Vec<Plot>, PlotError> {
    let Some(last) = runs.last() else {
        return Ok(Vec::new());
    };
    let mut plots = vec![
        Plot {
            title: "Latency by percentile",
            svg: plots::percentiles(runs)?,
        },
        Plot {
            title: "Answers over time",
            svg: plots::throughput(&last.series)?,
        },
        Plot {
            title: "Latency over time",
            svg: plots::latency(&last.series)?,
        },
    ];
    if !last.batch_sizes.is_empty() {
        plots.push(Plot {
            title: "Batch sizes",
            svg: plots::batches(&last.batch_sizes)?,
        });
    }
    if !last.server_series.is_empty() {
        plots.push(Plot {
            title: "Memory",
            svg: plots::memory(&last.server_series)?,
        });
        plots.push(Plot {
            title: "Processors",
            svg: plots::cpus(&last.server_series)?,
        });
    }
    Ok(plots)
}

fn parts(split: &Split) -> Vec<LatencyPart> {
    let parts = [
        ("waiting at the client", split.client, "#718096"),
        ("network and transport", split.transport, "#a0aec0"),
        ("server, other", split.server_other, "#b7791f"),
        ("queue", split.queue, "#c53030"),
        ("assemble", split.assemble, "#63b3ed"),
        ("inference", split.inference, "#2b6cb0"),
        ("scatter", split.scatter, "#2f855a"),
    ];
    let all = parts.iter().map(|p| p.1).sum::<f64>().max(1e-9);
    let part = |(name, ms, colour): (&'static str, f64, &'static str)| LatencyPart {
        name,
        ms: format!("{ms:.2}"),
        percent: format!("{:.2}", ms / all * 100.0),
        colour,
    };
    parts.into_iter().map(part).collect()
}
