//! `troupe style`.

mod add;
mod args;
mod build;
mod extract;
mod json;
pub(crate) mod list;
mod rebuild;
mod show;

pub(crate) use self::args::Style;

use self::args::Action;
use crate::context::Context;
use crate::failure::Failure;

pub(super) async fn run(context: &Context, command: &Style) -> Result<(), Failure> {
    match &command.action {
        Action::Add(add) => add::run(context, add).await,
        Action::Build(build) => build::run(context, build).await,
        Action::List(list) => show::list(context, list).await,
        Action::Show(show) => show::show(context, show).await,
    }
}
