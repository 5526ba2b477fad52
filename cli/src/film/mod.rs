//! `troupe film`: pictures of paths, of filled gaps and of casts.

mod args;
mod cast;
mod gap;
mod path;

pub(crate) use self::args::Film;
pub(crate) use self::path::draw_motion;

use crate::context::Context;
use crate::failure::Failure;

pub(super) async fn run(context: &Context, command: &Film) -> Result<(), Failure> {
    command.check()?;
    let of = &command.subject;
    if let Some(file) = &of.path {
        path::film(context, command, file).await
    } else if let Some(file) = &of.clip {
        gap::film(context, command, file).await
    } else if let Some(file) = &of.cast {
        cast::film(context, command, file).await
    } else {
        Err(Failure::Input("--path, --clip or --cast is needed".to_owned()))
    }
}

/// Writes the picture to --out.
fn write(context: &Context, command: &Film, png: &[u8]) -> Result<(), Failure> {
    std::fs::write(&command.out, png).map_err(|e| Failure::output(&command.out, e))?;
    context
        .term
        .note(format_args!("picture written to {}", command.out.display()));
    Ok(())
}
