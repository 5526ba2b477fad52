//! `troupe-eval turns`: how characters turn and stop. Measures how often limbs pass through each
//! other, the acceleration of the root, and how long it takes.

use std::ops::Range;

use clap::Args;
use troupe_motion::clip::Clip;
use troupe_motion::fk::WorldMotion;
use troupe_motion::metrics::{
    LimbDistances, Limbs, foot_skate_m_per_frame, joint_accelerations_mps2, joint_jitter_mps2,
    root_accelerations_mps2,
};
use troupe_motion::root::wrap_angle;
use troupe_motion::rotation::yaw;
use troupe_motion::{Vec3, root::GlobalRoot};

use super::Played;
use super::crowd::{LocalCrowd, LocalRole, is_straight, slowest_ahead};
use crate::figures::{mean, percentile};

/// Frames that all characters stand at first.
const STAND_FRAMES: usize = 20;
/// Least frames straight on before a turn.
const BEFORE_FRAMES: usize = 80;
/// Frames after a turn or stop that are measured.
const AFTER_FRAMES: usize = 60;
/// Angles, degrees.
const TURNS: [f32; 4] = [45.0, 90.0, 120.0, 180.0];
/// Different moments of a step at which turns to each side begin.
const MOMENTS: usize = 2;
/// Frames between a stop and the next start.
const PAUSE_FRAMES: usize = 30;
/// Shins and feet nearer than this pass through each other, metres.
const SHINS_M: f32 = 0.05;
const FEET_M: f32 = 0.04;
/// A forearm whose axis is nearer to the trunk's than this, metres.
const ARMS_M: f32 = 0.08;
/// A turn is done once heading and way are off by less than this, radians, and the speed by less
/// than this share.
const DONE: (f32, f32) = (0.26, 0.15);
/// Frames over which sway is taken out of headings and velocities.
const SWAY_FRAMES: usize = 8;

/// One run, or one clip.
struct Figures {
    name: String,
    nearest: LimbDistances,
    /// Largest acceleration of the root over the ground, m/s².
    root_mps2: f64,
    /// Highest turning rate of the pelvis without its sway, rad/s.
    turn_rps: f64,
    skate_mm: f64,
    jitter_mps2: f64,
    joints_p999_mps2: f64,
    /// Seconds until the turn is done; infinite if it is never done, NaN without a turn.
    done_s: f64,
}

/// Measure turns, and stops from runs.
#[derive(Debug, Args)]
pub(crate) struct Turns {
    #[command(flatten)]
    played: Played,
}

pub(crate) fn run(asked: &Turns) -> anyhow::Result<()> {
    let each = asked.played.each;
    let (mut crowd, clips) = asked.played.load()?;
    println!(
        "{:26} {:>5} {:>7} {:>6} {:>6} | {:>5} {:>5} {:>5} | {:>5} {:>5} | {:>6} {:>6} {:>6} | {:>5} {:>5} {:>5}",
        "",
        "runs",
        "shins<5",
        "feet<4",
        "arms<8",
        "root",
        "p95",
        "max",
        "turn",
        "p95",
        "skate",
        "jitter",
        "p99.9",
        "done",
        "p90",
        "never"
    );
    if let Some(clips) = clips {
        for (name, kinds) in [
            ("clips: walk-turn", &["walk-turn"][..]),
            ("clips: walk", &["_walk_"]),
            ("clips: run, dash", &["_run_", "_dash_"]),
        ] {
            let mut all = Vec::new();
            for clip in clips.read(|name| kinds.iter().any(|kind| name.contains(kind))) {
                let (name, clip) = clip?;
                // A clip may start or end in mid-air.
                all.push(figures(name, &clip, 2..clip.frames() - 2, None)?);
            }
            row(name, &all, each);
        }
    }
    for degrees in TURNS {
        let all = turns(&mut crowd, degrees)?;
        row(&format!("turns of {degrees:.0}°"), &all, each);
    }
    let (stops, starts) = stops(&mut crowd)?;
    row("stops, by gait", &stops, each);
    row("starts again, by gait", &starts, each);
    Ok(())
}

fn turns(crowd: &mut LocalCrowd, degrees: f32) -> anyhow::Result<Vec<Figures>> {
    let mut roles = Vec::new();
    for style in &crowd.styles {
        let Some(gait) = slowest_ahead(style) else {
            continue;
        };
        let period = gait.period_frames.max(8.0);
        for nth in 0..2 * MOMENTS {
            let side = if nth % 2 == 0 { 1.0 } else { -1.0 };
            let moment = (nth as f32 + degrees / 90.0) / (2 * MOMENTS) as f32;
            let at = STAND_FRAMES + BEFORE_FRAMES + (moment.fract() * period) as usize;
            let velocity = Vec3::Z * gait.forward_mps;
            roles.push(LocalRole {
                style: style.clone(),
                seed: None,
                facing: None,
                commands: vec![
                    (STAND_FRAMES, velocity),
                    (at, yaw(side * degrees.to_radians()) * velocity),
                ],
                frames: at + AFTER_FRAMES,
            });
        }
    }
    let takes = crowd.play(&roles)?;
    roles
        .iter()
        .zip(&takes)
        .map(|(role, take)| {
            let (at, velocity) = role.commands[1];
            let name = format!(
                "{} {:+.0}",
                role.style.name,
                velocity.x.atan2(velocity.z).to_degrees()
            );
            figures(&name, &take.clip, at..at + AFTER_FRAMES - 12, Some(velocity))
        })
        .collect()
}

/// Goes, stops, and goes again, at the speed of every gait that goes straight ahead.
fn stops(crowd: &mut LocalCrowd) -> anyhow::Result<(Vec<Figures>, Vec<Figures>)> {
    let mut roles = Vec::new();
    let mut names = Vec::new();
    for style in &crowd.styles {
        for gait in style.gaits.iter().filter(|gait| is_straight(gait)) {
            let velocity = Vec3::Z * gait.forward_mps;
            let at = STAND_FRAMES + BEFORE_FRAMES;
            names.push(format!("{} {}", style.name, gait.name));
            roles.push(LocalRole {
                style: style.clone(),
                seed: None,
                facing: None,
                commands: vec![
                    (STAND_FRAMES, velocity),
                    (at, Vec3::ZERO),
                    (at + PAUSE_FRAMES, velocity),
                ],
                frames: at + PAUSE_FRAMES + AFTER_FRAMES,
            });
        }
    }
    let takes = crowd.play(&roles)?;
    let (mut stops, mut starts) = (Vec::new(), Vec::new());
    for (name, (role, take)) in names.iter().zip(roles.iter().zip(&takes)) {
        let (at, again) = (role.commands[1].0, role.commands[2]);
        stops.push(figures(name, &take.clip, at..at + PAUSE_FRAMES, None)?);
        let after = again.0..again.0 + AFTER_FRAMES - 12;
        starts.push(figures(name, &take.clip, after, Some(again.1))?);
    }
    Ok((stops, starts))
}

fn figures(name: &str, clip: &Clip, frames: Range<usize>, goal: Option<Vec3>) -> anyhow::Result<Figures> {
    let motion = WorldMotion::from_clip(clip);
    let limbs = Limbs::of(&clip.skeleton);
    let root = root_accelerations_mps2(&motion, frames.clone(), clip.fps)?;
    let rates = turning_rates(clip, frames.clone());
    let joints = joint_accelerations_mps2(&motion, frames.clone(), clip.fps)?;
    Ok(Figures {
        name: name.to_owned(),
        nearest: limbs.nearest(&motion, frames.clone())?,
        root_mps2: root.iter().copied().fold(f64::NAN, f64::max),
        turn_rps: rates.iter().copied().fold(f64::NAN, f64::max),
        skate_mm: foot_skate_m_per_frame(&clip.skeleton, &motion, frames.clone())? * 1e3,
        jitter_mps2: joint_jitter_mps2(&motion, frames.clone(), clip.fps)?,
        joints_p999_mps2: percentile(&joints, 0.999),
        done_s: goal.map_or(f64::NAN, |goal| done_s(clip, frames, goal)),
    })
}

/// Turning rates of the pelvis over 8 frames, rad/s.
fn turning_rates(clip: &Clip, frames: Range<usize>) -> Vec<f64> {
    let half = SWAY_FRAMES / 2;
    let first = frames.start.max(half);
    let last = frames.end.min(clip.frames().saturating_sub(half));
    let heading = |frame: usize| clip.root_at(frame).heading;
    let rate = |frame: usize| {
        let turned: f32 = (frame - half..frame + half)
            .map(|f| wrap_angle(heading(f + 1) - heading(f)))
            .sum();
        f64::from(turned.abs() * clip.fps / SWAY_FRAMES as f32)
    };
    (first..last).map(rate).collect()
}

/// Seconds from the first of `frames` until the character first faces and goes where it should;
/// infinite if it never does.
fn done_s(clip: &Clip, frames: Range<usize>, goal: Vec3) -> f64 {
    let half = SWAY_FRAMES / 2;
    let wanted = goal.x.atan2(goal.z);
    let done = |frame: usize| {
        let way = clip.root_positions[frame + half] - clip.root_positions[frame - half];
        let speed = way.dot(goal.normalize()) * clip.fps / SWAY_FRAMES as f32;
        let headings = (frame - half..=frame + half).map(|f| {
            let GlobalRoot { heading, .. } = clip.root_at(f);
            wrap_angle(heading - wanted)
        });
        let off = headings.sum::<f32>() / (SWAY_FRAMES + 1) as f32;
        off.abs() <= DONE.0 && speed >= (1.0 - DONE.1) * goal.length()
    };
    let start = frames.start;
    match (start..frames.end).find(|&frame| done(frame)) {
        Some(frame) => (frame - start) as f64 / f64::from(clip.fps),
        None => f64::INFINITY,
    }
}

fn row(name: &str, all: &[Figures], each: bool) {
    if each {
        for f in all {
            println!(
                "    {:32} shins {:.3} feet {:.3} arms {:.3} root {:.1} turn {:.1} skate {:.1} jitter {:.1} done {:.2}",
                f.name,
                f.nearest.shins_m,
                f.nearest.feet_m,
                f.nearest.arms_m,
                f.root_mps2,
                f.turn_rps,
                f.skate_mm,
                f.jitter_mps2,
                f.done_s
            );
        }
    }
    let of = |figure: fn(&Figures) -> f64| all.iter().map(figure).collect::<Vec<_>>();
    let near = |figure: fn(&LimbDistances) -> f32, limit: f32| {
        all.iter().filter(|f| figure(&f.nearest) < limit).count()
    };
    let (root, turn, done) = (of(|f| f.root_mps2), of(|f| f.turn_rps), of(|f| f.done_s));
    let ends: Vec<f64> = done.iter().copied().filter(|d| d.is_finite()).collect();
    let never = done.iter().filter(|d| d.is_infinite()).count();
    println!(
        "{name:26} {:5} {:7} {:6} {:6} | {:5.1} {:5.1} {:5.1} | {:5.2} {:5.2} | {:6.2} {:6.2} {:6.1} | {:5.2} {:5.2} {never:5}",
        all.len(),
        near(|n| n.shins_m, SHINS_M),
        near(|n| n.feet_m, FEET_M),
        near(|n| n.arms_m, ARMS_M),
        percentile(&root, 0.5),
        percentile(&root, 0.95),
        percentile(&root, 1.0),
        percentile(&turn, 0.5),
        percentile(&turn, 0.95),
        mean(&of(|f| f.skate_mm)),
        mean(&of(|f| f.jitter_mps2)),
        mean(&of(|f| f.joints_p999_mps2)),
        percentile(&ends, 0.5),
        percentile(&ends, 0.9),
    );
}
