//! How robots are doing: a line each on a terminal, notes elsewhere, and a table at the end.

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use serde_json::json;
use troupe_sonic::{Jitter, Report, Robot, Why};

use crate::context::Context;
use crate::failure::Failure;
use crate::output::{print, table, to_json};

pub(super) struct Display<'a> {
    context: &'a Context,
    /// A line for each robot, on a terminal.
    all: MultiProgress,
    lines: Vec<ProgressBar>,
    /// What was noted of each robot last.
    noted: Vec<String>,
}

impl<'a> Display<'a> {
    pub(super) fn new(context: &'a Context, robots: &[Robot]) -> Self {
        for robot in robots {
            let text = format!("{} connects to tcp://{}", robot.name, robot.listen);
            context.term.note(text);
        }
        let all = MultiProgress::new();
        let line = |_| {
            let style =
                ProgressStyle::with_template("{msg}").unwrap_or_else(|_| ProgressStyle::default_bar());
            all.add(ProgressBar::no_length()).with_style(style)
        };
        let is_live = context.term.is_live();
        Self {
            context,
            lines: robots.iter().filter(|_| is_live).map(line).collect(),
            noted: vec![String::new(); robots.len()],
            all,
        }
    }

    pub(super) fn note(&self, text: impl std::fmt::Display) {
        self.all.suspend(|| self.context.term.note(text));
    }

    /// Shows how robots are doing. What changed is noted.
    pub(super) fn show(&mut self, reports: &[Report]) {
        for (line, report) in self.lines.iter().zip(reports) {
            line.set_message(format!(
                "{:12} {}; {}",
                report.name,
                state(report),
                measured(report)
            ));
        }
        let changed: Vec<String> = (self.noted.iter_mut().zip(reports))
            .filter(|(_, report)| report.windows > 0)
            .filter_map(|(noted, report)| {
                let now = state(report);
                let is_new = now != *noted;
                noted.clone_from(&now);
                is_new.then(|| format!("{}: {now}", report.name))
            })
            .collect();
        for text in changed {
            self.note(text);
        }
    }

    /// Prints what was sent.
    pub(super) fn end(self, reports: &[Report], as_json: bool) -> Result<(), Failure> {
        for line in &self.lines {
            line.finish_and_clear();
        }
        let mut all = Jitter::default();
        reports.iter().for_each(|report| all.merge(&report.jitter));
        if as_json {
            let robots: Vec<_> = reports.iter().map(as_value).collect();
            return print(&to_json(&json!({ "late_ms": late(&all), "robots": robots }))?);
        }
        let mut table = table();
        table.set_header([
            "robot",
            "windows",
            "late: p50, p99, most (ms)",
            "frames guessed",
            "frames too fast for a hinge",
            "fastest hinge",
            "times late",
            "robot's words",
        ]);
        for report in reports {
            table.add_row([
                report.name.clone(),
                report.windows.to_string(),
                lateness(&report.jitter),
                report.guessed.to_string(),
                report.too_fast.to_string(),
                fastest(report),
                report.late.to_string(),
                report.feedback.map_or(0, |feedback| feedback.count).to_string(),
            ]);
        }
        print(&table.to_string())
    }
}

/// A sentence on what a robot does.
fn state(report: &Report) -> String {
    let connected = match report.subscribers {
        0 => "not connected",
        _ => "connected",
    };
    let does = match report.stands {
        None => "moves",
        Some(Why::New) => "stands",
        Some(Why::Stopped) => "stands, as ordered",
        Some(Why::Late) => "stands: the server was late",
        Some(Why::Lost) => "stands: the server was lost",
    };
    let answered = if report.answered {
        ""
    } else {
        ", no word from the server"
    };
    format!("{connected}, {does}{answered}")
}

/// Figures of a robot.
fn measured(report: &Report) -> String {
    let said = report.feedback.map(|feedback| {
        let off = feedback
            .off_rad
            .map_or("no target".to_owned(), |off| format!("{off:.2} rad off"));
        let age = feedback.at.elapsed().as_millis();
        format!(
            "; tilt {:.0}°, {off}, {age} ms ago",
            feedback.tilt_rad.to_degrees()
        )
    });
    format!(
        "late by {} ms (p50, p99, most){}",
        lateness(&report.jitter),
        said.unwrap_or_default()
    )
}

/// The fastest hinge of all frames, and the share of its highest speed.
fn fastest(report: &Report) -> String {
    format!("{}, {:.0} %", report.fastest_joint, report.fastest.ratio * 100.0)
}

fn lateness(jitter: &Jitter) -> String {
    let [p50, p99] = [0.5, 0.99].map(|share| jitter.percentile_ms(share));
    format!("{p50:.2}, {p99:.2}, {:.2}", jitter.most_ms())
}

fn late(jitter: &Jitter) -> serde_json::Value {
    json!({
        "p50": jitter.percentile_ms(0.5),
        "p99": jitter.percentile_ms(0.99),
        "most": jitter.most_ms(),
    })
}

fn as_value(report: &Report) -> serde_json::Value {
    let feedback = report.feedback.map(|feedback| {
        json!({
            "messages": feedback.count,
            "tilt_rad": feedback.tilt_rad,
            "off_rad": feedback.off_rad,
        })
    });
    json!({
        "name": report.name,
        "windows": report.windows,
        "late_ms": late(&report.jitter),
        "guessed_frames": report.guessed,
        "too_fast_frames": report.too_fast,
        "fastest_hinge": { "joint": report.fastest_joint, "speed_ratio": report.fastest.ratio },
        "times_late": report.late,
        "state": state(report),
        "feedback": feedback,
    })
}
