//! Steps a crowd as fast as the server answers: the Rust side of
//! `clients/python/scripts/bench_crowd.py`, which does the same.
//!
//! ```text
//! cargo run --release --package troupe-client --example bench_crowd -- --count 50 --seconds 20
//! ```
//!
//! All characters walk; every second each gets a new heading. Prints character frames a second and
//! the time of a step, for floats and compact frames in turns.

use std::f32::consts::PI;
use std::time::{Duration, Instant};

use clap::Parser;
use glam::Vec3;
use hdrhistogram::Histogram;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use troupe_client::{Client, Crowd, CrowdOptions, Encoding, FrameOptions, Locomotion, Pack, SessionOptions};

/// Step a crowd as fast as a Troupe server answers.
#[derive(Debug, Parser)]
struct Arguments {
    /// Address of the server.
    #[arg(long, env = "TROUPE_SERVER", default_value = "http://127.0.0.1:8080")]
    server: String,
    /// Characters.
    #[arg(long, default_value_t = 50)]
    count: usize,
    /// How long a turn takes.
    #[arg(long, default_value_t = 20)]
    seconds: u64,
    /// Turns of each encoding.
    #[arg(long, default_value_t = 2)]
    turns: u32,
}

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments = Arguments::parse();
    let client = Client::connect(&arguments.server).await?;
    let pack = client.pack("").await?;
    for _ in 0..arguments.turns {
        for encoding in [Encoding::F32, Encoding::Compact] {
            measure(&client, &pack, &arguments, encoding).await?;
        }
    }
    Ok(())
}

/// One turn.
async fn measure(
    client: &Client,
    pack: &Pack,
    arguments: &Arguments,
    encoding: Encoding,
) -> Result<(), Box<dyn std::error::Error>> {
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let options = (0..).map(|seed| SessionOptions::new().seed(seed));
    let options = options.take(arguments.count).collect::<Vec<_>>();
    let sessions = client.open_sessions(pack, &options).await?;
    let ids = sessions.iter().map(|s| s.id().to_owned()).collect::<Vec<_>>();
    let frames = FrameOptions {
        encoding,
        ..FrameOptions::default()
    };
    let options = CrowdOptions {
        frames,
        ..CrowdOptions::default()
    };
    let mut crowd = Crowd::new(client, pack, options);
    let members = sessions.into_iter().map(|s| crowd.adopt(s)).collect::<Vec<_>>();
    crowd.step(30).await?;

    let mut step_us = Histogram::<u64>::new(3)?;
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(arguments.seconds) {
        if step_us.len() % 30 == 0 {
            for &member in &members {
                let heading = random.random_range(-PI..PI);
                if let Some(intent) = crowd.intent_mut(member) {
                    *intent = Locomotion::walk(1.2 * Vec3::new(heading.sin(), 0.0, heading.cos()));
                }
            }
        }
        let since = Instant::now();
        crowd.step(1).await?;
        step_us.record(u64::try_from(since.elapsed().as_micros())?)?;
    }
    let character_frames = arguments.count as f64 * step_us.len() as f64;
    let millis = |quantile| step_us.value_at_quantile(quantile) as f64 / 1e3;
    println!(
        "{:8} {:10.0} character frames/s   step p50 {:.2} ms, p99 {:.2} ms",
        format!("{encoding:?}"),
        character_frames / begin.elapsed().as_secs_f64(),
        millis(0.5),
        millis(0.99),
    );
    client.close_sessions(ids).await?;
    Ok(())
}
