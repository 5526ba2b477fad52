//! `troupe-eval seeds`: how much the walkers of a crowd differ by their seeds, beside the takes of
//! the data, and what that costs.

use clap::Args;
use troupe_motion::Vec3;
use troupe_motion::clip::Clip;
use troupe_motion::fk::WorldMotion;
use troupe_motion::gait::{ClosedCycle, CycleOptions, find_cycles};
use troupe_motion::metrics::{foot_skate_m_per_frame, joint_acceleration_percentile_mps2};
use troupe_motion::rotation::yaw;

use super::Played;
use super::crowd::{LocalRole, slowest_ahead};
use crate::clips::BvhFolder;

/// Frames that all characters stand at first.
const STAND_FRAMES: usize = 20;
/// Frames from the command until a character goes steadily, and those that are measured from there
/// on.
const STARTING_FRAMES: usize = 60;
const STEADY_FRAMES: usize = 240;
/// Phases of a step at which poses are compared.
const PHASES: usize = 32;

/// A walk at [`PHASES`] phases from a left strike on: positions of joints relative to the root on
/// the ground, turned to face ahead.
type Walk = Vec<Vec<Vec3>>;

/// Measure how much the walkers of a crowd differ by their seeds, beside the takes of the data.
#[derive(Debug, Args)]
pub(crate) struct Seeds {
    #[command(flatten)]
    played: Played,
    /// Number of seeds, from 1 on.
    #[arg(long, default_value_t = 8)]
    seeds: u64,
}

pub(crate) fn run(asked: &Seeds) -> anyhow::Result<()> {
    let (mut crowd, clips) = asked.played.load()?;
    println!(
        "{:20} {:>5} {:>9} | {:>5} {:>9} | {:>5} {:>5} | {:>6} {:>6} | {:>6} {:>6} | {:>6} {:>6}",
        "mm between walkers",
        "takes",
        "apart",
        "seeds",
        "apart",
        "speed",
        "most",
        "facing",
        "most",
        "skate",
        "seed 0",
        "accel",
        "seed 0"
    );
    for style in crowd.styles.clone() {
        let takes = match &clips {
            Some(clips) => of_clips(clips, &style.name)?,
            None => Vec::new(),
        };
        let Some(gait) = style.gait("walk").or_else(|| slowest_ahead(&style)) else {
            continue;
        };
        let velocity = Vec3::Z * gait.speed_mps();
        let roles: Vec<LocalRole> = (0..=asked.seeds)
            .map(|seed| LocalRole {
                style: style.clone(),
                seed: Some(seed),
                facing: Some(0.0),
                commands: vec![(STAND_FRAMES, velocity)],
                frames: STAND_FRAMES + STARTING_FRAMES + STEADY_FRAMES,
            })
            .collect();
        let played = crowd.play(&roles)?;
        let figures: Vec<Figures> =
            (played.iter().map(|take| Figures::of(&take.clip, velocity))).collect::<anyhow::Result<_>>()?;
        let walks: Vec<Walk> = figures[1..].iter().filter_map(|f| f.walk.clone()).collect();
        let mean =
            |of: &dyn Fn(&Figures) -> f64| figures[1..].iter().map(of).sum::<f64>() / asked.seeds as f64;
        let most = |of: &dyn Fn(&Figures) -> f64| figures[1..].iter().map(of).fold(0.0, f64::max);
        println!(
            "{:20} {:5} {:9.1} | {:5} {:9.1} | {:5.2} {:5.2} | {:6.1} {:6.1} | {:6.2} {:6.2} | {:6.1} {:6.1}",
            style.name,
            takes.len(),
            apart_mm(&takes),
            walks.len(),
            apart_mm(&walks),
            mean(&|f| f.speed),
            most(&|f| (f.speed - 1.0).abs()),
            mean(&|f| f.facing.abs()),
            most(&|f| f.facing.abs()),
            mean(&|f| f.skate_mm),
            figures[0].skate_mm,
            mean(&|f| f.joints_mps2),
            figures[0].joints_mps2,
        );
    }
    Ok(())
}

struct Figures {
    walk: Option<Walk>,
    /// Speed ÷ that of the command.
    speed: f64,
    /// Mean heading of the hips, degrees from the commanded one.
    facing: f64,
    skate_mm: f64,
    joints_mps2: f64,
}

impl Figures {
    fn of(clip: &Clip, velocity: Vec3) -> anyhow::Result<Self> {
        let steady = STAND_FRAMES + STARTING_FRAMES..clip.frames();
        let part = clip.slice(steady.clone())?;
        let motion = WorldMotion::from_clip(&part);
        let all = 0..part.frames();
        let seconds = (part.frames() - 1) as f32 / part.fps;
        let way = part.root_positions[part.frames() - 1] - part.root_positions[0];
        let facing = all.clone().map(|frame| part.root_at(frame).heading).sum::<f32>() / part.frames() as f32;
        Ok(Self {
            walk: walk(&part)?,
            speed: f64::from(way.dot(velocity) / velocity.length_squared() / seconds),
            facing: f64::from(facing.to_degrees()),
            skate_mm: foot_skate_m_per_frame(&part.skeleton, &motion, all.clone())? * 1e3,
            joints_mps2: joint_acceleration_percentile_mps2(&motion, all, part.fps, 0.999)?,
        })
    }
}

/// The takes of a style's walk, from the set with most takes.
fn of_clips(clips: &BvhFolder, style: &str) -> anyhow::Result<Vec<Walk>> {
    let mut all = Vec::new();
    for clip in clips.read(|name| name.contains(&format!("dataset-2_walk_{style}_"))) {
        all.extend(walk(&clip?.1)?);
    }
    Ok(all)
}

/// The steadiest cycle of a walk, if it has any.
fn walk(clip: &Clip) -> anyhow::Result<Option<Walk>> {
    let Ok(cycles) = find_cycles(clip, &CycleOptions::default()) else {
        return Ok(None);
    };
    let closed = ClosedCycle::new(clip, &cycles[0]);
    let (left, forward, _) = closed.velocity();
    let mut poses = Vec::with_capacity(PHASES);
    for phase in 0..PHASES {
        let at = phase as f32 / PHASES as f32 * closed.frames() as f32;
        let frame = closed.clip(at, 1)?;
        let ground = frame.root_positions[0].with_y(0.0);
        let heading = closed.heading_at(at);
        let motion = WorldMotion::from_clip(&frame);
        let places = motion.positions_at(0).iter();
        poses.push(places.map(|&place| yaw(-heading) * (place - ground)).collect());
    }
    Ok((left.hypot(forward) > 0.1).then_some(poses))
}

/// The mean distance of a joint between two walks at the same phase, over all pairs, millimetres.
fn apart_mm(walks: &[Walk]) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for (nth, one) in walks.iter().enumerate() {
        for other in &walks[nth + 1..] {
            for (a, b) in one.iter().flatten().zip(other.iter().flatten()) {
                sum += f64::from(a.distance(*b));
                count += 1;
            }
        }
    }
    sum * 1e3 / f64::from(count.max(1))
}
