//! The velocity ramp: its own velocity, which follows the commanded one with no more acceleration
//! than bodies show.
//!
//! Equation 6 asks for the commanded velocity at once. The networks then turn a walk round with 8
//! m/s², although no clip of a turn has much more than 4. Like the heading spring, the ramp
//! continues from command to command. A ramp that started again from the character at every plan
//! would never finish for a character that plans three times a second.

use serde::{Deserialize, Serialize};
use troupe_motion::Vec3;

use super::recipe::{CHANGE_S, GAMMA, LEAST_CHANGE_MPS, RESYNC_MPS, STILL, VELOCITY_LAG_S};

/// State of the ramp at one frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct VelocityRamp {
    /// Frame of the timeline that the state belongs to.
    frame: u64,
    velocity: Vec3,
    target: Vec3,
    /// Acceleration, m/s².
    rate_mps2: f32,
    /// It has not been set to a character's velocity yet.
    fresh: bool,
    /// It changes only from the next plan's first frame on: until then the character moves as
    /// before.
    waits: bool,
}

impl VelocityRamp {
    /// A ramp that takes the velocity of the character at its first plan.
    pub(crate) fn new(frame: u64) -> Self {
        Self {
            frame,
            velocity: Vec3::ZERO,
            target: Vec3::ZERO,
            rate_mps2: 0.0,
            fresh: true,
            waits: false,
        }
    }

    /// Leads the velocity to `target` from `frame` on, at `rate_mps2`, or faster if that would take
    /// longer than [`CHANGE_S`].
    pub(crate) fn go_to(&mut self, frame: u64, fps: f32, target: Vec3, rate_mps2: f32) {
        let now = self.ahead(frame, fps);
        *self = Self {
            frame: self.frame.max(frame),
            velocity: now.velocity,
            target,
            rate_mps2: rate_mps2.max(now.velocity.distance(target) / CHANGE_S),
            // A change under way goes on. Otherwise a command in every frame would stop all
            // progress.
            waits: self.waits || !now.changes(),
            ..*self
        };
    }

    /// The velocities after `frame`.
    pub(crate) fn ahead(&self, frame: u64, fps: f32) -> Ramp {
        let passed = frame.saturating_sub(self.frame) as f32 / fps;
        let whole = Ramp {
            velocity: self.velocity,
            target: self.target,
            rate_mps2: self.rate_mps2,
        };
        Ramp {
            velocity: whole.velocity(passed),
            ..whole
        }
    }

    /// The velocities after `frame`, at which a plan starts, for a character that moves at `actual`
    /// there.
    ///
    /// Time lost before the plan's start is not made up, except by a standing character: a start
    /// may be sudden but must not be late.
    pub(crate) fn ramp(&mut self, frame: u64, fps: f32, actual: Vec3) -> Ramp {
        if std::mem::take(&mut self.waits) && actual.length() >= STILL.0 {
            self.frame = self.frame.max(frame);
        }
        let ahead = self.ahead(frame, fps);
        let gained_mps = match ahead.changes() {
            true => self.rate_mps2 * VELOCITY_LAG_S,
            false => 0.0,
        };
        if !self.fresh && ahead.velocity.distance(actual) <= RESYNC_MPS + gained_mps {
            return ahead;
        }
        *self = Self {
            frame,
            velocity: actual,
            fresh: false,
            ..*self
        };
        self.go_to(frame, fps, self.target, self.rate_mps2);
        self.waits = false;
        self.ahead(frame, fps)
    }
}

/// The velocities of one plan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Ramp {
    velocity: Vec3,
    target: Vec3,
    rate_mps2: f32,
}

impl Ramp {
    /// Whether the velocity changes.
    pub(crate) fn changes(&self) -> bool {
        self.velocity.distance(self.target) > LEAST_CHANGE_MPS
    }

    /// Travel after `t` seconds, metres, of a character that moves at `actual` at first and comes
    /// to the ramp by the damping of equation 6.
    pub(crate) fn way_from(&self, actual: Vec3, t: f32) -> Vec3 {
        self.way(t) + (actual - self.velocity) * ((1.0 - (-GAMMA * t).exp()) / GAMMA)
    }

    /// Seconds until the ramp reaches its target.
    fn length_s(&self) -> f32 {
        let apart = self.velocity.distance(self.target);
        if apart > 0.0 { apart / self.rate_mps2 } else { 0.0 }
    }

    /// Velocity after `t` seconds, m/s.
    pub(crate) fn velocity(&self, t: f32) -> Vec3 {
        let length = self.length_s();
        if t >= length {
            return self.target;
        }
        self.velocity.lerp(self.target, t / length)
    }

    /// Travel after `t` seconds, metres.
    pub(crate) fn way(&self, t: f32) -> Vec3 {
        let length = self.length_s();
        let ramp = t.min(length);
        (self.velocity + self.velocity(ramp)) * (0.5 * ramp) + self.target * (t - ramp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FPS: f32 = 30.0;

    #[test]
    fn a_change_takes_as_long_as_the_rate_says() {
        let mut ramp = VelocityRamp::new(10);
        ramp.go_to(10, FPS, Vec3::Z * 1.5, 3.0);
        let ahead = ramp.ahead(10, FPS);
        assert_eq!(
            (ahead.velocity(0.25), ahead.velocity(0.5), ahead.velocity(2.0)),
            (Vec3::Z * 0.75, Vec3::Z * 1.5, Vec3::Z * 1.5)
        );
        // Half of the speed for half a second, then all of it.
        assert!((ahead.way(1.5).z - (0.75 * 0.5 + 1.5)).abs() < 1e-6);
        // No change takes longer than its limit.
        ramp.go_to(40, FPS, Vec3::Z * -4.5, 3.0);
        assert!((ramp.ahead(40, FPS).velocity(CHANGE_S).z + 4.5).abs() < 1e-5);
    }

    #[test]
    fn it_continues_from_command_to_command_and_resyncs_to_a_character_elsewhere() {
        let mut ramp = VelocityRamp::new(0);
        ramp.go_to(0, FPS, Vec3::Z * 2.0, 3.0);
        assert_eq!(ramp.ramp(0, FPS, Vec3::ZERO).velocity(0.0), Vec3::ZERO);
        let before = ramp.ahead(10, FPS).velocity(0.0);
        ramp.go_to(10, FPS, Vec3::X * 2.0, 3.0);
        assert!(ramp.ahead(10, FPS).velocity(0.0).abs_diff_eq(before, 1e-5));
        let same = ramp.ahead(15, FPS);
        assert_eq!(ramp.ramp(15, FPS, same.velocity(0.0) + Vec3::X * 0.5), same);
        let from = ramp.ramp(15, FPS, Vec3::Z * -3.0);
        assert_eq!(from.velocity(0.0), Vec3::Z * -3.0);
        assert_eq!(from.velocity(2.0), Vec3::X * 2.0);
    }

    #[test]
    fn a_moving_character_changes_from_the_plan_on_a_standing_one_from_the_command_on() {
        let commanded = |from: Vec3, target: Vec3| {
            let mut ramp = VelocityRamp::new(0);
            ramp.go_to(0, FPS, from, 3.0);
            ramp.ramp(0, FPS, from);
            ramp.go_to(30, FPS, target, 3.0);
            ramp
        };
        let (ahead, aside) = (Vec3::Z * 1.2, Vec3::X * 1.2);
        let turned = commanded(ahead, aside).ramp(33, FPS, ahead);
        assert!(turned.velocity(0.0).abs_diff_eq(ahead, 1e-5));
        let started = commanded(Vec3::ZERO, ahead).ramp(33, FPS, Vec3::ZERO);
        assert!(started.velocity(0.0).abs_diff_eq(Vec3::Z * 0.3, 1e-5));
    }

    #[test]
    fn commands_in_every_frame_do_not_stop_it() {
        let mut ramp = VelocityRamp::new(0);
        ramp.go_to(0, FPS, Vec3::Z, 3.0);
        ramp.ramp(0, FPS, Vec3::Z);
        for frame in 30..50 {
            ramp.go_to(frame, FPS, Vec3::X * (1.0 + frame as f32 * 1e-3), 3.0);
            let now = ramp.ahead(frame, FPS).velocity(0.0);
            ramp.ramp(frame + 2, FPS, now);
        }
        assert!(ramp.ahead(50, FPS).velocity(0.0).distance(Vec3::X) < 0.1);
    }

    #[test]
    fn a_lagging_measurement_does_not_resync_it() {
        let mut ramp = VelocityRamp::new(0);
        ramp.go_to(0, FPS, Vec3::Z * -3.0, 3.0);
        ramp.ramp(0, FPS, Vec3::Z * -3.0);
        ramp.go_to(30, FPS, Vec3::Z * 3.0, 3.0);
        ramp.ramp(32, FPS, Vec3::Z * -3.0);
        let same = ramp.ahead(42, FPS);
        // The velocity of five frames before.
        let lags = ramp.ahead(37, FPS).velocity(0.0);
        assert!(same.velocity(0.0).distance(lags) > RESYNC_MPS);
        assert_eq!(ramp.ramp(42, FPS, lags), same);
    }

    proptest! {
        #[test]
        fn any_commands_keep_it_finite_and_bounded(
            commands in proptest::collection::vec((1u64..40, -5.0f32..5.0, -5.0f32..5.0), 1..30),
        ) {
            let mut ramp = VelocityRamp::new(0);
            let mut frame = 0;
            for (wait, x, z) in commands {
                ramp.go_to(frame, FPS, Vec3::new(x, 0.0, z), 4.0);
                let ahead = ramp.ahead(frame, FPS);
                let change = ahead.velocity(0.1).distance(ahead.velocity(0.0));
                prop_assert!(change <= ahead.rate_mps2 * 0.1 + 1e-4);
                prop_assert!(ahead.velocity(CHANGE_S).abs_diff_eq(Vec3::new(x, 0.0, z), 1e-4));
                // The travel is the sum of the velocities.
                let steps = 200;
                let sum: Vec3 = (0..steps).map(|n| ahead.velocity((n as f32 + 0.5) / steps as f32)).sum();
                prop_assert!((sum / steps as f32).abs_diff_eq(ahead.way(1.0), 0.01));
                frame += wait;
            }
        }
    }
}
