//! `troupe film`.

mod picture;

use self::picture::{Film, WIDTH};
use super::Session;
use super::drive::{Take, follow};
use super::failure::Failure;
use super::live_args::Film as Arguments;
use super::path::Path;
use crate::live::FrameOptions;

pub(super) async fn run(session: &Session, command: &Arguments) -> Result<(), Failure> {
    let mut path = Path::read(&command.path)?;
    if let Some(seconds) = command.seconds {
        path.seconds = Some(std::time::Duration::from(seconds).as_secs_f32());
    }
    let take = follow(session, &path, &command.character, FrameOptions::default()).await?;
    let film = Film {
        title: command.title.clone().or(path.title).unwrap_or_default(),
        subtitle: subtitle(&take),
        take: &take,
        poses: usize::from(command.poses),
        zoom: command.width as f32 / WIDTH,
    };
    let png = film.to_png().map_err(Failure::Other)?;
    std::fs::write(&command.out, png).map_err(|e| Failure::output(&command.out, e))?;
    session
        .term
        .note(format_args!("picture written to {}", command.out.display()));
    Ok(())
}

/// How long and far it went, and what it took.
fn subtitle(take: &Take) -> String {
    let measures = take.measures();
    let miss = match measures.end_to_last_waypoint_m {
        Some(metres) => format!(" · ends {metres:.2} m from the last waypoint"),
        None => String::new(),
    };
    format!(
        "{:.1} s · {:.1} m · {:.2} m/s on average while told to go{miss} · {} plans",
        take.clip.duration_s(),
        measures.distance_m,
        measures.mean_speed_mps,
        super::sessions::plans(&take.stats),
    )
}

#[cfg(test)]
mod tests;
