//! Motion of a body whose network follows paths: one segment after another, each made window by
//! window.

use std::sync::Arc;

use troupe_motion::model::{Motion, Rig, Task};
use troupe_motion::path::{GroundPath, PathPoint};
use troupe_motion::root::heading_of;
use troupe_motion::{GlobalRoot, Quat, SegmentFrame, Vec3};

use super::note::Note;
use super::path_plan::{PathPlan, PathRequest};
use super::request::{Follower, Take};
use super::seed::window_seed;
use super::track::Track;
use super::way::Way;
use crate::keyframe::Checked;
use crate::limits::MAX_DISTANCE_M;
use crate::post::{NonFinite, check_finite};
use crate::{FieldError, Path};

/// Frames that are made before the start of a loop, so that it starts in motion.
const BEFORE: usize = 20;
/// Frames of the transition to a stretch whose predecessor is too short to be its context.
const LEAD_FRAMES: usize = 8;
/// Points a second of the path that the network gets.
const POINTS_PER_S: f32 = 10.0;

/// A motion in progress.
#[derive(Debug)]
pub(super) struct Follow {
    take: Arc<Take>,
    follower: Follower,
    sample: usize,
    way: Way,
    /// The stretches of the motion: one a segment, and one before the start of a loop.
    stretches: Vec<Stretch>,
    next: usize,
    plan: Option<(PathPlan, SegmentFrame)>,
    track: Track,
    lead: usize,
    boundaries: Vec<usize>,
    notes: Vec<Note>,
}

/// The frames that one plan makes.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    /// First frame of the stretch; negative before the start of the motion.
    from: i64,
    /// The frame after the last one.
    to: i64,
    seed: u64,
    /// For a stretch that ends in the first frames of a loop: how many frames the plan makes.
    closes: Option<usize>,
}

impl Follow {
    /// Begins a sample of a take.
    pub(super) fn new(take: &Arc<Take>, follower: &Follower, sample: usize) -> Self {
        let mut notes = Vec::new();
        let by_path = take.subject.rig.by_path.as_ref();
        let usual_mps = by_path.map_or(0.0, |body| body.usual_speed_mps);
        let mut way = Way::of(take, sample, usual_mps, &mut notes);
        let mut stretches = Vec::new();
        let dims = take.subject.rig.dims;
        let frames = take.frames as i64;
        let lead = match take.is_loop && take.frames > dims.context_frames {
            true => {
                way.begin_before(BEFORE);
                let seed = window_seed(take.seed, sample, usize::from(u16::MAX));
                stretches.push(Stretch {
                    from: -(BEFORE as i64),
                    to: 1,
                    seed,
                    closes: None,
                });
                // A window has whole tokens, so the motion may end a few frames later.
                let fresh = (take.frames - 1).next_multiple_of(dims.frames_per_token);
                stretches.push(Stretch {
                    from: 1,
                    to: frames,
                    seed: window_seed(take.segments[0].seed.unwrap_or(take.seed), sample, 0),
                    closes: Some(fresh.max(dims.min_frames())),
                });
                BEFORE
            }
            false => {
                let mut from = 0;
                for (index, segment) in take.segments.iter().enumerate() {
                    let to = segment.end as i64;
                    if to > from {
                        let seed = window_seed(segment.seed.unwrap_or(take.seed), sample, index);
                        stretches.push(Stretch {
                            from,
                            to,
                            seed,
                            closes: None,
                        });
                        from = to;
                    }
                }
                0
            }
        };
        Self {
            take: take.clone(),
            follower: follower.clone(),
            sample,
            way,
            stretches,
            next: 0,
            plan: None,
            track: Track::default(),
            lead,
            boundaries: Vec::new(),
            notes,
        }
    }

    /// The task of the next window; none after the last.
    ///
    /// # Errors
    /// [`FieldError`] for a path that the network does not accept.
    pub(super) fn next_task(&mut self) -> Result<Option<Task>, FieldError> {
        loop {
            if let Some((plan, frame)) = &mut self.plan {
                if let Some((task, at)) = plan.next_task() {
                    *frame = at;
                    self.boundaries.push(self.track.len());
                    return Ok(Some(Task::Path(task)));
                }
                self.plan = None;
                self.close();
            }
            let Some(&stretch) = self.stretches.get(self.next) else {
                return Ok(None);
            };
            self.next += 1;
            // A stretch of one frame replaces frames that were made beyond its start.
            let begun = (self.lead as i64 + stretch.from).max(0) as usize;
            if self.track.len() > begun {
                self.track = self.track.part(0, begun);
            }
            let root = Path::root().sized(self.take.size());
            let mut plan = PathPlan::new(&root, self.request(&root, &stretch)?)?;
            // The notes of all samples would be equal.
            if self.sample == 0 {
                let notes = std::mem::take(&mut plan.notes).into_iter();
                self.notes.extend(notes.map(|note| Note::warning("path", note)));
            }
            let origin = SegmentFrame::from_root(GlobalRoot::new(Vec3::ZERO, 0.0));
            self.plan = Some((plan, origin));
        }
    }

    /// Appends the network's answer to [`next_task`](Self::next_task).
    ///
    /// # Errors
    /// [`NonFinite`] if the answer has values that are not finite.
    pub(super) fn receive(&mut self, motion: &Motion) -> Result<(), NonFinite> {
        check_finite(motion)?;
        let Some((plan, frame)) = &mut self.plan else {
            return Ok(());
        };
        let whole = Track::of_motion(motion, frame, &plan.body.rig);
        let context = plan.body.rig.dims.context_frames;
        let (fresh, _) = plan.receive(motion, frame);
        let mut made = Track::of_motion(&fresh, frame, &plan.body.rig);
        let before = self.track.len();
        if let Some(last) = before.checked_sub(1).filter(|_| before >= context) {
            // The network's answer repeats the context only approximately.
            let of = |track: &Track, frame: usize| (track.roots[frame], track.pose(frame).to_vec());
            let (was, is) = (of(&whole, context - 1), of(&self.track, last));
            made.join((was.0, &was.1), (is.0, &is.1), LEAD_FRAMES);
            made.go_on(&self.track, LEAD_FRAMES);
        }
        self.track.extend(&made, 0, made.len());
        // Fewer frames than a context cannot serve as the network's past.
        if before < self.rig().dims.context_frames {
            self.track.lead_over(before, LEAD_FRAMES);
        }
        Ok(())
    }

    /// The frames, the frames at which windows begin, and the notes.
    pub(super) fn done(self) -> (Track, Vec<usize>, Vec<Note>) {
        let frames = self.take.frames;
        let inside = self
            .boundaries
            .iter()
            .filter_map(|frame| frame.checked_sub(self.lead));
        let boundaries = inside.filter(|&frame| frame > 0 && frame < frames).collect();
        (self.track.part(self.lead, frames), boundaries, self.notes)
    }

    fn rig(&self) -> &Rig {
        &self.take.subject.rig
    }

    /// The newest frames as keyframes: as many as a context has, or none.
    fn past(&self) -> Vec<Checked> {
        let end = self.track.len();
        let Some(from) = end.checked_sub(self.rig().dims.context_frames) else {
            return Vec::new();
        };
        let key = |frame: usize| self.keyframe(self.track.roots[frame], frame);
        (from..end).map(key).collect()
    }

    /// The pose of a frame of the track as a keyframe, with its root at `place`.
    fn keyframe(&self, place: Vec3, frame: usize) -> Checked {
        let pose = self
            .track
            .pose(frame)
            .iter()
            .map(|&rotation| rotation / rotation.length());
        let pose: Vec<Quat> = pose.collect();
        let heading = heading_of(pose[0], self.rig().skeleton.left_axis);
        Checked::of(Some(GlobalRoot::new(place, heading)), None, None, Some(pose))
    }

    /// The path of a stretch. Its time 0 is the newest finished frame, or the stretch's own first
    /// frame.
    fn request(&self, root: &Path<'_>, stretch: &Stretch) -> Result<PathRequest, FieldError> {
        let fps = self.take.clock.native_fps;
        let past = self.past();
        let begin = stretch.from - i64::from(!past.is_empty());
        let frames = (stretch.to - 1 - begin) as f32;
        // A stretch that closes a loop is made a little longer, and [`Self::close`] shortens it.
        let made = stretch.closes.map_or(frames, |fresh| fresh as f32);
        let count = (frames / fps * POINTS_PER_S).ceil().max(1.0) as usize;
        let times = (0..=count).map(|nth| nth as f32 / count as f32);
        let mut points: Vec<PathPoint> = times
            .map(|share| {
                let [x, z, heading] = self.way.at(begin as f32 + share * frames);
                PathPoint {
                    place: [x, z],
                    heading: Some(heading),
                    time_s: share * made / fps,
                }
            })
            .collect();
        if frames < 1.0 {
            points.truncate(1);
        }
        let mut targets = Vec::new();
        if stretch.closes.is_some() {
            let first = self.track.root(self.lead, &self.rig().skeleton);
            let [x, z] = self.way.place(self.take.frames as f32 - 1.0);
            let travel = Vec3::new(x, 0.0, z) - first.projected();
            for frame in self.lead + 1 - self.rig().dims.context_frames..=self.lead {
                targets.push(self.keyframe(self.track.roots[frame] + travel, frame));
            }
        }
        let Follower { body, words, steps } = &self.follower;
        let look = &self.take.look;
        let weight = |word: &String| f32::from(u8::from(look.word.as_ref() == Some(word)));
        Ok(PathRequest {
            body: body.clone(),
            points: ground_path(root, points)?,
            shows_steps: self.way.shows_steps(),
            seconds: (made / fps).max(1e-3),
            past,
            targets,
            style: words.iter().map(weight).collect(),
            steps: look.steps.unwrap_or(*steps),
            guidance: look.guidance.unwrap_or(1.0),
            seed: stretch.seed,
        })
    }

    /// Resamples a loop that was made longer to the number of frames that it must have.
    fn close(&mut self) {
        let Some(stretch) = self.next.checked_sub(1).map(|index| self.stretches[index]) else {
            return;
        };
        if stretch.closes.is_none() {
            return;
        }
        let (made, wanted) = (self.track.len() - self.lead, self.take.frames);
        if made != wanted && made > 1 && wanted > 1 {
            let motion = self.track.part(self.lead, made);
            let rate = (made - 1) as f32 / (wanted - 1) as f32;
            let pressed = motion.resampled(wanted, |frame| frame as f32 * rate);
            let mut track = self.track.part(0, self.lead);
            track.extend(&pressed, 0, wanted);
            self.track = track;
            let message = format!(
                "the loop is played {:.1} % faster than the model made it",
                (rate - 1.0) * 100.0
            );
            self.notes.push(Note::info("loop_length", message));
        }
    }
}

/// Checks that the points are within bounds and their times rise.
fn ground_path(root: &Path<'_>, points: Vec<PathPoint>) -> Result<GroundPath, FieldError> {
    let path = root.field("path");
    for (index, point) in points.iter().enumerate() {
        for (axis, value) in ["x", "z"].into_iter().zip(point.place) {
            if !(-MAX_DISTANCE_M..=MAX_DISTANCE_M).contains(&value) {
                let point = path.element("points", index);
                let position = point.field("position");
                let most = root.metres(MAX_DISTANCE_M);
                let message = format!("is {}", root.metres(value));
                return Err(position.field(axis).error(message, format!("-{most} to {most}")));
            }
        }
    }
    GroundPath::new(points).ok_or_else(|| path.field("points").error("has no order", "growing times"))
}
