//! The `troupe` command line as a function, so that its binary is one line and tests run the same
//! code; and what `troupe-eval` shares with it: how to connect, read clips and print.

mod args;
mod bridge;
mod character;
mod clip;
mod connection;
mod context;
mod describe;
mod drive;
mod failure;
mod feasibility;
mod files;
mod fill;
mod film;
mod generate;
mod graphics;
mod hero;
mod inbetween;
mod kept;
mod object;
mod output;
mod own_body;
mod pack_folder;
mod packs;
mod path;
mod reading;
mod rebuild;
mod replay;
mod retarget;
mod roots;
mod say;
mod scene;
mod scenery;
mod sessions;
mod shell;
mod splice;
mod style;
mod take;
mod term;
mod tokens;
mod top;
mod understand;
mod values;

#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

use std::process::ExitCode;

use clap::Parser as _;

use self::args::{Arguments, Command};

pub use self::connection::Connection;
pub use self::context::Context;
pub use self::failure::Failure;
pub use self::files::{clip_in, read_clip, read_clip_on};
pub use self::fill::Sampling;
pub use self::output::print;
pub use self::reading::Reading;
pub use self::style::list::{ClipPart, GaitClips, StyleEntry, StyleList};
pub use self::term::Term;
pub use self::values::positive;

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
            eprintln!("troupe: {}", term::plain_lines(&failure.to_string()));
            failure.exit_code()
        }
    }
}

async fn run(arguments: Arguments) -> Result<(), Failure> {
    let context = Context::from(arguments.connection);
    match arguments.command {
        Command::Inbetween(command) => inbetween::run(&context, &command).await,
        Command::Generate(command) => generate::run(&context, &command).await,
        Command::Say(command) => say::run(&context, &command).await,
        Command::Describe(command) => describe::run(&context, &command).await,
        Command::Clip(command) => clip::run(&context, &command).await,
        Command::Retarget(command) => retarget::run(&context, &command).await,
        Command::Packs(command) => packs::run(&context, &command).await,
        Command::Drive(command) => drive::run(&context, &command).await,
        Command::Film(command) => film::run(&context, &command).await,
        Command::Replay(command) => replay::run(&context, &command).await,
        Command::Sessions(command) => sessions::run(&context, &command).await,
        Command::Style(command) => style::run(&context, &command).await,
        Command::Scene(command) => scene::run(&context, &command).await,
        Command::Object(command) => object::run(&context, &command).await,
        Command::Top(command) => top::run(&context, &command).await,
        Command::Bridge(command) => bridge::run(&context, &command).await,
        Command::Completions(command) => shell::completions(&command),
        Command::Man(command) => shell::man(&context, &command),
    }
}
