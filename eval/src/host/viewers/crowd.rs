//! The characters that are watched.

use std::time::{Duration, Instant};

use anyhow::Context as _;
use troupe_client::{Client, Drive, DriveOptions, Encoding, FrameOptions, SessionOptions};
use troupe_motion::Vec3;

use crate::host::turning_walk;

/// Time between two commands of a character, seconds.
const EVERY_S: f32 = 2.0;
/// Distance between characters at first, metres.
const APART_M: f32 = 2.0;

/// Opens a stream of compact frames with characters on it, and gives the id of one of them.
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

/// Has all characters walk and turn until the task is aborted.
pub async fn drive(mut drive: Drive) -> anyhow::Result<()> {
    let begun = Instant::now();
    let mut ids: Vec<String> = Vec::new();
    loop {
        let update = tokio::time::timeout(Duration::from_secs(5), drive.next()).await;
        let update = update.context("no tick in 5 s")??.context("the stream ended")?;
        if let Some(tick) = update.tick {
            ids = tick.characters().map(|(id, _)| id.to_owned()).collect();
        }
        let since_s = begun.elapsed().as_secs_f32();
        for (nth, id) in ids.iter().enumerate() {
            if let Some(intent) = drive.intent_mut(id) {
                *intent = turning_walk((nth, ids.len()), since_s, EVERY_S);
            }
        }
    }
}
