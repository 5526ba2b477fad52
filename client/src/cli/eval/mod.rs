//! `troupe eval`.

mod live;
mod report;
mod windows;

use futures_util::{StreamExt as _, TryStreamExt as _, stream};
use indicatif::ProgressBar;
use troupe_motion::interpolate::fill_gap;
use troupe_motion::metrics::{Evaluation, MetricError, Summary, Task, evaluate};

use self::report::{GapReport, Report};
use self::windows::{NamedClip, Skipped, Window, clip_names, cut, read_clips, task, window_seed, windows};
use super::args::{Eval, EvalWhat, GapEval};
use super::failure::Failure;
use super::{Session, print};
use crate::connection::Client;
use crate::inbetween::{CONTEXT_FRAMES, InBetween};
use crate::pack::Pack;

pub(super) use live::Live;

pub(super) async fn run(session: &Session, command: &Eval) -> Result<(), Failure> {
    match &command.what {
        Some(EvalWhat::Live(command)) => live::run(session, command).await,
        None => fill_gaps(session, &command.gaps).await,
    }
}

async fn fill_gaps(session: &Session, command: &GapEval) -> Result<(), Failure> {
    let (client, pack) = session.connect_to_pack(&command.sampling.pack).await?;
    check_gaps(&command.gaps, &pack)?;
    let names = clip_names(command.data(), command.split.as_deref())?;
    let (mut clips, mut skipped) = read_clips(command.data(), &names, &pack, command.scale, &session.term);
    skipped.extend(drop_short(&mut clips, &command.gaps));
    if clips.is_empty() {
        let why = skipped.first().map_or("it holds no BVH files".to_owned(), |s| {
            format!("{}: {}", s.clip, s.reason)
        });
        return Err(Failure::file(
            command.data(),
            format_args!("no clip can be used ({why})"),
        ));
    }

    let bench = Bench {
        client,
        pack,
        clips,
        command,
    };
    let mut gaps = Vec::new();
    for &gap in &command.gaps {
        gaps.push(bench.measure(session, gap).await?);
    }
    let report = Report::new(&bench.pack, command, bench.clips.len(), skipped, gaps);
    if let Some(path) = &command.json {
        let json = serde_json::to_string_pretty(&report).map_err(|e| Failure::Other(e.to_string()))?;
        std::fs::write(path, json + "\n").map_err(|e| Failure::output(path, e))?;
    }
    print(&report.to_text(comfy_table::Table::new().width()))
}

fn check_gaps(gaps: &[usize], pack: &Pack) -> Result<(), Failure> {
    let given = task(0).frames();
    let (min, max) = pack.segment_frames().into_inner();
    match gaps.iter().find(|&&gap| !(min..=max).contains(&(gap + given))) {
        None => Ok(()),
        Some(gap) => Err(Failure::Input(format!(
            "--gaps: {gap} is outside what pack `{}` can fill, {} to {}",
            pack.name(),
            min.saturating_sub(given),
            max - given
        ))),
    }
}

/// Takes out the clips that are too short for every gap.
fn drop_short(clips: &mut Vec<NamedClip>, gaps: &[usize]) -> Vec<Skipped> {
    let least = gaps
        .iter()
        .map(|&gap| task(gap).frames())
        .min()
        .unwrap_or_default();
    let short = clips.extract_if(.., |named| named.clip.frames() < least);
    short
        .map(|named| Skipped {
            reason: format!(
                "{} frames, fewer than the {least} of the shortest window",
                named.clip.frames()
            ),
            clip: named.name,
        })
        .collect()
}

/// What is measured: a pack on clips.
struct Bench<'a> {
    client: Client,
    pack: Pack,
    clips: Vec<NamedClip>,
    command: &'a GapEval,
}

/// The same window in three forms.
struct Measured {
    truth: Evaluation,
    interpolation: Evaluation,
    pack: Evaluation,
}

impl Bench<'_> {
    /// Has all windows of one gap filled, some at a time, and measures them.
    async fn measure(&self, session: &Session, gap: usize) -> Result<GapReport, Failure> {
        let task = task(gap);
        let windows = windows(&self.clips, task, self.command.stride, self.command.max_windows);
        let bar = session.term.bar(windows.len(), "filling gaps");
        bar.set_message(format!("gap of {gap} frames"));
        let [mut truth, mut interpolation, mut pack] = [Summary::default(); 3];
        // In the order of the windows, so that sums round the same way in every run.
        let mut answers = stream::iter(windows.iter().map(|&window| self.fill(window, task, &bar)))
            .buffered(self.command.concurrency);
        while let Some(measured) = answers.try_next().await? {
            truth.add(&measured.truth);
            interpolation.add(&measured.interpolation);
            pack.add(&measured.pack);
        }
        bar.finish_and_clear();
        match (truth.figures(), interpolation.figures(), pack.figures()) {
            (Some(ground_truth), Some(interpolation), Some(figures)) => Ok(GapReport {
                gap_frames: gap,
                windows: windows.len(),
                ground_truth,
                interpolation,
                pack: figures,
            }),
            _ => Err(Failure::Input(format!(
                "--gaps: no clip is long enough for a gap of {gap}, which takes {} frames",
                task.frames()
            ))),
        }
    }

    async fn fill(&self, window: Window, task: Task, bar: &ProgressBar) -> Result<Measured, Failure> {
        let name = &self.clips[window.clip].name;
        let clip = cut(&self.clips, window, task)?;
        let (from, to) = (CONTEXT_FRAMES - 1, task.frames() - 1);
        let sampling = &self.command.sampling;
        let gap = InBetween::from_clip(&clip, from, to)?
            .seed(window_seed(sampling.seed, name, window.start))
            .temperature(sampling.temperature)
            .pose_steps(sampling.pose_steps);
        let answer = self.client.in_between(&self.pack, &gap).await?;
        let broken = |e: MetricError| {
            Failure::Other(format!(
                "{name} from frame {} cannot be measured: {e}",
                window.start
            ))
        };
        let plain = fill_gap(&clip, from, to).map_err(|e| Failure::Other(e.to_string()))?;
        bar.inc(1);
        Ok(Measured {
            truth: evaluate(&clip, &clip, task).map_err(broken)?,
            interpolation: evaluate(&plain, &clip, task).map_err(broken)?,
            pack: evaluate(&answer.clip, &clip, task).map_err(broken)?,
        })
    }
}
