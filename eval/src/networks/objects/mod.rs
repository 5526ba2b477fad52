//! `troupe-eval objects`: how well a pack's characters use smart objects. Many seeded approaches to
//! each object, from varied distances, directions, speeds and styles, then the same approach from
//! twelve directions.

mod measure;
mod report;
mod runner;
mod trials;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, ensure};
use clap::Args;
use troupe_character::object::{Definition, load_folder};
use troupe_character::style::StyleTable;
use troupe_engine::Pipeline;
use troupe_engine::pack::Pack;
use troupe_server::config::Config;

use self::report::Report;
use self::runner::Runner;
use self::trials::{TrialPlan, approaches, broken_off, directions};

/// Measure how characters use smart objects.
#[derive(Debug, Args)]
pub(crate) struct Objects {
    /// Folder of the pack.
    #[arg(long, default_value = "models/human", value_name = "FOLDER")]
    pack: PathBuf,
    /// Folder of the definitions.
    #[arg(long, default_value = "examples/objects", value_name = "FOLDER")]
    objects: PathBuf,
    /// Only these definitions.
    #[arg(long, value_delimiter = ',', value_name = "NAME,..")]
    only: Vec<String>,
    /// Heights at which objects stand, metres; 0 for all others.
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "cup=0.85",
        value_name = "NAME=METRES,.."
    )]
    height: Vec<String>,
    /// Approaches of each object.
    #[arg(long, default_value_t = 200, value_name = "COUNT")]
    approaches: usize,
    /// Approaches from each of twelve directions; 0 leaves them out.
    #[arg(long, default_value_t = 20, value_name = "COUNT")]
    per_direction: usize,
    /// Approaches that a command breaks off at a random moment.
    #[arg(long, default_value_t = 60, value_name = "COUNT")]
    broken_off: usize,
    /// Styles to move in. Default: every style of the pack that walks.
    #[arg(long, value_delimiter = ',', value_name = "STYLE,..")]
    styles: Vec<String>,
    /// Seed of all random choices.
    #[arg(long, default_value_t = 7)]
    seed: u64,
    /// Characters that are played at the same time.
    #[arg(long, default_value_t = 64, value_name = "COUNT")]
    at_once: usize,
    /// Print one JSON document instead of tables.
    #[arg(long)]
    json: bool,
}

/// Trials that are run a second time.
const AGAIN: usize = 20;

pub(crate) fn run(args: &Objects) -> anyhow::Result<()> {
    ensure!(
        args.approaches > 0 && args.at_once > 0,
        "approaches and at-once must be more than 0"
    );
    let pack = Arc::new(Pack::load(&args.pack)?);
    let styles = StyleTable::load(&pack.rig, &pack.folder, None)?;
    let definitions = definitions(args, &pack)?;
    let config = Config::local(Path::new("."))?;
    let selector = config.selector(1)?;
    let decision = selector.choose(&pack)?;
    let stages = selector.load(&pack, decision.engine)?;
    let max_batch = config.max_batch_of(decision.batching);
    let mut pipeline = Pipeline::new(pack.rig.dims, Box::new(stages), args.at_once.min(max_batch));
    pipeline.warm_up()?;
    let mut runner = Runner::new(pack.clone(), pipeline);

    let plan = TrialPlan {
        styles: trials::walking(&styles, &args.styles)?,
        seed: args.seed,
    };
    let mut report = Report::new(&pack, decision.engine.name(), args.seed);
    for (definition, height_m) in definitions {
        let definition = Arc::new(definition);
        let mut run = |specs: &[trials::Spec]| -> anyhow::Result<Vec<measure::Outcome>> {
            let mut outcomes = Vec::with_capacity(specs.len());
            for some in specs.chunks(args.at_once) {
                outcomes.extend(runner.run(&definition, some)?);
            }
            Ok(outcomes)
        };
        let specs = approaches(&plan, args.approaches, height_m);
        let varied = run(&specs)?;
        // With fewer others, so in other batches.
        let again = run(&specs[..specs.len().min(AGAIN)])?;
        let around = run(&directions(&plan, args.per_direction, height_m))?;
        let broken = run(&broken_off(&plan, args.broken_off, height_m))?;
        report.add(&definition.name, &varied, &again, &around, &broken);
    }
    match args.json {
        true => println!("{}", serde_json::to_string_pretty(&report)?),
        false => print!("{report}"),
    }
    Ok(())
}

/// The definitions to measure, with the heights at which they stand.
fn definitions(args: &Objects, pack: &Pack) -> anyhow::Result<Vec<(Definition, f32)>> {
    let mut heights = Vec::new();
    for given in &args.height {
        let (name, metres) = given.split_once('=').context("--height must be NAME=METRES")?;
        heights.push((
            name,
            metres
                .parse::<f32>()
                .with_context(|| format!("--height {given}"))?,
        ));
    }
    let found = load_folder(&args.objects, &pack.rig)?;
    for name in &args.only {
        ensure!(
            found.iter().any(|d| &d.name == name),
            "--only: {} has no definition {name:?}",
            args.objects.display()
        );
    }
    let wanted = |d: &Definition| args.only.is_empty() || args.only.contains(&d.name);
    let height = |d: &Definition| {
        heights
            .iter()
            .find(|(name, _)| *name == d.name)
            .map_or(0.0, |&(_, m)| m)
    };
    Ok(found
        .into_iter()
        .filter(wanted)
        .map(|definition| {
            let height_m = height(&definition);
            (definition, height_m)
        })
        .collect())
}
