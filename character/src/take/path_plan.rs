//! A motion along a path, for a network that follows paths: one window after another.

use std::sync::Arc;

use troupe_motion::interpolate::smoothstep;
use troupe_motion::model::{Body, Dims, GLOBAL_ROOT, Motion, PathTask, SIX_D};
use troupe_motion::path::{GroundPath, distance};
use troupe_motion::root::wrap_angle;
use troupe_motion::{GlobalRoot, SegmentFrame, Vec3};

use crate::keyframe::{Checked, KeyWriter};
use crate::post::{parent_relative, roots, to_world_rotations};
use crate::{FieldError, Path};

/// Fastest speed over the ground, metres a second.
const MAX_SPEED_MPS: f32 = 15.0;
/// A faster path gets a note, body sizes a second.
const NOTED_SPEED: f32 = 5.0;
/// A path that turns faster gets a note, radians a second.
const NOTED_TURN_RAD_PER_S: f32 = 4.0;
/// Farthest that a given pose may be from the path, metres.
const MAX_OFF_M: f32 = 5.0;
/// Duration of the transition from a given pose to the path, and from the path to a given pose,
/// seconds.
pub(super) const LEAD_S: f32 = 0.5;
/// Slower paths stand, metres a second.
const STANDS_MPS: f32 = 0.1;
/// The speed of a walking root differs by more than this share from its mean over a second, in half
/// of the frames or more.
const UNEVEN: f32 = 0.015;
/// It crosses that mean twice a step: more than this many times a second.
const CHANGES_PER_S: f32 = 1.5;
/// Note of a path that counts as a recorded root.
const RECORDED: &str =
    "the path's speed changes with each step: it is taken for a recorded root, and gets no sway of its own";

/// A checked path, with the options of the sampler.
#[derive(Debug, Clone)]
pub struct PathRequest {
    /// The body that moves.
    pub body: Arc<Body>,
    /// Positions and their times. Time 0 is the first frame, or the last one of `past`.
    pub points: GroundPath,
    /// Whether the path was given with enough points to be a recorded root.
    pub shows_steps: bool,
    /// Length of the motion in seconds, above 0.
    pub seconds: f32,
    /// Frames before the motion, each with root and pose: none, or as many as the context.
    pub past: Vec<Checked>,
    /// The last frames of the motion, each with root and pose: at most the body's `max_targets`.
    pub targets: Vec<Checked>,
    /// A weight for each word of the network.
    pub style: Vec<f32>,
    /// Steps of the network's sampler.
    pub steps: u32,
    /// Strength of the style; 1 is that of the training.
    pub guidance: f32,
    /// Seed of all random choices.
    pub seed: u64,
}

/// A motion along a path: its windows and the newest frames.
#[derive(Debug)]
pub struct PathPlan {
    /// The body that moves.
    pub body: Arc<Body>,
    /// Notes about paths that the network may not follow well.
    pub notes: Vec<String>,
    dims: Dims,
    /// World x, z and heading of every frame, those of the past included.
    path: Vec<[f32; 3]>,
    /// The newest frames: those of the past, then those of finished windows. None, or as many as
    /// the context.
    last: Vec<Checked>,
    targets: Vec<Checked>,
    sways: bool,
    style: Vec<f32>,
    steps: u32,
    guidance: f32,
    seed: u64,
    windows: Vec<Window>,
    done: usize,
}

/// A call of the network: a range of the path's frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Window {
    /// The first frame that the window makes.
    start: usize,
    /// How many frames the window makes.
    fresh: usize,
    /// Frames of the call, those before `start` and behind the path included.
    frames: usize,
}

impl PathPlan {
    /// Plans the windows of a motion. `root` is the request, for errors and notes.
    ///
    /// # Errors
    /// [`FieldError`] for a path that is too fast, or too far from the past or the targets.
    pub fn new(root: &Path<'_>, request: PathRequest) -> Result<Self, FieldError> {
        let PathRequest {
            body,
            points,
            shows_steps,
            seconds,
            past,
            targets,
            style,
            steps,
            guidance,
            seed,
        } = request;
        let path = root.field("path");
        let (dims, fps) = (body.rig.dims, body.rig.fps);
        let mut fresh = (seconds * fps).round().max(1.0) as usize;
        // The first frame is the start of the path, unless the last frame of the past is.
        fresh += usize::from(past.is_empty());
        if !targets.is_empty() {
            // The last window ends with the targets, and windows have whole tokens.
            let unit = dims.frames_per_token;
            fresh = fresh.next_multiple_of(unit).max(dims.min_frames() - past.len());
        }
        let start_s = if past.is_empty() { 0.0 } else { 1.0 / fps };
        let mut frames = points.frames(start_s, fps, fresh);
        check_speed(&path, &points, &frames, fps)?;
        let mut notes = speed_notes(root, &body, &frames, fps);
        let sways = !(shows_steps && is_recorded(&frames, fps));
        if !sways && body.sway.is_some() {
            notes.push(RECORDED.to_owned());
        }
        lead_over(root, &path, &mut frames, &past, &targets, fps)?;
        let lead = past.iter().filter_map(|key| key.root).map(flat);
        Ok(Self {
            path: lead.chain(frames).collect(),
            windows: windows(past.len(), fresh, &dims, !targets.is_empty()),
            last: past,
            body,
            notes,
            dims,
            targets,
            sways,
            style,
            steps,
            guidance,
            seed,
            done: 0,
        })
    }

    /// The newest finished frames, or the past; none or as many as the context.
    pub fn newest(&self) -> &[Checked] {
        &self.last
    }

    /// The last frames of the motion, which are given.
    pub fn targets(&self) -> &[Checked] {
        &self.targets
    }

    /// World x, z and heading of every frame, those of the past included.
    pub fn way(&self) -> &[[f32; 3]] {
        &self.path
    }

    /// The next window's task, and the frame of reference of its segment; none after the last.
    pub fn next_task(&self) -> Option<(PathTask, SegmentFrame)> {
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
            sways: self.sways,
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
            // Each window has noise of its own.
            seed: self.seed.wrapping_add(self.done as u64),
        };
        Some((task, frame))
    }

    /// Takes the network's answer to [`next_task`](Self::next_task). Returns the new frames, and
    /// whether they are the last.
    pub fn receive(&mut self, motion: &Motion, frame: &SegmentFrame) -> (Motion, bool) {
        let (rig, context) = (&self.body.rig, self.dims.context_frames);
        let Some(window) = self.windows.get(self.done) else {
            return (Motion::default(), true);
        };
        let from = self.last.len();
        let fresh = part(motion, from, window.fresh, &rig.dims);
        self.done += 1;
        let is_last = self.done == self.windows.len();
        if !is_last {
            // The next window continues from the network's own frames, without limits of a robot's
            // hinges.
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

/// The root at a point of the path.
fn lift([x, z, heading]: [f32; 3]) -> GlobalRoot {
    GlobalRoot::new(Vec3::new(x, 0.0, z), heading)
}

/// World x, z and heading of a root.
pub(super) fn flat(root: GlobalRoot) -> [f32; 3] {
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

/// The windows of a motion of `fresh` frames after `past` ones. If the motion ends in targets, its
/// last window ends with them.
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

/// Nothing alive is that fast.
pub(super) fn check_speed(
    path: &Path<'_>,
    points: &GroundPath,
    frames: &[[f32; 3]],
    fps: f32,
) -> Result<(), FieldError> {
    let speeds = frames.windows(2).map(|pair| speed_mps(pair, fps));
    match speeds.enumerate().find(|(_, speed)| *speed > MAX_SPEED_MPS) {
        None => Ok(()),
        Some((frame, speed)) => {
            let index = points.point_after((frame + 1) as f32 / fps);
            let message = format!("is reached at {:.1} m/s", path.metres(speed));
            let allowed = format!("at most {} m/s", path.metres(MAX_SPEED_MPS));
            Err(path.element("points", index).error(message, allowed))
        }
    }
}

/// Speed over the ground between two frames of a way. A frame has world x, z and heading.
pub fn speed_mps(pair: &[[f32; 3]], fps: f32) -> f32 {
    let [[ax, az, _], [bx, bz, _]] = [pair[0], pair[1]];
    distance([ax, az], [bx, bz]) * fps
}

/// Whether a path is that of a walking root: its speed rises and falls with each step. Drawn paths
/// change theirs now and then.
fn is_recorded(frames: &[[f32; 3]], fps: f32) -> bool {
    let speeds: Vec<f32> = frames.windows(2).map(|pair| speed_mps(pair, fps)).collect();
    let half = (fps / 2.0) as usize;
    let uneven = |(frame, speed): (usize, &f32)| {
        let around = &speeds[frame.saturating_sub(half)..(frame + half).min(speeds.len())];
        let mean = around.iter().sum::<f32>() / around.len() as f32;
        (mean > STANDS_MPS).then(|| (speed - mean) / mean)
    };
    let mut uneven: Vec<f32> = speeds.iter().enumerate().filter_map(uneven).collect();
    let changes = uneven.windows(2).filter(|pair| pair[0] * pair[1] < 0.0).count();
    let seconds = uneven.len() as f32 / fps;
    uneven.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let median = uneven.get(uneven.len() / 2).map_or(0.0, |median| median.abs());
    median > UNEVEN && changes as f32 > CHANGES_PER_S * seconds
}

fn speed_notes(root: &Path<'_>, body: &Body, frames: &[[f32; 3]], fps: f32) -> Vec<String> {
    let mut notes = Vec::new();
    let speeds = frames.windows(2).map(|pair| speed_mps(pair, fps));
    let fastest = speeds.fold(0.0, f32::max);
    if fastest > NOTED_SPEED * body.size_m {
        notes.push(format!(
            "the path is up to {:.1} m/s fast, more than clips of a body of {:.1} m show: poses may not be such as it takes",
            root.metres(fastest),
            root.metres(body.size_m)
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
    notes
}

/// Bends the path so that it begins at the past, and ends at the targets.
pub(super) fn lead_over(
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
        near(&root.element("past", past.len() - 1), "the path's begin", off)?;
        for (frame, point) in frames.iter_mut().enumerate() {
            shift(point, off, 1.0 - smoothstep((frame as f32 / lead).min(1.0)));
        }
    }
    let (count, first) = (frames.len(), frames.len().saturating_sub(targets.len()));
    if let Some(to) = targets.first().and_then(|key| key.root).map(flat) {
        let off = offset(to, frames[first]);
        near(&path.element("targets", 0), "the path's end", off)?;
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
pub(super) fn offset(to: [f32; 3], from: [f32; 3]) -> [f32; 3] {
    [to[0] - from[0], to[1] - from[1], wrap_angle(to[2] - from[2])]
}

pub(super) fn shift(point: &mut [f32; 3], off: [f32; 3], share: f32) {
    for (value, off) in point.iter_mut().zip(off) {
        *value += share * off;
    }
}

/// Checks that the keyframe at `path`, which is off by so much, is not too far from a place of the
/// path.
pub(super) fn near(path: &Path<'_>, place: &str, off: [f32; 3]) -> Result<(), FieldError> {
    let way = off[0].hypot(off[1]);
    match way <= MAX_OFF_M {
        true => Ok(()),
        false => {
            let message = format!("is {:.1} m from {place}", path.metres(way));
            Err(path
                .field("root")
                .field("position")
                .error(message, format!("at most {} m", path.metres(MAX_OFF_M))))
        }
    }
}

#[cfg(test)]
#[path = "path_plan_tests.rs"]
mod tests;
