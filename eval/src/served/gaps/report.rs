//! What an evaluation found: tables, claims, JSON.

use comfy_table::{Cell, CellAlignment, Table, presets};
use serde::Serialize;
use troupe_motion::metrics::Estimate;

use super::bench::Bench;
use super::claims::{Claim, claims};
use super::figures::GapReport;
use crate::clips::Skipped;
use crate::evaluator::Origin;
use crate::figures::line;

/// Skipped clips named in the text; the JSON has all.
const SKIPPED_IN_TEXT: usize = 20;

/// Width of the table with values and intervals side by side.
const WIDE: u16 = 118;

/// Everything that an evaluation found.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    pack: String,
    pack_version: String,
    content_hash: String,
    clips: usize,
    stride_frames: usize,
    seed: u64,
    temperature: f32,
    pose_steps: u32,
    /// Whether the server held feet that stand.
    feet_held: bool,
    /// How far the pack's motions were bent to the left, metres.
    bend_m: f32,
    /// Takes of each window that diversity was measured over.
    diversity_seeds: u32,
    /// None if none was found.
    evaluator: Option<Origin>,
    gaps: Vec<GapReport>,
    claims: Vec<Claim>,
    skipped: Vec<Skipped>,
}

/// Which way is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Better {
    Lower,
    Higher,
    LikeTruth,
    Neither,
}

/// A row of the table: a measure and how to write it.
struct Row {
    key: &'static str,
    name: &'static str,
    unit: &'static str,
    better: Better,
    factor: f64,
    decimals: usize,
}

const ROWS: [Row; 21] = {
    use Better::{Higher, LikeTruth, Lower, Neither};
    const fn row(
        key: &'static str,
        name: &'static str,
        unit: &'static str,
        better: Better,
        factor: f64,
        decimals: usize,
    ) -> Row {
        Row {
            key,
            name,
            unit,
            better,
            factor,
            decimals,
        }
    }
    [
        row("fid", "FID", "", Lower, 1.0, 3),
        row("mmd", "MMD", "", Lower, 1.0, 3),
        row("joint_diversity_m", "joint diversity", "mm", Neither, 1e3, 1),
        row("diversity_ratio", "diversity ÷ distance", "", Neither, 1.0, 2),
        row("best_of_seeds_nearer", "best take nearer", "%", Neither, 1e2, 0),
        row(
            "best_of_seeds_l2p_ratio",
            "best L2P ÷ likeliest",
            "",
            Lower,
            1.0,
            2,
        ),
        row("latent_diversity", "latent diversity", "", Neither, 1.0, 3),
        row("l2p_m", "L2P", "m", Lower, 1.0, 3),
        row("l2q", "L2Q", "", Lower, 1.0, 3),
        row("npss", "NPSS", "", Lower, 1.0, 4),
        row("foot_skate_m_per_frame", "foot skate", "mm/frame", Lower, 1e3, 2),
        row("penetration_m", "penetration", "mm", Lower, 1e3, 2),
        row("contact_accuracy", "contacts right", "%", Higher, 1e2, 1),
        row(
            "contact_prediction_accuracy",
            "contacts said right",
            "%",
            Higher,
            1e2,
            1,
        ),
        row("joint_jitter_mps2", "joint jitter", "m/s²", LikeTruth, 1.0, 2),
        row("root_jitter_mps2", "root jitter", "m/s²", LikeTruth, 1.0, 2),
        row("context_keyframe_error_m", "context joints", "mm", Lower, 1e3, 1),
        row("target_keyframe_error_m", "target joints", "mm", Lower, 1e3, 1),
        row("context_root_error_m", "context root", "mm", Lower, 1e3, 1),
        row("target_root_error_m", "target root", "mm", Lower, 1e3, 1),
        row("reached", "target reached", "%", Higher, 1e2, 1),
    ]
};

const NO_EVALUATOR: &str =
    "FID, MMD and latent diversity are not measured: no evaluator was given (--evaluator).";

const LEGEND: &str = "\
↓ lower is better, ↑ higher is better, ≈ nearer to ground truth is better. Each figure is the mean over all windows. The interval
holds 95 % of the means over resampled clips. FID, MMD: distance to the windows of ground truth in the evaluator's latent space.
Those of ground truth are between two halves of its windows, and larger with few windows. Diversity: mean distance between takes
of one window at temperature 1, and that ÷ their mean distance to ground truth: 1 if takes differ from each other as much as
from ground truth. Best take nearer: windows in which a take has a lower L2P than the answer at temperature 0. Best L2P ÷
likeliest: the lowest L2P of the takes ÷ that answer's. L2P, L2Q: length of the difference to ground truth over all joints (world
positions, world quaternions), mean over the gap; positions are not normalised. Context and target joints: the worst joint.
Target reached: within 5 cm and 15°.";

impl Report {
    pub(super) fn new(bench: &Bench<'_>, skipped: Vec<Skipped>, gaps: Vec<GapReport>) -> Self {
        let (of, command) = (bench.pack.description(), bench.command);
        Self {
            pack: of.name.clone(),
            pack_version: of.version.clone(),
            content_hash: of.content_hash.clone(),
            clips: bench.clips.len(),
            stride_frames: command.windows.stride,
            seed: command.sampling.seed,
            temperature: command.sampling.temperature,
            pose_steps: command.sampling.pose_steps,
            feet_held: !command.sampling.free_feet,
            bend_m: command.bend,
            diversity_seeds: command.seeds,
            evaluator: bench.evaluator.as_ref().map(|e| e.origin().clone()),
            claims: claims(&gaps),
            gaps,
            skipped,
        }
    }

    /// The report as text: for a terminal of this width, or of any width without one.
    pub(super) fn to_text(&self, width: Option<u16>) -> String {
        let mut text = String::new();
        for gap in &self.gaps {
            line(
                &mut text,
                format_args!(
                    "Gap of {} frames, {} windows of {} clips{}",
                    gap.gap_frames,
                    gap.windows,
                    self.clips,
                    match gap.diversity_windows {
                        0 => String::new(),
                        some => format!("; diversity of {some}, {} takes each", self.diversity_seeds),
                    }
                ),
            );
            line(&mut text, format_args!("{}\n", self.table(gap, width)));
        }
        line(&mut text, format_args!("{LEGEND}\n"));
        if self.bend_m != 0.0 {
            let bend_m = self.bend_m;
            line(
                &mut text,
                format_args!(
                    "The pack's motions pass {bend_m} m to the left of their own way in the middle of the gap.\n"
                ),
            );
        }
        match &self.evaluator {
            Some(evaluator) => {
                let (file, digest) = (evaluator.file.display(), &evaluator.sha256);
                let short = digest.get(..12).unwrap_or(digest);
                line(&mut text, format_args!("Evaluator: {file}, sha256 {short}\n"));
            }
            None => line(&mut text, format_args!("{NO_EVALUATOR}\n")),
        }
        for claim in &self.claims {
            line(&mut text, format_args!("{claim}"));
        }
        if !self.skipped.is_empty() {
            line(&mut text, format_args!("\nSkipped clips: {}", self.skipped.len()));
            for skipped in self.skipped.iter().take(SKIPPED_IN_TEXT) {
                line(&mut text, format_args!("  {}: {}", skipped.clip, skipped.reason));
            }
            if let Some(more) = self
                .skipped
                .len()
                .checked_sub(SKIPPED_IN_TEXT)
                .filter(|&more| more > 0)
            {
                line(&mut text, format_args!("  and {more} more"));
            }
        }
        text.trim_end().to_owned()
    }

    /// A row for each measure and a column for each method; on a narrow terminal intervals stand
    /// below their values.
    fn table(&self, gap: &GapReport, width: Option<u16>) -> Table {
        let pack = format!("{} {}", self.pack, self.pack_version);
        let methods = [
            ("ground truth", &gap.metrics.ground_truth),
            ("linear/slerp interpolation", &gap.metrics.interpolation),
            (&*pack, &gap.metrics.pack),
        ];
        let between = if width.is_some_and(|width| width < WIDE) {
            "\n"
        } else {
            " "
        };
        let mut table = Table::new();
        table.load_style(presets::UTF8_FULL_CONDENSED);
        table.set_header(std::iter::once(Cell::new("")).chain(methods.map(|(name, _)| Cell::new(name))));
        for row in &ROWS {
            let figures = methods.map(|(_, metrics)| row.cell(metrics.get(row.key), between));
            table.add_row(std::iter::once(Cell::new(row.heading())).chain(figures));
        }
        table
    }
}

impl Row {
    /// Name, unit, and which way is better.
    fn heading(&self) -> String {
        let arrow = match self.better {
            Better::Lower => "↓",
            Better::Higher => "↑",
            Better::LikeTruth => "≈",
            Better::Neither => "",
        };
        let words = [self.name, self.unit, arrow];
        words
            .into_iter()
            .filter(|word| !word.is_empty())
            .collect::<Vec<_>>()
            .join(" ")
    }

    /// A value and its interval, in the unit of the heading.
    fn cell(&self, estimate: Option<Estimate>, between: &str) -> Cell {
        let number = |value: f64| format!("{:.*}", self.decimals, value * self.factor);
        let text = estimate.map_or_else(
            || "–".to_owned(),
            |found| {
                let ends = found
                    .low
                    .zip(found.high)
                    .map(|(low, high)| (number(low), number(high)));
                let interval = ends.filter(|(low, high)| low != high);
                interval.map_or(number(found.mean), |(low, high)| {
                    format!("{}{between}({low} to {high})", number(found.mean))
                })
            },
        );
        Cell::new(text).set_alignment(CellAlignment::Right)
    }
}

#[cfg(test)]
mod tests {
    use troupe_motion::metrics::Figures;

    use super::super::figures::testing::gap;
    use super::*;

    fn report(gaps: Vec<GapReport>) -> Report {
        Report {
            pack: "human".to_owned(),
            pack_version: "1.2.0".to_owned(),
            content_hash: "sha256:00".to_owned(),
            clips: 5,
            stride_frames: 30,
            seed: 0,
            temperature: 0.0,
            feet_held: true,
            bend_m: 0.0,
            pose_steps: 1,
            diversity_seeds: 20,
            evaluator: None,
            claims: claims(&gaps),
            gaps,
            skipped: vec![Skipped {
                clip: "bow".to_owned(),
                reason: "line 3: no joints".to_owned(),
            }],
        }
    }

    #[test]
    fn the_text_is_as_documented() {
        insta::assert_snapshot!(report(vec![gap(15, 0.6), gap(45, 0.4)]).to_text(None));
    }

    #[test]
    fn it_fits_a_narrow_terminal() {
        let text = report(vec![gap(30, 0.4)]).to_text(Some(100));
        let table = text
            .lines()
            .filter(|line| line.contains(['│', '─']))
            .collect::<Vec<_>>();
        assert!(
            table.len() > ROWS.len() && table.iter().all(|line| line.chars().count() <= 100),
            "{text}"
        );
        let skate = table.iter().position(|line| line.contains("foot skate")).unwrap();
        let (values, intervals) = (table[skate], table[skate + 1]);
        assert!(
            values.contains("0.40") && values.contains("5.20") && values.contains("1.10"),
            "{values}"
        );
        assert!(intervals.contains("(4.68 to 6.24)"), "{intervals}");
    }

    #[test]
    fn the_json_has_every_measure_by_name() {
        let json = serde_json::to_value(report(vec![gap(15, 0.6)])).unwrap();
        let pack = &json["gaps"][0]["metrics"]["pack"];
        let fid = ["mean", "low", "high"].map(|end| pack["fid"][end].as_f64().unwrap());
        assert_eq!(fid, [0.1, 0.1 * 0.9, 0.1 * 1.2]);
        assert_eq!(pack["contact_accuracy"]["mean"], 0.913);
        assert_eq!(pack["mmd"], serde_json::Value::Null);
        // `troupe-train card` reads this name.
        assert_eq!(json["gaps"][0]["pack"]["reaching_success"], 0.0);
        let known = Figures::NAMES
            .iter()
            .all(|name| ROWS.iter().any(|row| row.key == *name));
        assert!(known, "a figure without a row");
    }
}
