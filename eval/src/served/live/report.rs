//! The report of `troupe-eval live`: tables, bars, JSON.

use comfy_table::{Cell, CellAlignment, ContentArrangement, Table, presets};
use serde::Serialize;
use troupe_client::Pack;
use troupe_motion::metrics::percentile;
use troupe_proto::v1;

use super::measure::{Outcome, Then};
use super::reference::References;
use super::scenario::Scenario;
use super::turns::{Turning, turning_bars};
use crate::figures::line;

/// Share of accelerations below the figure that is reported.
const P999: f64 = 0.999;
/// Width without a terminal.
const WIDE: u16 = 150;

/// All figures of a pack.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    pack: String,
    pack_version: String,
    content_hash: String,
    gaits: Vec<GaitRow>,
    turns: Vec<TurnRow>,
    /// Limbs that meet in turns, and accelerations of the root in turns and stops.
    turning: Turning,
    /// All joint accelerations of all characters, 99.9th percentile, and of all clips.
    acceleration: Against,
    plans: u64,
    late_plans: u64,
    underruns: u64,
    failed_plans: u64,
    bars: Vec<Bar>,
}

/// A figure beside that of the clips.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Against {
    pub(super) figure: f64,
    pub(super) clips: Option<f64>,
    pub(super) ratio: Option<f64>,
}

impl Against {
    pub(super) fn new(figure: f64, clips: Option<f64>) -> Self {
        Self {
            figure,
            clips,
            ratio: clips.filter(|&c| c > 0.0).map(|c| figure / c),
        }
    }
}

/// A character that went straight on and stopped.
#[derive(Debug, Serialize)]
struct GaitRow {
    style: String,
    gait: String,
    commanded_mps: f32,
    speed_1s_mps: f32,
    speed_1s_error: f32,
    steady_mps: f32,
    steady_error: f32,
    speed_1s_after_stop_mps: f32,
    foot_skate_mm: Against,
    acceleration_p999_mps2: Against,
    joint_jitter_mps2: f64,
    /// Mean heading while steady against where it should face, degrees.
    facing_error_deg: f32,
}

/// The characters that turned by an angle, to the left and to the right.
#[derive(Debug, Serialize)]
struct TurnRow {
    style: String,
    turn_deg: f32,
    /// Heading error 1 s after, the larger of both sides, degrees.
    heading_error_deg: f32,
    /// With the pelvis' sway.
    heading_error_with_sway_deg: f32,
    /// Larger of both sides.
    speed_1s_error: f32,
    acceleration_p999_mps2: Against,
}

/// A bar, and how many meet it.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Bar {
    bar: String,
    met: usize,
    of: usize,
    /// Characters that miss it, the worst first.
    missed: Vec<String>,
    mean: Option<f64>,
}

impl Bar {
    /// The bar `figure <= limit` for each of the named figures.
    pub(super) fn new(bar: &str, limit: f64, figures: impl IntoIterator<Item = (String, f64)>) -> Self {
        let figures: Vec<(String, f64)> = figures.into_iter().collect();
        let mut missed: Vec<&(String, f64)> =
            figures.iter().filter(|(_, f)| *f > limit || f.is_nan()).collect();
        missed.sort_by(|a, b| b.1.total_cmp(&a.1));
        let sum: f64 = figures.iter().map(|(_, f)| f).sum();
        Self {
            bar: bar.to_owned(),
            met: figures.len() - missed.len(),
            of: figures.len(),
            missed: missed.iter().map(|(name, f)| format!("{name} {f:.2}")).collect(),
            mean: (!figures.is_empty()).then(|| sum / figures.len() as f64),
        }
    }
}

impl Report {
    /// Compares outcomes, one for each scenario, with the references.
    pub(super) fn new(
        pack: &Pack,
        scenarios: &[Scenario],
        outcomes: &[Outcome],
        references: &References,
        stats: &v1::SessionStats,
    ) -> Self {
        let (mut gaits, mut turns) = (Vec::new(), Vec::new());
        for (scenario, outcome) in scenarios.iter().zip(outcomes) {
            let reference = references.get(&(scenario.style.clone(), scenario.gait.clone()));
            let p999 = |values: &[f64]| percentile(values.to_vec(), P999);
            let acceleration = Against::new(
                p999(&outcome.accelerations).unwrap_or(0.0),
                reference.and_then(|r| p999(&r.accelerations)),
            );
            let commanded = scenario.velocity.length();
            let error = |speed: f32| speed / commanded - 1.0;
            match outcome.then {
                Then::Stopped { speed_1s } => gaits.push(GaitRow {
                    style: scenario.style.clone(),
                    gait: scenario.gait.clone(),
                    commanded_mps: commanded,
                    speed_1s_mps: outcome.speed_1s,
                    speed_1s_error: error(outcome.speed_1s),
                    steady_mps: outcome.speed_steady,
                    steady_error: error(outcome.speed_steady),
                    speed_1s_after_stop_mps: speed_1s,
                    foot_skate_mm: Against::new(
                        outcome.skate_m * 1000.0,
                        reference.map(|r| r.skate_m * 1000.0),
                    ),
                    acceleration_p999_mps2: acceleration,
                    joint_jitter_mps2: outcome.jitter,
                    facing_error_deg: outcome.facing_error.to_degrees(),
                }),
                Then::Turned {
                    angle,
                    heading_error,
                    raw_error,
                    speed_1s,
                } => turns.push(TurnRow {
                    style: scenario.style.clone(),
                    turn_deg: angle.to_degrees(),
                    heading_error_deg: heading_error.to_degrees().abs(),
                    heading_error_with_sway_deg: raw_error.to_degrees().abs(),
                    speed_1s_error: error(speed_1s),
                    acceleration_p999_mps2: acceleration,
                }),
            }
        }
        let all: Vec<f64> = outcomes
            .iter()
            .flat_map(|o| o.accelerations.iter().copied())
            .collect();
        let clips: Vec<f64> = references
            .values()
            .flat_map(|r| r.accelerations.iter().copied())
            .collect();
        let acceleration = Against::new(percentile(all, P999).unwrap_or(0.0), percentile(clips, P999));
        let of = pack.description();
        let turning = Turning::new(scenarios, outcomes, references);
        let mut bars = bars(&gaits, &turns, acceleration);
        bars.extend(turning_bars(&turning));
        Self {
            pack: of.name.clone(),
            pack_version: of.version.clone(),
            content_hash: of.content_hash.clone(),
            bars,
            gaits,
            turns: both_sides(turns),
            turning,
            acceleration,
            plans: stats.plans(),
            late_plans: stats.late_plans,
            underruns: stats.underruns,
            failed_plans: stats.failed_plans,
        }
    }

    /// The report as text for a terminal of a width.
    pub(super) fn to_text(&self, width: Option<u16>) -> String {
        let mut text = String::new();
        let width = width.unwrap_or(WIDE);
        line(
            &mut text,
            format_args!("live characters of {} {}", self.pack, self.pack_version),
        );
        line(&mut text, format_args!("{}", self.gait_table(width)));
        line(&mut text, format_args!("{}", self.turn_table(width)));
        line(&mut text, format_args!("{}", self.turning));
        line(
            &mut text,
            format_args!(
                "joint acceleration, 99.9 % below: {} m/s² over all characters, starts, turns and stops included; clips {}",
                number(Some(self.acceleration.figure), 1),
                number(self.acceleration.clips, 1)
            ),
        );
        line(
            &mut text,
            format_args!(
                "{} plans, {} late, {} failed, {} underruns",
                self.plans, self.late_plans, self.failed_plans, self.underruns
            ),
        );
        for bar in &self.bars {
            line(&mut text, format_args!("{bar}"));
        }
        text.trim_end().to_owned()
    }

    fn gait_table(&self, width: u16) -> Table {
        let mut table = table(
            width,
            &[
                "style",
                "gait",
                "speed\nm/s",
                "after 1 s\nm/s",
                "off\n%",
                "steady\nm/s",
                "off\n%",
                "1 s after\nstop m/s",
                "skate\nmm",
                "clips\nmm",
                "ratio",
                "accel.\nm/s²",
                "clips\nm/s²",
                "ratio",
                "jitter\nm/s²",
                "facing\noff °",
            ],
        );
        let mut last = "";
        for row in &self.gaits {
            let style = if row.style == last { "" } else { &row.style };
            last = &row.style;
            let (skate, acceleration) = (row.foot_skate_mm, row.acceleration_p999_mps2);
            let mut cells = vec![Cell::new(style), Cell::new(&row.gait)];
            let numbers = [
                (Some(f64::from(row.commanded_mps)), 2),
                (Some(f64::from(row.speed_1s_mps)), 2),
                (Some(f64::from(row.speed_1s_error) * 100.0), 0),
                (Some(f64::from(row.steady_mps)), 2),
                (Some(f64::from(row.steady_error) * 100.0), 0),
                (Some(f64::from(row.speed_1s_after_stop_mps)), 2),
                (Some(skate.figure), 1),
                (skate.clips, 1),
                (skate.ratio, 2),
                (Some(acceleration.figure), 0),
                (acceleration.clips, 0),
                (acceleration.ratio, 2),
                (Some(row.joint_jitter_mps2), 1),
                (Some(f64::from(row.facing_error_deg)), 0),
            ];
            cells.extend(numbers.map(|(n, digits)| right(number(n, digits))));
            table.add_row(cells);
        }
        table
    }

    fn turn_table(&self, width: u16) -> Table {
        let mut table = table(
            width,
            &[
                "style",
                "turn °",
                "heading off\nafter 1 s °",
                "with\nsway °",
                "speed off\n%",
                "accel.\nm/s²",
                "clips\nm/s²",
                "ratio",
            ],
        );
        let mut last = "";
        for row in &self.turns {
            let style = if row.style == last { "" } else { &row.style };
            last = &row.style;
            let acceleration = row.acceleration_p999_mps2;
            let mut cells = vec![Cell::new(style)];
            let numbers = [
                (Some(f64::from(row.turn_deg)), 0),
                (Some(f64::from(row.heading_error_deg)), 1),
                (Some(f64::from(row.heading_error_with_sway_deg)), 1),
                (Some(f64::from(row.speed_1s_error) * 100.0), 0),
                (Some(acceleration.figure), 0),
                (acceleration.clips, 0),
                (acceleration.ratio, 2),
            ];
            cells.extend(numbers.map(|(n, digits)| right(number(n, digits))));
            table.add_row(cells);
        }
        table
    }
}

/// Puts turns to the left and to the right of one angle into one row, with the worse of both.
fn both_sides(turns: Vec<TurnRow>) -> Vec<TurnRow> {
    let mut rows: Vec<TurnRow> = Vec::new();
    for mut turn in turns {
        turn.turn_deg = turn.turn_deg.abs();
        let same = |row: &&mut TurnRow| row.style == turn.style && (row.turn_deg - turn.turn_deg).abs() < 0.5;
        let Some(row) = rows.iter_mut().find(same) else {
            rows.push(turn);
            continue;
        };
        let worse = |a: f32, b: f32| if b.abs() > a.abs() { b } else { a };
        row.heading_error_deg = worse(row.heading_error_deg, turn.heading_error_deg);
        row.heading_error_with_sway_deg =
            worse(row.heading_error_with_sway_deg, turn.heading_error_with_sway_deg);
        row.speed_1s_error = worse(row.speed_1s_error, turn.speed_1s_error);
        let figure = row
            .acceleration_p999_mps2
            .figure
            .max(turn.acceleration_p999_mps2.figure);
        row.acceleration_p999_mps2 = Against::new(figure, row.acceleration_p999_mps2.clips);
    }
    rows
}

/// The bars for live characters.
fn bars(gaits: &[GaitRow], turns: &[TurnRow], acceleration: Against) -> Vec<Bar> {
    let named = |row: &GaitRow| format!("{} {}", row.style, row.gait);
    let turned = |row: &TurnRow| format!("{} {:+.0}°", row.style, row.turn_deg);
    let of_gaits = |figure: fn(&GaitRow) -> Option<f64>| {
        gaits
            .iter()
            .filter_map(move |row| Some((named(row), figure(row)?)))
            .collect::<Vec<_>>()
    };
    let walks = of_gaits(|row| {
        row.gait
            .starts_with("walk")
            .then_some(row.foot_skate_mm.ratio)
            .flatten()
    });
    vec![
        Bar::new(
            "speed within 15 % 1 s after the command",
            0.15,
            of_gaits(|row| Some(f64::from(row.speed_1s_error.abs()))),
        ),
        Bar::new(
            "steady speed within 15 %",
            0.15,
            of_gaits(|row| Some(f64::from(row.steady_error.abs()))),
        ),
        Bar::new(
            "speed within 15 % 1 s after a turn",
            0.15,
            turns
                .iter()
                .map(|row| (turned(row), f64::from(row.speed_1s_error.abs()))),
        ),
        Bar::new(
            "heading within 10° 1 s after a turn",
            10.0,
            turns
                .iter()
                .map(|row| (turned(row), f64::from(row.heading_error_deg))),
        ),
        Bar::new(
            "facing within 15° while going steadily, in all directions",
            15.0,
            of_gaits(|row| Some(f64::from(row.facing_error_deg))),
        ),
        Bar::new(
            "foot skate while walking at most 2 times that of the clips",
            2.0,
            walks,
        ),
        Bar::new(
            "acceleration (99.9 %) at most 1.5 times that of the clips, by gait",
            1.5,
            of_gaits(|row| row.acceleration_p999_mps2.ratio),
        ),
        Bar::new(
            "acceleration (99.9 %) at most 1.5 times that of the clips, by turn",
            1.5,
            turns
                .iter()
                .filter_map(|row| Some((turned(row), row.acceleration_p999_mps2.ratio?))),
        ),
        Bar::new(
            "acceleration (99.9 %) at most 1.5 times that of the clips, over all",
            1.5,
            acceleration.ratio.map(|ratio| ("all".to_owned(), ratio)),
        ),
    ]
}

impl std::fmt::Display for Bar {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Some(mean) = self.mean else {
            return write!(f, "not measured: {}", self.bar);
        };
        let verdict = if self.met == self.of {
            "holds:   "
        } else {
            "missed:  "
        };
        write!(
            f,
            "{verdict} {}: {} of {}, mean {mean:.2}",
            self.bar, self.met, self.of
        )?;
        if !self.missed.is_empty() {
            write!(f, "; not {}", self.missed.join(", "))?;
        }
        Ok(())
    }
}

fn table(width: u16, header: &[&str]) -> Table {
    let mut table = Table::new();
    table
        .load_style(presets::UTF8_FULL_CONDENSED)
        .set_content_arrangement(ContentArrangement::Dynamic)
        .set_width(width)
        .set_header(header.iter().copied());
    table
}

fn right(text: String) -> Cell {
    Cell::new(text).set_alignment(CellAlignment::Right)
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "n/a".to_owned(), |v| format!("{v:.digits$}"))
}

#[cfg(test)]
#[path = "report_tests.rs"]
mod tests;
