//! `troupe-eval sides`: characters that go aside and backwards while they face ahead. Measures
//! where hips and shoulders face, the speed, and the acceleration of joints.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use troupe_cli::{GaitClips, StyleList};
use troupe_motion::clip::Clip;
use troupe_motion::fk::WorldMotion;
use troupe_motion::metrics::{
    Limbs, foot_skate_m_per_frame, joint_acceleration_percentile_mps2, joint_accelerations_mps2,
};
use troupe_motion::root::wrap_angle;
use troupe_motion::rotation::yaw;
use troupe_motion::{Skeleton, Vec3};

use super::Played;
use super::crowd::{LocalRole, slowest_ahead};
use crate::clips::BvhFolder;
use crate::figures::{mean, percentile};

/// Frames that all characters stand at first.
const STAND_FRAMES: usize = 20;
/// Frames from the command until a character goes steadily.
const STARTING_FRAMES: usize = 45;
/// Frames that are measured from there on.
const STEADY_FRAMES: usize = 180;
/// Directions, degrees to the left of where it faces.
const DIRECTIONS: [f32; 9] = [45.0, -45.0, 60.0, -60.0, 90.0, -90.0, 135.0, -135.0, 180.0];
/// Share of a clip at either end that is not measured: it may start or stop there.
const EDGE: f32 = 0.15;
/// Bars: hips off, radians; speed off, as a share; acceleration ÷ that of the clip.
const BARS: (f64, f64, f64) = (0.262, 0.15, 1.5);

/// One run, or one clip.
struct Figures {
    name: String,
    /// Speed of the command, and the speed that the character reported, m/s.
    asked_mps: f64,
    bounded_mps: f64,
    /// Speed along the commanded direction.
    speed_mps: f64,
    /// Mean headings of hips and shoulders, radians to the left of ahead.
    hips: f64,
    shoulders: f64,
    /// 99.9th percentile of the accelerations of joints, and that of a clip of the same style.
    joints_mps2: f64,
    clip_mps2: f64,
    skate_mm: f64,
    shins_m: f32,
    feet_m: f32,
}

pub(crate) fn run(asked: &Played) -> anyhow::Result<()> {
    let (mut crowd, clips) = asked.load()?;
    if let Some(clips) = &clips {
        of_clips(clips, asked.each)?;
    }
    let references = references(clips.as_ref(), &asked.pack)?;
    println!(
        "{:30} {:>4} | {:>5} {:>5} {:>5} {:>6} {:>6} {:>4} | {:>5} {:>5} {:>4} | {:>5} {:>5} {:>4} | {:>5} {:>5} {:>5}",
        "facing ahead, going to",
        "runs",
        "asked",
        "bound",
        "speed",
        "/asked",
        "/bound",
        "met",
        "hips",
        "chest",
        "met",
        "accel",
        "times",
        "met",
        "skate",
        "shins",
        "feet"
    );
    for degrees in DIRECTIONS {
        let mut roles = Vec::new();
        for style in &crowd.styles {
            let walk = style.gait("walk").or_else(|| slowest_ahead(style));
            let speed = walk.map_or(0.0, |gait| gait.speed_mps());
            roles.push(LocalRole {
                style: style.clone(),
                seed: None,
                facing: Some(0.0),
                commands: vec![(STAND_FRAMES, yaw(degrees.to_radians()) * Vec3::Z * speed)],
                frames: STAND_FRAMES + STARTING_FRAMES + STEADY_FRAMES,
            });
        }
        let takes = crowd.play(&roles)?;
        let mut all = Vec::new();
        for (role, take) in roles.iter().zip(&takes) {
            let velocity = role.commands[0].1;
            let frames = STAND_FRAMES + STARTING_FRAMES..take.clip.frames();
            let mut figures = figures(&role.style.name, &take.clip, frames, velocity)?;
            figures.bounded_mps = take.bounded_mps.map_or(figures.asked_mps, f64::from);
            let gait = if degrees.abs() > 100.0 {
                "walk-back"
            } else {
                "walk"
            };
            let reference = |gait: &str| references.get(&(role.style.name.clone(), gait.to_owned()));
            let clip = reference(gait)
                .or_else(|| reference("walk"))
                .or_else(|| reference("run"));
            figures.clip_mps2 = clip.copied().unwrap_or(f64::NAN);
            all.push(figures);
        }
        row(&format!("{degrees:+.0}°"), &all, asked.each);
    }
    Ok(())
}

/// The 99.9th percentile of joint accelerations of the clips that show styles' walks, by style and
/// gait.
fn references(clips: Option<&BvhFolder>, pack: &Path) -> anyhow::Result<BTreeMap<(String, String), f64>> {
    let mut all = BTreeMap::new();
    let Some(clips) = clips else { return Ok(all) };
    for (style, entry) in StyleList::read(&pack.join("styles.toml"))?.styles {
        for gait in ["walk", "walk-back", "run"] {
            let Some(GaitClips::Clip(wanted)) = entry.gaits.get(gait) else {
                continue;
            };
            for clip in clips.read(|name| name == wanted) {
                let (_, clip) = clip?;
                let accelerations =
                    joint_accelerations_mps2(&WorldMotion::from_clip(&clip), middle(&clip), clip.fps)?;
                all.insert(
                    (style.clone(), gait.to_owned()),
                    percentile(&accelerations, 0.999),
                );
            }
        }
    }
    Ok(all)
}

fn middle(clip: &Clip) -> Range<usize> {
    let edge = (clip.frames() as f32 * EDGE) as usize;
    edge..clip.frames() - edge
}

/// Prints where the clips that go aside or backwards face, seen from their way.
fn of_clips(clips: &BvhFolder, each: bool) -> anyhow::Result<()> {
    println!(
        "{:30} {:>4} | degrees to the left of the hips: the way: mean, most | shoulders: mean | the way from the shoulders: most",
        "clips", "all"
    );
    for kind in ["walk-left", "walk-right", "walk-back"] {
        let (mut ways, mut chests, mut from_chest) = (Vec::new(), Vec::new(), Vec::new());
        for clip in clips.read(|name| name.contains(kind)) {
            let (name, clip) = clip?;
            let frames = middle(&clip);
            let way = clip.root_positions[frames.end] - clip.root_positions[frames.start];
            let figures = figures(name, &clip, frames, way.with_y(0.0))?;
            let way = f64::from(way.x.atan2(way.z));
            let to_way = wrap(way - figures.hips).to_degrees();
            let chest = wrap(figures.shoulders - figures.hips).to_degrees();
            if each {
                println!("    {name:40} way {to_way:6.1} shoulders {chest:6.1}");
            }
            ways.push(to_way);
            chests.push(chest);
            from_chest.push(wrap(way - figures.shoulders).to_degrees().abs());
        }
        let most = ways.iter().map(|way| way.abs()).fold(0.0, f64::max);
        println!(
            "{kind:30} {:4} | {:6.1} {most:6.1} | {:6.1} | {:6.1}",
            ways.len(),
            mean(&ways),
            mean(&chests),
            from_chest.iter().copied().fold(0.0, f64::max)
        );
    }
    Ok(())
}

fn wrap(angle: f64) -> f64 {
    f64::from(wrap_angle(angle as f32))
}

fn figures(name: &str, clip: &Clip, frames: Range<usize>, velocity: Vec3) -> anyhow::Result<Figures> {
    let motion = WorldMotion::from_clip(clip);
    let last = frames.end - 1;
    let way = clip.root_positions[last] - clip.root_positions[frames.start];
    let seconds = (last - frames.start) as f32 / clip.fps;
    let nearest = Limbs::of(&clip.skeleton).nearest(&motion, frames.clone())?;
    let mean_heading = |of: &dyn Fn(usize) -> Option<f32>| {
        let ways = frames.clone().filter_map(of).map(|angle| yaw(angle) * Vec3::Z);
        let sum: Vec3 = ways.sum();
        f64::from(sum.x.atan2(sum.z))
    };
    let sides = ["Shoulder_L", "Shoulder_R"].map(|name| joint(&clip.skeleton, name));
    let shoulders = |frame: usize| {
        let [left, right] = [sides[0]?, sides[1]?].map(|joint| motion.positions_at(frame)[joint]);
        let across = left - right;
        // Left is a quarter turn to the left of ahead.
        Some((-across.z).atan2(across.x))
    };
    Ok(Figures {
        name: name.to_owned(),
        asked_mps: f64::from(velocity.length()),
        bounded_mps: f64::NAN,
        speed_mps: f64::from(way.dot(velocity.normalize_or_zero()) / seconds),
        hips: mean_heading(&|frame| Some(clip.root_at(frame).heading)),
        shoulders: mean_heading(&shoulders),
        joints_mps2: joint_acceleration_percentile_mps2(&motion, frames.clone(), clip.fps, 0.999)?,
        clip_mps2: f64::NAN,
        skate_mm: foot_skate_m_per_frame(&clip.skeleton, &motion, frames)? * 1e3,
        shins_m: nearest.shins_m,
        feet_m: nearest.feet_m,
    })
}

fn joint(skeleton: &Skeleton, name: &str) -> Option<usize> {
    skeleton.joints.iter().position(|joint| joint.name == name)
}

fn row(name: &str, all: &[Figures], each: bool) {
    let print = |name: &str, f: &[&Figures]| {
        let mean = |of: &dyn Fn(&Figures) -> f64| f.iter().map(|&f| of(f)).sum::<f64>() / f.len() as f64;
        let met = |of: &dyn Fn(&Figures) -> bool| f.iter().filter(|&&f| of(f)).count();
        let least = |of: &dyn Fn(&Figures) -> f32| f.iter().map(|&f| of(f)).fold(f32::INFINITY, f32::min);
        println!(
            "{name:30} {:4} | {:5.2} {:5.2} {:5.2} {:6.2} {:6.2} {:4} | {:5.1} {:5.1} {:4} | {:5.1} {:5.2} {:4} | {:5.2} {:5.3} {:5.3}",
            f.len(),
            mean(&|f| f.asked_mps),
            mean(&|f| f.bounded_mps),
            mean(&|f| f.speed_mps),
            mean(&|f| f.speed_mps / f.asked_mps),
            mean(&|f| f.speed_mps / f.bounded_mps),
            met(&|f| (f.speed_mps / f.asked_mps - 1.0).abs() <= BARS.1),
            mean(&|f| f.hips.abs()).to_degrees(),
            mean(&|f| f.shoulders.abs()).to_degrees(),
            met(&|f| f.hips.abs() <= BARS.0),
            mean(&|f| f.joints_mps2),
            mean(&|f| f.joints_mps2 / f.clip_mps2),
            met(&|f| f.joints_mps2 <= BARS.2 * f.clip_mps2),
            mean(&|f| f.skate_mm),
            least(&|f| f.shins_m),
            least(&|f| f.feet_m),
        );
    };
    if each {
        for figures in all {
            print(&format!("    {}", figures.name), &[figures]);
        }
    }
    print(name, &all.iter().collect::<Vec<_>>());
}
