//! The `troupe-loadtest` command line.

mod args;
mod plan;

use std::path::Path;
use std::process::ExitCode;
use std::time::SystemTime;

use clap::{CommandFactory as _, Parser as _};

use crate::failure::{BOUND_MISSED, Failure};
use crate::figures::Bounds;
use crate::plan::Plan;
use crate::report::{Report, compare, html, table};
use crate::run::{Progress, WORKER, work};
use crate::{overload, run, search};
use args::{Arguments, Command, Output};

/// Runs the command line and gives its exit code.
pub fn main() -> ExitCode {
    let is_worker = std::env::args().nth(1).is_some_and(|first| first == WORKER);
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build();
    let result = match runtime {
        Ok(runtime) if is_worker => {
            let done = runtime.block_on(work()).map(|()| ExitCode::SUCCESS);
            // A pending read of standard input must not delay the exit.
            runtime.shutdown_background();
            done
        }
        Ok(runtime) => runtime.block_on(command(Arguments::parse())),
        Err(why) => Err(Failure::Other(format!(
            "cannot start the asynchronous runtime: {why}"
        ))),
    };
    result.unwrap_or_else(|failure| {
        eprintln!("troupe-loadtest: {failure}");
        failure.exit_code()
    })
}

async fn command(arguments: Arguments) -> Result<ExitCode, Failure> {
    match arguments.command {
        Command::Run(args) => {
            let plan = args.plan()?;
            let progress = args.output.progress();
            let began = SystemTime::now();
            let mut runs = Vec::new();
            for nth in 1..=args.repeat {
                let named = progress.named(repetition(nth, args.repeat));
                runs.push(run::once(&plan, &named).await?);
            }
            let report = Report::new(args.output.label.clone(), began, plan, runs);
            finish(report, &args.output, &args.bounds.bounds())
        }
        Command::Search(args) => {
            let (plan, aim, goal, limits) = args.search()?;
            let began = SystemTime::now();
            let progress = args.output.progress();
            let (found, plan, runs) = search::search(&plan, aim, goal, limits, &progress).await?;
            let none = found.found.is_none();
            let mut report = Report::new(args.output.label.clone(), began, plan, runs);
            report.search = Some(found);
            let code = finish(report, &args.output, &Bounds::default())?;
            Ok(if none { ExitCode::from(BOUND_MISSED) } else { code })
        }
        Command::Overload(args) => {
            let (plan, how) = args.overload()?;
            let began = SystemTime::now();
            let progress = args.output.progress();
            let (found, plan, run) = overload::overload(&plan, &how, &progress).await?;
            let mut report = Report::new(args.output.label.clone(), began, plan, vec![run]);
            report.bounds = args.bounds(&found);
            report.overload = Some(found);
            finish(report, &args.output, &Bounds::default())
        }
        Command::Compare(args) => {
            let reports = args.reports.iter().map(|path| labelled(path));
            say(&compare::compare(&reports.collect::<Result<Vec<_>, _>>()?))
        }
        Command::Report(args) => {
            let report = Report::read(&args.report)?;
            if let Some(path) = &args.html {
                html::write(&report, path)?;
            }
            say(&table::report(&report))
        }
        Command::Schema => {
            let schema = serde_json::to_string_pretty(&schemars::schema_for!(Report))
                .map_err(|e| Failure::Other(e.to_string()))?;
            say(&(schema + "\n"))
        }
        Command::Man { out } => write_manual(&out),
    }
}

fn write_manual(folder: &Path) -> Result<ExitCode, Failure> {
    std::fs::create_dir_all(folder)
        .and_then(|()| clap_mangen::generate_to(Arguments::command(), folder))
        .map_err(|why| Failure::output(folder, why))?;
    Ok(ExitCode::SUCCESS)
}

fn repetition(nth: u32, of: u32) -> String {
    if of > 1 {
        format!("run {nth} of {of}")
    } else {
        String::new()
    }
}

/// Reads a report. Without a label it gets the name of its file.
fn labelled(path: &Path) -> Result<Report, Failure> {
    let mut report = Report::read(path)?;
    if report.label.is_empty() {
        report.label = path
            .file_stem()
            .map(|s| s.to_string_lossy().into_owned())
            .unwrap_or_default();
    }
    Ok(report)
}

/// Writes the report to the files of the options and to standard output. Returns the exit code.
fn finish(mut report: Report, output: &Output, bounds: &Bounds) -> Result<ExitCode, Failure> {
    report.bounds.extend(bounds.check(&report.runs, &report.median));
    if let Some(path) = &output.json {
        report.write(path)?;
    }
    if let Some(path) = &output.html {
        html::write(&report, path)?;
    }
    say(&table::report(&report))?;
    Ok(if report.bounds.iter().all(|bound| bound.kept) {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(BOUND_MISSED)
    })
}

/// Writes to standard output. A closed pipe is no error.
fn say(text: &str) -> Result<ExitCode, Failure> {
    use std::io::{ErrorKind, Write as _};
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Failure::Other(format!(
            "cannot write to standard output: {error}"
        ))),
        _ => Ok(ExitCode::SUCCESS),
    }
}

impl Output {
    fn progress(&self) -> Progress {
        Progress::new(self.quiet)
    }
}

/// The result of reading the arguments of a command.
type Planned = Result<Plan, Failure>;

#[cfg(test)]
mod tests;
