//! The heading spring: its own heading, which follows the commanded one from command to command.
//!
//! It does not start again from the character at every plan. Otherwise the turn would ease in again
//! with every plan, and a character that plans three times a second would never finish a turn in
//! time.

use serde::{Deserialize, Serialize};
use troupe_motion::root::wrap_angle;
use troupe_motion::spring::critically_damped;

use super::recipe::{MAX_TURN, RESYNC_TURN, TURN_GAMMA, TURN_S};

/// State of the spring at one frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct HeadingSpring {
    /// Frame of the timeline that the state belongs to.
    frame: u64,
    turn: Turn,
}

impl HeadingSpring {
    /// A spring at rest.
    pub(crate) fn new(frame: u64, heading: f32) -> Self {
        let turn = Turn {
            heading,
            omega: 0.0,
            goal: heading,
            target: heading,
            rate_rps: 0.0,
            unfinished: false,
        };
        Self { frame, turn }
    }

    /// A spring that is turning at rate `omega`, rad/s, and comes to rest by itself.
    pub(crate) fn moving(frame: u64, heading: f32, omega: f32) -> Self {
        let mut spring = Self::new(frame, wrap_angle(heading));
        spring.turn.omega = omega;
        spring.turn.rest();
        spring
    }

    fn passed_s(&self, frame: u64, fps: f32) -> f32 {
        frame.saturating_sub(self.frame) as f32 / fps
    }

    /// Heading and angular velocity at a frame, radians and rad/s.
    pub(crate) fn at(&self, frame: u64, fps: f32) -> (f32, f32) {
        self.turn.at(self.passed_s(frame, fps))
    }

    /// Leads the heading to `target` from `frame` on, the shorter way round, at most at `most_rps`.
    /// `None`: to where it comes to rest by itself.
    pub(crate) fn turn_to(&mut self, frame: u64, fps: f32, target: Option<f32>, most_rps: f32) {
        let (passed, (heading, omega)) = (self.passed_s(frame, fps), self.at(frame, fps));
        let goal = self.turn.goal_at(passed) - heading;
        self.frame = self.frame.max(frame);
        // Drops whole turns, so that the count stays small.
        let turn = &mut self.turn;
        turn.heading = wrap_angle(heading);
        turn.omega = omega;
        let Some(target) = target else {
            return turn.rest();
        };
        let ahead = wrap_angle(target - turn.heading);
        turn.target = turn.heading + ahead;
        // The goal's lead over the heading counts only in the direction of the new target.
        turn.goal = turn.heading + goal.clamp(ahead.min(0.0), ahead.max(0.0));
        turn.rate_rps = ((turn.target - turn.goal).abs() / TURN_S).min(most_rps);
    }

    /// Angle still to be turned at a frame, radians.
    pub(crate) fn remaining(&self, frame: u64, fps: f32) -> f32 {
        self.turn.target - self.at(frame, fps).0
    }

    /// The turn from `frame` on for a character that faces `actual` there.
    pub(crate) fn turn(&mut self, frame: u64, fps: f32, actual: f32) -> Turn {
        let (heading, omega) = self.at(frame, fps);
        if wrap_angle(heading - actual).abs() > RESYNC_TURN {
            let (target, rate_rps) = (self.turn.target, self.turn.rate_rps);
            *self = Self::new(frame, actual);
            self.turn.target = actual + wrap_angle(target - actual);
            self.turn.rate_rps = rate_rps.max((self.turn.target - actual).abs() / TURN_S);
        } else {
            let goal = self.turn.goal_at(self.passed_s(frame, fps));
            self.turn = Turn {
                heading,
                omega,
                goal,
                ..self.turn
            };
            self.frame = self.frame.max(frame);
        }
        let turn = self.turn;
        let ahead = wrap_angle(turn.heading - actual) + (turn.target - turn.heading);
        let too_far = ahead - ahead.clamp(-MAX_TURN, MAX_TURN);
        let target = turn.target - too_far;
        Turn {
            // Not beyond the target, from whichever side the turn comes.
            goal: match too_far > 0.0 {
                true => turn.goal.min(target),
                false if too_far < 0.0 => turn.goal.max(target),
                false => turn.goal,
            },
            target,
            unfinished: too_far != 0.0,
            ..turn
        }
    }
}

/// The headings of one plan: a critically damped spring that follows a goal. The goal moves to the
/// target at a steady rate, and the heading never turns faster, however far the target is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Turn {
    /// Radians, not wrapped: whole turns keep the way round.
    heading: f32,
    omega: f32,
    /// The goal that the spring follows, and the target of the goal; radians, not wrapped.
    goal: f32,
    target: f32,
    /// Rate of the goal, rad/s.
    rate_rps: f32,
    unfinished: bool,
}

impl Turn {
    /// Whether the turn is longer than one plan.
    pub(crate) fn unfinished(&self) -> bool {
        self.unfinished
    }

    /// From here on only damping acts, so the heading never swings back.
    fn rest(&mut self) {
        self.target = self.heading + self.omega / TURN_GAMMA;
        self.goal = self.target;
        self.rate_rps = 0.0;
    }

    /// Seconds until the goal is at the target.
    fn goal_s(&self) -> f32 {
        let way = (self.target - self.goal).abs();
        if way > 0.0 && self.rate_rps > 0.0 {
            way / self.rate_rps
        } else {
            0.0
        }
    }

    fn goal_at(&self, t: f32) -> f32 {
        let (whole, way) = (self.goal_s(), self.target - self.goal);
        if t < whole {
            self.goal + way * (t / whole)
        } else {
            self.target
        }
    }

    /// Heading and angular velocity after `t` seconds. The heading is not wrapped.
    pub(crate) fn at(&self, t: f32) -> (f32, f32) {
        let whole = self.goal_s();
        if whole == 0.0 {
            return critically_damped(self.heading, self.omega, self.target, TURN_GAMMA, t);
        }
        let (heading, omega) = critically_damped(self.heading, self.omega, self.goal, TURN_GAMMA, t);
        let rate = (self.target - self.goal) / whole;
        let ((here, speed), (after, later)) = (follows(t), follows(t - whole));
        (heading + rate * (here - after), omega + rate * (speed - later))
    }
}

/// Position and velocity, after `t` seconds, of a critically damped spring that starts at rest and
/// whose goal moves away at 1 a second.
fn follows(t: f32) -> (f32, f32) {
    if t <= 0.0 {
        return (0.0, 0.0);
    }
    let (lag, left) = (2.0 / TURN_GAMMA, (-TURN_GAMMA * t).exp());
    (t - lag + (t + lag) * left, 1.0 - (1.0 + TURN_GAMMA * t) * left)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f32::consts::PI;

    const FPS: f32 = 30.0;
    /// Fastest turn in these tests, rad/s.
    const MOST: f32 = 4.5;

    #[test]
    fn a_quarter_turn_is_done_after_a_second() {
        let mut spring = HeadingSpring::new(100, 0.0);
        spring.turn_to(100, FPS, Some(PI / 2.0), MOST);
        let (heading, _) = spring.at(130, FPS);
        assert!((heading - PI / 2.0).abs().to_degrees() < 0.3);
        assert!((spring.remaining(100, FPS) - PI / 2.0).abs() < 1e-6);
    }

    #[test]
    fn it_continues_from_command_to_command() {
        let mut spring = HeadingSpring::new(0, 3.0);
        spring.turn_to(0, FPS, Some(-3.0), MOST);
        let (before, omega) = spring.at(5, FPS);
        assert!(before > 3.0 && omega > 0.0, "over the seam, the short way");
        spring.turn_to(5, FPS, Some(0.0), MOST);
        let (after, same) = spring.at(5, FPS);
        assert!(wrap_angle(after - before).abs() < 1e-5 && (same - omega).abs() < 1e-5);
        // Setting the same target again changes nothing.
        let (want, _) = spring.at(20, FPS);
        spring.turn_to(11, FPS, Some(0.0), MOST);
        assert!(wrap_angle(spring.at(20, FPS).0 - want).abs() < 1e-4);
    }

    #[test]
    fn stopping_in_a_turn_never_swings_back() {
        let mut spring = HeadingSpring::new(0, 0.0);
        spring.turn_to(0, FPS, Some(2.0), MOST);
        spring.turn_to(6, FPS, None, MOST);
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
        spring.turn_to(0, FPS, Some(3.1), MOST);
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

    #[test]
    fn no_turn_exceeds_its_rate() {
        for angle in [0.3, 1.0, 2.0, 3.1] {
            let mut spring = HeadingSpring::new(0, 0.0);
            spring.turn_to(0, FPS, Some(angle), MOST);
            let rates: Vec<f32> = (0..60).map(|frame| spring.at(frame, FPS).1).collect();
            assert!(rates.iter().all(|rate| (0.0..=MOST).contains(rate)), "{rates:?}");
            // The heading is the sum of the rates.
            let turned: f32 = rates.iter().sum::<f32>() / FPS;
            assert!((turned - angle).abs() < 0.01, "{turned}");
            assert!((spring.at(30, FPS).0 - angle).abs().to_degrees() < 10.0);
        }
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
                spring.turn_to(frame, FPS, target, MOST);
                let (after, same) = spring.at(frame, FPS);
                prop_assert!(wrap_angle(after - before).abs() < 1e-3 && (same - omega).abs() < 1e-2);
                prop_assert!(after.abs() <= PI + 1e-3 && (spring.turn.target - after).abs() < 2.0 * PI);
            }
        }
    }
}
