//! Frames of a performance that have arrived and are not in the buffer yet.

use troupe_motion::SegmentFrame;

use super::super::buffer::Frames;
use super::super::policy::MARGIN_FRAMES;
use super::{MAX_PERFORMANCE_FRAMES, WordsPart};

/// Fewest frames with which a performance begins: a fade, and some more.
pub(super) const BEGIN_FRAMES: usize = 2 * MARGIN_FRAMES as usize;
/// Usual frames of a part.
const PART_FRAMES: i64 = 32;
/// Fewest frames that the next part is expected to take. The first may have been fast because no
/// other performance asked for parts then.
const LEAST_EXPECTED: i64 = 30;

/// The frames that wait, in their segment frame, and when they arrived.
#[derive(Debug, Default)]
pub(super) struct Script {
    waiting: WordsPart,
    /// Number of frames that have arrived so far.
    come: usize,
    /// The frame at which the newest arrived.
    newest_at: i64,
    /// No more will arrive.
    whole: bool,
    /// Why no more will arrive, unless the model ended.
    failure: Option<String>,
}

impl Script {
    /// Takes frames that arrive at frame `now`, up to the longest performance.
    pub(super) fn take(&mut self, part: WordsPart, now: i64, is_last: bool) {
        let room = (MAX_PERFORMANCE_FRAMES as usize).saturating_sub(self.come);
        let part = part.first(room);
        self.come += part.frames();
        self.newest_at = now;
        self.whole |= is_last || self.come >= MAX_PERFORMANCE_FRAMES as usize;
        self.waiting.append(part);
    }

    /// Notes that no more frames will arrive, because of a failure.
    pub(super) fn fail(&mut self, reason: String) {
        self.whole = true;
        self.failure = Some(reason);
    }

    /// Whether no more frames will arrive.
    pub(super) fn is_whole(&self) -> bool {
        self.whole
    }

    /// Takes the failure that ended the frames; none if the model ended.
    pub(super) fn take_failure(&mut self) -> Option<String> {
        self.failure.take()
    }

    /// All frames that have arrived are in the buffer.
    pub(super) fn is_empty(&self) -> bool {
        self.waiting.frames() == 0
    }

    /// Whether a performance may begin on a clock that waits for its frames: more than the last
    /// `reserve` are there.
    pub(super) fn is_enough(&self, reserve: i64) -> bool {
        let held = self.waiting.frames();
        self.whole || held >= BEGIN_FRAMES && held as i64 > reserve
    }

    /// Whether a performance that was asked for at frame `asked` may begin on a clock that does not
    /// wait. Beyond the last `reserve` frames there must be as many as the next part is expected to
    /// take, from the time that parts took so far.
    pub(super) fn will_last(&self, asked: i64, reserve: i64) -> bool {
        let held = self.waiting.frames() as i64;
        let took = (self.newest_at - asked).max(1);
        let expected = (took * PART_FRAMES / held.max(1)).max(LEAST_EXPECTED);
        self.is_enough(reserve) && (self.whole || held >= reserve + expected)
    }

    /// Hands over the first `count` frames that wait, or all, moved into the world by `lies`.
    pub(super) fn give(&mut self, count: usize, lies: &SegmentFrame) -> WordsPart {
        let mut part = self.waiting.split_off_first(count);
        part.lay(lies);
        part
    }
}

impl WordsPart {
    /// Number of frames.
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

    /// Moves frames from the segment frame into the world.
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
