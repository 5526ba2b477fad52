//! What a character shows: its frames, its state, and its future.

use troupe_motion::robot::Fitted;
use troupe_motion::terrain::Lift;
use troupe_motion::{GlobalRoot, Quat, Vec3};

use super::{Character, FrameOut, Intent, Peek, SUB_FRAMES, View, WaitingCommand};

/// Frames ahead of a keyframe from which [`Character::reaches`] lists its joints.
pub const REACH_LEAD_FRAMES: i64 = 10;

impl Character {
    /// The frame of the timeline at the cursor, between two frames too.
    pub fn time_frames(&self) -> f64 {
        self.timeline.cursor() as f64 / f64::from(SUB_FRAMES)
    }

    /// Samples the frame at the cursor.
    pub fn sample(&self, out: &mut FrameOut) {
        (out.root, out.contacts) = self.shown(self.timeline.cursor(), &mut out.rotations, &mut out.fitted);
        out.frame = self.timeline.frame() as u64;
        out.underrun = self.timeline.slowing();
    }

    /// The motion at `cursor`, in sub-frames, as it is shown: that of the buffer after
    /// post-processing.
    pub(super) fn shown(&self, cursor: i64, rotations: &mut Vec<Quat>, fitted: &mut Fitted) -> (Vec3, u8) {
        let (mut root, contacts) = self.timeline.buffer().sample(cursor, rotations);
        self.post_process(frame_of(cursor), &mut root, rotations, fitted);
        (root, contacts)
    }

    /// Heights of what the character stands on at the cursor, in the middle and under each foot, in
    /// the order of its legs. What [`Character::sample`] gives is lifted by that from flat ground
    /// at height 0.
    pub fn lift(&self) -> Lift {
        let (frame, part) = frame_of(self.timeline.cursor());
        let post = self.post.as_ref();
        post.map(|post| post.lift(frame, part)).unwrap_or_default()
    }

    /// The joints that a keyframe holds at places of the scene at the cursor, or will within
    /// [`REACH_LEAD_FRAMES`], into a list that is cleared first. If the character is shown on
    /// another body, the same joints of that body belong at the same places.
    pub fn reaches(&self, into: &mut Vec<usize>) {
        into.clear();
        if let Some(behaviour) = &self.behaviour {
            behaviour.reaches(self.timeline.frame(), into);
        }
    }

    /// Turns a frame of the buffer, `part` of the way (0 to 1) to the next, into one that is shown:
    /// lifted onto the ground, with a bent arm if it carries something, and on a robot's hinges.
    fn post_process(
        &self,
        (frame, part): (i64, f32),
        root: &mut Vec3,
        rotations: &mut [Quat],
        fitted: &mut Fitted,
    ) {
        let skeleton = &self.rig.skeleton;
        if let Some(post) = &self.post {
            post.apply(skeleton, (frame, part), root, rotations);
        }
        // Last, so that everything reported about the frame is about the same pose.
        match &skeleton.robot {
            Some(robot) => robot.fit(rotations, fitted),
            None => fitted.clear(),
        }
    }

    /// The character's state at the cursor.
    pub fn view(&self) -> View {
        let cursor = self.timeline.cursor();
        let (mut pose, mut before, mut fitted) = (Vec::new(), Vec::new(), Fitted::default());
        let (position, _) = self.shown(cursor, &mut pose, &mut fitted);
        let (before, _) = self.shown(cursor - i64::from(SUB_FRAMES), &mut before, &mut fitted);
        let way = (position - before).with_y(0.0).length();
        let pelvis = pose.first().copied().unwrap_or_default();
        View {
            frame: self.timeline.frame() as u64,
            root: GlobalRoot::of_pose(position, pelvis, self.rig.skeleton.left_axis),
            speed_mps: way * self.rig.fps,
            buffered_frames: self.timeline.frames_left() as u32,
            last_sequence: self.inbox.last_sequence(),
            stats: self.timeline.stats(),
        }
    }

    /// Up to `frames` frames beyond the cursor, and the plan that they come from.
    pub fn peek(&self, frames: usize) -> Peek {
        let first = self.timeline.frame() + 1;
        let last = first.saturating_add_unsigned(frames as u64).saturating_sub(1);
        let future = self.timeline.buffer().range(first, last);
        let (mut roots, mut rotations) = (future.roots.to_vec(), future.rotations.to_vec());
        let poses = rotations.chunks_exact_mut(self.rig.skeleton.joint_count());
        let mut fitted = Fitted::default();
        for (frame, (root, pose)) in (first..).zip(roots.iter_mut().zip(poses)) {
            self.post_process((frame, 0.0), root, pose, &mut fitted);
        }
        Peek {
            first_frame: first as u64,
            roots,
            rotations,
            contacts: future.contacts.to_vec(),
            plan: self.planning.newest().cloned(),
            in_flight: self.timeline.awaits_plan(),
            waiting: self.waiting(),
        }
    }

    /// The command that waits: the first for its frame, or the current one if no plan was asked for
    /// with it yet.
    fn waiting(&self) -> Option<WaitingCommand> {
        self.inbox.waiting().cloned().or_else(|| {
            let (sequence, frame) = self.inbox.current()?;
            self.timeline.command_waits().then(|| WaitingCommand {
                sequence,
                frame,
                intent: match self.locomotion.path() {
                    Some(path) => Intent::FollowPath(path.clone()),
                    None => Intent::Locomote(self.locomotion.command().clone()),
                },
            })
        })
    }
}

/// The frame of a cursor, and the share of the way from there to the next.
fn frame_of(cursor: i64) -> (i64, f32) {
    let sub_frames = i64::from(SUB_FRAMES);
    let (frame, rest) = (cursor.div_euclid(sub_frames), cursor.rem_euclid(sub_frames));
    (frame, rest as f32 / SUB_FRAMES as f32)
}
