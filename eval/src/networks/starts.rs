//! `troupe-eval starts`: from a command to go until a quarter of its speed, and the starts of
//! clips.

use troupe_motion::Vec3;
use troupe_motion::clip::Clip;

use super::Played;
use super::crowd::{LocalRole, slowest_ahead};
use crate::clips::BvhFolder;
use crate::figures::percentile;

/// Share of the speed from which on a character counts as moving, as in the load tester.
const MOVES_FROM: f32 = 0.25;
/// Share of the speed up to which it counts as standing.
const RESTS_BELOW: f32 = 0.05;
/// Share of a new frame in the smoothed velocity, as in the load tester.
const SMOOTHING: f32 = 0.5;
/// Frames that all characters stand at first.
const STAND_FRAMES: usize = 75;
/// Different moments after that at which commands come.
const MOMENTS: usize = 9;
/// Frames after the command.
const AFTER_FRAMES: usize = 60;
/// A clip that stays below this speed does not go anywhere, m/s.
const GOES_MPS: f32 = 0.5;
/// Frames of rest before a start.
const REST_FRAMES: usize = 3;
/// Most frames of a start.
const START_FRAMES: usize = 45;

pub(crate) fn run(asked: &Played) -> anyhow::Result<()> {
    let (mut crowd, clips) = asked.load()?;
    println!("milliseconds until a quarter of the speed     count    p10    p50    p90    p99");
    if let Some(clips) = &clips {
        of_clips(clips, asked.each)?;
    }
    let styles = crowd.styles.clone();
    let mut roles = Vec::new();
    for style in &styles {
        let speed = slowest_ahead(style).map_or(0.0, |gait| gait.speed_mps());
        roles.extend((0..MOMENTS).map(|moment| LocalRole {
            style: style.clone(),
            seed: None,
            facing: None,
            commands: vec![(STAND_FRAMES + moment, Vec3::Z * speed)],
            frames: STAND_FRAMES + moment + AFTER_FRAMES,
        }));
    }
    let takes = crowd.play(&roles)?;
    let per_frame = 1e3 / f64::from(crowd.fps());
    let [mut live, mut leaves, mut ahead, mut plans] = [const { Vec::new() }; 4];
    for (role, take) in roles.iter().zip(&takes) {
        let (at, velocity) = role.commands[0];
        let until = |share| frames_until((&take.clip.root_positions, at), velocity * share, take.clip.fps);
        let (left, reached) = (until(RESTS_BELOW), until(MOVES_FROM));
        let Some(plan) = take.plans.iter().find(|(splice, _)| *splice >= at) else {
            continue;
        };
        // The plan's last context frame is its third.
        let own = frames_until((&plan.1.roots, 3), velocity * MOVES_FROM, take.clip.fps);
        if asked.each {
            println!(
                "{} {at}: {reached:?}, splice {}, plan {own:?}",
                role.style.name,
                plan.0 - at
            );
        }
        leaves.push(left.unwrap_or(f64::INFINITY) * per_frame);
        live.push(reached.unwrap_or(f64::INFINITY) * per_frame);
        plans.push(own.unwrap_or(f64::INFINITY) * per_frame);
        ahead.push((plan.0 - at) as f64 * per_frame);
    }
    row("commands", &live);
    row("  until rest is left (5 %)", &leaves);
    row("  until the plan takes over", &ahead);
    row("  the plan from there, without the fade", &plans);
    Ok(())
}

fn row(name: &str, values: &[f64]) {
    let [p10, p50, p90, p99] = [0.1, 0.5, 0.9, 0.99].map(|share| percentile(values, share));
    println!(
        "{name:44} {:6} {p10:6.0} {p50:6.0} {p90:6.0} {p99:6.0}",
        values.len()
    );
}

/// Frames after `at` until the smoothed velocity reaches `velocity`, with the fraction of a frame.
fn frames_until((roots, at): (&[Vec3], usize), velocity: Vec3, fps: f32) -> Option<f64> {
    let speeds = smoothed(roots, at, fps);
    let along: Vec<f32> = speeds.iter().map(|v| v.dot(velocity.normalize())).collect();
    crossing(&along, velocity.length())
}

/// The smoothed velocity over the ground at `at` and in the frames after it.
fn smoothed(roots: &[Vec3], at: usize, fps: f32) -> Vec<Vec3> {
    let mut now = Vec3::ZERO;
    let mut all = vec![now];
    for pair in roots[at..].windows(2) {
        let step = (pair[1] - pair[0]).with_y(0.0) * fps;
        now += (step - now) * SMOOTHING;
        all.push(now);
    }
    all
}

/// The frame at which `values` first reach `wanted`, with the fraction of a frame.
fn crossing(values: &[f32], wanted: f32) -> Option<f64> {
    let after = values.iter().position(|&value| value >= wanted)?;
    let Some(before) = after.checked_sub(1) else {
        return Some(0.0);
    };
    let share = (wanted - values[before]) / (values[after] - values[before]);
    Some(before as f64 + f64::from(share))
}

/// Prints the starts of the clips: walks and runs, and steps in clips of other kinds.
fn of_clips(clips: &BvhFolder, each: bool) -> anyhow::Result<()> {
    let (mut walks, mut steps) = (Vec::new(), Vec::new());
    for clip in clips.read(|_| true) {
        let (name, clip) = clip?;
        let walks_on = ["walk", "run", "dash"].iter().any(|kind| name.contains(kind));
        for (frame, ms) in starts_of(&clip, walks_on) {
            if each {
                println!("{name} frame {frame}: {ms:.0} ms");
            }
            match walks_on {
                true => walks.push(ms),
                false => steps.push(ms),
            }
        }
    }
    row("clips: walks and runs", &walks);
    row("clips: steps out of a stand", &steps);
    Ok(())
}

/// Starts from rest: the frame at which a clip last rested, and milliseconds from there to a
/// quarter of its speed. That is the clip's median if it walks on, else the most that it reaches.
fn starts_of(clip: &Clip, walks_on: bool) -> Vec<(usize, f64)> {
    let speeds: Vec<f32> = smoothed(&clip.root_positions, 0, clip.fps)
        .iter()
        .map(|v| v.length())
        .collect();
    let median = percentile(&speeds.iter().map(|&v| f64::from(v)).collect::<Vec<_>>(), 0.5) as f32;
    let mut starts = Vec::new();
    let mut frame = REST_FRAMES;
    while frame + 1 < speeds.len() {
        let end = speeds.len().min(frame + START_FRAMES);
        let most = speeds[frame..end].iter().copied().fold(0.0, f32::max);
        let speed = if walks_on { median } else { most };
        let rest = RESTS_BELOW * speed;
        let rested = speeds[frame - REST_FRAMES..=frame].iter().all(|&v| v <= rest);
        let leaves = speeds[frame + 1] > rest;
        if speed < GOES_MPS || !rested || !leaves {
            frame += 1;
            continue;
        }
        let start = &speeds[frame..end];
        // A start that comes to rest again on the way was only a sway.
        if let Some(reached) = crossing(start, MOVES_FROM * speed)
            && start[1..=reached.ceil() as usize].iter().all(|&v| v > rest)
        {
            // It leaves rest between two frames.
            let left = (rest - start[0]) / (start[1] - start[0]);
            starts.push((frame, (reached - f64::from(left)) * 1e3 / f64::from(clip.fps)));
        }
        frame += REST_FRAMES;
    }
    starts
}
