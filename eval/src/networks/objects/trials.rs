//! The trials: where a character starts, how it moves, and when it gets the command to use the
//! object.

use std::f32::consts::{PI, TAU};
use std::sync::Arc;

use anyhow::{Context as _, ensure};
use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use troupe_character::style::{Style, StyleTable};
use troupe_motion::{GlobalRoot, Vec3};

/// Directions that the same approach is made from.
pub const DIRECTIONS: usize = 12;
/// Distance from the object at which characters start, metres.
const START_M: (f32, f32) = (2.5, 6.0);
/// Frames after which a command breaks an interaction off: on the way, in the first set, or later.
const BROKEN_OFF_FRAMES: (u64, u64) = (10, 240);
/// Frames that characters move before the command to use the object.
const MOVE_FRAMES: (u64, u64) = (20, 60);

/// What all trials have in common.
pub struct TrialPlan {
    /// Styles to choose from.
    pub styles: Vec<Arc<Style>>,
    /// Seed of all choices.
    pub seed: u64,
}

/// One trial.
#[derive(Clone)]
pub struct Spec {
    /// Seed of the character.
    pub seed: u64,
    /// Which way the object faces, radians.
    pub object_heading: f32,
    /// Height at which the object stands, metres.
    pub object_height_m: f32,
    /// Where the character starts, as seen from the object at the origin.
    pub start: GlobalRoot,
    /// How it moves at first, m/s over the ground.
    pub velocity: Vec3,
    /// The style it moves in.
    pub style: Arc<Style>,
    /// The frame of the command to use the object.
    pub command_at: u64,
    /// Which of [`DIRECTIONS`] it comes from, in trials by direction.
    pub direction: Option<usize>,
    /// A command that breaks the interaction off: frames after the first command, and velocity over
    /// the ground, m/s.
    pub broken_off: Option<(u64, Vec3)>,
}

/// The styles that walk, or those of these names.
pub fn walking(table: &StyleTable, names: &[String]) -> anyhow::Result<Vec<Arc<Style>>> {
    let styles = match names.is_empty() {
        true => table
            .list()
            .into_iter()
            .filter(|style| !style.is_static)
            .collect(),
        false => names
            .iter()
            .map(|name| {
                table
                    .get(name)
                    .with_context(|| format!("--styles: the pack has no style {name:?}"))
            })
            .collect::<anyhow::Result<Vec<_>>>()?,
    };
    ensure!(!styles.is_empty(), "the pack has no style that walks");
    Ok(styles)
}

/// Approaches from any distance, direction, speed and style.
pub fn approaches(plan: &TrialPlan, count: usize, object_height_m: f32) -> Vec<Spec> {
    let one = |index| {
        let mut rng = generator(plan.seed, index);
        let bearing = rng.random_range(-PI..PI);
        spec(plan, &mut rng, bearing, object_height_m)
    };
    (0..count as u64).map(one).collect()
}

/// The same approaches from each direction. Those of one number differ in nothing else.
pub fn directions(plan: &TrialPlan, each: usize, object_height_m: f32) -> Vec<Spec> {
    let one = |index: usize| {
        let (number, direction) = (index / DIRECTIONS, index % DIRECTIONS);
        let mut rng = generator(plan.seed ^ 0x5eed, number as u64);
        let turn = TAU * direction as f32 / DIRECTIONS as f32;
        let mut spec = spec(plan, &mut rng, 0.0, object_height_m);
        // The object turns under the character, so that nothing else differs.
        spec.object_heading = -turn;
        spec.direction = Some(direction);
        spec
    };
    (0..each * DIRECTIONS).map(one).collect()
}

/// Approaches that a command to go elsewhere breaks off at a random moment.
pub fn broken_off(plan: &TrialPlan, count: usize, object_height_m: f32) -> Vec<Spec> {
    let one = |(index, mut spec): (usize, Spec)| {
        let mut rng = generator(plan.seed ^ 0xb0ff, index as u64);
        let angle = rng.random_range(-PI..PI);
        let way = Vec3::new(angle.sin(), 0.0, angle.cos());
        let after = rng.random_range(BROKEN_OFF_FRAMES.0..BROKEN_OFF_FRAMES.1);
        spec.broken_off = Some((after, way * spec.style.default_speed_mps));
        spec
    };
    let specs = approaches(plan, count, object_height_m);
    specs.into_iter().enumerate().map(one).collect()
}

fn generator(seed: u64, index: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(index);
    rng
}

fn spec(plan: &TrialPlan, rng: &mut ChaCha8Rng, bearing: f32, object_height_m: f32) -> Spec {
    let distance = rng.random_range(START_M.0..START_M.1);
    let style = plan.styles[rng.random_range(0..plan.styles.len())].clone();
    let fastest = style
        .gaits
        .iter()
        .map(|gait| gait.forward_mps)
        .fold(style.default_speed_mps, f32::max);
    // One in five stands, the others go in any direction.
    let speed = match rng.random_range(0..5) {
        0 => 0.0,
        _ => rng.random_range(0.3..fastest.max(0.4)),
    };
    let along = |angle: f32| Vec3::new(angle.sin(), 0.0, angle.cos());
    Spec {
        seed: rng.next_u64(),
        object_heading: rng.random_range(-PI..PI),
        object_height_m,
        start: GlobalRoot::new(along(bearing) * distance, rng.random_range(-PI..PI)),
        velocity: along(rng.random_range(-PI..PI)) * speed,
        style,
        command_at: rng.random_range(MOVE_FRAMES.0..MOVE_FRAMES.1),
        direction: None,
        broken_off: None,
    }
}
