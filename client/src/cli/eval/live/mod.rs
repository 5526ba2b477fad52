//! `troupe eval live`.

mod args;
mod measure;
mod reference;
mod report;
mod scenario;

pub(in crate::cli) use args::Live;

use glam::{Quat, Vec3};
use troupe_motion::clip::Clip;
use troupe_proto::v1;

use self::measure::{Outcome, measure};
use self::reference::References;
use self::report::Report;
use self::scenario::{Scenario, scenarios};
use crate::cli::failure::Failure;
use crate::cli::{Session, print};
use crate::connection::Client;
use crate::live::{Crowd, CrowdOptions, SessionOptions};
use crate::pack::Pack;

/// Characters that are run at a time.
const TOGETHER: usize = 256;

pub(super) async fn run(session: &Session, command: &Live) -> Result<(), Failure> {
    let (client, pack) = session.connect_to_pack(&command.pack).await?;
    let styles = styles(&client, &pack, &command.styles).await?;
    let references = match (&command.list, &command.data) {
        (Some(list), Some(data)) => {
            let names: Vec<String> = styles.iter().map(|s| s.name.clone()).collect();
            let with = (&pack, command.scale, &session.term);
            reference::read(list, data, &names, command.takes, with)?
        }
        _ => References::new(),
    };
    let all: Vec<Scenario> = styles.iter().flat_map(scenarios).collect();
    let bar = session
        .term
        .bar(all.iter().map(|s| s.frames).sum(), "live frames");
    let mut outcomes = Vec::with_capacity(all.len());
    let mut stats = v1::SessionStats::default();
    for some in all.chunks(TOGETHER) {
        let stage = Stage {
            client: &client,
            pack: &pack,
            seed: command.seed,
            bar: &bar,
        };
        let (clips, theirs) = stage.play(some).await?;
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

/// The styles to measure, with all that the server says of them.
async fn styles(client: &Client, pack: &Pack, only: &[String]) -> Result<Vec<v1::Style>, Failure> {
    let listed = client.styles(pack).await?.styles;
    if let Some(unknown) = only.iter().find(|name| listed.iter().all(|s| s.name != **name)) {
        let names: Vec<&str> = listed.iter().map(|s| s.name.as_str()).collect();
        return Err(Failure::Input(format!(
            "--styles: pack `{}` has no style `{unknown}`; it has {}",
            pack.name(),
            names.join(", ")
        )));
    }
    Ok(listed
        .into_iter()
        .filter(|style| only.is_empty() || only.contains(&style.name))
        .collect())
}

/// Where scenarios are played.
struct Stage<'a> {
    client: &'a Client,
    pack: &'a Pack,
    seed: u64,
    bar: &'a indicatif::ProgressBar,
}

impl Stage<'_> {
    /// Plays scenarios side by side, a frame at a time, and returns what each character did.
    async fn play(&self, scenarios: &[Scenario]) -> Result<(Vec<Clip>, v1::SessionStats), Failure> {
        let mut crowd = Crowd::new(self.client, self.pack, CrowdOptions::default());
        let options: Vec<SessionOptions> = scenarios
            .iter()
            .map(|s| SessionOptions::new().style(&s.style).seed(self.seed))
            .collect();
        let members = crowd.add(&options).await?;
        let mut takes: Vec<(Vec<Vec3>, Vec<Quat>)> = vec![Default::default(); scenarios.len()];
        let longest = scenarios.iter().map(|s| s.frames).max().unwrap_or(0);
        for frame in 0..longest {
            for (scenario, member) in scenarios.iter().zip(&members) {
                for (_, order) in scenario.orders.iter().filter(|(at, _)| *at == frame) {
                    if let Some(intent) = crowd.intent_mut(*member) {
                        *intent = order.clone();
                    }
                }
            }
            let step = crowd.step(1).await?;
            if let Some(fault) = step.faults().first() {
                return Err(Failure::Other(format!(
                    "session {}: {}",
                    fault.session, fault.problem
                )));
            }
            for ((scenario, member), (roots, rotations)) in scenarios.iter().zip(&members).zip(&mut takes) {
                if frame >= scenario.frames {
                    continue;
                }
                let frames = step.get(*member).and_then(|f| f.last());
                let now = frames.ok_or_else(|| Failure::Other("a character has no frame".to_owned()))?;
                roots.push(now.root);
                rotations.extend_from_slice(now.rotations);
                self.bar.inc(1);
            }
        }
        let stats = crowd.stats().await?;
        crowd.close().await?;
        let clips = takes.into_iter().map(|(roots, rotations)| {
            Clip::new(self.pack.skeleton().clone(), self.pack.fps(), roots, rotations)
                .map_err(|e| Failure::Other(format!("a character's frames are no clip: {e}")))
        });
        Ok((clips.collect::<Result<_, _>>()?, stats))
    }
}
