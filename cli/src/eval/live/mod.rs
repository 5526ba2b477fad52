//! `troupe eval live`.

mod args;
mod measure;
mod reference;
mod report;
mod scenario;
mod turns;

pub(crate) use args::Live;

use troupe_client::SessionOptions;
use troupe_proto::v1;

use self::measure::{Outcome, measure};
use self::reference::References;
use self::report::Report;
use self::scenario::{Scenario, scenarios};
use super::stage::{Role, Stage, styles};
use crate::context::Context;
use crate::failure::Failure;
use crate::output::print;

/// Characters that are run at a time.
const TOGETHER: usize = 256;

pub(super) async fn run(context: &Context, command: &Live) -> Result<(), Failure> {
    let (client, pack) = context.connect_to_pack(&command.pack).await?;
    let styles = styles(&client, &pack, &command.styles).await?;
    let references = match (&command.list, &command.data) {
        (Some(list), Some(data)) => {
            let names: Vec<String> = styles.iter().map(|s| s.name.clone()).collect();
            reference::read(list, data, &names, command.takes, (&pack, command.scale))?
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
        let stage = Stage {
            client: &client,
            pack: &pack,
            bar: &bar,
        };
        let roles = some.iter().map(|scenario| Role {
            options: SessionOptions::new().style(&scenario.style).seed(command.seed),
            orders: scenario.orders.clone(),
            frames: scenario.frames,
        });
        let (clips, theirs) = stage.play(&roles.collect::<Vec<_>>()).await?;
        stats += &theirs;
        for (scenario, clip) in some.iter().zip(&clips) {
            let outcome: Outcome = measure(scenario, clip)
                .map_err(|e| Failure::Other(format!("{} {}: {e}", scenario.style, scenario.gait)))?;
            outcomes.push(outcome);
        }
    }
    bar.finish_and_clear();
    let report = Report::new(&pack, &all, &outcomes, &references, &stats);
    if let Some(path) = &command.json {
        let json = serde_json::to_string_pretty(&report).map_err(|e| Failure::Other(e.to_string()))?;
        std::fs::write(path, json + "\n").map_err(|e| Failure::output(path, e))?;
    }
    print(&report.to_text(comfy_table::Table::new().width()))
}
