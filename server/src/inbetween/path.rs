//! Paths to follow: from a request to the windows of a motion of any length, one after another.

mod strict;

use std::sync::Arc;

use troupe_character::keyframe::{Checked, KeyWriter};
use troupe_character::post::{parent_relative, roots, to_world_rotations};
use troupe_character::{FieldError, Path};
use troupe_engine::pack::Pack;
use troupe_motion::interpolate::smoothstep;
use troupe_motion::model::{Body, Dims, GLOBAL_ROOT, Motion, PathTask, SIX_D};
use troupe_motion::path::{GroundPath, PathPoint, distance};
use troupe_motion::root::wrap_angle;
use troupe_motion::{GlobalRoot, SegmentFrame, Vec3};
use troupe_proto::v1;

use super::body::inline_body;
use super::prepare::check_keyframes;
use troupe_live::wire::keyframe::Role;
use troupe_live::wire::{MAX_DISTANCE_M, units};

/// Most points of a path.
pub const MAX_PATH_POINTS: usize = 10_000;
/// Longest motion, seconds.
const MAX_SECONDS: f32 = 300.0;
/// Slowest and fastest way over the ground, metres a second.
const SPEEDS_MPS: [f32; 2] = [0.05, 15.0];
/// Paths that are faster than so many sizes of a body a second, or turn faster than so many
/// radians, have a note.
const NOTED_SPEED: f32 = 5.0;
const NOTED_TURN_RAD_PER_S: f32 = 4.0;
/// Farthest that a given pose may be from the path, metres.
const MAX_OFF_M: f32 = 5.0;
/// Time over which a motion leads over from a given pose to the path, and from there to one,
/// seconds.
const LEAD_S: f32 = 0.5;
/// Usual speed of a walk, sizes of the body a second.
const WALK: f32 = 1.4;
/// Largest guidance.
const MAX_GUIDANCE: f32 = 8.0;
/// Most words that an error lists.
const MAX_LISTED: usize = 32;

/// A motion along a path, on its way: what is done of it, and what comes next.
#[derive(Debug)]
pub struct PathPlan {
    /// What moves.
    pub body: Arc<Body>,
    /// What the model was asked for that it may not do well.
    pub notes: Vec<String>,
    dims: Dims,
    /// World x, z and heading of every frame, those of the past included.
    path: Vec<[f32; 3]>,
    /// The last frames that there are: the past, then those of the windows that are done. None or
    /// as many as the context.
    last: Vec<Checked>,
    targets: Vec<Checked>,
    style: Vec<f32>,
    steps: u32,
    guidance: f32,
    seed: u64,
    windows: Vec<Window>,
    done: usize,
}

/// A call of the model: frames of the path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Window {
    /// The first frame that it makes.
    start: usize,
    /// How many it makes.
    fresh: usize,
    /// Frames of the call, those before `start` and behind the path included.
    frames: usize,
}

impl PathPlan {
    /// Checks a path and what is to follow it. `past` is checked already.
    ///
    /// # Errors
    /// [`FieldError`] for the first value that is not accepted.
    pub fn new(
        goal: &v1::PathGoal,
        past: &[v1::Keyframe],
        seed: u64,
        pack: &Pack,
    ) -> Result<Self, FieldError> {
        let root = Path::root();
        let path = root.field("path");
        let dims = pack.rig.dims;
        let body = body(&path, goal, pack)?;
        strict::check(&path, goal, &body)?;
        let context = dims.context_frames;
        if !past.is_empty() && past.len() != context {
            let message = format!("has {} keyframes", past.len());
            let allowed = format!("none, or exactly {context}");
            return Err(root.field("past").error(message, allowed));
        }
        let last = check_keyframes(&root, "past", past, Role::Context, &body.rig)?;
        units::length(&path.field("targets"), goal.targets.len(), 0, dims.max_targets)?;
        let targets = check_keyframes(&path, "targets", &goal.targets, Role::Context, &body.rig)?;
        let (points, wanted_s) = points(&path, goal, body.size_m)?;
        let fps = body.rig.fps;
        let mut fresh = (wanted_s * fps).round().max(1.0) as usize;
        // The first frame is the path's begin, unless that is the last one of the past.
        fresh += usize::from(last.is_empty());
        let mut notes = Vec::new();
        if !targets.is_empty() {
            // The last window ends with them, and windows are of whole tokens.
            let unit = dims.frames_per_token;
            fresh = fresh.next_multiple_of(unit).max(dims.min_frames() - last.len());
        }
        let start_s = if last.is_empty() { 0.0 } else { 1.0 / fps };
        let mut frames = points.frames(start_s, fps, fresh);
        check_speed(&path, &points, &frames, fps)?;
        note_speed(&body, &frames, fps, &mut notes);
        lead_over(&root, &path, &mut frames, &last, &targets, fps)?;
        let lead = last.iter().filter_map(|key| key.root).map(flat);
        let path_frames: Vec<[f32; 3]> = lead.chain(frames).collect();
        let steps = steps(&path, goal, pack)?;
        let guidance = goal.guidance.unwrap_or(1.0);
        Ok(Self {
            windows: windows(last.len(), fresh, &dims, !targets.is_empty()),
            style: style(&path, goal, pack, &body, &mut notes)?,
            guidance: units::within(&path.field("guidance"), guidance, 0.0, MAX_GUIDANCE)?,
            body,
            notes,
            dims,
            path: path_frames,
            last,
            targets,
            steps,
            seed,
            done: 0,
        })
    }

    /// What the model is to make next, and where its segment lies; none where all is done.
    pub fn next(&self) -> Option<(PathTask, SegmentFrame)> {
        let window = self.windows.get(self.done)?;
        let context = self.last.len();
        let from = window.start - context;
        let last = self.path.len() - 1;
        let world: Vec<[f32; 3]> = (from..from + window.frames)
            .map(|frame| self.path[frame.min(last)])
            .collect();
        let frame = match self.last.last().and_then(|key| key.root) {
            Some(root) => SegmentFrame::from_root(root),
            None => SegmentFrame::from_root(lift(world[0])),
        };
        let mut writer = KeyWriter::new(&self.body.rig.skeleton, self.body.rig.fps);
        let is_last = self.done + 1 == self.windows.len();
        let targets = if is_last { &*self.targets } else { &[] };
        let task = PathTask {
            body: self.body.clone(),
            context: writer.write(&frame, &self.last),
            targets: writer.write(&frame, targets),
            path: world
                .into_iter()
                .map(|point| flat(frame.to_segment_root(lift(point))))
                .collect(),
            style: self.style.clone(),
            steps: self.steps,
            guidance: self.guidance,
            // Each window has its own noise.
            seed: self.seed.wrapping_add(self.done as u64),
        };
        Some((task, frame))
    }

    /// Takes what the model made of [`next`](Self::next); gives the frames of it that are new, and
    /// whether they are the last.
    pub fn take(&mut self, motion: &Motion, frame: &SegmentFrame) -> (Motion, bool) {
        let (rig, context) = (&self.body.rig, self.dims.context_frames);
        let Some(window) = self.windows.get(self.done) else {
            return (Motion::default(), true);
        };
        let from = self.last.len();
        let fresh = part(motion, from, window.fresh, &rig.dims);
        self.done += 1;
        let is_last = self.done == self.windows.len();
        if !is_last {
            // The network's own frames: what hinges make of them is for those who look.
            let tail = part(motion, from + window.fresh - context, context, &rig.dims);
            let joints = rig.dims.joints;
            let mut rotations = parent_relative(&tail, context, &rig.dims, &rig.skeleton);
            to_world_rotations(frame, joints, &mut rotations);
            let keys = roots(&tail.root).zip(rotations.chunks_exact(joints));
            self.last = keys
                .map(|(root, pose)| {
                    let root = frame.to_world_root(root);
                    Checked::of(Some(root), None, None, Some(pose.to_vec()))
                })
                .collect();
        }
        (fresh, is_last)
    }
}

/// A root on the ground.
fn lift([x, z, heading]: [f32; 3]) -> GlobalRoot {
    GlobalRoot::new(Vec3::new(x, 0.0, z), heading)
}

/// World x, z and heading of a root.
fn flat(root: GlobalRoot) -> [f32; 3] {
    [root.position.x, root.position.z, root.heading]
}

/// Some frames of a motion.
fn part(motion: &Motion, from: usize, count: usize, dims: &Dims) -> Motion {
    let cut = |values: &[f32], width: usize| values[from * width..(from + count) * width].to_vec();
    Motion {
        root: cut(&motion.root, GLOBAL_ROOT),
        rotations: cut(&motion.rotations, dims.joints * SIX_D),
        contacts: cut(&motion.contacts, dims.contacts),
        trace: None,
    }
}

/// The windows of a motion of `fresh` frames behind `past` ones. Where it ends in targets the last
/// window ends with it.
fn windows(past: usize, fresh: usize, dims: &Dims, ends_in_targets: bool) -> Vec<Window> {
    let (context, most) = (dims.context_frames, dims.max_frames());
    let mut windows = Vec::new();
    let (mut start, mut left) = (past, fresh);
    while left > 0 {
        let before = if start == 0 { 0 } else { context };
        let mut fresh = left.min(most - before);
        let rest = left - fresh;
        let least = dims.min_frames() - context;
        if ends_in_targets && rest > 0 && rest < least {
            fresh -= least - rest;
        }
        let frames = (before + fresh).next_multiple_of(dims.frames_per_token);
        windows.push(Window {
            start,
            fresh,
            frames: frames.clamp(dims.min_frames(), most),
        });
        start += fresh;
        left -= fresh;
    }
    windows
}

fn body(path: &Path<'_>, goal: &v1::PathGoal, pack: &Pack) -> Result<Arc<Body>, FieldError> {
    let field = path.field("body");
    match &goal.skeleton {
        Some(_) if !goal.body.is_empty() => {
            Err(field.error("is given beside a skeleton", "only one of the two"))
        }
        Some(skeleton) => inline_body(&path.field("skeleton"), skeleton, pack).map(Arc::new),
        None => pack.body(&goal.body).cloned().ok_or_else(|| {
            let names: Vec<&str> = pack.bodies.iter().map(|body| &*body.name).collect();
            field.error(format!("is {:?}", cut(&goal.body)), names.join(", "))
        }),
    }
}

fn cut(name: &str) -> String {
    name.chars().take(64).collect()
}

/// The path, and how long the motion along it is, seconds.
fn points(path: &Path<'_>, goal: &v1::PathGoal, size_m: f32) -> Result<(GroundPath, f32), FieldError> {
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
        .map(|speed| units::within(&path.field("speed"), speed, least, most));
    let speed = speed.transpose()?;
    let mut points = Vec::with_capacity(count);
    for (index, point) in goal.points.iter().enumerate() {
        points.push(self::point(&path.element("points", index), point)?);
    }
    let timed = goal.points.iter().filter(|point| point.time.is_some()).count();
    if timed == 0 {
        let places: Vec<[f32; 2]> = points.iter().map(|point| point.place).collect();
        let way: f32 = places.windows(2).map(|pair| distance(pair[0], pair[1])).sum();
        let usual = seconds.map_or((WALK * size_m).clamp(least, most), |seconds| {
            (way / seconds).max(least)
        });
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
        units::within(&position.field(axis), value, -MAX_DISTANCE_M, MAX_DISTANCE_M)?;
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

/// Nothing alive is that fast.
fn check_speed(
    path: &Path<'_>,
    points: &GroundPath,
    frames: &[[f32; 3]],
    fps: f32,
) -> Result<(), FieldError> {
    let [_, most] = SPEEDS_MPS;
    let speeds = frames.windows(2).map(|pair| speed(pair, fps));
    match speeds.enumerate().find(|(_, speed)| *speed > most) {
        None => Ok(()),
        Some((frame, speed)) => {
            let index = points.point_after((frame + 1) as f32 / fps);
            let message = format!("is reached at {speed:.1} m/s");
            Err(path
                .element("points", index)
                .error(message, format!("at most {most} m/s")))
        }
    }
}

fn speed(pair: &[[f32; 3]], fps: f32) -> f32 {
    let [[ax, az, _], [bx, bz, _]] = [pair[0], pair[1]];
    distance([ax, az], [bx, bz]) * fps
}

fn note_speed(body: &Body, frames: &[[f32; 3]], fps: f32, notes: &mut Vec<String>) {
    let fastest = frames.windows(2).map(|pair| speed(pair, fps)).fold(0.0, f32::max);
    if fastest > NOTED_SPEED * body.size_m {
        notes.push(format!(
            "the path is up to {fastest:.1} m/s fast, more than clips of a body of {:.1} m show: poses may not be such as it takes",
            body.size_m
        ));
    }
    let turns = frames
        .windows(2)
        .map(|pair| wrap_angle(pair[1][2] - pair[0][2]).abs() * fps);
    let turn = turns.fold(0.0, f32::max);
    if turn > NOTED_TURN_RAD_PER_S {
        notes.push(format!(
            "the path turns at up to {turn:.1} rad/s, more than clips show"
        ));
    }
}

/// Bends the path so that it begins at the past, and ends at the targets.
fn lead_over(
    root: &Path<'_>,
    path: &Path<'_>,
    frames: &mut [[f32; 3]],
    past: &[Checked],
    targets: &[Checked],
    fps: f32,
) -> Result<(), FieldError> {
    let lead = LEAD_S * fps;
    if let Some(from) = past.last().and_then(|key| key.root).map(flat) {
        let off = offset(from, frames[0]);
        near(&root.element("past", past.len() - 1), "begin", off)?;
        for (frame, point) in frames.iter_mut().enumerate() {
            shift(point, off, 1.0 - smoothstep((frame as f32 / lead).min(1.0)));
        }
    }
    let (count, first) = (frames.len(), frames.len().saturating_sub(targets.len()));
    if let Some(to) = targets.first().and_then(|key| key.root).map(flat) {
        let off = offset(to, frames[first]);
        near(&path.element("targets", 0), "end", off)?;
        for (frame, point) in frames[..first].iter_mut().enumerate() {
            shift(
                point,
                off,
                1.0 - smoothstep(((first - frame) as f32 / lead).min(1.0)),
            );
        }
    }
    let given = targets.iter().filter_map(|key| key.root).map(flat);
    frames[first..count]
        .iter_mut()
        .zip(given)
        .for_each(|(point, given)| *point = given);
    Ok(())
}

/// From a point of the path to where it should be.
fn offset(to: [f32; 3], from: [f32; 3]) -> [f32; 3] {
    [to[0] - from[0], to[1] - from[1], wrap_angle(to[2] - from[2])]
}

fn shift(point: &mut [f32; 3], off: [f32; 3], share: f32) {
    for (value, off) in point.iter_mut().zip(off) {
        *value += share * off;
    }
}

fn near(path: &Path<'_>, end: &str, off: [f32; 3]) -> Result<(), FieldError> {
    let way = off[0].hypot(off[1]);
    match way <= MAX_OFF_M {
        true => Ok(()),
        false => {
            let message = format!("is {way:.1} m from the path's {end}");
            Err(path
                .field("root")
                .field("position")
                .error(message, format!("at most {MAX_OFF_M} m")))
        }
    }
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
