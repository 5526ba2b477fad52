//! Motion of a body that follows paths, segment after segment, each window after window.

use troupe_character::FieldError;
use troupe_character::post::{NonFinite, check_finite};
use troupe_engine::pack::Pack;
use troupe_motion::model::{Motion, Rig, Task};
use troupe_motion::rotation::to_wxyz;
use troupe_motion::{GlobalRoot, Quat, SegmentFrame, Vec3};
use troupe_proto::v1;

use super::take::{Note, Take, window_seed};
use super::track::Track;
use super::way::Way;
use crate::inbetween::PathPlan;

/// Frames that a loop is begun earlier, for it to begin on its way.
const BEFORE: usize = 20;
/// Frames over which a stretch leads over from one that is too short to go on from.
const LEAD_FRAMES: usize = 8;
/// Points of a path a second, where it is given to the model.
const POINTS_PER_S: f32 = 10.0;

/// A motion on its way.
#[derive(Debug)]
pub struct Follow {
    take: Take,
    sample: usize,
    way: Way,
    /// Stretches of the motion: one a segment, and before a loop how it is begun.
    stretches: Vec<Stretch>,
    next: usize,
    plan: Option<(PathPlan, SegmentFrame)>,
    track: Track,
    lead: usize,
    boundaries: Vec<usize>,
    notes: Vec<Note>,
}

/// Frames that one plan makes.
#[derive(Debug, Clone, Copy)]
struct Stretch {
    /// Its first frame, and one behind its last, of the motion: negative before its begin.
    from: i64,
    to: i64,
    seed: u64,
    /// Frames that the plan makes, where its last ones are the loop's first.
    closes: Option<usize>,
}

impl Follow {
    /// A sample of a take.
    pub fn new(take: &Take, sample: usize) -> Self {
        let mut notes = Vec::new();
        let by_path = take.model.rig().by_path.as_ref();
        let usual_mps = by_path.map_or(0.0, |body| body.usual_speed_mps);
        let mut way = Way::of(take, sample, usual_mps, &mut notes);
        let mut stretches = Vec::new();
        let dims = take.model.rig().dims;
        let frames = take.frames as i64;
        let lead = match take.is_loop && take.frames > dims.context_frames {
            true => {
                way.begun_before(BEFORE);
                let seed = window_seed(take.seed, sample, usize::from(u16::MAX));
                stretches.push(Stretch {
                    from: -(BEFORE as i64),
                    to: 1,
                    seed,
                    closes: None,
                });
                // Windows are of whole tokens, so the end that is closed may come a few frames
                // later.
                let fresh = (take.frames - 1).next_multiple_of(dims.frames_per_token);
                stretches.push(Stretch {
                    from: 1,
                    to: frames,
                    seed: window_seed(take.parts[0].seed.unwrap_or(take.seed), sample, 0),
                    closes: Some(fresh.max(dims.min_frames())),
                });
                BEFORE
            }
            false => {
                let mut from = 0;
                for (index, part) in take.parts.iter().enumerate() {
                    let to = part.end as i64;
                    if to > from {
                        let seed = window_seed(part.seed.unwrap_or(take.seed), sample, index);
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

    /// What the model is to make next; none where all is done.
    ///
    /// # Errors
    /// [`FieldError`] where the path is not one that the model takes.
    pub fn ask(&mut self) -> Result<Option<Task>, FieldError> {
        loop {
            if let Some((plan, frame)) = &mut self.plan {
                if let Some((task, at)) = plan.next() {
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
            // A stretch of a single frame is made longer.
            let begun = (self.lead as i64 + stretch.from).max(0) as usize;
            if self.track.len() > begun {
                self.track = self.track.part(0, begun);
            }
            let goal = self.goal(&stretch);
            let past = self.keyframes(self.track.len());
            let pack: &Pack = &self.take.model.loaded.pack;
            let mut plan = PathPlan::new(&goal, &past, stretch.seed, pack)?;
            // Each sample would say the same.
            if self.sample == 0 {
                let notes = std::mem::take(&mut plan.notes).into_iter();
                self.notes.extend(notes.map(|note| Note::warning("path", note)));
            }
            let origin = SegmentFrame::from_root(GlobalRoot::new(Vec3::ZERO, 0.0));
            self.plan = Some((plan, origin));
        }
    }

    /// Takes what the model made of [`ask`](Self::ask).
    ///
    /// # Errors
    /// [`NonFinite`] where its numbers are not usable.
    pub fn take(&mut self, motion: &Motion) -> Result<(), NonFinite> {
        check_finite(motion)?;
        let Some((plan, frame)) = &mut self.plan else {
            return Ok(());
        };
        let whole = Track::of_motion(motion, frame, &plan.body.rig);
        let context = plan.body.rig.dims.context_frames;
        let (fresh, _) = plan.take(motion, frame);
        let mut made = Track::of_motion(&fresh, frame, &plan.body.rig);
        let before = self.track.len();
        if let Some(last) = before.checked_sub(1).filter(|_| before >= context) {
            // The network's own context is near the frames that it was given.
            let of = |track: &Track, frame: usize| (track.roots[frame], track.pose(frame).to_vec());
            let (was, is) = (of(&whole, context - 1), of(&self.track, last));
            made.join((was.0, &was.1), (is.0, &is.1), LEAD_FRAMES);
        }
        self.track.extend(&made, 0, made.len());
        // So few frames are no past to go on from.
        if before < self.rig().dims.context_frames {
            self.track.lead_over(before, LEAD_FRAMES);
        }
        Ok(())
    }

    /// The frames, those at which windows begin, and what is good to know.
    pub fn done(self) -> (Track, Vec<usize>, Vec<Note>) {
        let frames = self.take.frames;
        let inside = self
            .boundaries
            .iter()
            .filter_map(|frame| frame.checked_sub(self.lead));
        let boundaries = inside.filter(|&frame| frame > 0 && frame < frames).collect();
        (self.track.part(self.lead, frames), boundaries, self.notes)
    }

    fn rig(&self) -> &Rig {
        self.take.model.rig()
    }

    /// The last frames before frame `end` of the track as keyframes; none where there are none.
    fn keyframes(&self, end: usize) -> Vec<v1::Keyframe> {
        let Some(from) = end.checked_sub(self.rig().dims.context_frames) else {
            return Vec::new();
        };
        let skeleton = &self.rig().skeleton;
        let key = |frame: usize| keyframe(self.track.root(frame, skeleton), self.track.pose(frame));
        (from..end).map(key).collect()
    }

    /// The path of a stretch. Where there is a past its time 0 is the past's last frame.
    fn goal(&self, stretch: &Stretch) -> v1::PathGoal {
        let fps = self.take.clock.native_fps;
        let has_past = self.track.len() >= self.rig().dims.context_frames;
        let begin = stretch.from - i64::from(has_past);
        let frames = (stretch.to - 1 - begin) as f32;
        // A stretch that closes a loop is made a little longer, and pressed together again.
        let made = stretch.closes.map_or(frames, |fresh| fresh as f32);
        let count = (frames / fps * POINTS_PER_S).ceil().max(1.0) as usize;
        let times = (0..=count).map(|nth| nth as f32 / count as f32);
        let mut points: Vec<v1::PathPoint> = times
            .map(|share| {
                let [x, z, heading] = self.way.at(begin as f32 + share * frames);
                v1::PathPoint {
                    position: Some(v1::Vec3 { x, y: 0.0, z }),
                    heading: Some(heading),
                    time: Some(share * made / fps),
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
                let mut root = self.track.root(frame, &self.rig().skeleton);
                root.position += travel;
                targets.push(keyframe(root, self.track.pose(frame)));
            }
        }
        let word = self.take.look.word.iter();
        v1::PathGoal {
            points,
            seconds: Some((made / fps).max(1e-3)),
            body: self
                .take
                .model
                .body()
                .map(|body| body.name.clone())
                .unwrap_or_default(),
            style: word
                .map(|word| v1::StyleWord {
                    word: word.clone(),
                    weight: Some(1.0),
                })
                .collect(),
            steps: self.take.look.steps,
            guidance: self.take.look.guidance,
            targets,
            ..v1::PathGoal::default()
        }
    }

    /// Presses a loop that was made longer into its frames.
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

fn keyframe(root: GlobalRoot, pose: &[Quat]) -> v1::Keyframe {
    let Vec3 { x, y, z } = root.position;
    v1::Keyframe {
        root: Some(v1::Root {
            position: Some(v1::Vec3 { x, y, z }),
            heading: None,
        }),
        pose: Some(v1::Pose {
            rotations: pose.iter().copied().flat_map(to_wxyz).collect(),
            root_height: None,
        }),
        ..v1::Keyframe::default()
    }
}
