//! Has a pack fill gaps in clips, and measures its answers, ground truth and interpolation.

use futures_util::{StreamExt as _, TryStreamExt as _, stream};
use glam::Vec2;
use indicatif::ProgressBar;
use troupe_cli::{Context, Failure};
use troupe_client::{CONTEXT_FRAMES, Client, InBetween, InBetweenAnswer, Pack, RootKey};
use troupe_motion::clip::Clip;
use troupe_motion::fk::WorldMotion;
use troupe_motion::interpolate::fill_gap;
use troupe_motion::metrics::{
    Evaluation, Gaussian, Latents, MetricError, Mmd, Resamples, Summary, Task, contact_prediction_accuracy,
    evaluate,
};

use super::args::GapEval;
use super::figures::{ByMethod, GapReport, Metrics};
use crate::clips::NamedClip;
use crate::evaluator::Evaluator;
use crate::resampling::{DISTRIBUTION_SETS, SETS};
use crate::served::IN_FLIGHT;
use crate::served::patience::patiently;
use crate::served::windows::{Window, cut, pieces_of, task, window_seed, windows};

/// Windows that the evaluator takes at a time.
const LATENT_BATCH: usize = 32;

/// A pack that fills gaps of clips.
pub(super) struct Bench<'a> {
    pub(super) client: Client,
    pub(super) pack: Pack,
    pub(super) clips: Vec<NamedClip>,
    pub(super) command: &'a GapEval,
    pub(super) evaluator: Option<Evaluator>,
}

/// A window's motion and its measures.
struct Filled {
    clips: ByMethod<Clip>,
    measured: ByMethod<Evaluation>,
    /// Share of the contacts of the networks that agree with ground truth, 0 to 1.
    predicted_contacts: f64,
}

impl Bench<'_> {
    /// Has all windows of one gap filled, several at a time, and measures them.
    pub(super) async fn measure(&self, context: &Context, gap: usize) -> Result<GapReport, Failure> {
        let task = task(gap);
        let windows = self.windows(task, None);
        if windows.is_empty() {
            return Err(Failure::Input(format!(
                "--gaps: no clip is long enough for a gap of {gap}, which takes {} frames",
                task.frames()
            )));
        }
        let bar = context.term.bar(windows.len(), "filling gaps");
        bar.set_message(format!("gap of {gap} frames"));
        // Answers are taken in the order of the windows, so that sums round alike in every run.
        let answers = stream::iter(windows.iter().map(|&window| self.fill(window, task, &bar)));
        let filled: Vec<Filled> = answers.buffered(IN_FLIGHT).try_collect().await?;
        bar.finish_and_clear();

        let of_piece = pieces_of(&windows);
        let pieces = of_piece.last().map_or(0, |last| last + 1);
        let mut summaries = ByMethod::<Vec<Summary>>::default();
        let mut all = ByMethod::<Summary>::default();
        for method in summaries.each_mut() {
            method.resize(pieces, Summary::default());
        }
        for (filled, &piece) in filled.iter().zip(&of_piece) {
            let measured = [
                &filled.measured.ground_truth,
                &filled.measured.interpolation,
                &filled.measured.pack,
            ];
            for ((measured, by_piece), all) in
                measured.into_iter().zip(summaries.each_mut()).zip(all.each_mut())
            {
                by_piece[piece].add(measured);
                all.add(measured);
            }
        }
        let resamples = Resamples::new(pieces, SETS, self.command.sampling.seed);
        let mut metrics = summaries.map(|pieces| Metrics::of_figures(resamples.figures(pieces)));
        let predicted = of_piece
            .iter()
            .zip(&filled)
            .map(|(&piece, filled)| (piece, filled.predicted_contacts));
        if let Some(mean) = resamples.mean(&predicted.collect::<Vec<_>>()) {
            metrics.pack.set("contact_prediction_accuracy", mean);
        }
        if let Some(evaluator) = &self.evaluator {
            let latents = self.latents(context, evaluator, &filled, &of_piece)?;
            let sets = Resamples::new(pieces, DISTRIBUTION_SETS, self.command.sampling.seed);
            add_distances(&mut metrics, &latents, pieces, sets);
        }
        let diversity_windows = self.add_diversity(&mut metrics, context, task).await?;
        let figures = all.map(|summary| summary.figures().unwrap_or_default());
        Ok(GapReport {
            gap_frames: gap,
            windows: windows.len(),
            ground_truth: figures.ground_truth,
            interpolation: figures.interpolation,
            pack: figures.pack,
            pieces,
            diversity_windows,
            metrics,
        })
    }

    /// Windows of a task as the options have them, at most `most`.
    pub(super) fn windows(&self, task: Task, most: Option<usize>) -> Vec<Window> {
        let of = &self.command.windows;
        let most = most.into_iter().chain(of.max_windows).min();
        windows(&self.clips, task, of.stride, most)
    }

    async fn fill(&self, window: Window, task: Task, bar: &ProgressBar) -> Result<Filled, Failure> {
        let name = &self.clips[window.clip].name;
        let truth = cut(&self.clips, window, task)?;
        let sampling = &self.command.sampling;
        let seed = window_seed(sampling.seed, name, window.start);
        let mut answer = self.take(&truth, task, seed, sampling.temperature, None).await?;
        if self.command.bend != 0.0 {
            let beside = beside(&answer.clip, task, self.command.bend);
            let bent = self.take(&truth, task, seed, sampling.temperature, Some(beside));
            answer = bent.await?;
        }
        let (from, to) = (CONTEXT_FRAMES - 1, task.frames() - 1);
        let interpolation = fill_gap(&truth, from, to).map_err(|e| Failure::Other(e.to_string()))?;
        bar.inc(1);
        let clips = ByMethod {
            ground_truth: truth,
            interpolation,
            pack: answer.clip,
        };
        let measure =
            |clip: &Clip| evaluate(clip, &clips.ground_truth, task).map_err(|e| self.unmeasured(window, e));
        let motion = WorldMotion::from_clip(&clips.ground_truth);
        let skeleton = &clips.ground_truth.skeleton;
        let predicted =
            contact_prediction_accuracy(skeleton, &answer.contacts, &motion, task.gap(), self.pack.fps());
        Ok(Filled {
            predicted_contacts: predicted.map_err(|e| self.unmeasured(window, e))?,
            measured: ByMethod {
                ground_truth: measure(&clips.ground_truth)?,
                interpolation: measure(&clips.interpolation)?,
                pack: measure(&clips.pack)?,
            },
            clips,
        })
    }

    /// The pack's answer to a window.
    pub(super) async fn take(
        &self,
        truth: &Clip,
        task: Task,
        seed: u64,
        temperature: f32,
        root: Option<RootKey>,
    ) -> Result<InBetweenAnswer, Failure> {
        let gap = InBetween::from_clip(truth, CONTEXT_FRAMES - 1, task.frames() - 1)?
            .seed(seed)
            .temperature(temperature)
            .pose_steps(self.command.sampling.pose_steps)
            .root(root)
            .hold_feet(!self.command.sampling.free_feet);
        Ok(patiently(|| self.client.in_between(&self.pack, &gap)).await?)
    }

    pub(super) fn unmeasured(&self, window: Window, why: MetricError) -> Failure {
        let name = &self.clips[window.clip].name;
        Failure::Other(format!(
            "{name} from frame {} cannot be measured: {why}",
            window.start
        ))
    }

    fn latents(
        &self,
        context: &Context,
        evaluator: &Evaluator,
        filled: &[Filled],
        of_piece: &[usize],
    ) -> Result<ByMethod<Latents>, Failure> {
        let bar = context.term.bar(3 * filled.len(), "latents");
        let of = |clip: fn(&Filled) -> &Clip| {
            let mut latents = Latents::default();
            for (some, of_piece) in filled.chunks(LATENT_BATCH).zip(of_piece.chunks(LATENT_BATCH)) {
                let clips: Vec<&Clip> = some.iter().map(clip).collect();
                let rows = evaluator.latents(&clips)?;
                of_piece
                    .iter()
                    .zip(rows)
                    .for_each(|(&piece, row)| latents.push(piece, row));
                bar.inc(some.len() as u64);
            }
            Ok::<_, Failure>(latents)
        };
        let all = ByMethod {
            ground_truth: of(|filled| &filled.clips.ground_truth)?,
            interpolation: of(|filled| &filled.clips.interpolation)?,
            pack: of(|filled| &filled.clips.pack)?,
        };
        bar.finish_and_clear();
        Ok(all)
    }
}

/// A root that lies `metres` to the left of where a motion is in the middle of its gap.
fn beside(clip: &Clip, task: Task, metres: f32) -> RootKey {
    let frame = task.context_frames + task.gap_frames / 2;
    let root = clip.root_at(frame);
    let (sin, cos) = root.heading.sin_cos();
    let left = Vec2::new(cos, -sin);
    RootKey::new(frame as u32).ground(Vec2::new(root.position.x, root.position.z) + metres * left)
}

/// Adds FID and MMD: of each method to ground truth, and between the halves of ground truth.
fn add_distances(
    metrics: &mut ByMethod<Metrics>,
    latents: &ByMethod<Latents>,
    pieces: usize,
    sets: Resamples,
) {
    let halves = latents.ground_truth.halves();
    let fid = |times: &[u32]| {
        let fit = |latents: &Latents| Gaussian::fit(latents, times);
        let others = [&fit(&latents.interpolation)?, &fit(&latents.pack)?];
        let [interpolation, pack] = fit(&latents.ground_truth)?.frechet_distances(others);
        let [truth] = fit(&halves[0])?.frechet_distances([&fit(&halves[1])?]);
        Some([truth, interpolation, pack])
    };
    let kernels = [
        Mmd::between(&halves[0], &halves[1]),
        Mmd::between(&latents.ground_truth, &latents.interpolation),
        Mmd::between(&latents.ground_truth, &latents.pack),
    ];
    let mmd = |times: &[u32]| {
        let [truth, interpolation, pack] = &kernels;
        Some([
            truth.value(times)?,
            interpolation.value(times)?,
            pack.value(times)?,
        ])
    };
    let once = vec![1; pieces];
    let found = [
        ("fid", fid(&once).map(|all| sets.centred(all, fid))),
        ("mmd", mmd(&once).map(|all| sets.centred(all, mmd))),
    ];
    for (name, found) in found {
        for (method, estimate) in metrics.each_mut().into_iter().zip(found.into_iter().flatten()) {
            method.set(name, estimate);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_to_ground_truth_and_between_its_own_halves() {
        // Ground truth alternates between 1 and -1, in both halves. The pack equals it, and
        // interpolation is always at 3.
        let latents = |of: &dyn Fn(usize) -> f32| {
            let mut all = Latents::default();
            (0..24).for_each(|nth| all.push(nth / 4, vec![of(nth)]));
            all
        };
        let truth = latents(&|nth| if nth % 4 < 2 { 1.0 } else { -1.0 });
        let latents = ByMethod {
            interpolation: latents(&|_| 3.0),
            pack: truth.clone(),
            ground_truth: truth,
        };
        let mut metrics = ByMethod::<Metrics>::default();
        add_distances(&mut metrics, &latents, 6, Resamples::new(6, 20, 0));
        let fid = |of: &Metrics| of.get("fid").unwrap();
        assert!(fid(&metrics.ground_truth).mean < 1e-9 && fid(&metrics.pack).mean < 1e-9);
        // |0 - 3|², and ground truth's variance of 24 / 23, which interpolation lacks.
        let wanted = 9.0 + 24.0 / 23.0;
        assert!((fid(&metrics.interpolation).mean - wanted).abs() < 1e-9);
        let mmd = |of: &Metrics| of.get("mmd").unwrap();
        assert!(mmd(&metrics.pack).mean < 1e-9 && mmd(&metrics.interpolation).mean > 10.0);
        assert!(mmd(&metrics.interpolation).low.is_some());
    }
}
