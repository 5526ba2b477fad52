//! Paths to follow: from a request to the windows of a motion of any length.

mod strict;
mod walk;

use std::sync::Arc;

use troupe_character::keyframe::Checked;
use troupe_character::take::{PathPlan, PathRequest};
use troupe_character::{FieldError, Path};
use troupe_engine::pack::Pack;
use troupe_motion::model::{Body, Dims, Rig};
use troupe_motion::path::{GroundPath, PathPoint, distance};
use troupe_proto::v1;

use super::prepare::check_keyframes;
use troupe_live::wire::keyframe::Role;
use troupe_live::wire::{MAX_DISTANCE_M, inline_body, units};

pub use strict::{path_judge, refuse_path, refuse_walk, walk_judge};
pub use walk::{MAX_PATH_KEYFRAMES, Walking, prepare_walk};

/// Most points of a path.
pub const MAX_PATH_POINTS: usize = 10_000;
/// Longest motion, seconds.
const MAX_SECONDS: f32 = 300.0;
/// Slowest and fastest speed over the ground, metres per second.
const SPEEDS_MPS: [f32; 2] = [0.05, 15.0];
/// Usual walking speed, body sizes per second.
const WALK: f32 = 1.4;
/// Largest weight of the guidance.
const MAX_GUIDANCE: f32 = 8.0;
/// Most words that an error lists.
const MAX_LISTED: usize = 32;

/// Checks a path and the frames before it, for a pack whose network takes paths. `root` is the
/// request, for errors.
///
/// # Errors
/// [`FieldError`] for the first value that is not accepted.
pub fn prepare_path(
    root: &Path<'_>,
    goal: &v1::PathGoal,
    past: &[v1::Keyframe],
    seed: u64,
    pack: &Pack,
) -> Result<PathPlan, FieldError> {
    let path = root.field("path");
    let mut notes = Vec::new();
    let body = body(&path, goal, pack, &mut notes)?;
    strict::check(&path, goal, &body.name, &body.rig)?;
    if !goal.keyframes.is_empty() {
        let allowed = format!("none: the network of the pack {} takes none", pack.name());
        return Err(path.field("keyframes").error("is given", allowed));
    }
    let [past, targets] = check_ends(root, goal, past, &body.rig)?;
    let (points, seconds) = points(&path, goal, WALK * body.size_m)?;
    let guidance = goal.guidance.unwrap_or(1.0);
    let request = PathRequest {
        shows_steps: points.shows_steps(),
        points,
        seconds,
        past,
        targets,
        style: style(&path, goal, pack, &body, &mut notes)?,
        steps: steps(&path, goal, pack)?,
        guidance: units::within(&path.field("guidance"), guidance, 0.0, MAX_GUIDANCE)?,
        seed,
        body,
    };
    let mut plan = PathPlan::new(root, request)?;
    plan.notes.extend(notes);
    Ok(plan)
}

/// Checks the frames before the path, and those at its end.
fn check_ends(
    root: &Path<'_>,
    goal: &v1::PathGoal,
    past: &[v1::Keyframe],
    rig: &Rig,
) -> Result<[Vec<Checked>; 2], FieldError> {
    let path = root.field("path");
    check_end_counts(root, goal, past.len(), &rig.dims)?;
    let past = check_keyframes(root, "past", past, Role::Context, rig)?;
    let targets = check_keyframes(&path, "targets", &goal.targets, Role::Context, rig)?;
    Ok([past, targets])
}

/// Checks how many frames there are before the path, and at its end.
pub(super) fn check_end_counts(
    root: &Path<'_>,
    goal: &v1::PathGoal,
    past: usize,
    dims: &Dims,
) -> Result<(), FieldError> {
    let context = dims.context_frames;
    if past > 0 && past != context {
        let allowed = format!("none, or exactly {context}");
        return Err(root.field("past").error(format!("has {past} keyframes"), allowed));
    }
    let path = root.field("path");
    units::length(&path.field("targets"), goal.targets.len(), 0, dims.max_targets)
}

fn body(
    path: &Path<'_>,
    goal: &v1::PathGoal,
    pack: &Pack,
    notes: &mut Vec<String>,
) -> Result<Arc<Body>, FieldError> {
    let field = path.field("body");
    match &goal.skeleton {
        Some(_) if !goal.body.is_empty() => {
            Err(field.error("is given beside a skeleton", "only one of the two"))
        }
        Some(skeleton) => {
            let mut body = inline_body(&path.field("skeleton"), skeleton, &pack.rig, notes)?;
            if let Some(like) = pack.body("") {
                body.sway_like(like);
            }
            Ok(Arc::new(body))
        }
        None => pack.body(&goal.body).cloned().ok_or_else(|| {
            let names: Vec<&str> = pack.bodies.iter().map(|body| &*body.name).collect();
            field.error(format!("is {:?}", cut(&goal.body)), names.join(", "))
        }),
    }
}

fn cut(name: &str) -> String {
    name.chars().take(64).collect()
}

/// The path, and the duration of the motion along it, seconds. Points without times are passed at
/// about `usual_mps`.
fn points(path: &Path<'_>, goal: &v1::PathGoal, usual_mps: f32) -> Result<(GroundPath, f32), FieldError> {
    let count = goal.points.len();
    units::length(&path.field("points"), count, 1, MAX_PATH_POINTS)?;
    let seconds = goal.seconds.map(|seconds| {
        let field = path.field("seconds");
        match seconds > 0.0 && seconds <= MAX_SECONDS {
            true => Ok(seconds),
            false => Err(field.error(format!("is {seconds}"), format!("above 0, at most {MAX_SECONDS}"))),
        }
    });
    let seconds = seconds.transpose()?;
    let [least, most] = SPEEDS_MPS;
    let speed = goal
        .speed
        .map(|speed| units::metres_within(&path.field("speed"), speed, least, most));
    let speed = speed.transpose()?;
    let mut points = Vec::with_capacity(count);
    for (index, point) in goal.points.iter().enumerate() {
        points.push(self::point(&path.element("points", index), point)?);
    }
    let timed = goal.points.iter().filter(|point| point.time.is_some()).count();
    if timed == 0 {
        let places: Vec<[f32; 2]> = points.iter().map(|point| point.place).collect();
        let way: f32 = places.windows(2).map(|pair| distance(pair[0], pair[1])).sum();
        let usual = seconds.map_or(usual_mps.clamp(least, most), |seconds| (way / seconds).max(least));
        let times = GroundPath::times_at(&places, speed.unwrap_or(usual));
        points
            .iter_mut()
            .zip(times)
            .for_each(|(point, time_s)| point.time_s = time_s);
    } else if let Some(index) = goal.points.iter().position(|point| point.time.is_none()) {
        let field = path.element("points", index);
        return Err(field
            .field("time")
            .error("is missing", "a time in every point, or in none"));
    } else if speed.is_some() {
        return Err(path
            .field("speed")
            .error("is given beside times", "only one of the two"));
    }
    if let Some(index) = points
        .windows(2)
        .position(|pair| pair[0].time_s >= pair[1].time_s)
    {
        let field = path.element("points", index + 1);
        let message = format!("is {}", points[index + 1].time_s);
        let allowed = format!("more than {}, that of the point before", points[index].time_s);
        return Err(field.field("time").error(message, allowed));
    }
    let whole =
        GroundPath::new(points).ok_or_else(|| path.field("points").error("has no order", "growing times"))?;
    let length = seconds.unwrap_or(whole.end_s());
    match length > 0.0 && length <= MAX_SECONDS {
        true => Ok((whole, length)),
        false if seconds.is_none() && length <= 0.0 => Err(path
            .field("seconds")
            .error("is missing", "the length of a path of one point")),
        false => {
            let message = format!("has a path of {length:.1} s");
            Err(path
                .field("points")
                .error(message, format!("at most {MAX_SECONDS} s; or say seconds")))
        }
    }
}

fn point(path: &Path<'_>, point: &v1::PathPoint) -> Result<PathPoint, FieldError> {
    let position = path.field("position");
    let Some(v1::Vec3 { x, z, .. }) = point.position else {
        return Err(position.error("is missing", "x and z in metres"));
    };
    for (axis, value) in [("x", x), ("z", z)] {
        units::metres_within(&position.field(axis), value, -MAX_DISTANCE_M, MAX_DISTANCE_M)?;
    }
    let heading = point
        .heading
        .map(|heading| units::within(&path.field("heading"), heading, -1000.0, 1000.0));
    let time = point
        .time
        .map(|time| units::within(&path.field("time"), time, 0.0, 1e6));
    Ok(PathPoint {
        time_s: time.transpose()?.unwrap_or(0.0),
        place: [x, z],
        heading: heading.transpose()?,
    })
}

fn steps(path: &Path<'_>, goal: &v1::PathGoal, pack: &Pack) -> Result<u32, FieldError> {
    let (usual, most) = pack.sampler().map_or((1, 1), |steps| (steps.default, steps.max));
    units::count_within(&path.field("steps"), goal.steps.unwrap_or(usual), 1, most)
}

/// A weight for each word of the pack.
fn style(
    path: &Path<'_>,
    goal: &v1::PathGoal,
    pack: &Pack,
    body: &Body,
    notes: &mut Vec<String>,
) -> Result<Vec<f32>, FieldError> {
    let mut weights = vec![0.0; pack.words.len()];
    let known = if body.words.is_empty() {
        &pack.words
    } else {
        &body.words
    };
    for (place, v1::StyleWord { word, weight }) in goal.style.iter().enumerate() {
        let field = path.element("style", place);
        let Some(index) = pack.words.iter().position(|other| other == word) else {
            let listed: Vec<&str> = known.iter().take(MAX_LISTED).map(|word| &**word).collect();
            let more = if known.len() > MAX_LISTED {
                ", and more"
            } else {
                ""
            };
            let allowed = format!("{}{more}", listed.join(", "));
            return Err(field.field("word").error(format!("is {:?}", cut(word)), allowed));
        };
        if weights[index] > 0.0 {
            return Err(field
                .field("word")
                .error(format!("is {word:?} again"), "each word once"));
        }
        weights[index] = units::within(&field.field("weight"), weight.unwrap_or(1.0), 0.0, 1.0)?;
        if !known.contains(word) {
            notes.push(format!("no clip of {} shows {word}", body.name));
        }
    }
    let sum: f32 = weights.iter().sum();
    match sum <= 1.001 {
        true => Ok(weights),
        false => Err(path
            .field("style")
            .error(format!("has weights of {sum} in all"), "at most 1 in all")),
    }
}

#[cfg(test)]
#[path = "path_tests.rs"]
mod tests;
