//! `troupe eval`.

mod bench;
mod claims;
mod clips;
mod evaluator;
mod live;
mod report;
mod stage;
mod wander;
mod windows;

use self::bench::Bench;
use self::clips::{clip_names, drop_short, endings, read_clips};
use self::evaluator::Evaluator;
use self::report::Report;
use self::windows::task;
use super::args::{Eval, EvalWhat, GapEval};
use super::failure::Failure;
use super::{Session, print};
use crate::pack::Pack;

pub(super) use live::Live;
pub(super) use wander::Wander;

pub(super) async fn run(session: &Session, command: &Eval) -> Result<(), Failure> {
    match &command.what {
        Some(EvalWhat::Live(command)) => live::run(session, command).await,
        Some(EvalWhat::Wander(command)) => wander::run(session, command).await,
        None => fill_gaps(session, &command.gaps).await,
    }
}

async fn fill_gaps(session: &Session, command: &GapEval) -> Result<(), Failure> {
    let (client, pack) = session.connect_to_pack(&command.sampling.pack).await?;
    check_gaps(&command.gaps, &pack)?;
    let evaluator = Evaluator::find(command.evaluator.as_deref(), pack.name())?;
    let names = clip_names(command.data(), command.split.as_deref())?;
    let (mut clips, mut skipped) = read_clips(command.data(), &names, &pack, command.scale, &session.term);
    let least = command.gaps.iter().map(|&gap| task(gap).frames()).min();
    skipped.extend(drop_short(&mut clips, least.unwrap_or_default()));
    if clips.is_empty() {
        let why = skipped
            .first()
            .map_or(format!("it holds no {} files", endings()), |s| {
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
        evaluator,
    };
    let mut gaps = Vec::new();
    for &gap in &command.gaps {
        gaps.push(bench.measure(session, gap).await?);
    }
    let report = Report::new(&bench, skipped, gaps);
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
