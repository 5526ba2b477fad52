//! `troupe-eval live`: how well live characters obey, and how they move.

mod args;
mod measure;
mod reference;
mod report;
mod scenario;
mod turns;

pub(crate) use args::Live;

use troupe_cli::{Context, Failure};
use troupe_client::SessionOptions;
use troupe_proto::v1;

use self::measure::{Outcome, measure};
use self::reference::References;
use self::report::Report;
use self::scenario::{Scenario, scenarios};
use super::crowd::{Role, play, styles};
use super::publish;

/// Characters that live at the same time.
const TOGETHER: usize = 256;

pub(crate) async fn run(context: &Context, command: &Live) -> Result<(), Failure> {
    let (client, pack) = context.connect_to_pack(&command.pack).await?;
    let styles = styles(&client, &pack, &command.styles).await?;
    let references = match (&command.list, &command.data) {
        (Some(list), Some(data)) => {
            let names: Vec<String> = styles.iter().map(|s| s.name.clone()).collect();
            reference::read(list, data, &names, (&pack, &command.reading))?
        }
        _ => References::new(),
    };
    let all: Vec<Scenario> = styles.iter().flat_map(scenarios).collect();
    let bar = context
        .term
        .bar(all.iter().map(|s| s.frames).sum(), "live frames");
    let mut outcomes = Vec::with_capacity(all.len());
    let mut stats = v1::SessionStats::default();
    for some in all.chunks(TOGETHER) {
        let roles = some.iter().map(|scenario| Role {
            options: SessionOptions::new().style(&scenario.style).seed(command.seed),
            commands: scenario.commands.clone(),
            frames: scenario.frames,
        });
        let (clips, theirs) = play((&client, &pack), &roles.collect::<Vec<_>>(), &bar).await?;
        stats += &theirs;
        for (scenario, clip) in some.iter().zip(&clips) {
            let outcome: Outcome = measure(scenario, clip)
                .map_err(|e| Failure::Other(format!("{} {}: {e}", scenario.style, scenario.gait)))?;
            outcomes.push(outcome);
        }
    }
    bar.finish_and_clear();
    let report = Report::new(&pack, &all, &outcomes, &references, &stats);
    let text = report.to_text(comfy_table::Table::new().width());
    publish(&text, &report, command.json.as_deref())
}
