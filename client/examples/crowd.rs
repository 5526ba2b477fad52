//! A game server's loop: 200 characters that wander about for five seconds, at 30 ticks a second.
//!
//! `cargo run --release --package troupe-client --example crowd`, beside a server (`make run`)

use std::time::Duration;

use glam::{Quat, Vec3};
use troupe_client::{Client, Crowd, CrowdOptions, Locomotion, SessionOptions};

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let client = Client::connect("http://127.0.0.1:8080").await?;
    let pack = client.pack("").await?; // the server's default pack

    // One session per character. The seed makes its motion individual.
    let place = |nth: u64| Vec3::new((nth % 20) as f32, 0.0, (nth / 20) as f32) * 2.0;
    let options = (0..200).map(|nth| SessionOptions::new().seed(nth).at(place(nth), 0.0));
    let mut crowd = Crowd::new(&client, &pack, CrowdOptions::default());
    let members = crowd.add(&options.collect::<Vec<_>>()).await?;

    let mut clock = tokio::time::interval(Duration::from_secs(1) / 30);
    for tick in 0..150 {
        clock.tick().await;
        for (nth, &member) in members.iter().enumerate() {
            // A new direction every two seconds, for a few characters in each tick. An intent stays
            // until it changes, and only changes are sent to the server.
            if (tick + nth) % 60 == 0
                && let Some(intent) = crowd.intent_mut(member)
            {
                let way = Quat::from_rotation_y((tick * 7 + nth) as f32) * Vec3::Z;
                *intent = Locomotion::walk(way * 1.2); // m/s
            }
        }
        // One call advances all of them by a frame. It waits for plans that are needed.
        let step = crowd.step(1).await?;
        for (_member, frames) in step.characters() {
            let _pose = frames.last(); // the root, joint rotations and contacts to draw
        }
    }
    crowd.close().await?; // else the sessions live until they expire
    Ok(())
}
