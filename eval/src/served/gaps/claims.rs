//! What the project claims of its pack, put against the figures.

use serde::Serialize;

use super::figures::GapReport;

/// Something said of the pack, and whether the figures bear it out.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Claim {
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

/// All claims.
pub(super) fn claims(gaps: &[GapReport]) -> Vec<Claim> {
    let claim = |claim, least_gap: usize, name: &str| {
        let gaps = gaps.iter().filter(|gap| gap.gap_frames >= least_gap);
        let gaps = gaps.filter_map(|gap| {
            Some(Comparison {
                gap_frames: gap.gap_frames,
                pack: gap.metrics.pack.get(name)?.mean,
                interpolation: gap.metrics.interpolation.get(name)?.mean,
            })
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
            "foot_skate_m_per_frame",
        ),
        claim("the pack beats interpolation on NPSS at every gap", 0, "npss"),
        claim(
            "the pack beats interpolation on L2P at gaps of 30 frames and more",
            30,
            "l2p_m",
        ),
        claim("the pack beats interpolation on FID at every gap", 0, "fid"),
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

#[cfg(test)]
mod tests {
    use super::super::figures::testing::gap;
    use super::*;

    #[test]
    fn claims_come_from_the_figures() {
        // L2P is worse at 15, where nothing is claimed of it, and at 45, where something is.
        let holds = |gaps: &[GapReport]| claims(gaps).into_iter().map(|c| c.holds).collect::<Vec<_>>();
        assert_eq!(
            holds(&[gap(15, 0.9), gap(30, 0.4)]),
            [Some(true), Some(true), Some(true), Some(true)]
        );
        assert_eq!(
            holds(&[gap(30, 0.4), gap(45, 0.9)]),
            [Some(true), Some(true), Some(false), Some(true)]
        );
        assert_eq!(holds(&[gap(15, 0.4)])[2], None);
        assert_eq!(holds(&[])[3], None);
    }

    #[test]
    fn a_tie_or_nan_is_no_win() {
        for figure in [0.5, f64::NAN] {
            assert_eq!(claims(&[gap(30, figure)])[2].holds, Some(false));
        }
    }
}
