//! `troupe-eval bodies`: live characters of the bodies of a UniMoGen pack. A minute of commands,
//! then a path. Prints how smooth they are, how well they obey, and the time of a plan. Then users'
//! paths, raw and finished (`paths`).

use std::collections::BTreeMap;
use std::f32::consts::TAU;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail};
use clap::Args;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use troupe_character::Path;
use troupe_character::live::{
    Character, CharacterEvent, CharacterOptions, EventKind, FrameOut, Intent, LivePlan, PlanItem,
    PlanRequest, Start, finish_live, hold_plan,
};
use troupe_character::primitives::path::AskedPoint;
use troupe_character::primitives::{LocomotionCommand, PathCommand};
use troupe_character::style::{Style, StyleTable};
use troupe_engine::families::unimogen::UniMoGen;
use troupe_engine::onnx::{Growth, OnnxDenoiser, Runtime};
use troupe_engine::pack::Pack;
use troupe_motion::fk::world_transforms;
use troupe_motion::model::{Body, PathTask};
use troupe_motion::{GlobalRoot, Quat, Vec3};

use super::clock::{HasCharacter, Planned, Planner, tick};
use super::{one_thread, paths};
use crate::figures::{mean, percentile};

/// Frames between commands.
const COMMAND_FRAMES: usize = 90;
/// Frames at the end of a command in which its speed is measured.
const STEADY_FRAMES: usize = 30;
/// Frames of the path.
const PATH_FRAMES: usize = 900;
/// Frames from the start of a path until it is measured.
const LEAD_IN_FRAMES: usize = 60;
/// First frames of a plan, which are not measured: its context, and frames that are drawn to it.
const PINNED_FRAMES: usize = 12;
/// Radius of the path ÷ size of the body.
const RADIUS_SIZES: f32 = 2.5;

/// Measure live characters of the bodies of a UniMoGen pack.
///
/// Then their motion on users' paths: the network's own beside the finished.
#[derive(Debug, Args)]
pub(crate) struct Bodies {
    /// Folder of the pack.
    #[arg(long, default_value = "models/unimogen")]
    pack: PathBuf,
    /// Names of the bodies.
    #[arg(long, value_delimiter = ',', default_value = "human,g1,h1_2,horse")]
    bodies: Vec<String>,
    /// Style. A body without it moves in its default style.
    #[arg(long, default_value = "walk")]
    style: String,
    /// Seconds of commands.
    #[arg(long, default_value_t = 60)]
    seconds: usize,
    /// Frames between plans. Default: those of the style.
    #[arg(long)]
    interval: Option<u32>,
    /// Seed of characters and commands.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Roots of captured walks, to measure on them as well: `troupe-train unimogen roots` writes
    /// the file.
    #[arg(long)]
    roots: Option<PathBuf>,
}

pub(crate) fn run(options: &Bodies) -> anyhow::Result<()> {
    let pack = Pack::load(&options.pack)?;
    let denoiser = OnnxDenoiser::load(&Runtime::new(None)?, &pack, one_thread(Growth::None))?;
    let mut generator = UniMoGen::new(&pack, Box::new(denoiser), 1)?;
    let walks: BTreeMap<String, paths::Walks> = match &options.roots {
        Some(file) => {
            let text = std::fs::read(file).with_context(|| format!("--roots {}", file.display()))?;
            serde_json::from_slice(&text).with_context(|| format!("--roots {}", file.display()))?
        }
        None => BTreeMap::new(),
    };
    println!("joint acceleration in m/s²: mean and 99.9th percentile, live and inside of plans");
    for name in &options.bodies {
        let body = pack
            .body(name)
            .with_context(|| format!("--bodies: the pack has no body {name}"))?;
        Wander::new(&pack, body, &mut generator, options)?.run(options.seconds * 30)?;
        let style = style_of(&pack, body, &options.style)?;
        let walks = walks.get(name);
        paths::measure(&pack, body, &style, &mut generator, (walks, options.seed))?;
    }
    Ok(())
}

fn style_of(pack: &Pack, body: &Body, name: &str) -> anyhow::Result<Arc<Style>> {
    let styles = StyleTable::load(&body.rig, &pack.folder, None)?;
    let style = styles.get(name).or_else(|| styles.default_style());
    style.context("the body has no styles")
}

struct Wander<'a> {
    body: &'a Arc<Body>,
    style: Arc<Style>,
    walker: WanderingBody,
    planner: PathPlanner<'a>,
    rng: ChaCha8Rng,
    sequence: u64,
    frames: Vec<FrameOut>,
}

/// The character, and all of its plans.
pub(super) struct WanderingBody {
    pub(super) character: Character,
    pub(super) plans: Vec<LivePlan>,
}

impl HasCharacter for WanderingBody {
    fn character(&mut self) -> &mut Character {
        &mut self.character
    }

    fn planned(&mut self, _: &PlanRequest, plan: &Planned) {
        self.plans.extend(plan.clone());
    }
}

/// Plans by paths, made by UniMoGen.
pub(super) struct PathPlanner<'a> {
    pub(super) pack: &'a Pack,
    pub(super) body: &'a Arc<Body>,
    pub(super) generator: &'a mut UniMoGen,
    /// Whether feet that stand are held, as a server does.
    pub(super) holds_feet: bool,
    /// Time that the networks took so far.
    pub(super) took: Duration,
}

impl Planner for PathPlanner<'_> {
    fn plan(&mut self, asked: &[PlanRequest]) -> anyhow::Result<Vec<Planned>> {
        asked.iter().map(|request| self.plan_one(request)).collect()
    }
}

impl PathPlanner<'_> {
    fn plan_one(&mut self, request: &PlanRequest) -> anyhow::Result<Planned> {
        let PlanItem::Path(item) = &request.item else {
            bail!("the pack plans by keyframes")
        };
        let weight = |word: &String| {
            let given = item.words.iter().find(|(given, _)| given == word);
            given.map_or(0.0, |(_, weight)| *weight)
        };
        let steps = self.pack.sampler().map_or(1, |steps| steps.default);
        let task = PathTask {
            sways: true,
            body: self.body.clone(),
            style: self.pack.words.iter().map(weight).collect(),
            context: item.context.clone(),
            targets: Vec::new(),
            path: item.path.clone(),
            steps,
            guidance: 1.0,
            seed: item.seed,
        };
        let started = Instant::now();
        let mut made = self.generator.run(std::slice::from_ref(&task))?;
        self.took += started.elapsed();
        let raw = made.pop().context("the networks gave no motion")?;
        let rig = &self.body.rig;
        let mut plan = finish_live(&raw, &request.shape, rig)?;
        if self.holds_feet {
            hold_plan(rig, &mut plan);
        }
        Ok(Ok(plan))
    }
}

impl<'a> Wander<'a> {
    fn new(
        pack: &'a Pack,
        body: &'a Arc<Body>,
        generator: &'a mut UniMoGen,
        options: &Bodies,
    ) -> anyhow::Result<Self> {
        let style = style_of(pack, body, &options.style)?;
        let character = CharacterOptions {
            seed: options.seed,
            look_ahead_frames: 4,
            replan_interval_frames: options.interval,
            root_ratio: None,
            temperature: 0.0,
        };
        let start = Start::Standing(GlobalRoot::new(Vec3::ZERO, 0.0));
        let standing = LocomotionCommand::standing(&style);
        Ok(Self {
            walker: WanderingBody {
                character: Character::new(body.rig.clone(), character, start, standing),
                plans: Vec::new(),
            },
            planner: PathPlanner {
                pack,
                body,
                generator,
                holds_feet: true,
                took: Duration::ZERO,
            },
            body,
            style,
            rng: ChaCha8Rng::seed_from_u64(options.seed),
            sequence: 0,
            frames: Vec::new(),
        })
    }

    fn give(&mut self, intent: Intent) -> anyhow::Result<()> {
        self.sequence += 1;
        self.walker.character.give(self.sequence, None, intent)?;
        Ok(())
    }

    fn tick(&mut self) -> anyhow::Result<()> {
        tick(std::slice::from_mut(&mut self.walker), &mut self.planner)?;
        let mut out = FrameOut::default();
        self.walker.character.sample(&mut out);
        self.frames.push(out);
        Ok(())
    }

    fn run(&mut self, frames: usize) -> anyhow::Result<()> {
        let by_path = self
            .body
            .rig
            .by_path
            .as_ref()
            .context("the pack does not plan by paths")?;
        let (usual, size) = (by_path.usual_speed_mps, self.body.size_m);
        let (mut wanted, mut off) = (0.0, 0.0);
        for frame in 0..frames {
            if frame % COMMAND_FRAMES == 0 {
                let speed = usual * [0.0, 0.7, 1.0, 1.4][self.rng.random_range(0..4)];
                let way = self.rng.random_range(0.0..TAU);
                let velocity = Vec3::new(way.sin(), 0.0, way.cos()) * speed;
                self.give(Intent::Locomote(LocomotionCommand {
                    velocity,
                    ..LocomotionCommand::standing(&self.style)
                }))?;
                wanted = speed;
            }
            self.tick()?;
            if frame % COMMAND_FRAMES == COMMAND_FRAMES - 1 {
                let at = |back: usize| self.frames[self.frames.len() - back].root.with_y(0.0);
                let speed = at(1).distance(at(1 + STEADY_FRAMES)) / STEADY_FRAMES as f32 * 30.0;
                off += (speed - wanted).abs() * COMMAND_FRAMES as f32 / frames as f32;
            }
        }
        let live = accelerations(
            self.body,
            self.frames.iter().map(|frame| (frame.root, &frame.rotations[..])),
        );
        let mut inside = Vec::new();
        for plan in &self.walker.plans {
            let joints = self.body.joints();
            let poses = plan
                .roots
                .iter()
                .copied()
                .zip(plan.rotations.chunks_exact(joints));
            inside.extend(accelerations(self.body, poses.skip(PINNED_FRAMES)));
        }
        let ([mean, high], [mean_in, high_in]) = (figures(&live), figures(&inside));
        let plans = self.walker.plans.len();
        let each_ms = self.planner.took.as_secs_f64() * 1e3 / plans as f64;
        println!(
            "{:6} {:10} live {mean:6.2} {high:7.1}  plans {mean_in:6.2} {high_in:7.1}  ratio {:.2} {:.2}  speed off {off:.3} of {usual:.2} m/s  {plans} plans, {each_ms:.1} ms each",
            self.body.name,
            self.style.name,
            mean / mean_in,
            high / high_in,
        );
        self.follow(RADIUS_SIZES * size)
    }

    /// Follows a circle, then a line to its end.
    fn follow(&mut self, radius: f32) -> anyhow::Result<()> {
        let from = self.frames.last().context("no frames")?.root.with_y(0.0);
        let centre = from + Vec3::X * radius;
        let point = |position| AskedPoint {
            position,
            heading: None,
            time_s: None,
        };
        let around = |n: usize| {
            let angle = n as f32 / 12.0 * TAU;
            point(centre - Vec3::new(angle.cos(), 0.0, -angle.sin()) * radius)
        };
        let circle: Vec<AskedPoint> = (0..12).map(around).collect();
        let path = PathCommand::new(&Path::root(), &circle, None, true, self.style.clone())?;
        self.give(Intent::FollowPath(path))?;
        let first = self.frames.len();
        for _ in 0..PATH_FRAMES {
            self.tick()?;
        }
        let off = |frame: &FrameOut| (frame.root.with_y(0.0).distance(centre) - radius).abs();
        let offs: Vec<f32> = self.frames[first + LEAD_IN_FRAMES..].iter().map(off).collect();
        let mean = offs.iter().sum::<f32>() / offs.len() as f32;
        let most = offs.iter().copied().fold(0.0, f32::max);
        let way: f32 = (self.frames[first + LEAD_IN_FRAMES..].windows(30).step_by(30))
            .map(|second| second[0].root.distance(second[29].root) / 29.0 * 30.0)
            .sum::<f32>()
            / (offs.len() / 30) as f32;

        let here = self.frames.last().context("no frames")?.root.with_y(0.0);
        let line = [here, here + Vec3::Z * radius, here + Vec3::Z * 2.0 * radius].map(point);
        let path = PathCommand::new(&Path::root(), &line, None, false, self.style.clone())?;
        self.give(Intent::FollowPath(path))?;
        let mut events: Vec<CharacterEvent> = Vec::new();
        for _ in 0..PATH_FRAMES {
            self.tick()?;
            self.walker.character.take_events(&mut events);
            if !events.is_empty() {
                break;
            }
        }
        let arrived = match events.first().map(|event| &event.kind) {
            Some(EventKind::Arrived { late_s, off_m }) => format!("{late_s:.2} s late, {off_m:.3} m off"),
            _ => "never".to_owned(),
        };
        println!(
            "       circle of {radius:.1} m: off by {mean:.3} m, at most {most:.3} m, at {way:.2} m/s; a line: arrives {arrived}"
        );
        Ok(())
    }
}

/// Accelerations of all joints in all frames, m/s².
fn accelerations<'f>(body: &Body, frames: impl Iterator<Item = (Vec3, &'f [Quat])>) -> Vec<f64> {
    let skeleton = &body.rig.skeleton;
    let positions = |(root, pose): (Vec3, &[Quat])| {
        let (mut positions, mut turns) = (vec![Vec3::ZERO; pose.len()], vec![Quat::IDENTITY; pose.len()]);
        world_transforms(skeleton, root, pose, &mut positions, &mut turns);
        positions
    };
    let frames: Vec<Vec<Vec3>> = frames.map(positions).collect();
    let each = frames.windows(3).flat_map(|three| {
        let joints = three[0].iter().zip(&three[1]).zip(&three[2]);
        joints.map(|((a, b), c)| f64::from((*a - *b * 2.0 + *c).length() * 900.0))
    });
    each.collect()
}

/// Mean and 99.9th percentile.
fn figures(values: &[f64]) -> [f64; 2] {
    [mean(values), percentile(values, 0.999)]
}
