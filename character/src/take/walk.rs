//! Motion of a body that goes from keyframe to keyframe, window after window.
//!
//! A window ends with a keyframe that is near. Without one smart locomotion walks along the way in
//! a style, as a live character does. Words are acted out from the newest frames.

use std::collections::BTreeMap;
use std::sync::Arc;

use troupe_motion::interpolate::smoothstep;
use troupe_motion::model::{DescribeTask, Motion, PromptTask, Rig, SamplingTask, Task};
use troupe_motion::root::wrap_angle;
use troupe_motion::{GlobalRoot, SegmentFrame, Vec3};

use super::note::Note;
use super::request::{MotionFrames, Part, Prompt, Take};
use super::seed::window_seed;
use super::start::start;
use super::track::Track;
use super::way::Way;
use crate::keyframe::{Checked, KeyWriter};
use crate::live::request::{Context, build};
use crate::live::{CONTEXT_FRAMES, CharacterOptions, LiveShape, PlanItem, finish_live};
use crate::post::{NonFinite, check_finite};
use crate::primitives::path::PathPoint;
use crate::primitives::{
    GapPose, Guide, Locomotion, LocomotionCommand, PathCommand, PlanContext, PlanTargets, TargetKey,
};

/// Frames that are taken of a window of smart locomotion. The next window begins behind them.
const FRESH: usize = 24;
/// A window ends with a keyframe that is this many frames away, at least and at most.
const KEY_FRAMES: [usize; 2] = [8, 48];
/// Frames over which the root's velocity is measured.
const VELOCITY_FRAMES: usize = 10;

/// A motion on its way.
#[derive(Debug)]
pub(super) struct Walk {
    take: Arc<Take>,
    rig: Arc<Rig>,
    sample: usize,
    /// Frames of the track before the motion's first one.
    lead: usize,
    /// Whether the end of a loop is still open.
    is_open: bool,
    /// Whole poses, by frame of the track.
    keys: BTreeMap<usize, TargetKey>,
    way: Way,
    /// Made for the first window that needs it.
    locomotion: Option<Locomotion>,
    track: Track,
    pending: Option<Pending>,
    /// Words that the generator found for a motion, which are to be acted out.
    heard: Option<String>,
    windows: usize,
    /// Frames of the track at which windows begin.
    boundaries: Vec<usize>,
    notes: Vec<Note>,
}

/// A window that is being made.
#[derive(Debug)]
enum Pending {
    Plan { shape: Box<LiveShape>, fresh: usize },
    Words { frame: SegmentFrame, fresh: usize },
}

impl Walk {
    /// A sample of a take.
    pub(super) fn new(take: &Arc<Take>, sample: usize) -> Self {
        let rig = take.subject.rig.clone();
        let mut notes = Vec::new();
        let usual_mps = (take.look.style.as_ref()).map_or(0.0, |style| style.default_speed_mps);
        let mut way = Way::of(take, sample, usual_mps, &mut notes);
        let (track, lead) = start(take, &mut way);
        let left = rig.skeleton.left_axis;
        let whole = take.wanted.keys.iter().filter_map(|key| {
            let rotations = key.whole()?;
            let root = key.root.map(|root| GlobalRoot::of_pose(root, rotations[0], left));
            let key_frame = key.frame + lead;
            let key = TargetKey {
                height_m: root.is_none().then_some(take.subject.rest_height_m),
                root,
                velocity: None,
                rotations: Some(rotations),
            };
            (key_frame >= track.len()).then_some((key_frame, key))
        });
        Self {
            keys: whole.collect(),
            take: take.clone(),
            rig,
            sample,
            lead,
            is_open: take.is_loop,
            way,
            locomotion: None,
            track,
            pending: None,
            heard: None,
            windows: 0,
            boundaries: Vec::new(),
            notes,
        }
    }

    /// The task of the next window; none behind the last.
    pub(super) fn next_task(&mut self) -> Option<Task> {
        let end = self.lead + self.take.frames;
        let begin = self.track.len();
        if begin >= end {
            return None;
        }
        self.close_loop();
        let part = self.part(begin).clone();
        let left = (self.lead + part.end).min(end) - begin;
        let seed = window_seed(part.seed.unwrap_or(self.take.seed), self.sample, self.windows);
        self.windows += 1;
        let words = match part.prompt {
            Prompt::Free => None,
            Prompt::Words(text) => Some(text),
            Prompt::Like(motion) => match self.heard.take() {
                Some(text) => Some(text),
                None => return Some(self.describe(&motion, seed)),
            },
        };
        self.boundaries.push(begin);
        match words {
            Some(text) => Some(self.words(text, left, seed)),
            None => self.plan(left, seed),
        }
    }

    /// Takes the words that the generator found for a motion. They are acted out next.
    pub(super) fn hear(&mut self, text: &str) {
        let message = format!("a motion of the request was read as {text:?}");
        self.notes.push(Note::info("motion_reference", message));
        self.heard = Some(text.to_owned());
    }

    /// Takes what the generator made of [`next_task`](Self::next_task).
    ///
    /// # Errors
    /// [`NonFinite`] for numbers that are not usable.
    pub(super) fn receive(&mut self, motion: &Motion) -> Result<(), NonFinite> {
        let before = self.track.len();
        match self.pending.take() {
            None => {}
            Some(Pending::Plan { shape, fresh }) => {
                let plan = finish_live(motion, &shape, &self.rig)?;
                let made = Track {
                    roots: plan.roots,
                    rotations: plan.rotations,
                    contacts: plan.contacts,
                };
                self.track.extend(&made, CONTEXT_FRAMES, fresh);
            }
            Some(Pending::Words { frame, fresh }) => {
                check_finite(motion)?;
                let made = Track::of_motion(motion, &frame, &self.rig);
                self.track.extend(&made, 0, fresh);
                self.track.lead_over(before, self.take.transition);
                let short = fresh.saturating_sub(made.len());
                if short > 0 && !self.track.is_empty() {
                    let message = format!(
                        "the model made {short} frames less than were asked for: it stays in the last"
                    );
                    self.notes.push(Note::warning("shorter_than_asked", message));
                    let last = self.track.part(self.track.len() - 1, 1);
                    (0..short).for_each(|_| self.track.extend(&last, 0, 1));
                }
            }
        }
        // A generator that makes nothing would never end.
        match self.track.len() > before {
            true => Ok(()),
            false => Err(NonFinite),
        }
    }

    /// The frames, those at which windows begin, and what a caller should know.
    pub(super) fn done(self) -> (Track, Vec<usize>, Vec<Note>) {
        let inside = self
            .boundaries
            .iter()
            .filter_map(|frame| frame.checked_sub(self.lead));
        let frames = self.take.frames;
        let boundaries = inside.filter(|&frame| frame > 0 && frame < frames).collect();
        (self.track.part(self.lead, frames), boundaries, self.notes)
    }

    /// The segment of a frame of the track.
    fn part(&self, frame: usize) -> &Part {
        let frame = frame.saturating_sub(self.lead);
        let parts = &self.take.parts;
        let found = parts.iter().find(|part| frame < part.end);
        found.unwrap_or(&parts[parts.len() - 1])
    }

    /// Makes keys of the end of a loop once its first frame is there: the same frames, carried along
    /// the way.
    fn close_loop(&mut self) {
        if !self.is_open || self.track.len() <= self.lead {
            return;
        }
        self.is_open = false;
        let skeleton = &self.rig.skeleton;
        let first = self.track.root(self.lead, skeleton);
        let to = self.way.place(self.take.frames as f32 - 1.0);
        let travel = Vec3::new(to[0], 0.0, to[1]) - first.projected();
        let last = self.lead + self.take.frames - 1;
        for back in 0..CONTEXT_FRAMES.min(self.lead + 1) {
            let (from, at) = (self.lead - back, last.saturating_sub(back));
            if at < self.track.len() + KEY_FRAMES[0] {
                break;
            }
            let mut root = self.track.root(from, skeleton);
            root.position += travel;
            let key = TargetKey {
                root: Some(root),
                velocity: None,
                rotations: Some(self.track.pose(from).to_vec()),
                height_m: None,
            };
            self.keys.insert(at, key);
        }
    }

    fn describe(&self, motion: &MotionFrames, seed: u64) -> Task {
        Task::Describe(DescribeTask {
            frames: motion.to_vec(),
            seed,
            sampling: SamplingTask::at(self.take.look.temperature),
            ..DescribeTask::default()
        })
    }

    fn words(&mut self, text: String, frames: usize, seed: u64) -> Task {
        let keys = self.last_keys();
        let origin = GlobalRoot::new(Vec3::ZERO, self.way.first_heading());
        // With too few frames for a context the words begin at the newest one.
        let last = self.track.len().checked_sub(1);
        let last = last.map(|frame| self.track.root(frame, &self.rig.skeleton));
        let frame = SegmentFrame::from_root(last.unwrap_or(origin));
        self.pending = Some(Pending::Words { frame, fresh: frames });
        // The words lead off the way: the next walk starts from their end.
        self.locomotion = None;
        Task::Prompt(PromptTask {
            text,
            context: KeyWriter::new(&self.rig.skeleton, self.rig.fps).write(&frame, &keys),
            frames: Some(frames),
            seed,
            sampling: SamplingTask::at(self.take.look.temperature),
            ..PromptTask::default()
        })
    }

    /// The newest frames as keyframes: as many as a context has, or none.
    fn last_keys(&self) -> Vec<Checked> {
        let Some(from) = self.track.len().checked_sub(self.rig.dims.context_frames) else {
            return Vec::new();
        };
        let key = |frame: usize| {
            let root = self.track.root(frame, &self.rig.skeleton);
            Checked::of(Some(root), None, None, Some(self.track.pose(frame).to_vec()))
        };
        (from..self.track.len()).map(key).collect()
    }

    /// Repeats the first frame until there is a context: words may have made fewer frames.
    fn fill_context(&mut self) {
        let missing = CONTEXT_FRAMES.saturating_sub(self.track.len());
        if missing == 0 || self.track.is_empty() {
            return;
        }
        let first = self.track.part(0, 1);
        let made = std::mem::take(&mut self.track);
        (0..missing).for_each(|_| self.track.extend(&first, 0, 1));
        self.track.extend(&made, 0, made.len());
        self.lead += missing;
        self.boundaries.iter_mut().for_each(|frame| *frame += missing);
        let keys = std::mem::take(&mut self.keys);
        self.keys = keys
            .into_iter()
            .map(|(frame, key)| (frame + missing, key))
            .collect();
    }

    /// A window of keyframes. At most `left` of its frames are taken.
    fn plan(&mut self, left: usize, seed: u64) -> Option<Task> {
        self.fill_context();
        let now = self.track.len() - 1;
        let [least, most] = KEY_FRAMES;
        let target = self
            .keys
            .range(now + least..)
            .next()
            .map(|(frame, _)| frame - now);
        let (targets, fresh) = match target {
            Some(away) if away <= most => self.to_key(now, away),
            _ => {
                let fresh = target.map_or(FRESH, |away| FRESH.min(away - least));
                (self.by_style(now), fresh)
            }
        };
        let from = self.track.len() - CONTEXT_FRAMES;
        let context = Context {
            roots: std::array::from_fn(|frame| self.track.roots[from + frame]),
            rotations: self.track.part(from, CONTEXT_FRAMES).rotations,
        };
        let options = CharacterOptions {
            seed,
            look_ahead_frames: 0,
            replan_interval_frames: None,
            root_ratio: None,
            temperature: self.take.look.temperature,
        };
        let (item, shape) = build(&self.rig, &options, self.windows as u64, context, targets);
        self.pending = Some(Pending::Plan {
            shape: Box::new(shape),
            fresh: fresh.min(left),
        });
        match item {
            PlanItem::Keyframes(task) => Some(Task::Keyframes(task)),
            // Only bodies that take paths have such plans, and they do not walk.
            PlanItem::Path(_) => None,
        }
    }

    /// The keyframes of smart locomotion on the way, and the given poses that are too near to end a
    /// window.
    fn by_style(&mut self, now: usize) -> PlanTargets {
        let rig = self.rig.clone();
        let rotations = self
            .track
            .part(now + 1 - CONTEXT_FRAMES, CONTEXT_FRAMES)
            .rotations;
        let roots =
            std::array::from_fn(|frame| self.track.root(now + 1 - CONTEXT_FRAMES + frame, &rig.skeleton));
        let context = PlanContext {
            frame: now as u64,
            roots,
            rotations: &rotations,
            velocity: self.velocity(now),
            seed: 0,
            skeleton: &rig.skeleton,
            fps: rig.fps,
            frames_per_token: rig.dims.frames_per_token,
            plan_frames: None,
        };
        if self.locomotion.is_none() {
            self.locomotion = self.locomotion(now, context.roots[CONTEXT_FRAMES - 1]);
        }
        let planned = self
            .locomotion
            .as_mut()
            .map(|locomotion| locomotion.plan(&context));
        let mut targets = planned.unwrap_or_else(|| stand(context.roots[CONTEXT_FRAMES - 1]));
        let frames = targets.frames.unwrap_or(rig.dims.max_frames());
        targets.gap_poses.extend(self.gap_poses(now, frames));
        targets
    }

    fn locomotion(&mut self, now: usize, root: GlobalRoot) -> Option<Locomotion> {
        let style = self.take.look.style.clone()?;
        let frame = now as f32 - self.lead as f32;
        if !self.way.is_given {
            self.way.shift_to(frame, [root.position.x, root.position.z]);
        }
        let points = self.way.knots.iter().map(|knot| PathPoint {
            position: Vec3::new(knot.place[0], 0.0, knot.place[1]),
            heading: knot.heading,
            time_s: (knot.frame - frame) / self.way.fps,
        });
        let path = PathCommand {
            style: style.clone(),
            points: points.collect(),
            closing_s: None,
        };
        let standing = LocomotionCommand::standing(&style);
        let mut locomotion = Locomotion::new(now as u64, root.heading, self.rig.fps, standing);
        locomotion.set_path(now as u64, path);
        Some(locomotion)
    }

    /// Velocity over the ground without the sway of a step, m/s.
    fn velocity(&self, now: usize) -> Vec3 {
        let from = now.saturating_sub(VELOCITY_FRAMES);
        let way = (self.track.roots[now] - self.track.roots[from]).with_y(0.0);
        way * self.rig.fps / (now - from).max(1) as f32
    }

    /// A window that ends with the keyframe `away` frames ahead and those right behind it, and how
    /// many frames it makes.
    fn to_key(&self, now: usize, away: usize) -> (PlanTargets, usize) {
        let first = now + away;
        let most = self.rig.dims.max_targets;
        let row = (first..).take(most).map_while(|frame| self.keys.get(&frame));
        let keys: Vec<TargetKey> = row.cloned().collect();
        let fresh = away + keys.len() - 1;
        let frames = CONTEXT_FRAMES + fresh;
        let here = self.track.root(now, &self.rig.skeleton);
        let to = keys.last().and_then(|key| key.root);
        let targets = PlanTargets {
            targets: keys,
            gap_poses: self.gap_poses(now, CONTEXT_FRAMES + away - 1),
            frames: Some(frames),
            allowed_token_counts: Vec::new(),
            guide: self.way.is_given.then(|| self.guide(now, frames, here, to)),
            follow: None,
            r_g1: to.unwrap_or(here),
            r_g2: Vec::new(),
            path: None,
            unfinished: false,
            gaits: Vec::new(),
        };
        (targets, fresh)
    }

    /// The keyed poses inside the window of `frames` frames that begins behind `now`.
    fn gap_poses(&self, now: usize, frames: usize) -> Vec<GapPose> {
        let inside = self
            .keys
            .range(now + 1..now + 1 + frames.saturating_sub(CONTEXT_FRAMES));
        let pose = |(frame, key): (&usize, &TargetKey)| {
            let root_m = key.root.map(|root| root.position.y);
            Some(GapPose {
                frame: frame - now + CONTEXT_FRAMES - 1,
                rotations: key.rotations.clone()?,
                height_m: root_m.or(key.height_m)?,
            })
        };
        inside.filter_map(pose).collect()
    }

    /// The way of a window, which begins at the newest frame and ends at `to`.
    fn guide(&self, now: usize, frames: usize, here: GlobalRoot, to: Option<GlobalRoot>) -> Guide {
        let first = now as f32 - self.lead as f32;
        let last = frames - CONTEXT_FRAMES;
        let at = |step: usize| {
            let [x, z, heading] = self.way.at(first + step as f32);
            GlobalRoot::new(Vec3::new(x, 0.0, z), heading)
        };
        let off = |root: GlobalRoot, way: GlobalRoot| {
            let place = (root.position - way.position).with_y(0.0);
            (place, wrap_angle(root.heading - way.heading))
        };
        let start = off(here, at(0));
        let end = to.map_or((Vec3::ZERO, 0.0), |to| off(to, at(last)));
        let height_m = to.map_or(here.position.y, |to| to.position.y);
        let root = |frame: usize| {
            let Some(step) = frame.checked_sub(CONTEXT_FRAMES - 1) else {
                let from = now + 1 + frame - CONTEXT_FRAMES;
                return self.track.root(from, &self.rig.skeleton);
            };
            let share = smoothstep((step as f32 / last.max(1) as f32).min(1.0));
            let way = at(step);
            let place = way.position + start.0 * (1.0 - share) + end.0 * share;
            let y = here.position.y + (height_m - here.position.y) * share;
            let heading = way.heading + start.1 * (1.0 - share) + end.1 * share;
            GlobalRoot::new(place.with_y(y), wrap_angle(heading))
        };
        Guide {
            path: (0..frames).map(root).collect(),
            position_ratio: 1.0,
            height_ratio: 0.0,
            heading_ratio: 1.0,
        }
    }
}

/// The keyframes of a body without a style: it stays in its place.
fn stand(here: GlobalRoot) -> PlanTargets {
    PlanTargets {
        targets: vec![TargetKey {
            root: Some(here),
            ..TargetKey::default()
        }],
        gap_poses: Vec::new(),
        frames: Some(CONTEXT_FRAMES + FRESH),
        allowed_token_counts: Vec::new(),
        guide: None,
        follow: None,
        r_g1: here,
        r_g2: Vec::new(),
        path: None,
        unfinished: false,
        gaits: Vec::new(),
    }
}
