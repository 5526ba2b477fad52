//! Arguments of `troupe-eval`.

use clap::{Args, Parser, Subcommand};
use troupe_cli::{Connection, Context, Failure};

use crate::files::requests::{RequestSet, SampleRequest};
use crate::files::takes::Takes;
use crate::host::attacks::Attacks;
use crate::host::churn::Churn;
use crate::host::costs::Costs;
use crate::host::restart::Restart;
use crate::host::viewers::Viewers;
use crate::networks::bodies::Bodies;
use crate::networks::objects::Objects;
use crate::networks::raw_loop::RawLoops;
use crate::networks::seeds::Seeds;
use crate::networks::unimogen::Unimogen;
use crate::networks::vermo::Vermo;
use crate::networks::{Played, turns::Turns};
use crate::served::feasibility::FeasibilityEval;
use crate::served::gaps::GapEval;
use crate::served::live::Live;
use crate::served::steps::Steps;
use crate::served::wander::Wander;

/// Measure packs, live characters, engines and servers.
#[derive(Debug, Parser)]
#[command(name = "troupe-eval", version, propagate_version = true, max_term_width = 110, after_long_help = AFTER)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
}

const AFTER: &str = "\
Exit codes:
  0  done
  1  an output file could not be written, or something broke
  2  wrong arguments, or a file that cannot be used
  3  no server answers at the address, or not in time
  4  the server refused the request
  5  attacks, churn and restart: a bar was missed

Examples:
  troupe-eval gaps --data clips/ --split test.txt --json eval.json
  troupe-eval live --data clips/ --list models/human/styles.toml
  troupe-eval starts --data clips/
  troupe-eval raw-loop --workers 1,2 --batch 1,8,32 --frames 36,64 --repeats 5
  troupe-eval attacks --only hulls --seconds 20";

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Gaps(Box<Served<GapEval>>),
    Feasibility(Box<Served<FeasibilityEval>>),
    Live(Box<Served<Live>>),
    Wander(Box<Served<Wander>>),
    Steps(Box<Served<Steps>>),
    /// Measure how soon characters start: from a command until a quarter of its speed.
    Starts(Played),
    Turns(Turns),
    /// Measure characters that go aside and backwards while they face ahead.
    Sides(Played),
    Seeds(Seeds),
    Objects(Objects),
    Bodies(Bodies),
    RawLoop(RawLoops),
    Unimogen(Unimogen),
    Vermo(Vermo),
    Attacks(Attacks),
    Churn(Churn),
    Costs(Costs),
    Restart(Restart),
    Viewers(Viewers),
    /// Simulate the scheduler to see what three of its rules are worth.
    ///
    /// Idle workers share waiting requests, a batch ends at a time limit, and an engine that cuts
    /// batches into calls gets whole calls. Workers are modelled, so every run on every machine
    /// gives the same figures.
    Scheduler,
    Requests(RequestSet),
    SampleRequest(SampleRequest),
    Takes(Takes),
}

/// A measurement that asks a running server.
#[derive(Debug, Args)]
pub(crate) struct Served<A: Args> {
    #[command(flatten)]
    pub(crate) what: A,

    #[command(flatten)]
    pub(crate) connection: Connection,
}

impl<A: Args> Served<A> {
    /// Measures with the server that the options name.
    pub(crate) async fn run<F>(self, measure: F) -> Result<(), Failure>
    where
        F: AsyncFnOnce(&Context, &A) -> Result<(), Failure>,
    {
        measure(&Context::from(self.connection), &self.what).await
    }
}
