//! The `troupe` command line, as a function, so that its binary is one line and tests can run the very same code.

mod args;
mod draw;
mod drive;
mod eval;
mod failure;
mod files;
mod film;
mod inbetween;
mod live_args;
mod object;
mod pack_folder;
mod packs;
mod path;
mod scene;
mod sessions;
mod splice;
mod style;
mod term;
#[cfg(test)]
mod testing;

use std::io::{ErrorKind, Write as _};
use std::process::ExitCode;

use clap::Parser as _;

use self::args::{Arguments, Command};
use self::failure::Failure;
use self::term::Term;
use crate::connection::{Client, ConnectOptions};
use crate::pack::Pack;

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
    let session = Session {
        url: arguments.server,
        options: ConnectOptions {
            request_timeout: arguments.timeout.into(),
            ..ConnectOptions::default()
        },
        term: Term::new(arguments.quiet),
    };
    match arguments.command {
        Command::Inbetween(command) => inbetween::run(&session, &command).await,
        Command::Packs(command) => packs::run(&session, &command).await,
        Command::Eval(command) => eval::run(&session, &command).await,
        Command::Draw(command) => draw::run(&session, &command).await,
        Command::Drive(command) => drive::run(&session, &command).await,
        Command::Film(command) => film::run(&session, &command).await,
        Command::Sessions(command) => sessions::run(&session, &command).await,
        Command::Style(command) => style::run(&session, &command).await,
        Command::Scene(command) => scene::run(&session, &command).await,
        Command::Object(command) => object::run(&session, &command).await,
    }
}

/// Prints a command's answer. A reader that has had enough, such as `head`, is no error.
fn print(text: &str) -> Result<(), Failure> {
    match writeln!(std::io::stdout(), "{text}") {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Failure::Other(format!("cannot print: {e}"))),
        _ => Ok(()),
    }
}

/// What every command shares.
struct Session {
    url: String,
    options: ConnectOptions,
    term: Term,
}

impl Session {
    async fn connect(&self) -> Result<Client, Failure> {
        Ok(Client::connect_with(&self.url, self.options.clone()).await?)
    }

    /// Connects and fetches a pack; an empty name stands for the server's default pack.
    async fn connect_to_pack(&self, name: &str) -> Result<(Client, Pack), Failure> {
        let client = self.connect().await?;
        let pack = client.pack(name).await?;
        Ok((client, pack))
    }
}

#[cfg(test)]
mod tests;
