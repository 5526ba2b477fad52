//! What an evaluation found: tables, claims, JSON.

use std::fmt::Write as _;

use comfy_table::{Cell, CellAlignment, Table, presets};
use serde::Serialize;
use troupe_motion::metrics::Figures;

use super::windows::Skipped;
use crate::cli::args::GapEval;
use crate::pack::Pack;

/// Skipped clips named in the text; the JSON has all.
const SKIPPED_IN_TEXT: usize = 20;

/// Width of the table that has a column for each figure.
const WIDE: u16 = 160;

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
    gaps: Vec<GapReport>,
    claims: Vec<Claim>,
    skipped: Vec<Skipped>,
}

/// The figures of one gap.
#[derive(Debug, Serialize)]
pub(super) struct GapReport {
    pub(super) gap_frames: usize,
    pub(super) windows: usize,
    pub(super) ground_truth: Figures,
    pub(super) interpolation: Figures,
    pub(super) pack: Figures,
}

/// Something said of the pack, and whether the figures bear it out.
#[derive(Debug, PartialEq, Serialize)]
struct Claim {
    claim: &'static str,
    /// None where no gap was measured that it speaks of.
    holds: Option<bool>,
    /// The pack's figure and that of interpolation, for each gap.
    gaps: Vec<Comparison>,
}

#[derive(Debug, PartialEq, Serialize)]
struct Comparison {
    gap_frames: usize,
    pack: f64,
    interpolation: f64,
}

/// Which way is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Better {
    Lower,
    Higher,
    LikeTruth,
}

/// A column of the table: two lines of heading, how to read it, and the figure in the unit of the heading.
struct Column {
    name: &'static str,
    unit: &'static str,
    better: Better,
    decimals: usize,
    value: fn(&Figures) -> f64,
}

const COLUMNS: [Column; 13] = {
    use Better::{Higher, LikeTruth, Lower};
    const fn column(
        name: &'static str,
        unit: &'static str,
        better: Better,
        decimals: usize,
        value: fn(&Figures) -> f64,
    ) -> Column {
        Column {
            name,
            unit,
            better,
            decimals,
            value,
        }
    }
    [
        column("L2P", "m", Lower, 3, |f| f.l2p_m),
        column("L2Q", "", Lower, 3, |f| f.l2q),
        column("NPSS", "", Lower, 4, |f| f.npss),
        column("foot skate", "mm/frame", Lower, 2, |f| {
            f.foot_skate_m_per_frame * 1e3
        }),
        column("penetration", "mm", Lower, 2, |f| f.penetration_m * 1e3),
        column("contacts right", "%", Higher, 1, |f| f.contact_accuracy * 1e2),
        column("joint jitter", "m/s²", LikeTruth, 2, |f| f.joint_jitter_mps2),
        column("root jitter", "m/s²", LikeTruth, 2, |f| f.root_jitter_mps2),
        column("context joints", "mm", Lower, 1, |f| {
            f.context_keyframe_error_m * 1e3
        }),
        column("target joints", "mm", Lower, 1, |f| {
            f.target_keyframe_error_m * 1e3
        }),
        column("context root", "mm", Lower, 1, |f| f.context_root_error_m * 1e3),
        column("target root", "mm", Lower, 1, |f| f.target_root_error_m * 1e3),
        column("target reached", "%", Higher, 1, |f| f.reaching_success * 1e2),
    ]
};

const LEGEND: &str = "\
↓ lower is better, ↑ higher is better, ≈ nearer to ground truth is better. Means over all windows.
L2P, L2Q: length of the difference to ground truth over all joints (world positions, world quaternions), mean over
the gap; positions are not normalised. Context and target joints: the worst joint. Target reached: 5 cm and 15°.";

impl Report {
    pub(super) fn new(
        pack: &Pack,
        command: &GapEval,
        clips: usize,
        skipped: Vec<Skipped>,
        gaps: Vec<GapReport>,
    ) -> Self {
        let of = pack.description();
        Self {
            pack: of.name.clone(),
            pack_version: of.version.clone(),
            content_hash: of.content_hash.clone(),
            clips,
            stride_frames: command.stride,
            seed: command.sampling.seed,
            temperature: command.sampling.temperature,
            pose_steps: command.sampling.pose_steps,
            claims: claims(&gaps),
            gaps,
            skipped,
        }
    }

    /// The report for people, on a terminal of a width or, without one, as wide as it gets.
    pub(super) fn to_text(&self, width: Option<u16>) -> String {
        let mut text = String::new();
        for gap in &self.gaps {
            let windows = gap.windows;
            line(
                &mut text,
                format_args!(
                    "Gap of {} frames, {windows} windows of {} clips",
                    gap.gap_frames, self.clips
                ),
            );
            line(&mut text, format_args!("{}\n", self.table(gap, width)));
        }
        line(&mut text, format_args!("{LEGEND}\n"));
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

    /// A row for each of ground truth, interpolation and pack, or a column on a terminal too narrow for that.
    fn table(&self, gap: &GapReport, width: Option<u16>) -> Table {
        let pack = format!("{} {}", self.pack, self.pack_version);
        let rows = [
            ("ground truth", &gap.ground_truth),
            ("linear/slerp interpolation", &gap.interpolation),
            (&*pack, &gap.pack),
        ];
        let mut table = Table::new();
        table.load_style(presets::UTF8_FULL_CONDENSED);
        if width.is_some_and(|width| width < WIDE) {
            table.set_header(std::iter::once(Cell::new("")).chain(rows.map(|(name, _)| Cell::new(name))));
            for column in &COLUMNS {
                let figures = rows.map(|(_, figures)| column.cell(figures));
                let name = Cell::new(format!("{} {}", column.name, column.unit()));
                table.add_row(std::iter::once(name).chain(figures));
            }
            return table;
        }
        let heading = COLUMNS.iter().map(|column| {
            let name = column.name.replace(' ', "\n");
            Cell::new(format!("{name}\n{}", column.unit())).set_alignment(CellAlignment::Right)
        });
        table.set_header(std::iter::once(Cell::new("")).chain(heading));
        for (name, figures) in rows {
            let figures = COLUMNS.iter().map(|column| column.cell(figures));
            table.add_row(std::iter::once(Cell::new(name)).chain(figures));
        }
        table
    }
}

impl Column {
    /// The unit, and which way is better.
    fn unit(&self) -> String {
        let arrow = match self.better {
            Better::Lower => "↓",
            Better::Higher => "↑",
            Better::LikeTruth => "≈",
        };
        if self.unit.is_empty() {
            arrow.to_owned()
        } else {
            format!("{} {arrow}", self.unit)
        }
    }

    fn cell(&self, figures: &Figures) -> Cell {
        let text = format!("{:.*}", self.decimals, (self.value)(figures));
        Cell::new(text).set_alignment(CellAlignment::Right)
    }
}

/// What the project claims of its pack, put against the figures.
fn claims(gaps: &[GapReport]) -> Vec<Claim> {
    let claim = |claim, least_gap: usize, value: fn(&Figures) -> f64| {
        let gaps = gaps.iter().filter(|gap| gap.gap_frames >= least_gap);
        let gaps = gaps.map(|gap| Comparison {
            gap_frames: gap.gap_frames,
            pack: value(&gap.pack),
            interpolation: value(&gap.interpolation),
        });
        let gaps = gaps.collect::<Vec<_>>();
        let holds = gaps.iter().all(|c| c.pack < c.interpolation);
        Claim {
            claim,
            holds: (!gaps.is_empty()).then_some(holds),
            gaps,
        }
    };
    vec![
        claim(
            "the pack beats interpolation on foot skate at every gap",
            0,
            |f| f.foot_skate_m_per_frame,
        ),
        claim("the pack beats interpolation on NPSS at every gap", 0, |f| f.npss),
        claim(
            "the pack beats interpolation on L2P at gaps of 30 frames and more",
            30,
            |f| f.l2p_m,
        ),
    ]
}

impl std::fmt::Display for Claim {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let verdict = match self.holds {
            Some(true) => "holds:        ",
            Some(false) => "does not hold:",
            None => "not measured: ",
        };
        write!(f, "{verdict} {}", self.claim)?;
        for (nth, gap) in self.gaps.iter().enumerate() {
            let sign = if gap.pack < gap.interpolation { "<" } else { "≥" };
            let lead = if nth == 0 { " (" } else { ", " };
            write!(
                f,
                "{lead}{}: {:.4} {sign} {:.4}",
                gap.gap_frames, gap.pack, gap.interpolation
            )?;
        }
        if self.gaps.is_empty() {
            Ok(())
        } else {
            write!(f, ")")
        }
    }
}

/// Adds a line. Writing to a string cannot fail.
fn line(text: &mut String, what: std::fmt::Arguments<'_>) {
    let _ = writeln!(text, "{what}");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gap(gap_frames: usize, pack_l2p_m: f64) -> GapReport {
        let figures = |l2p_m, npss, skate| Figures {
            l2p_m,
            npss,
            foot_skate_m_per_frame: skate,
            contact_accuracy: 0.913,
            ..Figures::default()
        };
        GapReport {
            gap_frames,
            windows: 12,
            ground_truth: figures(0.0, 0.0, 0.0004),
            interpolation: figures(0.5, 0.06, 0.0052),
            pack: figures(pack_l2p_m, 0.03, 0.0011),
        }
    }

    fn report(gaps: Vec<GapReport>) -> Report {
        Report {
            pack: "human".to_owned(),
            pack_version: "1.2.0".to_owned(),
            content_hash: "sha256:00".to_owned(),
            clips: 5,
            stride_frames: 30,
            seed: 0,
            temperature: 0.0,
            pose_steps: 1,
            claims: claims(&gaps),
            gaps,
            skipped: vec![Skipped {
                clip: "bow".to_owned(),
                reason: "line 3: no joints".to_owned(),
            }],
        }
    }

    #[test]
    fn claims_come_from_the_figures() {
        // L2P is worse at 15, where nothing is claimed of it, and at 45, where something is.
        let holds = |gaps: &[GapReport]| claims(gaps).into_iter().map(|c| c.holds).collect::<Vec<_>>();
        assert_eq!(
            holds(&[gap(15, 0.9), gap(30, 0.4)]),
            [Some(true), Some(true), Some(true)]
        );
        assert_eq!(
            holds(&[gap(30, 0.4), gap(45, 0.9)]),
            [Some(true), Some(true), Some(false)]
        );
        assert_eq!(holds(&[gap(15, 0.4)]), [Some(true), Some(true), None]);
    }

    #[test]
    fn a_tie_or_nan_is_no_win() {
        for figure in [0.5, f64::NAN] {
            assert_eq!(claims(&[gap(30, figure)])[2].holds, Some(false));
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
            table.len() > COLUMNS.len() && table.iter().all(|line| line.chars().count() <= 100),
            "{text}"
        );
        let skate = table.iter().find(|line| line.contains("foot skate")).unwrap();
        assert!(
            skate.contains("0.40") && skate.contains("5.20") && skate.contains("1.10"),
            "{skate}"
        );
    }
}
