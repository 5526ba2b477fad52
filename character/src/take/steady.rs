//! The windows of a motion along a path, whose feet stand: frames leave once they are final.

use troupe_motion::SegmentFrame;
use troupe_motion::ik::Carried;
use troupe_motion::model::Motion;

use super::path_plan::PathPlan;
use super::track::Track;
use crate::post::plant;

/// Frames that wait for the next window: where a foot comes down says how it gets there.
const AHEAD: usize = 20;
/// Frames that are kept of those that left: speeds are measured over them.
const BEHIND: usize = 8;
/// Frames over which a window leads over from the one before.
const SEAM_FRAMES: usize = 8;

/// Finishes the windows of a [`PathPlan`] in their order. The network goes on from its own frames,
/// so that it makes the same motion as without this.
#[derive(Debug, Default)]
pub struct Steady {
    /// The network's frames: some that left, and all that wait.
    made: Track,
    /// Frames of `made` that left.
    left: usize,
    /// What the feet bring along from the frames that left; none at the begin.
    carried: Option<Carried>,
}

impl Steady {
    /// Takes the network's answer to the plan's newest task, and has the plan take it. Returns the
    /// frames that are final, and whether they are the last.
    pub fn receive(&mut self, plan: &mut PathPlan, motion: &Motion, frame: &SegmentFrame) -> (Track, bool) {
        let context = plan.newest().len();
        let (fresh, is_last) = plan.receive(motion, frame);
        let rig = &plan.body.rig;
        let whole = Track::of_motion(motion, frame, rig);
        if self.made.is_empty() {
            self.made.extend(&whole, 0, context);
            self.left = self.made.len();
        }
        let mut window = whole.part(context, fresh.frames());
        // Given frames are met exactly.
        let targets = if is_last { plan.targets().len() } else { 0 };
        let free = window.len() - targets.min(window.len());
        window.go_on(&self.made, SEAM_FRAMES.min(free));
        self.made.extend(&window, 0, window.len());

        let mut work = self.made.clone();
        let end = work.len();
        let range = self.left..end - targets.min(end - self.left);
        let planted = plant(rig, work.columns(), range, self.carried.as_ref());
        let until = match is_last {
            true => end,
            false => end.saturating_sub(AHEAD).max(self.left),
        };
        let part = work.part(self.left, until - self.left);
        if until > self.left {
            self.carried = Some(planted.at(until - 1));
            let gone = until.saturating_sub(BEHIND);
            self.made = self.made.part(gone, end - gone);
            self.left = until - gone;
        }
        (part, is_last)
    }
}

#[cfg(test)]
#[path = "steady_tests.rs"]
mod tests;
