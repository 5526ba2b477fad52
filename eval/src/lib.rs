//! What measures Troupe, behind one command. Each subcommand prints a table; most also write JSON.
//!
//! The modules are cut by what a measurement needs:
//!
//! | module | subcommands | needs |
//! |---|---|---|
//! | [`served`] | `gaps`, `feasibility`, `live`, `wander`, `steps` | a running server, as `troupe` does |
//! | [`networks`] | `starts`, `turns`, `sides`, `seeds`, `objects`, `bodies`, `raw-loop`, `unimogen`, `vermo` | a pack's folder: its networks run in this process |
//! | [`host`] | `attacks`, `churn`, `costs`, `restart`, `viewers` | the release build of the server, which it starts itself |
//! | [`scheduler`] | `scheduler` | nothing: a simulation |
//! | [`files`] | `requests`, `sample-request`, `takes` | a pack's folder; they make files for others |
//!
//! There is one binary because all of this needs the same dependencies. A second one,
//! `troupe-eval-jemalloc`, differs in its allocator alone. Load tests are another program,
//! `troupe-loadtest`.

mod args;
mod clips;
mod evaluator;
mod figures;
mod files;
mod host;
mod networks;
mod resampling;
mod scheduler;
mod served;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

use std::process::ExitCode;

use clap::Parser as _;
use troupe_cli::Failure;

use self::args::{Arguments, Command};

/// Exit code of a measurement that missed a bar.
const MISSED: u8 = 5;

/// Reads the process's arguments, measures, and gives the exit code (see `troupe-eval --help`).
pub fn main() -> ExitCode {
    match run(Arguments::parse().command) {
        Ok(Bars::Met) => ExitCode::SUCCESS,
        Ok(Bars::Missed) => ExitCode::from(MISSED),
        Err(error) => {
            eprintln!("troupe-eval: {error:#}");
            let failure = error.downcast_ref::<Failure>();
            failure.map_or(ExitCode::FAILURE, Failure::exit_code)
        }
    }
}

/// Whether a measurement met the bars that decide about the exit code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Bars {
    Met,
    Missed,
}

impl From<bool> for Bars {
    fn from(met: bool) -> Self {
        if met { Self::Met } else { Self::Missed }
    }
}

fn run(command: Command) -> anyhow::Result<Bars> {
    match command {
        Command::Gaps(asked) => block_on(asked.run(served::gaps::run))?,
        Command::Feasibility(asked) => block_on(asked.run(served::feasibility::run))?,
        Command::Live(asked) => block_on(asked.run(served::live::run))?,
        Command::Wander(asked) => block_on(asked.run(served::wander::run))?,
        Command::Steps(asked) => block_on(asked.run(served::steps::run))?,
        Command::Starts(asked) => networks::starts::run(&asked)?,
        Command::Turns(asked) => networks::turns::run(&asked)?,
        Command::Sides(asked) => networks::sides::run(&asked)?,
        Command::Seeds(asked) => networks::seeds::run(&asked)?,
        Command::Objects(asked) => networks::objects::run(&asked)?,
        Command::Bodies(asked) => networks::bodies::run(&asked)?,
        Command::RawLoop(asked) => networks::raw_loop::run(&asked)?,
        Command::Unimogen(asked) => networks::unimogen::run(&asked)?,
        Command::Vermo(asked) => networks::vermo::run(&asked)?,
        Command::Attacks(asked) => return host::attacks::run(&asked),
        Command::Churn(asked) => return block_on(host::churn::run(asked)),
        Command::Costs(asked) => host::costs::run(&asked)?,
        Command::Restart(asked) => return block_on(host::restart::run(asked)),
        Command::Viewers(asked) => block_on(host::viewers::run(asked))?,
        Command::Scheduler => scheduler::run(),
        Command::Requests(asked) => files::requests::run(&asked)?,
        Command::SampleRequest(asked) => files::requests::print_sample(&asked)?,
        Command::Takes(asked) => files::takes::run(&asked)?,
    }
    Ok(Bars::Met)
}

fn block_on<T, E: Into<anyhow::Error>>(work: impl Future<Output = Result<T, E>>) -> anyhow::Result<T> {
    let runtime = tokio::runtime::Runtime::new()?;
    runtime.block_on(work).map_err(Into::into)
}
