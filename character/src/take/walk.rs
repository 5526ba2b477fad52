//! Motion of a body that goes from keyframe to keyframe, made window by window.
//!
//! A window ends with a keyframe that is near. Without one smart locomotion walks along the way in
//! a style, as a live character does ([`plan`]). Words are acted out from the newest frames.

mod plan;

use std::collections::BTreeMap;
use std::sync::Arc;

use troupe_motion::model::{DescribeTask, Motion, PromptTask, Rig, SamplingTask, Task};
use troupe_motion::{GlobalRoot, SegmentFrame, Vec3};

use super::note::Note;
use super::request::{MotionFrames, Prompt, Take, TakeSegment};
use super::seed::window_seed;
use super::settle::settle;
use super::start::start;
use super::track::Track;
use super::way::Way;
use crate::keyframe::{Checked, KeyWriter};
use crate::live::{CONTEXT_FRAMES, LiveShape, finish_live};
use crate::post::{NonFinite, check_finite};
use crate::primitives::{Locomotion, TargetKey};
use plan::KEY_FRAMES;

/// A motion in progress.
#[derive(Debug)]
pub(super) struct Walk {
    take: Arc<Take>,
    rig: Arc<Rig>,
    sample: usize,
    /// Frames of the track before the motion's first one.
    lead: usize,
    /// Whether the end of a loop has no keyframes yet.
    is_open: bool,
    /// Whole poses, by frame of the track.
    keys: BTreeMap<usize, TargetKey>,
    way: Way,
    /// Created for the first window that needs it.
    locomotion: Option<Locomotion>,
    track: Track,
    pending: Option<Pending>,
    /// The generator's description of a motion: the next window is motion for it.
    description: Option<String>,
    windows: usize,
    /// Frames of the track that [`new_part`](Self::new_part) gave.
    given: usize,
    /// Frames of the track at which windows begin.
    boundaries: Vec<usize>,
    notes: Vec<Note>,
}

/// The window that the generator is making.
#[derive(Debug)]
enum Pending {
    Plan { shape: Box<LiveShape>, fresh: usize },
    Words { frame: SegmentFrame, fresh: usize },
}

impl Walk {
    /// Begins a sample of a take.
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
            description: None,
            windows: 0,
            given: lead,
            boundaries: Vec::new(),
            notes,
        }
    }

    /// The task of the next window; none after the last.
    pub(super) fn next_task(&mut self) -> Option<Task> {
        let end = self.lead + self.take.frames;
        let begin = self.track.len();
        if begin >= end {
            return None;
        }
        self.close_loop();
        let segment = self.segment(begin).clone();
        let left = (self.lead + segment.end).min(end) - begin;
        let seed = window_seed(segment.seed.unwrap_or(self.take.seed), self.sample, self.windows);
        self.windows += 1;
        let words = match segment.prompt {
            Prompt::Free => None,
            Prompt::Words(text) => Some(text),
            Prompt::Like(motion) => match self.description.take() {
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

    /// Takes the generator's description of a motion. The next window is motion for it.
    pub(super) fn receive_text(&mut self, text: &str) {
        let message = format!("a motion of the request was read as {text:?}");
        self.notes.push(Note::info("motion_reference", message));
        self.description = Some(text.to_owned());
    }

    /// Appends the generator's answer to [`next_task`](Self::next_task).
    ///
    /// # Errors
    /// [`NonFinite`] if the answer has values that are not finite.
    pub(super) fn receive(&mut self, motion: &Motion) -> Result<(), NonFinite> {
        let before = self.track.len();
        match self.pending.take() {
            None => {}
            Some(Pending::Plan { shape, fresh }) => {
                let plan = finish_live(motion, &shape, &self.rig)?;
                let mut made = Track {
                    roots: plan.roots,
                    rotations: plan.rotations,
                    contacts: plan.contacts,
                };
                if self.take.in_parts {
                    self.settle(&mut made, fresh);
                }
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
        // Without this, a generator that makes no frames would never end.
        match self.track.len() > before {
            true => Ok(()),
            false => Err(NonFinite),
        }
    }

    /// Has a window meet the keys among its `fresh` frames.
    fn settle(&self, window: &mut Track, fresh: usize) {
        let begin = self.track.len();
        let context = begin - CONTEXT_FRAMES;
        window.contacts[..CONTEXT_FRAMES].copy_from_slice(&self.track.contacts[context..]);
        let keys = self.keys.range(begin..begin + fresh);
        let keys: Vec<(usize, &TargetKey)> = keys.map(|(frame, key)| (frame - context, key)).collect();
        settle(&self.rig, window, &keys, self.take.hold_feet);
    }

    /// The frames of the motion that were made since the last call.
    pub(super) fn new_part(&mut self) -> Track {
        let end = self.track.len().min(self.lead + self.take.frames);
        let from = self.given.min(end);
        self.given = self.given.max(end);
        self.track.part(from, end - from)
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

    /// The segment that contains a frame of the track.
    fn segment(&self, frame: usize) -> &TakeSegment {
        let frame = frame.saturating_sub(self.lead);
        let segments = &self.take.segments;
        let found = segments.iter().find(|segment| frame < segment.end);
        found.unwrap_or(&segments[segments.len() - 1])
    }

    /// Makes keyframes for the end of a loop when its first frame is known: the same frames, moved
    /// along the way.
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
        // With fewer frames than a context, the words begin at the newest one.
        let last = self.track.len().checked_sub(1);
        let last = last.map(|frame| self.track.root(frame, &self.rig.skeleton));
        let frame = SegmentFrame::from_root(last.unwrap_or(origin));
        self.pending = Some(Pending::Words { frame, fresh: frames });
        // Motion for words leaves the way: the next walk starts at its end.
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

    /// Repeats the first frame until there are enough for a context: words may have given fewer
    /// frames.
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
}
