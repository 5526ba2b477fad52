//! How far takes of one window are from each other and from the truth, and whether one of them is
//! nearer than the likeliest answer.

use futures_util::{StreamExt as _, TryStreamExt as _, stream};
use troupe_cli::{Context, Failure};
use troupe_motion::clip::Clip;
use troupe_motion::fk::WorldMotion;
use troupe_motion::metrics::{
    Estimate, MetricError, Resamples, Task, joint_distance_m, joint_diversity_m, l2p_m,
    mean_pairwise_distance,
};

use super::bench::Bench;
use super::figures::{ByMethod, Metrics};
use crate::resampling::SETS;
use crate::served::IN_FLIGHT;
use crate::served::windows::{Window, cut, pieces_of, window_seed};

/// Temperature at which diversity is measured.
const TEMPERATURE: f32 = 1.0;

/// How the takes of one window differ.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Spread {
    /// Piece of the window's clip, by which intervals are drawn.
    piece: usize,
    /// Mean distance of a joint between two takes, metres.
    diversity_m: f64,
    /// Mean distance of a joint from a take to the captured motion, metres.
    distance_m: f64,
    /// The lowest L2P of the takes, metres.
    best_m: f64,
    /// L2P of the likeliest answer, metres.
    likeliest_m: f64,
}

impl Spread {
    fn of(
        piece: usize,
        takes: &[WorldMotion],
        likeliest: &WorldMotion,
        truth: &WorldMotion,
        task: Task,
    ) -> Result<Self, MetricError> {
        let range = task.gap();
        let (mut distance_m, mut best_m) = (0.0, f64::INFINITY);
        for take in takes {
            distance_m += joint_distance_m(take, truth, range.clone())? / takes.len() as f64;
            best_m = best_m.min(l2p_m(take, truth, range.clone())?);
        }
        Ok(Self {
            piece,
            diversity_m: joint_diversity_m(takes, range.clone())?,
            distance_m,
            best_m,
            likeliest_m: l2p_m(likeliest, truth, range)?,
        })
    }
}

impl Bench<'_> {
    /// Fills some windows with several seeds each and adds how far the takes are from each other.
    /// Returns how many.
    pub(super) async fn add_diversity(
        &self,
        metrics: &mut ByMethod<Metrics>,
        context: &Context,
        task: Task,
    ) -> Result<usize, Failure> {
        let seeds = u64::from(self.command.seeds);
        if seeds < 2 {
            return Ok(0);
        }
        let windows = self.windows(task, Some(self.command.diversity_windows));
        let bar = context
            .term
            .bar(windows.len() * (seeds as usize + 1), "diversity");
        let (mut spreads, mut latents) = (Vec::new(), Vec::new());
        for (&window, piece) in windows.iter().zip(pieces_of(&windows)) {
            let truth = cut(&self.clips, window, task)?;
            // The likeliest answer comes first, then one for each seed.
            let answers = (0..=seeds).map(|nth| self.nth_take(&truth, window, task, nth));
            let answers = stream::iter(answers).buffered(IN_FLIGHT);
            let answers: Vec<Clip> = answers.inspect(|_| bar.inc(1)).try_collect().await?;
            let motions: Vec<WorldMotion> = answers.iter().map(WorldMotion::from_clip).collect();
            let truth = WorldMotion::from_clip(&truth);
            let spread = Spread::of(piece, &motions[1..], &motions[0], &truth, task);
            spreads.push(spread.map_err(|e| self.unmeasured(window, e))?);
            if let Some(evaluator) = &self.evaluator {
                let rows = evaluator.latents(&answers[1..].iter().collect::<Vec<_>>())?;
                latents.extend(mean_pairwise_distance(&rows).map(|mean| (piece, mean)));
            }
        }
        bar.finish_and_clear();
        add(metrics, &spreads, &latents, self.command.sampling.seed);
        Ok(windows.len())
    }

    /// Take number `nth` of a window, from 1 on; 0 is the likeliest answer.
    async fn nth_take(&self, truth: &Clip, window: Window, task: Task, nth: u64) -> Result<Clip, Failure> {
        let name = &self.clips[window.clip].name;
        let seed = window_seed(self.command.sampling.seed.wrapping_add(nth), name, window.start);
        let temperature = if nth == 0 { 0.0 } else { TEMPERATURE };
        let answer = self.take(truth, task, seed, temperature, None).await?;
        Ok(answer.clip)
    }
}

fn add(metrics: &mut ByMethod<Metrics>, spreads: &[Spread], latents: &[(usize, f64)], seed: u64) {
    let pieces = spreads.last().map_or(0, |spread| spread.piece + 1);
    let resamples = Resamples::new(pieces, SETS, seed);
    let each = |of: fn(&Spread) -> f64| -> Vec<(usize, f64)> {
        spreads.iter().map(|spread| (spread.piece, of(spread))).collect()
    };
    let joints = each(|spread| spread.diversity_m);
    for (name, values) in [("joint_diversity_m", &joints[..]), ("latent_diversity", latents)] {
        if let Some(mean) = resamples.mean(values) {
            metrics.pack.set(name, mean);
            // Interpolation has no seed.
            metrics.interpolation.set(name, Estimate::bare(0.0));
        }
    }
    let ratio = |of: fn(&Spread) -> [f64; 2]| {
        let pairs = spreads.iter().map(|spread| {
            let [above, below] = of(spread);
            (spread.piece, above, below)
        });
        resamples.ratio(&pairs.collect::<Vec<_>>())
    };
    let found = [
        ("diversity_ratio", ratio(|s| [s.diversity_m, s.distance_m])),
        (
            "best_of_seeds_nearer",
            resamples.mean(&each(|s| f64::from(s.best_m < s.likeliest_m))),
        ),
        ("best_of_seeds_l2p_ratio", ratio(|s| [s.best_m, s.likeliest_m])),
    ];
    for (name, estimate) in found {
        if let Some(estimate) = estimate {
            metrics.pack.set(name, estimate);
        }
    }
}

#[cfg(test)]
mod tests {
    use troupe_motion::{Joint, Quat, Skeleton, Vec3};

    use super::*;

    const TASK: Task = Task {
        context_frames: 4,
        gap_frames: 2,
        target_frames: 1,
    };

    /// Two joints at rest, moved to the left.
    fn standing(x: f32) -> WorldMotion {
        let joint = |name: &str, parent, y| Joint {
            name: name.into(),
            parent,
            offset_m: Vec3::new(0.0, y, 0.0),
        };
        let joints = vec![joint("Hips", None, 0.0), joint("Foot", Some(0), -0.8)];
        let skeleton = Skeleton::new(joints, Vec3::X, 0.0, None).unwrap();
        let frames = TASK.frames();
        let clip = Clip {
            skeleton: skeleton.into(),
            fps: 30.0,
            root_positions: vec![Vec3::new(x, 0.8, 0.0); frames],
            rotations: vec![Quat::IDENTITY; 2 * frames],
        };
        WorldMotion::from_clip(&clip)
    }

    fn spread(piece: usize, takes: [f32; 2], likeliest: f32) -> Spread {
        let takes = takes.map(standing);
        Spread::of(piece, &takes, &standing(likeliest), &standing(0.0), TASK).unwrap()
    }

    #[test]
    fn takes_around_the_truth_are_as_diverse_as_they_are_far_off() {
        let found = spread(3, [-0.1, 0.3], 0.2);
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-6, "{found:?}");
        near(found.diversity_m, 0.4);
        near(found.distance_m, 0.2);
        // Of two joints.
        let length = 2.0_f64.sqrt();
        near(found.best_m, 0.1 * length);
        near(found.likeliest_m, 0.2 * length);
        assert_eq!(found.piece, 3);
    }

    #[test]
    fn the_ratio_is_that_of_the_means() {
        // 0.4 + 0.2 m between takes, 0.2 + 0.5 m off.
        let spreads = [spread(0, [-0.1, 0.3], 0.2), spread(1, [0.4, 0.6], 0.1)];
        let mut metrics = ByMethod::<Metrics>::default();
        add(&mut metrics, &spreads, &[(0, 2.0), (1, 4.0)], 0);
        let pack = |name: &str| metrics.pack.get(name).unwrap();
        assert!((pack("diversity_ratio").mean - 0.6 / 0.7).abs() < 1e-6);
        assert!((pack("joint_diversity_m").mean - 0.3).abs() < 1e-6);
        assert_eq!(
            (pack("best_of_seeds_nearer").mean, pack("latent_diversity").mean),
            (0.5, 3.0)
        );
        // 0.1 + 0.4 m of the best takes, 0.2 + 0.1 m of the likeliest answers.
        assert!((pack("best_of_seeds_l2p_ratio").mean - 5.0 / 3.0).abs() < 1e-6);
        let level = [spread(0, [0.1, 0.3], 0.1), spread(1, [0.1, 0.3], 0.1)];
        let mut even = ByMethod::<Metrics>::default();
        add(&mut even, &level, &[], 0);
        assert_eq!(
            even.pack.get("best_of_seeds_nearer").unwrap().mean,
            0.0,
            "as near is not nearer"
        );
        assert!(pack("diversity_ratio").low < pack("diversity_ratio").high);
        assert_eq!(
            metrics.interpolation.get("diversity_ratio"),
            None,
            "interpolation has one answer"
        );
    }
}
