//! The inputs of the evaluator.

use troupe_client::CONTEXT_FRAMES;
use troupe_motion::clip::Clip;
use troupe_motion::fk::WorldMotion;
use troupe_motion::rotation::six_d;
use troupe_motion::segment::SegmentFrame;

/// The inputs of windows of one length, one window after the other.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Inputs {
    pub(super) root: Vec<f32>,
    pub(super) positions: Vec<f32>,
    pub(super) six_d: Vec<f32>,
}

impl Inputs {
    /// Adds a window.
    pub(super) fn push(&mut self, clip: &Clip) {
        let frame = SegmentFrame::from_root(clip.root_at((CONTEXT_FRAMES - 1).min(clip.frames() - 1)));
        let motion = WorldMotion::from_clip(clip);
        for f in 0..clip.frames() {
            let root = clip.root_at(f);
            self.root.extend(frame.to_segment_root(root).to_array());
            for (&position, &rotation) in motion.positions_at(f).iter().zip(motion.rotations_at(f)) {
                let place = frame.to_segment_vector(position - root.projected());
                self.positions.extend(place.to_array());
                self.six_d.extend(six_d(frame.to_segment_rotation(rotation)));
            }
        }
    }
}
