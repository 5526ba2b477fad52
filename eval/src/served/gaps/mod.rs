//! `troupe-eval gaps`: how a pack fills gaps in held-out clips.

mod args;
mod bench;
mod claims;
mod diversity;
mod figures;
mod report;

use troupe_cli::{Context, Failure};

use self::bench::Bench;
use self::report::Report;
use super::publish;
use super::windows::{check_gaps, task};
use crate::clips::{clip_names, drop_short, endings, read_clips};
use crate::evaluator::Evaluator;

pub(crate) use self::args::GapEval;

pub(crate) async fn run(context: &Context, command: &GapEval) -> Result<(), Failure> {
    let (client, pack) = context.connect_to_pack(&command.sampling.pack).await?;
    check_gaps(&command.gaps, &pack)?;
    let evaluator = Evaluator::find(command.evaluator.as_deref(), pack.name())?;
    let of = &command.windows;
    let names = clip_names(&of.data, of.split.as_deref())?;
    let (mut clips, mut skipped) = read_clips(&of.data, &names, &pack, &of.reading, &context.term);
    let least = command.gaps.iter().map(|&gap| task(gap).frames()).min();
    skipped.extend(drop_short(&mut clips, least.unwrap_or_default()));
    if clips.is_empty() {
        let why = match skipped.first() {
            Some(skipped) => format!("{}: {}", skipped.clip, skipped.reason),
            None => format!("it holds no {} files", endings()),
        };
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
        evaluator,
    };
    let mut gaps = Vec::new();
    for &gap in &command.gaps {
        gaps.push(bench.measure(context, gap).await?);
    }
    let report = Report::new(&bench, skipped, gaps);
    let text = report.to_text(comfy_table::Table::new().width());
    publish(&text, &report, command.json.as_deref())
}
