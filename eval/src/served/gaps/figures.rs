//! The figures of gaps, by method and by measure.

use serde::{Serialize, Serializer};
use troupe_motion::metrics::{Estimate, Figures};

/// The same for ground truth, interpolation and the pack.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(super) struct ByMethod<T> {
    pub(super) ground_truth: T,
    pub(super) interpolation: T,
    pub(super) pack: T,
}

impl<T> ByMethod<T> {
    pub(super) fn map<U>(&self, of: impl Fn(&T) -> U) -> ByMethod<U> {
        ByMethod {
            ground_truth: of(&self.ground_truth),
            interpolation: of(&self.interpolation),
            pack: of(&self.pack),
        }
    }

    pub(super) fn each_mut(&mut self) -> [&mut T; 3] {
        [&mut self.ground_truth, &mut self.interpolation, &mut self.pack]
    }
}

/// The figures of one gap.
#[derive(Debug, Serialize)]
pub(super) struct GapReport {
    pub(super) gap_frames: usize,
    pub(super) windows: usize,
    /// Means alone; `metrics` has them with their intervals, and more.
    pub(super) ground_truth: Figures,
    pub(super) interpolation: Figures,
    pub(super) pack: Figures,
    /// Clips, and pieces of long ones, that intervals were drawn over.
    pub(super) pieces: usize,
    pub(super) diversity_windows: usize,
    pub(super) metrics: ByMethod<Metrics>,
}

/// Measures by name, each with its interval.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Metrics(Vec<(&'static str, Estimate)>);

impl Metrics {
    /// The figures of tasks, in the order of [`Figures::NAMES`].
    pub(super) fn of_figures(figures: Option<[Estimate; Figures::NAMES.len()]>) -> Self {
        Self(
            Figures::NAMES
                .into_iter()
                .zip(figures.into_iter().flatten())
                .collect(),
        )
    }

    pub(super) fn set(&mut self, name: &'static str, estimate: Estimate) {
        self.0.retain(|(other, _)| *other != name);
        self.0.push((name, estimate));
    }

    pub(super) fn get(&self, name: &str) -> Option<Estimate> {
        self.0
            .iter()
            .find(|(other, _)| *other == name)
            .map(|(_, estimate)| *estimate)
    }
}

impl Serialize for Metrics {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().copied())
    }
}

#[cfg(test)]
pub(super) mod testing {
    use super::*;

    /// A gap with made-up figures.
    pub(in crate::served::gaps) fn gap(gap_frames: usize, pack_l2p_m: f64) -> GapReport {
        let figures = |l2p_m, npss, skate| Figures {
            l2p_m,
            npss,
            foot_skate_m_per_frame: skate,
            contact_accuracy: 0.913,
            ..Figures::default()
        };
        let [ground_truth, interpolation, pack] = [
            figures(0.0, 0.0, 0.0004),
            figures(0.5, 0.06, 0.0052),
            figures(pack_l2p_m, 0.03, 0.0011),
        ];
        let around = |mean: f64| Estimate {
            mean,
            low: Some(mean * 0.9),
            high: Some(mean * 1.2),
        };
        let metrics = |figures: Figures, fid: f64| {
            let mut metrics = Metrics::of_figures(Some(figures.values().map(around)));
            metrics.set("fid", around(fid));
            metrics
        };
        GapReport {
            gap_frames,
            windows: 12,
            metrics: ByMethod {
                ground_truth: metrics(ground_truth, 0.02),
                interpolation: metrics(interpolation, 0.4),
                pack: metrics(pack, 0.1),
            },
            ground_truth,
            interpolation,
            pack,
            pieces: 5,
            diversity_windows: 4,
        }
    }
}
