//! `troupe style`.

mod add;
mod args;
mod build;
mod extract;
mod json;
mod list;
mod rebuild;
mod show;

pub(super) use args::Style;
pub(super) use list::StyleList;

use self::args::Action;
use super::Session;
use super::failure::Failure;

pub(super) async fn run(session: &Session, command: &Style) -> Result<(), Failure> {
    match &command.action {
        Action::Add(add) => add::run(session, add).await,
        Action::Build(build) => build::run(session, build).await,
        Action::List(list) => show::list(session, list).await,
        Action::Show(show) => show::show(session, show).await,
    }
}
