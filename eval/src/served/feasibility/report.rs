//! The report of `troupe-eval feasibility`.

use std::collections::BTreeMap;

use comfy_table::{Cell, CellAlignment, Table, presets};
use serde::Serialize;
use troupe_client::Pack;
use troupe_proto::v1;

/// Most of the real windows that may be flagged, a share.
const MOST_REAL: f64 = 0.02;
/// Least of the impossible requests that must be flagged, a share.
const LEAST_IMPOSSIBLE: f64 = 0.95;

/// Real windows and impossible requests, and how many answers were flagged.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    pub(super) pack: String,
    pub(super) pack_version: String,
    pub(super) content_hash: String,
    pub(super) seed: u64,
    pub(super) real: Vec<Row>,
    pub(super) all_real: Row,
    pub(super) impossible: Vec<Row>,
    pub(super) all_impossible: Row,
}

/// A group of answers, and how many of them say that they are not feasible.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(super) struct Row {
    pub(super) what: String,
    pub(super) answers: usize,
    pub(super) flagged: usize,
    /// How often each figure was the worst of a flagged answer.
    pub(super) by_figure: BTreeMap<String, usize>,
    /// Ratios of the worst figures, from the smallest on.
    #[serde(skip)]
    ratios: Vec<f32>,
    /// Median of those ratios.
    pub(super) median_ratio: f32,
}

impl Row {
    /// Counts answers.
    pub(super) fn new(what: String, found: &[v1::Feasibility]) -> Self {
        let mut row = Self {
            what,
            answers: found.len(),
            ratios: found.iter().map(|found| found.ratio).collect(),
            ..Self::default()
        };
        for found in found.iter().filter(|found| !found.feasible) {
            row.flagged += 1;
            *row.by_figure.entry(found.worst.clone()).or_default() += 1;
        }
        row.sorted()
    }

    /// Several rows together.
    pub(super) fn sum(what: &str, rows: &[Self]) -> Self {
        let mut all = Self {
            what: what.to_owned(),
            ..Self::default()
        };
        for row in rows {
            all.answers += row.answers;
            all.flagged += row.flagged;
            all.ratios.extend(&row.ratios);
            for (figure, count) in &row.by_figure {
                *all.by_figure.entry(figure.clone()).or_default() += count;
            }
        }
        all.sorted()
    }

    fn sorted(mut self) -> Self {
        self.ratios.sort_by(f32::total_cmp);
        self.median_ratio = self
            .ratios
            .get(self.ratios.len() / 2)
            .copied()
            .unwrap_or_default();
        self
    }

    fn share(&self) -> f64 {
        self.flagged as f64 / self.answers.max(1) as f64
    }

    fn cells(&self) -> Vec<Cell> {
        let mut figures: Vec<_> = self.by_figure.iter().collect();
        figures.sort_by_key(|(_, count)| std::cmp::Reverse(**count));
        let named = figures
            .iter()
            .take(3)
            .map(|(name, count)| format!("{name} {count}"));
        let right = |text: String| Cell::new(text).set_alignment(CellAlignment::Right);
        vec![
            Cell::new(&self.what),
            right(self.answers.to_string()),
            right(self.flagged.to_string()),
            right(format!("{:.1} %", 1e2 * self.share())),
            right(format!("{:.2}", self.median_ratio)),
            Cell::new(named.collect::<Vec<_>>().join(", ")),
        ]
    }
}

impl Report {
    pub(super) fn new(pack: &Pack, seed: u64, real: Vec<Row>, impossible: Vec<Row>) -> Self {
        let of = pack.description();
        Self {
            pack: of.name.clone(),
            pack_version: of.version.clone(),
            content_hash: of.content_hash.clone(),
            seed,
            all_real: Row::sum("all real windows", &real),
            all_impossible: Row::sum("all impossible requests", &impossible),
            real,
            impossible,
        }
    }

    /// The report for people.
    pub(super) fn to_text(&self) -> String {
        let mut table = Table::new();
        table.load_style(presets::UTF8_FULL_CONDENSED);
        table.set_header(["", "answers", "not feasible", "share", "median ratio", "by"]);
        let rows = self.real.iter().chain([&self.all_real]);
        for row in rows.chain(&self.impossible).chain([&self.all_impossible]) {
            table.add_row(row.cells());
        }
        let met = |met: bool| if met { "met" } else { "missed" };
        let (real, impossible) = (self.all_real.share(), self.all_impossible.share());
        format!(
            "{} {}\n{table}\nRatio: a figure ÷ its limit, of the figure with the largest ratio. By: the figures with the largest ratios in \
             answers that are not feasible.\nReal windows flagged: {:.2} %, bar {:.0} %: {}\nImpossible requests flagged: {:.2} %, bar {:.0} %: {}",
            self.pack,
            self.pack_version,
            1e2 * real,
            1e2 * MOST_REAL,
            met(real <= MOST_REAL),
            1e2 * impossible,
            1e2 * LEAST_IMPOSSIBLE,
            met(impossible >= LEAST_IMPOSSIBLE),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(feasible: bool, worst: &str, ratio: f32) -> v1::Feasibility {
        v1::Feasibility {
            feasible,
            worst: worst.to_owned(),
            ratio,
            ..v1::Feasibility::default()
        }
    }

    #[test]
    fn rows_count_what_is_flagged_and_add_up() {
        let few = Row::new(
            "gap of 8".to_owned(),
            &[
                found(true, "tilt", 0.5),
                found(false, "turning", 1.5),
                found(true, "bend", 0.2),
            ],
        );
        assert_eq!((few.answers, few.flagged, few.median_ratio), (3, 1, 0.5));
        let more = Row::new("gap of 15".to_owned(), &[found(false, "turning", 3.0)]);
        let all = Row::sum("all", &[few, more]);
        assert_eq!((all.answers, all.flagged), (4, 2));
        assert_eq!(all.by_figure, BTreeMap::from([("turning".to_owned(), 2)]));
        assert_eq!(all.share(), 0.5);
        assert_eq!(all.median_ratio, 1.5);
        assert_eq!(Row::new(String::new(), &[]).share(), 0.0);
    }
}
