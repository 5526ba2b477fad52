//! `troupe-eval feasibility`: how often answers are right about what is feasible.

mod args;
mod kinds;
mod report;

use futures_util::{StreamExt as _, TryStreamExt as _, stream};
use indicatif::ProgressBar;
use troupe_cli::{Context, Failure};
use troupe_client::{CONTEXT_FRAMES, Client, InBetween, Pack, RequestError};
use troupe_motion::clip::Clip;
use troupe_proto::v1;

use self::kinds::Kind;
use self::report::{Report, Row};
use super::patience::patiently;
use super::windows::{Window, check_gaps, cut, task, window_seed, windows};
use super::{IN_FLIGHT, publish};
use crate::clips::{NamedClip, clip_names, read_clips};

pub(crate) use self::args::FeasibilityEval;

/// A pack that answers real and impossible requests.
struct Bench<'a> {
    client: Client,
    pack: Pack,
    clips: Vec<NamedClip>,
    command: &'a FeasibilityEval,
}

pub(crate) async fn run(context: &Context, command: &FeasibilityEval) -> Result<(), Failure> {
    let (client, pack) = context.connect_to_pack(&command.pack).await?;
    check_gaps(&command.gaps, &pack)?;
    let of = &command.windows;
    let names = clip_names(&of.data, of.split.as_deref())?;
    let (clips, skipped) = read_clips(&of.data, &names, &pack, &of.reading, &context.term);
    if clips.is_empty() {
        let why = skipped.first().map_or("it holds none", |skipped| &skipped.reason);
        return Err(Failure::file(
            &of.data,
            format_args!("no clip can be used ({why})"),
        ));
    }
    let bench = Bench {
        client,
        pack,
        clips,
        command,
    };
    let mut real = Vec::new();
    for &gap in &command.gaps {
        let windows = bench.windows(gap);
        let bar = context.term.bar(windows.len(), "real windows");
        let found = bench.ask(&windows, gap, &bar, |clip, _| {
            InBetween::from_clip(clip, CONTEXT_FRAMES - 1, task(gap).frames() - 1)
        });
        real.push(Row::new(format!("gap of {gap} frames"), &found.await?));
        bar.finish_and_clear();
    }
    let mut impossible = Vec::new();
    for kind in Kind::ALL {
        let windows = bench.windows(kind.gap());
        let bar = context.term.bar(windows.len(), kind.words());
        let found = bench.ask(&windows, kind.gap(), &bar, |clip, chance| {
            kind.request(clip, chance)
        });
        impossible.push(Row::new(kind.words().to_owned(), &found.await?));
        bar.finish_and_clear();
    }
    let report = Report::new(&bench.pack, command.seed, real, impossible);
    publish(&report.to_text(), &report, command.json.as_deref())
}

impl Bench<'_> {
    fn windows(&self, gap: usize) -> Vec<Window> {
        let of = &self.command.windows;
        windows(&self.clips, task(gap), of.stride, of.max_windows)
    }

    /// The verdicts of the answers to a request for each window.
    async fn ask(
        &self,
        windows: &[Window],
        gap: usize,
        bar: &ProgressBar,
        request: impl Fn(&Clip, u64) -> Result<InBetween, RequestError>,
    ) -> Result<Vec<v1::Feasibility>, Failure> {
        let answers = windows
            .iter()
            .map(|&window| self.answer(window, gap, bar, &request));
        let answers = stream::iter(answers).buffered(IN_FLIGHT);
        answers.try_collect().await
    }

    async fn answer(
        &self,
        window: Window,
        gap: usize,
        bar: &ProgressBar,
        request: &impl Fn(&Clip, u64) -> Result<InBetween, RequestError>,
    ) -> Result<v1::Feasibility, Failure> {
        let clip = cut(&self.clips, window, task(gap))?;
        let name = &self.clips[window.clip].name;
        let chance = window_seed(self.command.seed, name, window.start);
        let asked = request(&clip, chance)?.seed(chance);
        let answer = patiently(|| self.client.in_between(&self.pack, &asked)).await?;
        bar.inc(1);
        answer.feasibility.ok_or_else(|| {
            let pack = self.pack.name();
            Failure::Input(format!("pack `{pack}` has no limits: see `troupe-train limits`"))
        })
    }
}
