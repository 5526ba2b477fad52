//! `troupe animate`.

mod args;
mod body;
mod picture;
mod view;

pub(crate) use self::args::Animate;
use self::picture::{Picture, WIDTH};
use crate::context::Context;
use crate::failure::Failure;
use crate::path::Cast;
use crate::stage::Stage;
use crate::take::follow_together;

pub(crate) async fn run(context: &Context, command: &Animate) -> Result<(), Failure> {
    let cast = Cast::read(&command.cast)?;
    let take = follow_together(context, &cast, command.from + command.seconds).await?;
    let stage = match &take.scene {
        Some(scene) => Some(Stage::of(&context.connect().await?, scene, &take.events, &[]).await?),
        None => None,
    };
    let picture = Picture {
        title: command.title.clone().or(cast.title).unwrap_or_default(),
        take: &take,
        stage,
        from_s: command.from,
        seconds: command.seconds,
        fps: command.fps,
        zoom: command.width as f32 / WIDTH,
    };
    let bar = context.term.bar(picture.frame_count(), "pictures");
    let png = picture.to_png(|| bar.inc(1)).map_err(Failure::Other)?;
    bar.finish_and_clear();
    std::fs::write(&command.out, &png).map_err(|e| Failure::output(&command.out, e))?;
    context.term.note(format_args!(
        "{} frames, {} kB written to {}",
        picture.frame_count(),
        png.len() / 1000,
        command.out.display()
    ));
    Ok(())
}

#[cfg(test)]
mod tests;
