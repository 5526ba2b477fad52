//! Confidence intervals by resampling clips, or pieces of long clips.

use std::num::NonZero;
use std::thread;

use serde::{Deserialize, Serialize};

use super::{Figures, Summary, percentile};

/// Share of resamples below an interval, and above it.
const TAIL: f64 = 0.025;

/// A measured value with its 95 % confidence interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The measured value.
    pub mean: f64,
    /// Lower end of the interval. None if too few clips were measured.
    pub low: Option<f64>,
    /// Upper end of the interval.
    pub high: Option<f64>,
}

impl Estimate {
    /// A value without an interval.
    pub fn bare(mean: f64) -> Self {
        Self {
            mean,
            low: None,
            high: None,
        }
    }
}

/// The bootstrap: sets of clips drawn with replacement from those measured, each with as many
/// clips.
///
/// Clips are drawn, and not windows, because windows of one clip are alike: treated as independent
/// they would make intervals too narrow. If clips are few and long, pieces of them may take their
/// place. The nth set depends only on the seed and n. So all measures use the same sets, and the
/// same seed gives the same intervals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resamples {
    clips: usize,
    count: usize,
    seed: u64,
}

impl Resamples {
    /// `count` sets of `clips` clips.
    pub fn new(clips: usize, count: usize, seed: u64) -> Self {
        Self { clips, count, seed }
    }

    /// How many times each clip is in the nth set.
    pub fn times(&self, nth: usize) -> Vec<u32> {
        let mut times = vec![0; self.clips];
        let mut random = SplitMix(
            self.seed
                .wrapping_add((nth as u64).wrapping_mul(0xd134_2543_de82_ef95)),
        );
        for _ in 0..self.clips {
            // The bias of the remainder is below the number of clips in 2^64.
            times[(random.next() % self.clips as u64) as usize] += 1;
        }
        times
    }

    /// 95 % percentile intervals of measures. `of` gets the times that each clip counts, and
    /// returns the measures of that set, or none if they cannot be computed.
    ///
    /// None for fewer than two clips, or if no set could be measured.
    pub fn intervals<const N: usize>(
        &self,
        of: impl Fn(&[u32]) -> Option<[f64; N]> + Sync,
    ) -> Option<[(f64, f64); N]> {
        let sets = self.measure(of);
        (!sets.is_empty()).then(|| {
            std::array::from_fn(|nth| {
                let values = |share| percentile(sets.iter().map(|set| set[nth]).collect(), share);
                (
                    values(TAIL).unwrap_or(f64::NAN),
                    values(1.0 - TAIL).unwrap_or(f64::NAN),
                )
            })
        })
    }

    /// As [`Self::intervals`], with each interval moved so that the mean of the sets' values equals
    /// the measured value, but not below 0.
    ///
    /// This is for distances between distributions, which exceed 0 by chance alone. A set with some
    /// clips twice and others missing measures more than all clips do, so a plain interval may lie
    /// above the value.
    pub fn centred<const N: usize>(
        &self,
        measured: [f64; N],
        of: impl Fn(&[u32]) -> Option<[f64; N]> + Sync,
    ) -> [Estimate; N] {
        let sets = self.measure(of);
        std::array::from_fn(|nth| {
            let values: Vec<f64> = sets.iter().map(|set| set[nth]).collect();
            let off = measured[nth] - values.iter().sum::<f64>() / values.len().max(1) as f64;
            let at = |share| percentile(values.clone(), share).map(|value| (value + off).max(0.0));
            Estimate {
                mean: measured[nth],
                low: at(TAIL),
                high: at(1.0 - TAIL),
            }
        })
    }

    /// The figures of tasks gathered clip by clip, each with its interval, in the order of
    /// [`Figures::NAMES`]. None without tasks.
    pub fn figures(&self, clips: &[Summary]) -> Option<[Estimate; Figures::NAMES.len()]> {
        let gathered = |times: &[u32]| {
            let mut all = Summary::default();
            clips
                .iter()
                .zip(times)
                .for_each(|(clip, &times)| all.merge(clip, times));
            all.figures().map(|figures| figures.values())
        };
        let means = gathered(&vec![1; clips.len()])?;
        let intervals = self.intervals(gathered);
        Some(std::array::from_fn(|nth| Estimate {
            mean: means[nth],
            low: intervals.map(|all| all[nth].0),
            high: intervals.map(|all| all[nth].1),
        }))
    }

    /// The mean of values measured on clips, `(clip, value)`, with its interval. None without
    /// values.
    pub fn mean(&self, values: &[(usize, f64)]) -> Option<Estimate> {
        let counted: Vec<_> = values.iter().map(|&(clip, value)| (clip, value, 1.0)).collect();
        self.ratio(&counted)
    }

    /// The ratio of the sums of two values measured on clips, `(clip, above, below)`, with its
    /// interval. None if those below sum to 0.
    pub fn ratio(&self, values: &[(usize, f64, f64)]) -> Option<Estimate> {
        let mut sums = vec![(0.0, 0.0); self.clips];
        for &(clip, above, below) in values {
            sums[clip].0 += above;
            sums[clip].1 += below;
        }
        let ratio = |times: &[u32]| {
            let (above, below) = sums.iter().zip(times).fold((0.0, 0.0), |all, (clip, &times)| {
                let times = f64::from(times);
                (all.0 + clip.0 * times, all.1 + clip.1 * times)
            });
            (below > 0.0).then(|| [above / below])
        };
        let [all] = ratio(&vec![1; self.clips])?;
        let interval = self.intervals(ratio);
        Some(Estimate {
            mean: all,
            low: interval.map(|[(low, _)]| low),
            high: interval.map(|[(_, high)]| high),
        })
    }

    /// The measures of every set, in order, computed on all cores.
    fn measure<const N: usize>(&self, of: impl Fn(&[u32]) -> Option<[f64; N]> + Sync) -> Vec<[f64; N]> {
        if self.clips < 2 || self.count == 0 {
            return Vec::new();
        }
        let mut sets = vec![None; self.count];
        let cores = thread::available_parallelism().map_or(1, NonZero::get);
        let share = self.count.div_ceil(cores);
        thread::scope(|scope| {
            for (part, sets) in sets.chunks_mut(share).enumerate() {
                let of = &of;
                scope.spawn(move || {
                    for (nth, set) in sets.iter_mut().enumerate() {
                        *set = of(&self.times(part * share + nth));
                    }
                });
            }
        });
        sets.into_iter().flatten().collect()
    }
}

/// SplitMix64 (Steele et al. 2014).
struct SplitMix(u64);

impl SplitMix {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::{Task, evaluate};
    use crate::testing::walk;

    #[test]
    fn every_set_has_as_many_clips_as_there_are() {
        let resamples = Resamples::new(7, 50, 3);
        let sets: Vec<_> = (0..50).map(|nth| resamples.times(nth)).collect();
        assert!(sets.iter().all(|set| set.iter().sum::<u32>() == 7));
        assert!(sets.iter().any(|set| set.contains(&0)) && sets.iter().any(|set| set.iter().any(|&n| n > 1)));
        // Each clip is in 50 sets 50 times on average; a fair draw of 350 stays within 25 of it.
        for clip in 0..7 {
            let drawn: u32 = sets.iter().map(|set| set[clip]).sum();
            assert!((25..=75).contains(&drawn), "clip {clip}: {drawn}");
        }
        assert_eq!(sets[4], resamples.times(4));
        assert_ne!(sets[4], Resamples::new(7, 50, 4).times(4));
    }

    #[test]
    fn the_interval_of_a_mean_agrees_with_theory() {
        // 100 clips with the values 0 to 99: the mean is 49.5 and its standard error 28.87 / 10.
        let mean = |times: &[u32]| {
            let sum: f64 = times
                .iter()
                .enumerate()
                .map(|(clip, &n)| clip as f64 * f64::from(n))
                .sum();
            Some([sum / 100.0])
        };
        let [(low, high)] = Resamples::new(100, 1000, 0).intervals(mean).unwrap();
        assert!((low - (49.5 - 1.96 * 2.887)).abs() < 0.6, "{low}");
        assert!((high - (49.5 + 1.96 * 2.887)).abs() < 0.6, "{high}");
        assert_eq!(
            Resamples::new(100, 1000, 0).intervals(mean),
            Some([(low, high)]),
            "the same seed gives the same"
        );
        assert_eq!(Resamples::new(1, 1000, 0).intervals(mean), None);
        assert_eq!(Resamples::new(100, 1000, 0).intervals(|_| None::<[f64; 1]>), None);
    }

    #[test]
    fn centred_intervals_hold_the_value() {
        // Every set measures 2 more than all clips do, and half of them another 0.5.
        let lifted = |times: &[u32]| Some([3.0 + f64::from(times[0].min(1)) * 0.5]);
        let [found] = Resamples::new(9, 400, 0).centred([1.0], lifted);
        let (low, high) = (found.low.unwrap(), found.high.unwrap());
        assert!(
            low < 1.0 && 1.0 < high && (high - low - 0.5).abs() < 1e-12,
            "{found:?}"
        );
        let [floored] = Resamples::new(9, 400, 0).centred([0.01], lifted);
        assert_eq!(floored.low, Some(0.0));
        let [alone] = Resamples::new(1, 400, 0).centred([1.0], lifted);
        assert_eq!(alone, Estimate::bare(1.0));
    }

    #[test]
    fn a_ratio_is_that_of_the_sums() {
        let values = [(0, 8.0, 2.0), (1, 1.0, 1.0), (1, 3.0, 1.0)];
        let found = Resamples::new(3, 300, 0).ratio(&values).unwrap();
        assert_eq!((found.mean, found.low, found.high), (3.0, Some(2.0), Some(4.0)));
        assert_eq!(Resamples::new(3, 300, 0).ratio(&[(0, 1.0, 0.0)]), None);
    }

    #[test]
    fn a_mean_counts_every_value_once() {
        // Clip 0 has one value, clip 1 three, clip 2 none.
        let values = [(0, 8.0), (1, 1.0), (1, 2.0), (1, 3.0)];
        let found = Resamples::new(3, 300, 0).mean(&values).unwrap();
        assert_eq!((found.mean, found.low, found.high), (3.5, Some(2.0), Some(8.0)));
        assert_eq!(
            Resamples::new(1, 300, 0).mean(&[(0, 4.0)]),
            Some(Estimate::bare(4.0))
        );
        assert_eq!(Resamples::new(3, 300, 0).mean(&[]), None);
    }

    #[test]
    fn figures_are_those_of_all_tasks_together() {
        let task = Task {
            context_frames: 4,
            gap_frames: 15,
            target_frames: 1,
        };
        let truth = walk(20);
        // Clip 0 has one task, 1 cm off; clip 1 has two, 2 and 4 cm off.
        let mut clips = [Summary::default(); 2];
        let mut all = Summary::default();
        for (clip, off) in [(0, 0.01), (1, 0.02), (1, 0.04)] {
            let mut moved = truth.clone();
            moved.root_positions[19].z += off;
            let measured = evaluate(&moved, &truth, task).unwrap();
            clips[clip].add(&measured);
            all.add(&measured);
        }
        let figures = Resamples::new(2, 200, 1).figures(&clips).unwrap();
        let of = |name| figures[Figures::NAMES.iter().position(|other| *other == name).unwrap()];
        let error = of("target_root_error_m");
        assert!((error.mean - 0.07 / 3.0).abs() < 1e-6, "{error:?}");
        // The sets are clip 0, clip 1, and both.
        assert!((error.low.unwrap() - 0.01).abs() < 1e-6 && (error.high.unwrap() - 0.03).abs() < 1e-6);
        let (means, values) = (all.figures().unwrap().values(), figures.map(|f| f.mean));
        assert!(means.iter().zip(values).all(|(a, b)| (a - b).abs() < 1e-12));
        assert_eq!(of("reached").mean, 1.0);
        assert_eq!(Resamples::new(0, 200, 1).figures(&[]), None);
    }
}
