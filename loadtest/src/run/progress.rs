//! Progress on standard error: a bar on a terminal, one line per second elsewhere, or nothing.

use std::io::IsTerminal as _;
use std::sync::Arc;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep_until};

use crate::measure::{Pulse, Recorder};
use crate::plan::{Plan, Workload};

/// Shows the progress of a load.
#[derive(Debug, Clone)]
pub struct Progress {
    kind: Kind,
    what: String,
}

#[derive(Debug, Clone)]
enum Kind {
    Quiet,
    Lines,
    Bar(ProgressBar),
}

impl Progress {
    /// Makes a progress that shows nothing.
    pub fn quiet() -> Self {
        Self {
            kind: Kind::Quiet,
            what: String::new(),
        }
    }

    /// Makes a bar if standard error is a terminal, otherwise lines.
    pub fn new(quiet: bool) -> Self {
        if quiet {
            return Self::quiet();
        }
        let kind = if std::io::stderr().is_terminal() {
            let bar = ProgressBar::with_draw_target(Some(1), ProgressDrawTarget::stderr_with_hz(10));
            if let Ok(style) = ProgressStyle::with_template("{prefix} {bar:20.cyan/dim} {pos}/{len} s  {msg}")
            {
                bar.set_style(style.progress_chars("━╸─"));
            }
            Kind::Bar(bar)
        } else {
            Kind::Lines
        };
        Self {
            kind,
            what: String::new(),
        }
    }

    /// The same progress with a prefix that names one of several loads.
    #[must_use]
    pub fn named(&self, what: impl Into<String>) -> Self {
        Self {
            kind: self.kind.clone(),
            what: what.into(),
        }
    }

    /// Prints a note between the lines of the progress.
    pub fn note(&self, text: impl AsRef<str>) {
        match &self.kind {
            Kind::Quiet => {}
            Kind::Lines => eprintln!("{}", text.as_ref()),
            Kind::Bar(bar) => bar.suspend(|| eprintln!("{}", text.as_ref())),
        }
    }

    /// Reads a recorder every second until it is aborted.
    pub fn follow(&self, plan: &Plan, recorder: Arc<Recorder>) -> JoinHandle<()> {
        let (progress, plan) = (self.clone(), plan.clone());
        tokio::spawn(async move {
            let start = recorder.clock().start();
            for second in 1..u64::MAX {
                sleep_until(start + Duration::from_secs(second)).await;
                progress.show(&plan, second, &recorder.pulse(Instant::now()));
            }
        })
    }

    /// Shows the progress after a number of seconds.
    pub fn show(&self, plan: &Plan, second: u64, pulse: &Pulse) {
        let text = words(plan, second, pulse);
        match &self.kind {
            Kind::Quiet => {}
            Kind::Lines => {
                let gap = if self.what.is_empty() { "" } else { " " };
                eprintln!("{}{gap}{second:>4} s  {text}", self.what);
            }
            Kind::Bar(bar) => {
                if bar.is_finished() {
                    // The next of several loads starts with the same bar.
                    bar.reset();
                }
                bar.set_length((plan.warmup_s + plan.measured_s).ceil() as u64);
                bar.set_prefix(self.what.clone());
                bar.set_position(second);
                bar.set_message(text);
            }
        }
    }

    /// Ends the progress.
    pub fn done(&self) {
        if let Kind::Bar(bar) = &self.kind {
            bar.finish_and_clear();
        }
    }
}

/// The progress of one second as text.
fn words(plan: &Plan, second: u64, of: &Pulse) -> String {
    let what = match plan.workload {
        Workload::Calls { .. } => "answers",
        Workload::Drive(_) => "ticks",
        Workload::Step(_) => "steps",
        Workload::Idle { .. } => return "holding".to_owned(),
    };
    let mut text = format!(
        "{} {what}  {} frames  p50 {:.1} ms  p99 {:.1} ms",
        of.right, of.frames, of.p50_ms, of.p99_ms
    );
    let extras = [
        (of.in_flight, "in flight"),
        (of.refused, "refused"),
        (of.failed, "FAILED"),
        (of.dropped, "DROPPED by this client"),
        (of.underruns, "character frames slowed"),
    ];
    for (count, what) in extras.into_iter().filter(|(count, _)| *count > 0) {
        text += &format!("  {count} {what}");
    }
    if (second as f64) <= plan.warmup_s {
        text += "  (warming up)";
    }
    text
}
