//! `troupe drive`.

mod events;
mod keyboard;
mod keys;
mod screen;
mod scripted;

pub(super) use self::events::Event;
#[cfg(test)]
pub(super) use self::scripted::Order;
pub(super) use self::scripted::{Moved, Take, follow};

use serde_json::json;

use super::args::Scale;
use super::failure::Failure;
use super::files::Format;
use super::live_args::{Character, Drive};
use super::path::Path;
use super::sessions::plans;
use super::{Session, print};
use crate::live::{FrameOptions, SessionOptions};

pub(super) async fn run(session: &Session, command: &Drive) -> Result<(), Failure> {
    // Before any work is done for nothing.
    let format = command.out.as_deref().map(Format::of).transpose()?;
    if let (Some(format), Some(out)) = (format, &command.out) {
        format.check(session, &command.character.pack, out).await?;
    }
    let Some(file) = &command.path else {
        return keyboard::run(session, command, format).await;
    };
    let mut path = Path::read(file)?;
    if let Some(seconds) = command.seconds {
        path.seconds = Some(std::time::Duration::from(seconds).as_secs_f32());
    }
    let options = FrameOptions {
        rate: command.rate.into(),
        encoding: command.encoding.into(),
        positions: false,
    };
    let take = follow(session, &path, &command.character, options).await?;
    if let (Some(format), Some(out)) = (format, &command.out) {
        format.write(&take.clip, out, scale_of(command))?;
        session.term.note(format_args!(
            "{} frames written to {}",
            take.clip.frames(),
            out.display()
        ));
    }
    if command.json {
        return print(&format!("{:#}", to_json(&take)));
    }
    print(&in_words(&take))?;
    print_events(&take.events)
}

/// Prints what happened, a line for each event.
pub(super) fn print_events(events: &[Event]) -> Result<(), Failure> {
    events.iter().try_for_each(|event| print(&event.to_string()))
}

/// The scene that the arguments or else the path ask for.
fn scene_of<'a>(path: Option<&'a Path>, character: &'a Character) -> Option<&'a str> {
    let of_path = || path.and_then(|path| path.scene.as_deref());
    character.scene.as_deref().or_else(of_path)
}

/// How BVH files are written.
fn scale_of(command: &Drive) -> Scale {
    Scale {
        unit: command.unit,
        other_bones: false,
    }
}

/// Options of the character that the arguments and the path ask for.
fn options_of(path: Option<&Path>, character: &Character) -> SessionOptions {
    let seed = character.seed.or(path.map(|p| p.seed)).unwrap_or_default();
    let mut options = SessionOptions::new()
        .seed(seed)
        .temperature(character.temperature);
    let style = character.style.as_ref().or(path.and_then(|p| p.style.as_ref()));
    if let Some(style) = style {
        options = options.style(style);
    }
    if let Some(scene) = scene_of(path, character) {
        options = options.scene(scene);
    }
    if let Some(path) = path {
        options = options.at(glam::Vec3::new(path.start.x, 0.0, path.start.y), path.heading);
    }
    if let Some(frames) = character.look_ahead {
        options = options.look_ahead_frames(frames);
    }
    options
}

fn in_words(take: &Take) -> String {
    let (stats, measures) = (&take.stats, take.measures());
    let miss = match measures.end_to_last_waypoint_m {
        Some(metres) => format!(", {metres:.2} m from the last waypoint"),
        None => String::new(),
    };
    let mean = match measures.mean_speed_mps {
        Some(mps) => format!("{mps:.2} m/s on average while told to go, "),
        None => String::new(),
    };
    format!(
        "{:.1} s, {:.1} m{miss}\n\
         speed: {mean}{:.2} m/s at most\n\
         plans: {} ({} for commands, {} for a low buffer, {} after the interval), {} late, {} failed\n\
         underruns: {}",
        take.clip.duration_s(),
        measures.distance_m,
        measures.most_speed_mps,
        plans(stats),
        stats.plans_for_command,
        stats.plans_for_low_buffer,
        stats.plans_for_interval,
        stats.late_plans,
        stats.failed_plans,
        stats.underruns,
    )
}

fn to_json(take: &Take) -> serde_json::Value {
    let (stats, measures) = (&take.stats, take.measures());
    json!({
        "frames": take.clip.frames(),
        "fps": take.clip.fps,
        "seconds": take.clip.duration_s(),
        "distance_m": measures.distance_m,
        "mean_speed_mps": measures.mean_speed_mps,
        "most_speed_mps": measures.most_speed_mps,
        "end_to_last_waypoint_m": measures.end_to_last_waypoint_m,
        "commands": take.commands,
        "events": take.events.iter().map(Event::to_json).collect::<Vec<_>>(),
        "stats": stats,
    })
}
