//! How fast a robot's hinges turn between the frames that its client gets.

use std::sync::Arc;

use troupe_character::live::FrameOut;
use troupe_motion::robot::HingeRates;

use super::LivePack;

/// Measures the frames of a session, one after another.
#[derive(Debug)]
pub(super) struct ShownRates {
    pack: Arc<LivePack>,
    rates: HingeRates,
    /// Place of the last frame on the session's timeline.
    time_frames: f64,
}

impl ShownRates {
    /// Measures a session of `pack`. None if its skeleton is no robot.
    pub(super) fn of(pack: &Arc<LivePack>) -> Option<Self> {
        pack.shown().robot.as_ref()?;
        Some(Self {
            pack: Arc::clone(pack),
            rates: HingeRates::default(),
            time_frames: 0.0,
        })
    }

    /// Completes a frame, which is at `time_frames` of the timeline.
    pub(super) fn measure(&mut self, time_frames: f64, out: &mut FrameOut) {
        let Some(robot) = &self.pack.shown().robot else {
            return;
        };
        let seconds = (time_frames - self.time_frames) as f32 / self.pack.rig().fps;
        self.time_frames = time_frames;
        out.hinge_rate = self.rates.push(robot, &out.fitted.angles, seconds);
        if out.hinge_rate.speed_ratio > 1.0 {
            self.pack.metrics.too_fast();
        }
    }
}
