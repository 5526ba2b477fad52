//! Frames of a performance that have come and are not in the buffer yet.

use troupe_motion::SegmentFrame;

use super::super::buffer::Frames;
use super::super::policy::MARGIN_FRAMES;
use super::{MAX_PERFORMANCE_FRAMES, WordsPart};

/// Frames with which a performance begins: what a fade takes, and some more.
pub(super) const BEGIN_FRAMES: usize = 2 * MARGIN_FRAMES as usize;
/// About how many frames a part has.
const PART_FRAMES: i64 = 32;
/// Frames that the next part is expected to take at least: the first may have come before others
/// asked for theirs.
const LEAST_EXPECTED: i64 = 30;

/// Frames in their segment frame, by column, and how they came.
#[derive(Debug, Default)]
pub(super) struct Script {
    waiting: WordsPart,
    /// Frames that have come so far.
    come: usize,
    /// The frame at which the newest came.
    newest_at: i64,
    /// No more will come.
    whole: bool,
    /// Why, where that is no end that the model gave.
    failure: Option<String>,
}

impl Script {
    /// Takes frames that came at frame `now`, as many as a performance may have.
    pub(super) fn take(&mut self, part: WordsPart, now: i64, is_last: bool) {
        let room = (MAX_PERFORMANCE_FRAMES as usize).saturating_sub(self.come);
        let part = part.first(room);
        self.come += part.frames();
        self.newest_at = now;
        self.whole |= is_last || self.come >= MAX_PERFORMANCE_FRAMES as usize;
        self.waiting.append(part);
    }

    /// No more will come.
    pub(super) fn fail(&mut self, reason: String) {
        self.whole = true;
        self.failure = Some(reason);
    }

    /// No more will come.
    pub(super) fn is_whole(&self) -> bool {
        self.whole
    }

    /// Why no more come, where that is no end.
    pub(super) fn take_failure(&mut self) -> Option<String> {
        self.failure.take()
    }

    /// All frames that have come are in the buffer.
    pub(super) fn is_empty(&self) -> bool {
        self.waiting.frames() == 0
    }

    /// Whether a performance may begin for one who waits for every frame of it: there are more than
    /// the last `reserve` frames.
    pub(super) fn is_enough(&self, reserve: i64) -> bool {
        let held = self.waiting.frames();
        self.whole || held >= BEGIN_FRAMES && held as i64 > reserve
    }

    /// Whether a performance that was asked for at frame `asked` may begin for one who waits for
    /// nothing: beyond the last `reserve` frames there are as many as the next part is expected to
    /// take, by the time that those before took.
    pub(super) fn will_last(&self, asked: i64, reserve: i64) -> bool {
        let held = self.waiting.frames() as i64;
        let took = (self.newest_at - asked).max(1);
        let expected = (took * PART_FRAMES / held.max(1)).max(LEAST_EXPECTED);
        self.is_enough(reserve) && (self.whole || held >= reserve + expected)
    }

    /// The first `count` of the frames that wait, or all, where they lie in the world.
    pub(super) fn give(&mut self, count: usize, lies: &SegmentFrame) -> WordsPart {
        let mut part = self.waiting.split_off_first(count);
        part.lay(lies);
        part
    }
}

impl WordsPart {
    /// How many.
    pub fn frames(&self) -> usize {
        self.roots.len()
    }

    pub(super) fn columns(&self) -> Frames<'_> {
        Frames {
            roots: &self.roots,
            rotations: &self.rotations,
            contacts: &self.contacts,
        }
    }

    fn joints(&self) -> usize {
        self.rotations.len() / self.roots.len().max(1)
    }

    fn first(mut self, count: usize) -> Self {
        if count < self.frames() {
            self.rotations.truncate(count * self.joints());
            self.roots.truncate(count);
            self.contacts.truncate(count);
        }
        self
    }

    fn append(&mut self, mut other: Self) {
        self.roots.append(&mut other.roots);
        self.rotations.append(&mut other.rotations);
        self.contacts.append(&mut other.contacts);
    }

    fn split_off_first(&mut self, count: usize) -> Self {
        let (count, joints) = (count.min(self.frames()), self.joints());
        Self {
            rotations: self.rotations.drain(..count * joints).collect(),
            roots: self.roots.drain(..count).collect(),
            contacts: self.contacts.drain(..count).collect(),
        }
    }

    /// Brings frames from the segment frame into the world.
    fn lay(&mut self, lies: &SegmentFrame) {
        let joints = self.joints();
        for root in &mut self.roots {
            *root = lies.to_world_position(*root);
        }
        for pose in self.rotations.chunks_exact_mut(joints.max(1)) {
            pose[0] = lies.to_world_rotation(pose[0]).normalize();
        }
    }
}
