//! A picture of a character that follows a path.

mod picture;
mod strip;

use std::ops::RangeInclusive;
use std::path::Path as FilePath;

use glam::Vec2;
use troupe_client::FrameOptions;
use troupe_motion::clip::Clip;
use troupe_proto::v1;

use self::picture::{PathPicture, WIDTH};
use super::{Film, write};
use crate::context::Context;
use crate::failure::Failure;
use crate::hero::Hero;
use crate::path::Path;
use crate::scenery::Scenery;
use crate::take::{Order, Take, follow, pack_of, print_events, scene_of};

/// Poses without --poses, and of a generated motion.
const POSES: u8 = 16;

pub(super) async fn film(context: &Context, command: &Film, file: &FilePath) -> Result<(), Failure> {
    let path = Path::read(file)?;
    let hero = command.onto.read(&context.term)?;
    let take = match &hero {
        None => follow(context, &path, &command.character, FrameOptions::default()).await?,
        Some(hero) => worn(context, command, &path, hero).await?,
    };
    let scenery = match &take.scene {
        Some(scene) => {
            let client = context.connect().await?;
            Some(Scenery::of(&client, scene, &take.events, &take.moved).await?)
        }
        None => None,
    };
    let picture = PathPicture {
        scenery,
        range: range(command, &take)?,
        title: path.title.unwrap_or_default(),
        subtitle: subtitle(&take),
        take: &take,
        poses: usize::from(command.poses.unwrap_or(POSES)),
        zoom: command.zoom(WIDTH),
    };
    write(context, command, &picture.to_png().map_err(Failure::Other)?)?;
    print_events(&take.events)
}

/// A take of a path in the size of the character that wears its motion.
async fn worn(context: &Context, command: &Film, path: &Path, hero: &Hero<'_>) -> Result<Take, Failure> {
    if scene_of(Some(path), &command.character).is_some() {
        let why = "--onto needs a path without a scene, whose things have sizes of their own";
        return Err(Failure::Input(why.to_owned()));
    }
    let pack = pack_of(Some(path), &command.character);
    let (_, pack) = context.connect_to_pack(pack).await?;
    let scale = hero.scale(pack.skeleton())?;
    let path = path.sized(1.0 / scale);
    let mut take = follow(context, &path, &command.character, FrameOptions::default()).await?;
    take.clip = hero.wear(&take.clip, &take.clip, &context.term)?;
    take.commanded.iter_mut().for_each(|place| *place *= scale);
    take.goal = take.goal.map(|goal| goal * scale);
    take.orders.iter_mut().for_each(|order| order.velocity *= scale);
    Ok(take)
}

/// A picture of a motion that follows a path, as a PNG file. Its poses are labelled with `style`.
pub(crate) fn draw_motion(
    clip: &Clip,
    path: &[Vec2],
    style: &str,
    (title, subtitle): (String, String),
) -> Result<Vec<u8>, String> {
    let take = Take {
        clip: clip.clone(),
        orders: vec![Order {
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
    let picture = PathPicture {
        scenery: None,
        range: 0..=clip.frames().saturating_sub(1),
        title,
        subtitle,
        take: &take,
        poses: usize::from(POSES),
        zoom: 1.0,
    };
    picture.to_png()
}

/// The frames of the first and the last pose of the strip.
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

/// Time, distance, speed and plans of the take.
fn subtitle(take: &Take) -> String {
    let measures = take.measures();
    let miss = match measures.end_to_last_waypoint_m {
        Some(metres) => format!(" · ends {metres:.2} m from the last waypoint"),
        None => String::new(),
    };
    let mean = match measures.mean_speed_mps {
        Some(mps) => format!(" · {mps:.2} m/s on average while commanded to go"),
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
