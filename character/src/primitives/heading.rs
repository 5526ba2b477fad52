//! The heading spring: a heading of its own that follows the commanded one from command to command.
//!
//! It is not started again from the character at every plan. Every plan's turn would ease in again then, and a character that
//! plans three times a second would never finish a turn in time.

use serde::{Deserialize, Serialize};
use troupe_motion::root::wrap_angle;
use troupe_motion::spring::critically_damped;

use super::recipe::{GAMMA, MAX_TURN, RESYNC_TURN};

/// A heading that follows the commands, as it is at one frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct HeadingSpring {
    /// The frame of the timeline at which it was so.
    frame: u64,
    /// Radians, not wrapped: whole turns keep the way round.
    heading: f32,
    omega: f32,
    /// Where it is drawn to, on the same count.
    target: f32,
}

impl HeadingSpring {
    /// At rest.
    pub(crate) fn new(frame: u64, heading: f32) -> Self {
        Self {
            frame,
            heading,
            omega: 0.0,
            target: heading,
        }
    }

    /// At a frame, on the way to where it comes to rest by itself.
    pub(crate) fn moving(frame: u64, heading: f32, omega: f32) -> Self {
        let heading = wrap_angle(heading);
        Self {
            frame,
            heading,
            omega,
            target: heading + omega / GAMMA,
        }
    }

    /// Heading and angular velocity at a frame.
    pub(crate) fn at(&self, frame: u64, fps: f32) -> (f32, f32) {
        let t = frame.saturating_sub(self.frame) as f32 / fps;
        critically_damped(self.heading, self.omega, self.target, GAMMA, t)
    }

    /// Draws it to `target` from `frame` on, the shorter way round. `None`: to where it comes to rest by itself.
    pub(crate) fn turn_to(&mut self, frame: u64, fps: f32, target: Option<f32>) {
        let (heading, omega) = self.at(frame, fps);
        // Whole turns are dropped here, so that the count stays small.
        self.heading = wrap_angle(heading);
        self.omega = omega;
        self.frame = self.frame.max(frame);
        self.target = match target {
            Some(target) => self.heading + wrap_angle(target - self.heading),
            // No force but the damping's: it never swings back.
            None => self.heading + omega / GAMMA,
        };
    }

    /// Angle that is still to be turned at a frame, radians.
    pub(crate) fn remaining(&self, frame: u64, fps: f32) -> f32 {
        self.target - self.at(frame, fps).0
    }

    /// The turn from `frame` on for a character that faces `actual` there.
    pub(crate) fn turn(&mut self, frame: u64, fps: f32, actual: f32) -> Turn {
        let (mut heading, mut omega) = self.at(frame, fps);
        if wrap_angle(heading - actual).abs() > RESYNC_TURN {
            let target = self.target;
            *self = Self::new(frame, actual);
            self.target = actual + wrap_angle(target - actual);
            (heading, omega) = (actual, 0.0);
        }
        let ahead = wrap_angle(heading - actual) + (self.target - heading);
        let too_far = ahead - ahead.clamp(-MAX_TURN, MAX_TURN);
        Turn {
            heading,
            omega,
            target: self.target - too_far,
            unfinished: too_far != 0.0,
        }
    }
}

/// The headings of one plan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Turn {
    heading: f32,
    omega: f32,
    target: f32,
    unfinished: bool,
}

impl Turn {
    /// More is to be turned than one plan does.
    pub(crate) fn unfinished(&self) -> bool {
        self.unfinished
    }

    /// Heading and angular velocity after `t` seconds. The heading is not wrapped.
    pub(crate) fn at(&self, t: f32) -> (f32, f32) {
        critically_damped(self.heading, self.omega, self.target, GAMMA, t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f32::consts::PI;

    const FPS: f32 = 30.0;

    #[test]
    fn a_quarter_turn_is_done_after_a_second() {
        let mut spring = HeadingSpring::new(100, 0.0);
        spring.turn_to(100, FPS, Some(PI / 2.0));
        let (heading, _) = spring.at(130, FPS);
        // Equation 6: 1 - (1 + 8) e^-8 of the way.
        let want = PI / 2.0 * (1.0 - 9.0 * (-8.0f32).exp());
        assert!((heading - want).abs() < 1e-5);
        assert!((heading - PI / 2.0).abs().to_degrees() < 0.3);
        assert!((spring.remaining(100, FPS) - PI / 2.0).abs() < 1e-6);
    }

    #[test]
    fn it_goes_on_from_command_to_command() {
        let mut spring = HeadingSpring::new(0, 3.0);
        spring.turn_to(0, FPS, Some(-3.0));
        let (before, omega) = spring.at(5, FPS);
        assert!(before > 3.0 && omega > 0.0, "over the seam, the short way");
        spring.turn_to(5, FPS, Some(0.0));
        let (after, same) = spring.at(5, FPS);
        assert!(wrap_angle(after - before).abs() < 1e-5 && (same - omega).abs() < 1e-5);
        // Aiming again at the same changes nothing.
        let (want, _) = spring.at(20, FPS);
        spring.turn_to(11, FPS, Some(0.0));
        assert!(wrap_angle(spring.at(20, FPS).0 - want).abs() < 1e-4);
    }

    #[test]
    fn stopping_in_a_turn_never_swings_back() {
        let mut spring = HeadingSpring::new(0, 0.0);
        spring.turn_to(0, FPS, Some(2.0));
        spring.turn_to(6, FPS, None);
        let mut before = spring.at(6, FPS).0;
        for frame in 7..60 {
            let (heading, omega) = spring.at(frame, FPS);
            assert!(heading >= before && omega >= 0.0);
            before = heading;
        }
        assert!(before < 2.0);
    }

    #[test]
    fn a_plan_turns_no_farther_than_the_cap() {
        let mut spring = HeadingSpring::new(0, 0.0);
        spring.turn_to(0, FPS, Some(3.1));
        let turn = spring.turn(4, FPS, 0.0);
        assert!((turn.at(10.0).0 - MAX_TURN).abs() < 1e-4);
        assert_eq!(turn.at(0.0), spring.at(4, FPS));
        let turn = spring.turn(30, FPS, 2.5);
        assert!(
            (turn.at(10.0).0 - 3.1).abs() < 1e-4,
            "the rest of the way is near enough"
        );
    }

    #[test]
    fn it_starts_again_from_a_character_that_is_elsewhere() {
        let mut spring = HeadingSpring::new(0, 0.0);
        let turn = spring.turn(10, FPS, 3.0);
        assert_eq!(turn.at(0.0), (3.0, 0.0));
        assert!(spring.at(10, FPS).0 == 3.0 && spring.at(100, FPS).0.abs() < 1e-3);
    }

    proptest! {
        #[test]
        fn any_commands_keep_it_finite_and_continuous(
            commands in proptest::collection::vec((0u64..40, proptest::option::of(-1000.0f32..1000.0)), 1..30),
        ) {
            let mut spring = HeadingSpring::new(0, 0.0);
            let mut frame = 0;
            for (wait, target) in commands {
                frame += wait;
                let (before, omega) = spring.at(frame, FPS);
                spring.turn_to(frame, FPS, target);
                let (after, same) = spring.at(frame, FPS);
                prop_assert!(wrap_angle(after - before).abs() < 1e-3 && (same - omega).abs() < 1e-2);
                prop_assert!(after.abs() <= PI + 1e-3 && (spring.target - after).abs() < 2.0 * PI);
            }
        }
    }
}
