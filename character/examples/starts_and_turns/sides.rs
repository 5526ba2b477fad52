//! Steps aside and backwards while facing ahead: where hips and shoulders face, how much of the
//! speed the character reaches, and how hard its joints accelerate.

use std::collections::BTreeMap;
use std::ops::Range;

use troupe_motion::clip::Clip;
use troupe_motion::fk::WorldMotion;
use troupe_motion::metrics::{
    Limbs, foot_skate_m_per_frame, joint_acceleration_percentile_mps2, joint_accelerations_mps2,
};
use troupe_motion::root::wrap_angle;
use troupe_motion::rotation::yaw;
use troupe_motion::{Skeleton, Vec3};

use crate::clips::Clips;
use crate::simulation::{Role, Simulation, slowest_ahead};
use crate::{Args, percentile};

/// Frames for which everybody stands at first.
const STAND_FRAMES: usize = 20;
/// Frames from the command to a steady walk.
const STARTING_FRAMES: usize = 45;
/// Frames measured after that.
const STEADY_FRAMES: usize = 180;
/// Directions of travel, degrees to the left of the heading.
const DIRECTIONS: [f32; 9] = [45.0, -45.0, 60.0, -60.0, 90.0, -90.0, 135.0, -135.0, 180.0];
/// Share of a clip at either end that is not measured: the clip may start or stop there.
const EDGE: f32 = 0.15;
/// Limits: angle of the hips, radians; missing speed, as a share; acceleration, as a multiple of
/// the clip's.
const BARS: (f64, f64, f64) = (0.262, 0.15, 1.5);

/// The figures of one run or one clip.
struct Figures {
    name: String,
    /// The speed that was asked for, and the speed that the character announced, m/s.
    asked_mps: f64,
    bounded_mps: f64,
    /// Speed along the direction that was asked for, m/s.
    speed_mps: f64,
    /// Mean angle of hips and shoulders to the heading, radians to the left.
    hips: f64,
    shoulders: f64,
    /// 99.9th percentile of the joints' accelerations, and the same of the style's clip, m/s².
    joints_mps2: f64,
    clip_mps2: f64,
    skate_mm: f64,
    shins_m: f32,
    feet_m: f32,
}

pub fn run(simulation: &mut Simulation, clips: Option<&Clips>, args: &Args) -> anyhow::Result<()> {
    if let Some(clips) = clips {
        of_clips(clips, args.each)?;
    }
    let references = references(clips, args)?;
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
        for style in &simulation.styles {
            let walk = style.gait("walk").or_else(|| slowest_ahead(style));
            let speed = walk.map_or(0.0, |gait| gait.speed_mps());
            roles.push(Role {
                style: style.clone(),
                seed: None,
                facing: Some(0.0),
                orders: vec![(STAND_FRAMES, yaw(degrees.to_radians()) * Vec3::Z * speed)],
                frames: STAND_FRAMES + STARTING_FRAMES + STEADY_FRAMES,
            });
        }
        let takes = simulation.play(&roles)?;
        let mut all = Vec::new();
        for (role, take) in roles.iter().zip(&takes) {
            let velocity = role.orders[0].1;
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
        row(&format!("{degrees:+.0}°"), &all, args.each);
    }
    Ok(())
}

/// 99.9th percentile of joint accelerations in the clips of the styles' walks, by style and gait.
fn references(clips: Option<&Clips>, args: &Args) -> anyhow::Result<BTreeMap<(String, String), f64>> {
    let mut all = BTreeMap::new();
    let Some(clips) = clips else { return Ok(all) };
    let list: toml::Table = toml::from_str(&std::fs::read_to_string(args.pack.join("styles.toml"))?)?;
    let styles = list.get("styles").and_then(toml::Value::as_table);
    for (style, entry) in styles.into_iter().flatten() {
        for gait in ["walk", "walk-back", "run"] {
            let named = entry.get("gaits").and_then(|gaits| gaits.get(gait));
            let Some(wanted) = named.and_then(toml::Value::as_str) else {
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

/// Clips that move aside or backwards, with the angle of their travel.
fn of_clips(clips: &Clips, each: bool) -> anyhow::Result<()> {
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
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
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
    let mean = |of: &dyn Fn(usize) -> Option<f32>| {
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
        hips: mean(&|frame| Some(clip.root_at(frame).heading)),
        shoulders: mean(&shoulders),
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
