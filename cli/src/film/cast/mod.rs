//! A moving picture of a cast.

mod mannequin;
mod picture;
mod view;

use std::path::Path;

use self::picture::{CastPicture, WIDTH};
use super::{Film, write};
use crate::context::Context;
use crate::failure::Failure;
use crate::path::Cast;
use crate::scenery::Scenery;
use crate::take::follow_together;

/// Start of the picture without --from, seconds.
const FROM_S: f32 = 2.0;
/// The end fades into what comes before the start, so there must be something before, seconds.
const LEAST_FROM_S: f32 = 0.5;
/// Length of the picture without --to, and the least and the most, seconds.
const LENGTH_S: f32 = 6.0;
const LENGTHS_S: [f32; 2] = [1.0, 60.0];

pub(super) async fn film(context: &Context, command: &Film, file: &Path) -> Result<(), Failure> {
    let cast = Cast::read(file)?;
    let (from_s, seconds) = times(command)?;
    let fps = command.picture_fps()?;
    let take = follow_together(context, &cast, from_s + seconds).await?;
    let scenery = match &take.scene {
        Some(scene) => Some(Scenery::of(&context.connect().await?, scene, &take.events, &[]).await?),
        None => None,
    };
    let picture = CastPicture {
        title: cast.title.unwrap_or_default(),
        take: &take,
        scenery,
        from_s,
        seconds,
        fps,
        zoom: command.zoom(WIDTH),
    };
    let bar = context.term.bar(picture.frame_count(), "pictures");
    let png = picture.to_png(|| bar.inc(1)).map_err(Failure::Other)?;
    bar.finish_and_clear();
    write(context, command, &png)
}

/// Start and length of the picture, seconds.
fn times(command: &Film) -> Result<(f32, f32), Failure> {
    let from_s = command.from.unwrap_or(FROM_S);
    let seconds = command.to.map_or(LENGTH_S, |to_s| to_s - from_s);
    let [least, most] = LENGTHS_S;
    if from_s.is_nan() || from_s < LEAST_FROM_S {
        let text = format!("--from {from_s}: allowed with --cast is {LEAST_FROM_S} or more");
        return Err(Failure::Input(text));
    }
    if !(least..=most).contains(&seconds) {
        let text = format!(
            "--to: allowed is {least} to {most} s after --from, which is {} to {}",
            from_s + least,
            from_s + most
        );
        return Err(Failure::Input(text));
    }
    Ok((from_s, seconds))
}

#[cfg(test)]
mod tests;
