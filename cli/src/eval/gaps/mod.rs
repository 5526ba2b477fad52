//! `troupe eval` without a subcommand: how a pack fills gaps in held-out clips.

mod args;
mod bench;
mod claims;
mod diversity;
mod figures;
mod report;
pub(in crate::eval) mod windows;

use troupe_client::Pack;

use self::bench::Bench;
use self::report::Report;
use self::windows::task;
use crate::context::Context;
use crate::eval::clips::{clip_names, drop_short, endings, read_clips};
use crate::eval::evaluator::Evaluator;
use crate::failure::Failure;
use crate::output::print;

pub(super) use self::args::GapEval;

pub(super) async fn run(context: &Context, command: &GapEval) -> Result<(), Failure> {
    let (client, pack) = context.connect_to_pack(&command.sampling.pack).await?;
    check_gaps(&command.gaps, &pack)?;
    let evaluator = Evaluator::find(command.evaluator.as_deref(), pack.name())?;
    let names = clip_names(command.data(), command.split.as_deref())?;
    let (mut clips, mut skipped) = read_clips(command.data(), &names, &pack, command.scale, &context.term);
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
        gaps.push(bench.measure(context, gap).await?);
    }
    let report = Report::new(&bench, skipped, gaps);
    if let Some(path) = &command.json {
        let json = serde_json::to_string_pretty(&report).map_err(|e| Failure::Other(e.to_string()))?;
        std::fs::write(path, json + "\n").map_err(|e| Failure::output(path, e))?;
    }
    print(&report.to_text(comfy_table::Table::new().width()))
}

pub(super) fn check_gaps(gaps: &[usize], pack: &Pack) -> Result<(), Failure> {
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
