//! Users' paths: lines, arcs and S curves at an even speed. And the roots of captured walks. What
//! the network makes of them, and what the fronts answer.

use std::f32::consts::FRAC_PI_6;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use serde::Deserialize;
use troupe_character::Path;
use troupe_character::live::{Character, CharacterOptions, FrameOut, Intent, Start};
use troupe_character::primitives::path::AskedPoint;
use troupe_character::primitives::{LocomotionCommand, PathCommand};
use troupe_character::style::Style;
use troupe_character::take::{PathPlan, PathRequest, Steady, Track};
use troupe_engine::families::unimogen::UniMoGen;
use troupe_engine::pack::Pack;
use troupe_motion::fk::world_transforms;
use troupe_motion::model::Body;
use troupe_motion::path::{GroundPath, PathPoint};
use troupe_motion::{GlobalRoot, Quat, Skeleton, Vec3};

use super::bodies::{PathPlanner, WanderingBody};
use super::clock::tick;
use crate::figures::{mean, table};

/// Speeds over the ground, m/s.
const SPEEDS_MPS: [f32; 3] = [0.6, 1.2, 1.8];
/// Length of a path, seconds.
const SECONDS: f32 = 6.0;
/// Turn rate of arcs and S curves, radians a second.
const TURN_RAD_PER_S: f32 = FRAC_PI_6;
/// First seconds of a live character, in which it starts; they are not measured.
const START_S: f32 = 1.0;
/// A toe this far below the height at which it stands is in the ground, metres.
const SUNK_M: f32 = 0.01;
/// Shapes of the paths.
const SHAPES: [&str; 3] = ["line", "arc", "S"];

/// What a user sees of a motion.
#[derive(Debug, Default)]
struct Figures {
    standing_mm: Vec<f64>,
    sunk: Vec<f64>,
    bends: Vec<f64>,
    seams: Vec<f64>,
    off_m: Vec<f64>,
    highest_m: f64,
}

/// Captured walks of a body, as `troupe-train unimogen roots` writes them, with their figures.
#[derive(Debug, Deserialize)]
pub(super) struct Walks {
    /// x, z and heading of the root, 30 a second.
    roots: Vec<Vec<[f32; 3]>>,
    standing_foot_mm: f64,
    sunk_share: f64,
    acceleration_mps2: f64,
    highest_toe_m: f64,
}

impl Walks {
    fn figures(&self) -> Figures {
        Figures {
            standing_mm: vec![self.standing_foot_mm],
            sunk: vec![self.sunk_share],
            bends: vec![self.acceleration_mps2],
            highest_m: self.highest_toe_m,
            ..Figures::default()
        }
    }

    /// The root of a walk as a path.
    fn path(root: &[[f32; 3]]) -> Vec<PathPoint> {
        let point = |(frame, &[x, z, heading]): (usize, &[f32; 3])| PathPoint {
            time_s: frame as f32 / 30.0,
            place: [x, z],
            heading: Some(heading),
        };
        root.iter().enumerate().map(point).collect()
    }
}

/// Prints the figures of a body on all paths, and on the roots of captured walks if there are any.
pub(super) fn measure(
    pack: &Pack,
    body: &Arc<Body>,
    style: &Arc<Style>,
    generator: &mut UniMoGen,
    (walks, seed): (Option<&Walks>, u64),
) -> anyhow::Result<()> {
    let mut rows = Vec::new();
    let (mut took, mut frames) = (Duration::ZERO, 0);
    if let Some(walks) = walks {
        let mut all = [walks.figures(), Figures::default(), Figures::default()];
        for (root, seed) in walks.roots.iter().zip(seed..) {
            let points = Walks::path(root);
            let made = generated(pack, body, style, generator, (&points, seed))?;
            for (track, figures) in [&made.raw, &made.finished].into_iter().zip(&mut all[1..]) {
                figures.add(body, track, 0, &made.seams, Some(&points));
            }
        }
        for (what, figures) in ["captured", "raw", "finished"].into_iter().zip(&all) {
            rows.push(figures.row(&body.name, "captured root", what));
        }
    }
    for shape in SHAPES {
        let mut all: [Figures; 4] = Default::default();
        for speed in SPEEDS_MPS {
            let points = points(shape, speed);
            let made = generated(pack, body, style, generator, (&points, seed))?;
            let live =
                [false, true].map(|holds| live(pack, body, style, generator, (&points, speed, seed, holds)));
            let [bare, held] = live;
            let tracks = [&made.raw, &made.finished, &bare?, &held?];
            for (nth, (track, figures)) in tracks.into_iter().zip(&mut all).enumerate() {
                let (from, seams) = match nth {
                    0 | 1 => (0, &made.seams[..]),
                    _ => ((START_S * body.rig.fps) as usize, &[][..]),
                };
                figures.add(body, track, from, seams, (nth < 2).then_some(&points[..]));
            }
            took += made.took;
            frames += made.finished.len();
        }
        for (what, figures) in ["raw", "finished", "live, raw", "live"].into_iter().zip(&all) {
            rows.push(figures.row(&body.name, shape, what));
        }
    }
    let heads = [
        "body",
        "path",
        "motion",
        "standing foot (mm/frame)",
        "a toe in the ground (%)",
        "joint acceleration (m/s²)",
        "at seams (m/s²)",
        "highest toe (cm)",
        "off the path (cm)",
    ];
    print!("{}", table(&heads, 3, &rows));
    let each_us = took.as_secs_f64() * 1e6 / frames.max(1) as f64;
    println!(
        "finishing {frames} frames of {}: {each_us:.1} µs a frame\n",
        body.name
    );
    Ok(())
}

/// Points of a path every tenth of a second, with the heading along it.
fn points(shape: &str, speed_mps: f32) -> Vec<PathPoint> {
    let (steps, step_s) = ((SECONDS * 10.0) as usize, 0.1);
    let (mut place, mut heading) = ([0.0_f32; 2], 0.0_f32);
    let each = (0..=steps).map(|step| {
        let time_s = step as f32 * step_s;
        let point = PathPoint {
            time_s,
            place,
            heading: Some(heading),
        };
        heading += step_s
            * match shape {
                "arc" => TURN_RAD_PER_S,
                "S" if time_s < SECONDS / 2.0 => TURN_RAD_PER_S,
                "S" => -TURN_RAD_PER_S,
                _ => 0.0,
            };
        place[0] += speed_mps * step_s * heading.sin();
        place[1] += speed_mps * step_s * heading.cos();
        point
    });
    each.collect()
}

/// A motion window by window, as `Generate` makes it.
struct Generated {
    raw: Track,
    finished: Track,
    /// First frames of the windows but the first.
    seams: Vec<usize>,
    /// Time of the finishing.
    took: Duration,
}

fn generated(
    pack: &Pack,
    body: &Arc<Body>,
    style: &Arc<Style>,
    generator: &mut UniMoGen,
    (points, seed): (&[PathPoint], u64),
) -> anyhow::Result<Generated> {
    let seconds = points.last().map_or(0.0, |point| point.time_s);
    let plan = || -> anyhow::Result<PathPlan> {
        let points = GroundPath::new(points.to_vec()).context("no path")?;
        let request = PathRequest {
            body: body.clone(),
            shows_steps: points.shows_steps(),
            points,
            seconds,
            past: Vec::new(),
            targets: Vec::new(),
            style: weights(pack, style),
            steps: pack.sampler().map_or(1, |steps| steps.default),
            guidance: 1.0,
            seed,
        };
        Ok(PathPlan::new(&Path::root(), request)?)
    };
    let (mut bare, mut held, mut steady) = (plan()?, plan()?, Steady::default());
    let mut made = Generated {
        raw: Track::default(),
        finished: Track::default(),
        seams: Vec::new(),
        took: Duration::ZERO,
    };
    while let Some((task, frame)) = bare.next_task() {
        let motion = generator.run(std::slice::from_ref(&task))?.pop();
        let motion = motion.context("the network gave no motion")?;
        made.seams
            .extend((!made.raw.is_empty()).then_some(made.raw.len()));
        let (fresh, _) = bare.receive(&motion, &frame);
        let fresh = Track::of_motion(&fresh, &frame, &body.rig);
        made.raw.extend(&fresh, 0, fresh.len());
        held.next_task();
        let started = Instant::now();
        let (part, _) = steady.receive(&mut held, &motion, &frame);
        made.took += started.elapsed();
        made.finished.extend(&part, 0, part.len());
    }
    Ok(made)
}

/// A weight for each word of the pack.
fn weights(pack: &Pack, style: &Style) -> Vec<f32> {
    let weight = |word: &String| if *word == style.name { 1.0 } else { 0.0 };
    pack.words.iter().map(weight).collect()
}

/// A live character on a path.
fn live(
    pack: &Pack,
    body: &Arc<Body>,
    style: &Arc<Style>,
    generator: &mut UniMoGen,
    (points, speed, seed, holds_feet): (&[PathPoint], f32, u64, bool),
) -> anyhow::Result<Track> {
    let options = CharacterOptions {
        seed,
        look_ahead_frames: 4,
        replan_interval_frames: None,
        root_ratio: None,
        temperature: 0.0,
    };
    let start = Start::Standing(GlobalRoot::new(Vec3::ZERO, 0.0));
    let standing = LocomotionCommand::standing(style);
    let mut walker = WanderingBody {
        character: Character::new(body.rig.clone(), options, start, standing),
        plans: Vec::new(),
    };
    let mut planner = PathPlanner {
        pack,
        body,
        generator,
        holds_feet,
        took: Duration::ZERO,
    };
    let asked = |point: &PathPoint| AskedPoint {
        position: Vec3::new(point.place[0], 0.0, point.place[1]),
        heading: None,
        time_s: None,
    };
    let asked: Vec<AskedPoint> = points.iter().skip(5).step_by(5).map(asked).collect();
    let path = PathCommand::new(&Path::root(), &asked, Some(speed), false, style.clone())?;
    walker.character.give(1, None, Intent::FollowPath(path))?;
    let mut track = Track::default();
    for _ in 0..(SECONDS * body.rig.fps) as usize {
        tick(std::slice::from_mut(&mut walker), &mut planner)?;
        let mut out = FrameOut::default();
        walker.character.sample(&mut out);
        track.push(out.root, &out.rotations, out.contacts);
    }
    Ok(track)
}

impl Figures {
    /// Adds the frames of a motion from `from` on.
    fn add(&mut self, body: &Body, track: &Track, from: usize, seams: &[usize], path: Option<&[PathPoint]>) {
        let skeleton = &body.rig.skeleton;
        let places: Vec<Vec<Vec3>> = (from..track.len())
            .map(|frame| positions(skeleton, track.roots[frame], track.pose(frame)))
            .collect();
        let toes = toes(skeleton);
        for pair in places.windows(2) {
            let step = |&(joint, _): &(usize, f32)| {
                f64::from((pair[1][joint] - pair[0][joint]).with_y(0.0).length())
            };
            if let Some(least) = toes.iter().map(step).reduce(f64::min) {
                self.standing_mm.push(1e3 * least);
            }
        }
        for place in &places {
            let above = |&(joint, clearance_m): &(usize, f32)| place[joint].y - clearance_m;
            let above: Vec<f32> = toes.iter().map(above).collect();
            self.sunk
                .push(f64::from(u8::from(above.iter().any(|&above| above < -SUNK_M))));
            let highest = above.into_iter().fold(0.0, f32::max);
            self.highest_m = self.highest_m.max(f64::from(highest));
        }
        for (nth, three) in places.windows(3).enumerate() {
            let joints = three[0].iter().zip(&three[1]).zip(&three[2]);
            let rate = f64::from(body.rig.fps * body.rig.fps);
            let bends = joints.map(|((a, b), c)| rate * f64::from((*a - *b * 2.0 + *c).length()));
            let bend = mean(&bends.collect::<Vec<f64>>());
            self.bends.push(bend);
            // The last frame before the seam.
            if seams.contains(&(nth + 2)) {
                self.seams.push(bend);
            }
        }
        let way = path.and_then(|points| GroundPath::new(points.to_vec()));
        if let Some(way) = way {
            for (frame, root) in track.roots.iter().enumerate() {
                let [x, z] = way.place(frame as f32 / body.rig.fps);
                self.off_m.push(f64::from((root.x - x).hypot(root.z - z)));
            }
        }
    }

    fn row(&self, body: &str, shape: &str, what: &str) -> Vec<String> {
        let or_none = |values: &[f64], scale: f64| match values.is_empty() {
            true => String::new(),
            false => format!("{:.1}", scale * mean(values)),
        };
        vec![
            body.to_owned(),
            shape.to_owned(),
            what.to_owned(),
            or_none(&self.standing_mm, 1.0),
            or_none(&self.sunk, 100.0),
            or_none(&self.bends, 1.0),
            or_none(&self.seams, 1.0),
            format!("{:.0}", 100.0 * self.highest_m),
            or_none(&self.off_m, 100.0),
        ]
    }
}

/// Contact joints without a contact joint below them, with the heights at which they stand.
fn toes(skeleton: &Skeleton) -> Vec<(usize, f32)> {
    let Some(contacts) = &skeleton.contacts else {
        return Vec::new();
    };
    let is_above = |joint: usize| {
        let up = |other: usize| {
            std::iter::successors(skeleton.joints[other].parent, |&at| skeleton.joints[at].parent)
        };
        contacts
            .joints
            .iter()
            .any(|&other| up(other).any(|at| at == joint))
    };
    let all = contacts
        .joints
        .iter()
        .copied()
        .zip(contacts.clearance_m.iter().copied());
    all.filter(|(joint, _)| !is_above(*joint)).collect()
}

fn positions(skeleton: &Skeleton, root: Vec3, pose: &[Quat]) -> Vec<Vec3> {
    let mut positions = vec![Vec3::ZERO; pose.len()];
    let mut turns = vec![Quat::IDENTITY; pose.len()];
    world_transforms(skeleton, root, pose, &mut positions, &mut turns);
    positions
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_captured_root_is_a_path_frame_by_frame() {
        let walks: Walks = serde_json::from_str(
            r#"{"roots": [[[0.5, 1.0, 0.1], [0.5, 1.1, 0.2]]], "standing_foot_mm": 1.3, "sunk_share": 0.0,
                "acceleration_mps2": 5.8, "highest_toe_m": 0.1}"#,
        )
        .unwrap();
        let path = Walks::path(&walks.roots[0]);
        let found = (path[1].time_s, path[1].place, path[1].heading);
        assert_eq!(found, (1.0 / 30.0, [0.5, 1.1], Some(0.2)));
        let row = walks.figures().row("human", "captured root", "captured");
        assert_eq!(row[3..], ["1.3", "0.0", "5.8", "", "10", ""]);
    }

    #[test]
    fn paths_keep_their_speed_and_turn() {
        for (shape, turned) in [("line", 0.0), ("arc", SECONDS * TURN_RAD_PER_S), ("S", 0.0)] {
            let points = points(shape, 1.2);
            let steps = points.windows(2).map(|pair| {
                let ([x, z], [to_x, to_z]) = (pair[0].place, pair[1].place);
                (to_x - x).hypot(to_z - z)
            });
            let way: f32 = steps.sum();
            let last = points[points.len() - 1];
            assert!((way - 1.2 * SECONDS).abs() < 1e-3, "{shape}: {way}");
            assert!((last.heading.unwrap() - turned).abs() < 1e-3, "{shape}");
        }
    }
}
