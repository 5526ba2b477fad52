//! `troupe object`.

mod new;

use clap::{Args, Subcommand};

use self::new::New;
use super::Session;
use super::failure::Failure;

/// Make smart objects: things, and what characters can do with them.
#[derive(Debug, Args)]
pub(super) struct Object {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    New(Box<New>),
}

pub(super) async fn run(session: &Session, command: &Object) -> Result<(), Failure> {
    match &command.action {
        Action::New(new) => new::run(session, new).await,
    }
}
