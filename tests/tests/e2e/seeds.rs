//! The seed of a session: walkers with different seeds differ, all obey commands, and each moves
//! the same alone and in a crowd.

use troupe_client::{Client, Crowd, CrowdOptions, Locomotion, Pack, SessionOptions};
use troupe_motion::clip::Clip;
use troupe_motion::fk::WorldMotion;
use troupe_motion::gait::{ClosedCycle, CycleOptions, find_cycles};
use troupe_motion::metrics::foot_skate_m_per_frame;
use troupe_motion::rotation::yaw;
use troupe_motion::{Quat, Vec3};

use crate::crowd::perform;
use crate::server::shared;

/// Frames that every walker stands at first.
const STAND: u32 = 10;
/// Frames of each of the two steps in which the walkers go straight ahead.
const WALK: u32 = 90;
/// The frame from which the walkers go at a steady speed.
const STEADY: usize = 60;
const VELOCITY: Vec3 = Vec3::new(0.0, 0.0, 1.18);
/// Phases of a step at which walkers are compared.
const PHASES: usize = 32;

/// Steps walkers with these seeds together and records them.
async fn walk(client: &Client, pack: &Pack, seeds: &[u64]) -> Vec<Clip> {
    let options: Vec<SessionOptions> = (seeds.iter())
        .map(|&seed| SessionOptions::new().seed(seed).style("normal"))
        .collect();
    let intent = |part, _| match part {
        0 => Locomotion::stand().style("normal"),
        _ => Locomotion::walk(VELOCITY).facing(0.0).style("normal"),
    };
    let crowd = Crowd::new(client, pack, CrowdOptions::default());
    perform(crowd, pack, &options, &[STAND, WALK, WALK], intent).await
}

/// The places of the joints at [`PHASES`] phases of the steadiest step, metres, in axes whose
/// origin is the root on the ground and whose +Z is its heading.
fn step(clip: &Clip) -> Vec<Vec3> {
    let cycles = find_cycles(clip, &CycleOptions::default()).unwrap();
    let closed = ClosedCycle::new(clip, &cycles[0]);
    let place = |phase: usize| {
        let at = phase as f32 / PHASES as f32 * closed.frames() as f32;
        let frame = closed.clip(at, 1).unwrap();
        let ground = frame.root_positions[0].with_y(0.0);
        let turn: Quat = yaw(-closed.heading_at(at));
        let places = WorldMotion::from_clip(&frame).positions_at(0).to_vec();
        places.into_iter().map(move |place| turn * (place - ground))
    };
    (0..PHASES).flat_map(place).collect()
}

fn apart_m(a: &[Vec3], b: &[Vec3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).sum::<f32>() / a.len() as f32
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn walkers_differ_by_their_seeds_and_obey_as_well() {
    let (client, pack) = shared().client().await;
    let seeds = [0, 1, 2, 3, 4, 5];
    let clips = walk(&client, &pack, &seeds).await;
    let alone = walk(&client, &pack, &seeds[2..3]).await;
    assert_eq!(
        alone[0], clips[2],
        "a seed gives the same motion alone and in a crowd"
    );

    let steady: Vec<Clip> = clips
        .iter()
        .map(|clip| clip.slice(STEADY..clip.frames()).unwrap())
        .collect();
    let skate = |clip: &Clip| {
        let motion = WorldMotion::from_clip(clip);
        foot_skate_m_per_frame(&clip.skeleton, &motion, 0..clip.frames()).unwrap()
    };
    for (seed, clip) in seeds.iter().zip(&steady) {
        let last = clip.frames() - 1;
        let speed = (clip.root_positions[last] - clip.root_positions[0]) * clip.fps / last as f32;
        let off = (speed - VELOCITY).with_y(0.0).length() / VELOCITY.length();
        assert!(off < 0.05, "seed {seed} goes at {speed}");
        let facing = (0..=last).map(|frame| clip.root_at(frame).heading).sum::<f32>() / clip.frames() as f32;
        assert!(facing.abs() < 0.05, "seed {seed} faces {facing}");
        let (own, usual) = (skate(clip), skate(&steady[0]));
        assert!(
            own < 1.25 * usual,
            "seed {seed} slides {own} m a frame, the style {usual}"
        );
    }

    let steps: Vec<Vec<Vec3>> = steady.iter().map(step).collect();
    let pairs = (1..steps.len()).flat_map(|one| (1..one).map(move |other| (one, other)));
    let apart: Vec<f32> = pairs
        .map(|(one, other)| apart_m(&steps[one], &steps[other]))
        .collect();
    let mean = apart.iter().sum::<f32>() / apart.len() as f32;
    assert!(mean >= 0.020, "{mean} m apart on average: {apart:?}");
    let least = apart.iter().copied().fold(f32::INFINITY, f32::min);
    assert!(least > 0.006, "two of them walk alike: {apart:?}");
}
