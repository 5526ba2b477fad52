//! `troupe-eval steps`: a crowd that is stepped as fast as the server answers.
//! `clients/python/scripts/bench_crowd.py` measures the same of the Python client.

use std::f32::consts::PI;
use std::time::{Duration, Instant};

use clap::Args;
use glam::Vec3;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use troupe_cli::{Context, Failure};
use troupe_client::{Client, Crowd, CrowdOptions, Encoding, FrameOptions, Locomotion, Pack, SessionOptions};

use crate::figures::{ms, percentile};

/// Measure the Rust client: step a crowd as fast as the server answers.
///
/// All characters walk, and each gets a new heading every second. Prints character frames a second
/// and the time of a step, for floats and compact frames in turns.
#[derive(Debug, Args)]
pub(crate) struct Steps {
    /// Characters.
    #[arg(long, default_value_t = 50)]
    count: usize,
    /// Length of a turn.
    #[arg(long, default_value_t = 20)]
    seconds: u64,
    /// Turns of each encoding.
    #[arg(long, default_value_t = 2)]
    turns: u32,
}

pub(crate) async fn run(context: &Context, command: &Steps) -> Result<(), Failure> {
    let (client, pack) = context.connect_to_pack("").await?;
    for _ in 0..command.turns {
        for encoding in [Encoding::F32, Encoding::Compact] {
            measure((&client, &pack), command, encoding).await?;
        }
    }
    Ok(())
}

/// One turn.
async fn measure(
    (client, pack): (&Client, &Pack),
    command: &Steps,
    encoding: Encoding,
) -> Result<(), Failure> {
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let options: Vec<_> = (0..command.count as u64)
        .map(|seed| SessionOptions::new().seed(seed))
        .collect();
    let frames = FrameOptions {
        encoding,
        ..FrameOptions::default()
    };
    let mut crowd = Crowd::new(
        client,
        pack,
        CrowdOptions {
            frames,
            ..CrowdOptions::default()
        },
    );
    let members = crowd.add(&options).await?;
    crowd.step(30).await?;

    let mut steps_ms = Vec::new();
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(command.seconds) {
        if steps_ms.len() % 30 == 0 {
            for &member in &members {
                let heading = random.random_range(-PI..PI);
                if let Some(intent) = crowd.intent_mut(member) {
                    *intent = Locomotion::walk(1.2 * Vec3::new(heading.sin(), 0.0, heading.cos()));
                }
            }
        }
        let since = Instant::now();
        crowd.step(1).await?;
        steps_ms.push(ms(since.elapsed()));
    }
    let character_frames = (command.count * steps_ms.len()) as f64;
    println!(
        "{:8} {:10.0} character frames/s   step p50 {:.2} ms, p99 {:.2} ms",
        format!("{encoding:?}"),
        character_frames / begin.elapsed().as_secs_f64(),
        percentile(&steps_ms, 0.5),
        percentile(&steps_ms, 0.99),
    );
    Ok(crowd.close().await?)
}
