//! The characters that are watched.

use std::time::{Duration, Instant};

use anyhow::Context as _;
use troupe_client::{Client, Drive, DriveOptions, Encoding, FrameOptions, Locomotion, SessionOptions};
use troupe_motion::Vec3;

const SPEED_MPS: f32 = 1.2;
/// Time between two commands of a character, seconds.
const EVERY_S: f32 = 2.0;
/// Turn between them, radians.
const TURN: f32 = 0.7;
/// Distance between characters at first, metres.
const APART_M: f32 = 2.0;

/// A stream in the compact form, its characters on it, and the name of one.
pub async fn open(client: &Client, characters: u32) -> anyhow::Result<(Drive, String)> {
    let pack = client.pack("").await.context("the pack")?;
    let side = f64::from(characters).sqrt().ceil() as u32;
    let options: Vec<_> = (0..characters)
        .map(|nth| {
            let place = Vec3::new((nth % side) as f32, 0.0, (nth / side) as f32) * APART_M;
            SessionOptions::new().seed(nth.into()).at(place, 0.0)
        })
        .collect();
    let sessions = client
        .open_sessions(&pack, &options)
        .await
        .context("the sessions")?;
    let name = sessions[0].id().to_owned();
    let mut drive = client
        .drive(DriveOptions {
            frames: FrameOptions {
                encoding: Encoding::Compact,
                ..FrameOptions::default()
            },
            ..DriveOptions::default()
        })
        .await?;
    drive.attach(sessions).await?;
    Ok((drive, name))
}

/// Has all walk and turn until the task is ended.
pub async fn drive(mut drive: Drive) -> anyhow::Result<()> {
    let begun = Instant::now();
    let mut names: Vec<String> = Vec::new();
    loop {
        let update = tokio::time::timeout(Duration::from_secs(5), drive.next()).await;
        let update = update.context("no tick in 5 s")??.context("the stream ended")?;
        if let Some(tick) = update.tick {
            names = tick.characters().map(|(id, _)| id.to_owned()).collect();
        }
        let (since, count) = (begun.elapsed().as_secs_f32(), names.len() as f32);
        for (nth, id) in names.iter().enumerate() {
            let due = (since / EVERY_S + nth as f32 / count).floor();
            let heading = TURN * due + nth as f32;
            if let Some(intent) = drive.intent_mut(id) {
                *intent = Locomotion::walk(Vec3::new(heading.sin(), 0.0, heading.cos()) * SPEED_MPS);
            }
        }
    }
}
