//! A path for a body that walks: the take that follows it.

use std::sync::Arc;

use troupe_motion::interpolate::smoothstep;
use troupe_motion::model::Rig;
use troupe_motion::path::GroundPath;
use troupe_motion::{GlobalRoot, Quat, Vec3};

use super::path_plan::{LEAD_S, check_speed, flat, lead_over, near, offset, shift, speed_mps};
use super::request::{Clock, Knot, Look, PoseKey, Prompt, Subject, Take, TakeSegment, Wanted};
use crate::keyframe::Checked;
use crate::live::CONTEXT_FRAMES;
use crate::live::request::Context;
use crate::primitives::path::fastest;
use crate::style::Style;
use crate::{FieldError, Path};

/// Frames between the knots of the way.
const STEP: usize = 10;
/// Fewest frames in front of the targets: a window cannot end nearer to its begin.
const LEAST_FRAMES: usize = 8;
/// A way that is slower than this stands, m/s.
const STANDING_MPS: f32 = 0.1;
/// A way may be this many times as fast as the style goes.
const SLACK: f32 = 1.05;

/// A checked path for a body that walks, and what to meet on it.
#[derive(Debug, Clone)]
pub struct WalkRequest {
    /// Skeleton and sizes of windows.
    pub rig: Arc<Rig>,
    /// How it walks.
    pub style: Arc<Style>,
    /// Where to be, and when. Time 0 is the first frame, or the last one of `past`.
    pub points: GroundPath,
    /// Length of the motion, above 0.
    pub seconds: f32,
    /// Frames that go before, each with root and pose: none, or as many as the context.
    pub past: Vec<Checked>,
    /// Poses to pass, each with its time in seconds. One without a root is on the path.
    pub keyframes: Vec<(f32, Checked)>,
    /// The last frames, each with root and pose.
    pub targets: Vec<Checked>,
    /// All random choices follow from it.
    pub seed: u64,
    /// 0 for the most likely choices, above 0 to sample.
    pub temperature: f32,
    /// Whether standing feet are held still.
    pub hold_feet: bool,
}

/// A take along a path.
#[derive(Debug, Clone)]
pub struct WalkPath {
    /// To be made in parts.
    pub take: Arc<Take>,
    /// World x, z and heading of every frame, the last one of the past included.
    pub way: Vec<[f32; 3]>,
    /// Set for a path that the style cannot keep up with.
    pub too_fast: Option<TooFast>,
}

/// A path that is faster than a style goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TooFast {
    /// Speed of the path, m/s.
    pub path_mps: f32,
    /// Fastest speed of the style in that direction, m/s.
    pub style_mps: f32,
    /// When, seconds.
    pub time_s: f32,
}

impl WalkRequest {
    /// Plans the way, which begins at the past, passes the keyframes and ends at the targets.
    /// `root` is the request, for errors.
    ///
    /// # Errors
    /// [`FieldError`] for a path that is too fast, or too far from a keyframe, and for keyframes
    /// that are not on the motion.
    pub fn plan(self, root: &Path<'_>) -> Result<WalkPath, FieldError> {
        let path = root.field("path");
        let fps = self.rig.fps;
        let begins = usize::from(self.past.is_empty());
        let mut frames = (self.seconds * fps).round().max(1.0) as usize + begins;
        if !self.targets.is_empty() {
            frames = frames.max(LEAST_FRAMES + self.targets.len());
        }
        // Of the first frame: the path's begin is the last frame of a past.
        let start_s = (1 - begins) as f32 / fps;
        let mut way = self.points.frames(start_s, fps, frames);
        check_speed(&path, &self.points, &way, fps)?;
        lead_over(root, &path, &mut way, &self.past, &self.targets, fps)?;
        let mut keys = self.keys(&path, &mut way, begins)?;
        let first = frames - self.targets.len();
        keys.extend(
            (first..)
                .zip(&self.targets)
                .filter_map(|(frame, key)| pose_key(frame, key, None)),
        );
        let lead = self.past.last().and_then(|key| key.root).map(flat);
        let knots = self.knots(&way, lead);
        let way: Vec<[f32; 3]> = lead.into_iter().chain(way).collect();
        Ok(WalkPath {
            too_fast: too_fast(&self.style, &way, fps),
            way,
            take: Arc::new(self.take(frames, knots, keys)),
        })
    }

    /// The keyframes by their frames. Bends the way so that it passes them.
    fn keys(&self, path: &Path<'_>, way: &mut [[f32; 3]], begins: usize) -> Result<Vec<PoseKey>, FieldError> {
        let fps = self.rig.fps;
        let (lead, count) = (LEAD_S * fps, way.len() - self.targets.len());
        let mut keys: Vec<PoseKey> = Vec::with_capacity(self.keyframes.len());
        for (index, (time_s, key)) in self.keyframes.iter().enumerate() {
            let place = path.element("keyframes", index);
            let frame = (time_s * fps).round() as usize + begins;
            let frame = frame.checked_sub(1).filter(|&frame| frame < count);
            let Some(frame) = frame else {
                let allowed = (1 - begins) as f32 / fps..=(count - begins) as f32 / fps;
                let (least, most) = (allowed.start(), allowed.end());
                let allowed =
                    format!("{least:.2} to {most:.2}, inside the motion and in front of its targets");
                return Err(place.field("time").error(format!("is {time_s}"), allowed));
            };
            if keys.iter().any(|other| other.frame == frame) {
                let message = format!("is {time_s}, in the frame of another keyframe");
                return Err(place.field("time").error(message, "one keyframe a frame"));
            }
            if let Some(to) = key.root.map(flat) {
                let off = offset(to, way[frame]);
                near(&place.field("keyframe"), "the path", off)?;
                for (at, point) in way.iter_mut().enumerate() {
                    let share = 1.0 - smoothstep((at.abs_diff(frame) as f32 / lead).min(1.0));
                    shift(point, off, share);
                }
            }
            let [x, z, _] = way[frame];
            keys.extend(pose_key(frame, key, Some([x, z])));
        }
        keys.sort_by_key(|key| key.frame);
        Ok(keys)
    }

    /// Knots of the way, a few a second. They have headings if the path gives any.
    fn knots(&self, way: &[[f32; 3]], lead: Option<[f32; 3]>) -> Vec<Knot> {
        let faces = self.points.has_headings();
        let knot = |frame: f32, [x, z, heading]: [f32; 3]| Knot {
            frame,
            place: [x, z],
            heading: faces.then_some(heading),
        };
        let last = way.len() - 1;
        let inside = (0..last).step_by(STEP).chain([last]);
        let inside = inside.map(|frame| knot(frame as f32, way[frame]));
        lead.map(|lead| knot(-1.0, lead))
            .into_iter()
            .chain(inside)
            .collect()
    }

    fn take(self, frames: usize, path: Vec<Knot>, keys: Vec<PoseKey>) -> Take {
        let idle = self.style.idle();
        Take {
            subject: Subject {
                rest: idle.rotations.clone(),
                rest_height_m: idle.height_m,
                follower: None,
                rig: self.rig.clone(),
            },
            segments: vec![TakeSegment {
                end: frames,
                seed: None,
                prompt: Prompt::Free,
            }],
            wanted: Wanted {
                path,
                keys,
                ..Wanted::default()
            },
            seed: self.seed,
            frames,
            clock: Clock {
                native_fps: self.rig.fps,
                fps: self.rig.fps,
                frames,
            },
            hold_feet: self.hold_feet,
            transition: 0,
            is_loop: false,
            past: context(&self.past),
            in_parts: true,
            onto: None,
            look: Look {
                style: Some(self.style),
                temperature: self.temperature,
                ..Look::default()
            },
        }
    }
}

/// A whole pose at a frame; its root is at `place` if the keyframe has none.
fn pose_key(frame: usize, key: &Checked, place: Option<[f32; 2]>) -> Option<PoseKey> {
    let pose = key.pose.as_ref()?;
    let on_way = place.map(|[x, z]| Vec3::new(x, pose.height, z));
    Some(PoseKey {
        frame,
        rotations: pose.rotations.iter().copied().map(Some).collect(),
        root: key.root.map(|root| root.position).or(on_way),
    })
}

/// The frames that a motion goes on from.
fn context(past: &[Checked]) -> Option<Context> {
    let roots: Vec<GlobalRoot> = past.iter().filter_map(|key| key.root).collect();
    let poses = past.iter().filter_map(|key| key.pose.as_ref());
    let rotations: Vec<Quat> = poses.flat_map(|pose| pose.rotations.iter().copied()).collect();
    let roots: [GlobalRoot; CONTEXT_FRAMES] = roots.try_into().ok()?;
    Some(Context {
        roots: roots.map(|root| root.position),
        rotations,
    })
}

/// Where a way is faster than the style by most, if anywhere. Speeds are means over a second: the
/// style makes up for less.
fn too_fast(style: &Style, way: &[[f32; 3]], fps: f32) -> Option<TooFast> {
    let span = (fps as usize).min(way.len() - 1);
    let parts = way.windows(span + 1).enumerate().step_by(STEP);
    let found = parts.filter_map(|(frame, part)| {
        let speeds = part.windows(2).map(|pair| speed_mps(pair, fps));
        let path_mps = speeds.sum::<f32>() / span as f32;
        if path_mps < STANDING_MPS {
            return None;
        }
        let ([from_x, from_z, _], [to_x, to_z, _]) = (part[0], part[span]);
        let direction = Vec3::new(to_x - from_x, 0.0, to_z - from_z).normalize_or_zero();
        let style_mps = fastest(style, direction, part[span / 2][2]);
        (path_mps > style_mps * SLACK).then_some(TooFast {
            path_mps,
            style_mps,
            time_s: frame as f32 / fps,
        })
    });
    found.max_by(|a, b| (a.path_mps - a.style_mps).total_cmp(&(b.path_mps - b.style_mps)))
}

/// Whether a style cannot keep up with a path of knots in order. `scale` is the size of the body
/// that follows it by that of the style's.
pub fn falls_behind(style: &Style, knots: &[Knot], fps: f32, scale: f32) -> bool {
    let mut way: Vec<[f32; 3]> = Vec::new();
    for pair in knots.windows(2) {
        let ([x, z], [to_x, to_z]) = (pair[0].place, pair[1].place);
        let along = (to_x - x).atan2(to_z - z);
        let heading = pair[0].heading.unwrap_or(along);
        let (begin, end) = (pair[0].frame.ceil(), pair[1].frame.ceil());
        for frame in begin as usize..end as usize {
            let share = (frame as f32 - pair[0].frame) / (pair[1].frame - pair[0].frame);
            let at = |from: f32, to: f32| (from + share * (to - from)) / scale;
            way.push([at(x, to_x), at(z, to_z), heading]);
        }
    }
    way.len() > 1 && too_fast(style, &way, fps).is_some()
}

#[cfg(test)]
#[path = "along_tests.rs"]
mod tests;
