//! The commands of the characters.

use glam::Vec3;
use troupe_client::Locomotion;
use troupe_motion::rotation::yaw;
use troupe_proto::v1;

/// Frames that all characters stand at first.
pub(super) const START: usize = 30;
/// Frames from the start to the stop of those that go straight on.
pub(super) const STRAIGHT: usize = 210;
/// Frames after the stop, and after a turn.
pub(super) const AFTER: usize = 75;
/// Frames from the start to a turn, at least.
const BEFORE_TURN: usize = 90;
/// A gait that turns faster than this (rad/s) has no straight way to go.
const TURNING_RPS: f32 = 0.3;
/// A gait slower than this (m/s) stands.
const STANDING_MPS: f32 = 0.1;
/// A gait farther off its heading than this (radians) gets a command to face ahead.
const ASIDE: f32 = 0.2;
/// Turns of every style, degrees. 120 comes last, so that the others still begin at the moments
/// of earlier reports.
pub(super) const TURNS: [u16; 4] = [45, 90, 180, 120];

/// One character's commands.
#[derive(Debug, Clone)]
pub(super) struct Scenario {
    pub(super) style: String,
    /// The gait whose speed is commanded.
    pub(super) gait: String,
    /// Frames of that gait's cycle.
    pub(super) period: usize,
    /// Velocity of the first command in the world, m/s; the character faces +Z.
    pub(super) velocity: Vec3,
    /// Where it should face until the second command, radians.
    pub(super) facing: f32,
    pub(super) course: Course,
    /// Commands, each with the frame before which it is given.
    pub(super) commands: Vec<(usize, Locomotion)>,
    pub(super) frames: usize,
}

/// What comes after going straight on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Course {
    /// A command to stand.
    Stop {
        /// Its frame.
        at: usize,
    },
    /// A turn of the way.
    Turn {
        /// Its frame.
        at: usize,
        /// To the left above 0, radians.
        angle: f32,
    },
}

/// All that a style does.
pub(super) fn scenarios(style: &v1::Style) -> Vec<Scenario> {
    let moving =
        |gait: &&v1::Gait| gait.left.hypot(gait.forward) >= STANDING_MPS && gait.turn.abs() <= TURNING_RPS;
    let gaits: Vec<&v1::Gait> = style.gaits.iter().filter(moving).collect();
    let mut all: Vec<Scenario> = gaits.iter().map(|gait| straight(style, gait)).collect();
    let ahead = |gait: &&&v1::Gait| gait.forward > 0.0 && gait.left.atan2(gait.forward).abs() < ASIDE;
    let slowest = gaits
        .iter()
        .filter(ahead)
        .min_by(|a, b| a.forward.total_cmp(&b.forward));
    if let Some(gait) = slowest {
        let turns = TURNS
            .iter()
            .flat_map(|&degrees| [1.0, -1.0].map(|side| (degrees, side)));
        all.extend(
            turns
                .enumerate()
                .map(|(nth, (degrees, side))| turn(style, gait, side * f32::from(degrees).to_radians(), nth)),
        );
    }
    all
}

fn command(velocity: Vec3) -> Locomotion {
    let command = Locomotion::walk(velocity);
    if velocity.x.atan2(velocity.z).abs() > ASIDE {
        command.facing(0.0)
    } else {
        command
    }
}

fn straight(style: &v1::Style, gait: &v1::Gait) -> Scenario {
    let velocity = Vec3::new(gait.left, 0.0, gait.forward);
    let at = START + STRAIGHT;
    let command = command(velocity);
    Scenario {
        velocity,
        facing: command.facing.unwrap_or(velocity.x.atan2(velocity.z)),
        course: Course::Stop { at },
        commands: vec![(START, command.clone()), (at, command.stopped())],
        frames: at + AFTER,
        ..of(style, gait)
    }
}

/// The turns of a style begin at different moments of a step.
fn turn(style: &v1::Style, gait: &v1::Gait, angle: f32, nth: usize) -> Scenario {
    let base = of(style, gait);
    let velocity = Vec3::Z * gait.forward;
    let at = START + BEFORE_TURN.max(3 * base.period) + nth * base.period / 6;
    Scenario {
        velocity,
        course: Course::Turn { at, angle },
        commands: vec![
            (START, Locomotion::walk(velocity)),
            (at, Locomotion::walk(yaw(angle) * velocity)),
        ],
        frames: at + AFTER,
        ..base
    }
}

fn of(style: &v1::Style, gait: &v1::Gait) -> Scenario {
    Scenario {
        style: style.name.clone(),
        gait: gait.name.clone(),
        period: (gait.period_frames.round() as usize).max(8),
        velocity: Vec3::ZERO,
        facing: 0.0,
        course: Course::Stop { at: 0 },
        commands: Vec::new(),
        frames: 0,
    }
}

/// A command to stand that keeps the facing.
trait Stopped {
    fn stopped(self) -> Self;
}

impl Stopped for Locomotion {
    fn stopped(mut self) -> Self {
        self.velocity = Vec3::ZERO;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn style() -> v1::Style {
        let gait = |name: &str, left, forward, turn, period_frames| v1::Gait {
            name: name.to_owned(),
            left,
            forward,
            turn,
            period_frames,
            ..v1::Gait::default()
        };
        v1::Style {
            name: "calm".to_owned(),
            gaits: vec![
                gait("idle", 0.0, 0.0, 0.0, 0.0),
                gait("run", 0.0, 2.8, 0.0, 23.0),
                gait("walk", 0.02, 1.2, 0.0, 32.0),
                gait("walk-back", 0.0, -0.8, 0.0, 36.0),
                gait("walk-turn-left", -0.1, 1.1, 1.1, 32.0),
            ],
            ..v1::Style::default()
        }
    }

    #[test]
    fn every_straight_gait_is_played_and_the_walk_turned() {
        let all = scenarios(&style());
        let straight = all.iter().filter(|s| matches!(s.course, Course::Stop { .. }));
        assert_eq!(
            straight.map(|s| s.gait.as_str()).collect::<Vec<_>>(),
            ["run", "walk", "walk-back"]
        );
        let turned = all.iter().filter_map(|s| match s.course {
            Course::Turn { angle, .. } => Some((s.gait.as_str(), angle.to_degrees().round() as i32)),
            Course::Stop { .. } => None,
        });
        let wanted = [45, -45, 90, -90, 180, -180, 120, -120].map(|angle| ("walk", angle));
        assert_eq!(turned.collect::<Vec<_>>(), wanted);
    }

    #[test]
    fn going_backwards_faces_ahead() {
        let all = scenarios(&style());
        let facing = |gait: &str| all.iter().find(|s| s.gait == gait).unwrap().commands[0].1.facing;
        assert_eq!((facing("walk"), facing("walk-back")), (None, Some(0.0)));
    }

    #[test]
    fn turns_begin_at_different_moments_of_a_step() {
        let turns = scenarios(&style()).into_iter().filter_map(|s| match s.course {
            Course::Turn { at, .. } => Some(at % s.period),
            Course::Stop { .. } => None,
        });
        let mut moments: Vec<usize> = turns.collect();
        moments.sort_unstable();
        moments.dedup();
        assert_eq!(moments.len(), 6);
    }
}
