//! The report of `troupe-eval wander`: a table, bars, JSON.

use comfy_table::{Cell, CellAlignment, Table, presets};
use serde::Serialize;
use troupe_client::Pack;
use troupe_motion::metrics::Estimate;
use troupe_proto::v1;

use super::against::ratio;
use super::args::Wander;
use super::measure::{KINDS, Kinds};
use super::script::Replan;
use crate::figures::line;

/// Most that a figure of live characters may be, as a multiple of that of in-betweening.
const BAR: f64 = 1.5;

/// All runs of a pack.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    pack: String,
    pack_version: String,
    content_hash: String,
    characters: usize,
    seconds: u32,
    seed: u64,
    runs: Vec<Row>,
}

/// Characters that planned at one interval.
#[derive(Debug, Serialize)]
pub(super) struct Row {
    /// None: each style has its own.
    replan_interval_frames: Option<u32>,
    look_ahead_frames: Option<u32>,
    plans_per_second: f64,
    failed_plans: u64,
    underruns: u64,
    fid: Option<Estimate>,
    figures: Vec<Figure>,
}

/// One of [`KINDS`].
#[derive(Debug, Serialize)]
struct Figure {
    name: &'static str,
    live: Estimate,
    /// None without --against.
    in_betweening: Option<Estimate>,
    ratio: Option<Estimate>,
    /// Whether the ratio is at most 1.5.
    holds: Option<bool>,
}

impl Row {
    /// The figures of characters that lived for `seconds` in total.
    pub(super) fn new(
        replan: Option<Replan>,
        figures: Kinds<Estimate>,
        fid: Option<Estimate>,
        against: Option<Kinds<Estimate>>,
        stats: &v1::SessionStats,
        seconds: usize,
    ) -> Self {
        let plans = stats.plans();
        let figures = KINDS.iter().enumerate().map(|(nth, kind)| {
            let in_betweening = against.map(|all| all[nth]);
            let ratio = in_betweening.and_then(|base| ratio(figures[nth], base));
            Figure {
                name: kind.key,
                live: figures[nth],
                in_betweening,
                ratio,
                holds: ratio.map(|ratio| ratio.mean <= BAR),
            }
        });
        Self {
            replan_interval_frames: replan.map(|r| r.interval_frames),
            look_ahead_frames: replan.map(|r| r.look_ahead_frames),
            plans_per_second: plans as f64 / seconds.max(1) as f64,
            failed_plans: stats.failed_plans,
            underruns: stats.underruns,
            fid,
            figures: figures.collect(),
        }
    }

    fn interval(&self) -> String {
        match self.replan_interval_frames {
            Some(frames) => format!("every {frames} frames"),
            None => "as styles say".to_owned(),
        }
    }
}

impl Report {
    pub(super) fn new(pack: &Pack, characters: usize, command: &Wander, runs: Vec<Row>) -> Self {
        let of = pack.description();
        Self {
            pack: of.name.clone(),
            pack_version: of.version.clone(),
            content_hash: of.content_hash.clone(),
            characters,
            seconds: command.seconds,
            seed: command.seed,
            runs,
        }
    }

    /// The report as text.
    pub(super) fn to_text(&self) -> String {
        let mut text = String::new();
        line(
            &mut text,
            format_args!(
                "{} characters of {} {}, {} s each",
                self.characters, self.pack, self.pack_version, self.seconds
            ),
        );
        line(&mut text, format_args!("{}", self.table()));
        for run in &self.runs {
            if run.failed_plans + run.underruns > 0 {
                line(
                    &mut text,
                    format_args!(
                        "plans {}: {} failed, {} underruns",
                        run.interval(),
                        run.failed_plans,
                        run.underruns
                    ),
                );
            }
        }
        if self.in_betweening().is_none() {
            let why = "not measured: foot skate and jitter beside those of in-betweening (--against)";
            line(&mut text, format_args!("{why}"));
            return text.trim_end().to_owned();
        }
        for (nth, kind) in KINDS.iter().enumerate() {
            for run in &self.runs {
                let bar = Bar {
                    name: kind.name,
                    figure: &run.figures[nth],
                    interval: (self.runs.len() > 1).then(|| run.interval()),
                };
                line(&mut text, format_args!("{bar}"));
            }
        }
        text.trim_end().to_owned()
    }

    /// The figures of in-betweening, in the order of [`KINDS`].
    fn in_betweening(&self) -> Option<Vec<Estimate>> {
        let first = self.runs.first()?;
        first.figures.iter().map(|figure| figure.in_betweening).collect()
    }

    fn table(&self) -> Table {
        let with_fid = self.runs.iter().any(|run| run.fid.is_some());
        let mut table = Table::new();
        table.load_style(presets::UTF8_FULL_CONDENSED);
        let mut header = vec!["plans".to_owned(), "plans/s".to_owned()];
        header.extend(KINDS.iter().map(|kind| format!("{} {}", kind.name, kind.unit)));
        header.extend(with_fid.then(|| "FID".to_owned()));
        table.set_header(header);
        for run in &self.runs {
            let mut cells = vec![run.interval(), format!("{:.2}", run.plans_per_second)];
            let figures = run.figures.iter().zip(&KINDS);
            cells.extend(figures.map(|(figure, kind)| cell(figure.live, kind.factor, 2)));
            cells.extend(with_fid.then(|| run.fid.map_or("–".to_owned(), |fid| cell(fid, 1.0, 3))));
            table.add_row(aligned(cells));
        }
        if let Some(against) = self.in_betweening() {
            let mut cells = vec!["in-betweening".to_owned(), String::new()];
            let figures = against.into_iter().zip(&KINDS);
            cells.extend(figures.map(|(figure, kind)| cell(figure, kind.factor, 2)));
            cells.extend(with_fid.then(String::new));
            table.add_row(aligned(cells));
        }
        table
    }
}

/// The first cell to the left, the others to the right.
fn aligned(cells: Vec<String>) -> impl Iterator<Item = Cell> {
    cells.into_iter().enumerate().map(|(nth, text)| match nth {
        0 => Cell::new(text),
        _ => Cell::new(text).set_alignment(CellAlignment::Right),
    })
}

/// A value and its interval.
fn cell(estimate: Estimate, factor: f64, decimals: usize) -> String {
    let number = |value: f64| format!("{:.decimals$}", value * factor);
    let ends = estimate.low.zip(estimate.high);
    let interval = ends.map(|(low, high)| format!(" ({} to {})", number(low), number(high)));
    number(estimate.mean) + &interval.unwrap_or_default()
}

/// A line that says whether a figure is within its bar.
struct Bar<'a> {
    name: &'static str,
    figure: &'a Figure,
    /// The interval of plans, if runs differ in it.
    interval: Option<String>,
}

impl std::fmt::Display for Bar<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let verdict = match self.figure.holds {
            Some(true) => "holds:       ",
            Some(false) => "missed:      ",
            None => "not measured:",
        };
        write!(
            f,
            "{verdict} {} at most {BAR} times that of in-betweening",
            self.name
        )?;
        if let Some(interval) = &self.interval {
            write!(f, ", plans {interval}")?;
        }
        match self.figure.ratio {
            Some(ratio) => write!(f, ": {}", cell(ratio, 1.0, 2)),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn around(mean: f64) -> Estimate {
        Estimate {
            mean,
            low: Some(mean * 0.9),
            high: Some(mean * 1.1),
        }
    }

    fn report(intervals: &[Option<u32>], against: Option<Kinds<Estimate>>) -> Report {
        let stats = v1::SessionStats {
            plans_for_command: 50,
            plans_for_interval: 150,
            ..v1::SessionStats::default()
        };
        let row = |interval: &Option<u32>| {
            let replan = interval.map(|interval_frames| Replan {
                interval_frames,
                look_ahead_frames: 3,
            });
            let fid = replan.map(|_| around(0.2));
            Row::new(replan, [0.0030, 6.0, 3.1].map(around), fid, against, &stats, 60)
        };
        Report {
            pack: "human".to_owned(),
            pack_version: "1.2.0".to_owned(),
            content_hash: "sha256:00".to_owned(),
            characters: 44,
            seconds: 60,
            seed: 0,
            runs: intervals.iter().map(row).collect(),
        }
    }

    #[test]
    fn the_text_is_as_documented() {
        let text = report(&[None], Some([0.0034, 3.7, 2.2].map(around))).to_text();
        insta::assert_snapshot!(text);
    }

    #[test]
    fn intervals_stand_below_each_other() {
        insta::assert_snapshot!(report(&[Some(3), Some(8)], None).to_text());
    }

    #[test]
    fn only_ratios_of_at_most_one_and_a_half_hold() {
        let json = serde_json::to_value(report(&[None], Some([0.0020, 3.9, f64::NAN].map(around)))).unwrap();
        let holds: Vec<_> = json["runs"][0]["figures"]
            .as_array()
            .unwrap()
            .iter()
            .map(|figure| figure["holds"].clone())
            .collect();
        assert_eq!(holds, [true.into(), false.into(), serde_json::Value::Null]);
        assert_eq!(json["runs"][0]["plans_per_second"], 200.0 / 60.0);
    }
}
