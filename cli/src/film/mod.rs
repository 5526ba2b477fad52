//! `troupe film`.

mod args;
mod picture;
mod strip;

use std::ops::RangeInclusive;
use std::time::Duration;

use glam::Vec2;
use troupe_client::FrameOptions;
use troupe_motion::clip::Clip;
use troupe_proto::v1;

use self::picture::{Picture, WIDTH};
use crate::context::Context;
use crate::failure::Failure;
use crate::path::Path;
use crate::stage::Stage;
use crate::take::{Order, Take, follow, print_events};

pub(crate) use self::args::Film;

/// Poses of a picture of a generated motion.
const MOTION_POSES: usize = 16;

pub(super) async fn run(context: &Context, command: &Film) -> Result<(), Failure> {
    let mut path = Path::read(&command.path)?;
    if let Some(seconds) = command.seconds {
        path.seconds = Some(Duration::from(seconds).as_secs_f32());
    }
    let take = follow(context, &path, &command.character, FrameOptions::default()).await?;
    let stage = match &take.scene {
        Some(scene) => {
            let client = context.connect().await?;
            Some(Stage::of(&client, scene, &take.events, &take.moved).await?)
        }
        None => None,
    };
    let film = Picture {
        stage,
        range: range(command, &take)?,
        title: command.title.clone().or(path.title).unwrap_or_default(),
        subtitle: subtitle(&take),
        take: &take,
        poses: usize::from(command.poses),
        zoom: command.width as f32 / WIDTH,
    };
    let png = film.to_png().map_err(Failure::Other)?;
    std::fs::write(&command.out, png).map_err(|e| Failure::output(&command.out, e))?;
    context
        .term
        .note(format_args!("picture written to {}", command.out.display()));
    print_events(&take.events)
}

/// A picture of a motion that follows a path, as a PNG file of `width` pixels: `style` is what its
/// poses are labelled with.
pub(crate) fn draw_motion(
    clip: &Clip,
    path: &[Vec2],
    style: &str,
    title: (String, String),
    width: u32,
) -> Result<Vec<u8>, String> {
    let take = Take {
        clip: clip.clone(),
        told: vec![Order {
            frame: 0,
            style: style.to_owned(),
            velocity: Vec2::ZERO,
        }],
        commanded: path.to_vec(),
        goal: path.last().copied(),
        scene: None,
        events: Vec::new(),
        moved: Vec::new(),
        commands: 0,
        stats: v1::SessionStats::default(),
    };
    let (title, subtitle) = title;
    let picture = Picture {
        stage: None,
        range: 0..=clip.frames().saturating_sub(1),
        title,
        subtitle,
        take: &take,
        poses: MOTION_POSES,
        zoom: width as f32 / WIDTH,
    };
    picture.to_png()
}

/// The frames between which the strip's poses are.
fn range(command: &Film, take: &Take) -> Result<RangeInclusive<usize>, Failure> {
    let last = take.clip.frames() - 1;
    // Times below 0 count as 0.
    let frame = |time_s: f32| (time_s * take.clip.fps).round() as usize;
    let from = command.from.map_or(0, frame);
    let to = command.to.map_or(last, frame).min(last);
    if from >= to && last > 0 {
        let end_s = last as f32 / take.clip.fps;
        return Err(Failure::Input(format!(
            "--from must be before --to, and before the end, which is at {end_s:.2} s"
        )));
    }
    Ok(from..=to)
}

/// How long and far it went, and what it took.
fn subtitle(take: &Take) -> String {
    let measures = take.measures();
    let miss = match measures.end_to_last_waypoint_m {
        Some(metres) => format!(" · ends {metres:.2} m from the last waypoint"),
        None => String::new(),
    };
    let mean = match measures.mean_speed_mps {
        Some(mps) => format!(" · {mps:.2} m/s on average while told to go"),
        None => String::new(),
    };
    format!(
        "{:.1} s · {:.1} m{mean}{miss} · {} plans",
        take.clip.duration_s(),
        measures.distance_m,
        take.stats.plans(),
    )
}

#[cfg(test)]
mod tests;
