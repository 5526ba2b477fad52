//! The `troupe` command line, as a function, so that its binary is one line and tests can run the
//! very same code.

mod animate;
mod args;
mod context;
mod describe;
mod draw;
mod drive;
mod eval;
mod failure;
mod feasibility;
mod files;
mod fill;
mod film;
mod generate;
mod graphics;
mod inbetween;
mod object;
mod output;
mod pack_folder;
mod packs;
mod path;
mod rebuild;
mod roots;
mod say;
mod scene;
mod sessions;
mod shell;
mod splice;
mod stage;
mod style;
mod take;
mod term;
mod tokens;
mod top;
mod values;

#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

use std::process::ExitCode;

use clap::Parser as _;
use troupe_client::ConnectOptions;

use self::args::{Arguments, Command};
use self::context::Context;
use self::failure::Failure;
use self::term::Term;

/// Reads the process's arguments, runs the command, and gives its exit code (see `troupe --help`).
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let outcome = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|e| Failure::Other(format!("the async runtime does not start: {e}")))
        .and_then(|runtime| runtime.block_on(run(arguments)));
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("troupe: {failure}");
            failure.exit_code()
        }
    }
}

async fn run(arguments: Arguments) -> Result<(), Failure> {
    let context = Context {
        url: arguments.server,
        options: ConnectOptions {
            request_timeout: arguments.timeout.into(),
            key: arguments.key,
            tls: arguments.tls.into(),
            ..ConnectOptions::default()
        },
        term: Term::new(arguments.quiet),
    };
    match arguments.command {
        Command::Inbetween(command) => inbetween::run(&context, &command).await,
        Command::Generate(command) => generate::run(&context, &command).await,
        Command::Say(command) => say::run(&context, &command).await,
        Command::Describe(command) => describe::run(&context, &command).await,
        Command::Packs(command) => packs::run(&context, &command).await,
        Command::Eval(command) => eval::run(&context, &command).await,
        Command::Draw(command) => draw::run(&context, &command).await,
        Command::Drive(command) => drive::run(&context, &command).await,
        Command::Animate(command) => animate::run(&context, &command).await,
        Command::Film(command) => film::run(&context, &command).await,
        Command::Sessions(command) => sessions::run(&context, &command).await,
        Command::Style(command) => style::run(&context, &command).await,
        Command::Scene(command) => scene::run(&context, &command).await,
        Command::Object(command) => object::run(&context, &command).await,
        Command::Top(command) => top::run(&context, &command).await,
        Command::Completions(command) => shell::completions(&command),
        Command::Man(command) => shell::man(&context, &command),
    }
}
