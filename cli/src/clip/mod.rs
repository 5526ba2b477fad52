//! `troupe clip`: reads files of motion, says what it understood, and writes other formats.

mod check;
mod convert;
mod info;
mod onto;

use clap::{Args, Subcommand};

use self::check::Check;
use self::convert::Convert;
use self::info::Info;
pub(crate) use self::onto::Onto;
use crate::context::Context;
use crate::failure::Failure;

/// Say what files of motion hold, check them, and convert them. No server is needed.
#[derive(Debug, Args)]
pub(super) struct ClipFiles {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    Info(Info),
    Check(Check),
    Convert(Convert),
}

pub(super) async fn run(context: &Context, command: &ClipFiles) -> Result<(), Failure> {
    match &command.action {
        Action::Info(command) => info::run(context, command).await,
        Action::Check(command) => check::run(context, command).await,
        Action::Convert(command) => convert::run(context, command).await,
    }
}
