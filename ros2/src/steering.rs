//! What orders mean for a session. Pure: orders, times and places in, commands out.

use std::time::{Duration, Instant};

use glam::Vec3;
use troupe_client::{Act, LivePath, Locomotion, Performance};
use troupe_motion::root::wrap_angle;

use crate::body::{ODOM, Place};
use crate::messages::{Path, Twist};

/// A robot stands if no `cmd_vel` has come for so long.
pub(crate) const SILENCE: Duration = Duration::from_millis(500);
/// Points of a path that a session takes.
const MAX_POINTS: usize = 1024;
/// Points of a path that is read at all.
const MAX_POSES: usize = 100_000;
/// Points nearer to the one before are left out, metres.
const SPACING_M: f32 = 0.01;
/// Bytes of a sentence or a style.
const MAX_TEXT: usize = 4000;
/// A turn goes to the session in steps of this angle, radians, because each command is a new plan.
const TURN_RAD: f32 = 0.1;
/// How far the wanted heading may be ahead of the robot's, radians.
const LEAD_RAD: f32 = 1.0;
/// Longest time between two ticks that counts for turning.
const MAX_TICK: Duration = Duration::from_millis(100);

/// An order that comes over a topic.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Order {
    /// Velocity in the robot's own frame: metres per second ahead and to the left, radians per
    /// second to the left.
    Drive([f32; 3]),
    /// A path in the frame `odom`.
    Follow(Vec<[f32; 2]>),
    /// A sentence to act out.
    Say(String),
}

/// What the session is to do.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Command {
    /// Move like this from now on.
    Move(Locomotion),
    /// Do this once.
    Act(Act),
}

/// The state of one robot's orders. The newest order counts.
#[derive(Debug, Clone, Default)]
pub(crate) struct Steering {
    drive: Option<Driving>,
}

#[derive(Debug, Clone)]
struct Driving {
    velocity: [f32; 3],
    /// When the newest order came.
    heard: Instant,
    /// When the heading was last turned.
    turned: Instant,
    heading: f32,
    /// Velocity and heading of the last command.
    sent: Option<([f32; 3], f32)>,
}

impl Order {
    /// Reads `cmd_vel`.
    ///
    /// # Errors
    /// A sentence.
    pub(crate) fn of_twist(twist: &Twist) -> Result<Self, String> {
        let velocity = [twist.linear.x, twist.linear.y, twist.angular.z].map(|number| number as f32);
        match velocity.iter().all(|number| number.is_finite()) {
            true => Ok(Self::Drive(velocity)),
            false => Err(format!("cmd_vel: {velocity:?} is no velocity; it is ignored")),
        }
    }

    /// Reads `path`. Only places count.
    ///
    /// # Errors
    /// A sentence.
    pub(crate) fn of_path(path: &Path) -> Result<Self, String> {
        let frames = [&path.header].into_iter();
        let frames = frames.chain(path.poses.iter().map(|pose| &pose.header));
        for frame in frames.map(|header| header.frame_id.as_str()) {
            if !frame.is_empty() && frame != ODOM {
                return Err(format!(
                    "path: its frame is {frame:?}; allowed: {ODOM:?}. It is ignored"
                ));
            }
        }
        if path.poses.len() > MAX_POSES {
            let count = path.poses.len();
            return Err(format!(
                "path: {count} poses; allowed: at most {MAX_POSES}. It is ignored"
            ));
        }
        let places = path.poses.iter().map(|pose| pose.pose.position);
        let places: Vec<[f32; 2]> = places.map(|at| [at.x as f32, at.y as f32]).collect();
        match places.as_flattened().iter().all(|number| number.is_finite()) {
            true => Ok(Self::Follow(places)),
            false => Err("path: a place is no number; it is ignored".to_owned()),
        }
    }

    /// Reads `say`.
    ///
    /// # Errors
    /// A sentence.
    pub(crate) fn of_words(words: &str) -> Result<Self, String> {
        Ok(Self::Say(text("say", words)?))
    }
}

/// Text that is not empty.
///
/// # Errors
/// A sentence.
pub(crate) fn text(topic: &str, text: &str) -> Result<String, String> {
    match text.trim() {
        "" => Err(format!("{topic}: is empty; it is ignored")),
        long if long.len() > MAX_TEXT => {
            let count = long.len();
            Err(format!(
                "{topic}: {count} bytes; allowed: at most {MAX_TEXT}. It is ignored"
            ))
        }
        text => Ok(text.to_owned()),
    }
}

impl Steering {
    /// Takes an order that came at some time, and gives the command that follows at once, if any.
    pub(crate) fn take(&mut self, order: Order, came: Instant, place: Place) -> Option<Command> {
        let velocity = match order {
            Order::Drive(velocity) => velocity,
            Order::Follow(places) => {
                self.drive = None;
                return Some(follow(&places, place));
            }
            Order::Say(words) => {
                self.drive = None;
                return Some(Command::Act(Performance::of(words).into()));
            }
        };
        match &mut self.drive {
            Some(drive) => (drive.velocity, drive.heard) = (velocity, came),
            None => {
                self.drive = Some(Driving {
                    velocity,
                    heard: came,
                    turned: came,
                    heading: place.heading,
                    sent: None,
                });
            }
        }
        None
    }

    /// The command that is due now, if any.
    pub(crate) fn due(&mut self, now: Instant, place: Place) -> Option<Command> {
        let drive = self.drive.as_mut()?;
        if now.saturating_duration_since(drive.heard) > SILENCE {
            self.drive = None;
            return Some(Command::Move(Locomotion::stand()));
        }
        let command = drive.command(now, place.heading);
        // A robot that is to stand has nothing more to do.
        if drive.velocity == [0.0; 3] {
            self.drive = None;
        }
        command
    }

    /// Forgets what the robot was to do: it stands.
    pub(crate) fn forget(&mut self) {
        self.drive = None;
    }
}

impl Driving {
    fn command(&mut self, now: Instant, heading: f32) -> Option<Command> {
        let [ahead, left, turn] = self.velocity;
        let seconds = now
            .saturating_duration_since(self.turned)
            .min(MAX_TICK)
            .as_secs_f32();
        self.turned = now;
        self.heading += turn * seconds;
        // A robot that cannot turn so fast does not turn on for long afterwards.
        self.heading = heading + wrap_angle(self.heading - heading).clamp(-LEAD_RAD, LEAD_RAD);
        let turned = |sent: f32| wrap_angle(self.heading - sent).abs();
        let is_sent = self
            .sent
            .is_some_and(|(velocity, sent)| velocity == self.velocity && turned(sent) < TURN_RAD);
        if is_sent {
            return None;
        }
        self.sent = Some((self.velocity, self.heading));
        if self.velocity == [0.0; 3] {
            return Some(Command::Move(Locomotion::stand()));
        }
        let (sin, cos) = self.heading.sin_cos();
        let velocity = Vec3::new(ahead * cos - left * sin, ahead * sin + left * cos, 0.0);
        let locomotion = Locomotion::walk(velocity).facing(wrap_angle(self.heading));
        Some(Command::Move(locomotion))
    }
}

/// The command for a path.
fn follow(places: &[[f32; 2]], place: Place) -> Command {
    let mut way: Vec<[f32; 2]> = Vec::with_capacity(places.len().min(MAX_POINTS));
    if places.len() == 1 {
        way.push([place.x, place.y]);
    }
    for &[x, y] in places {
        let far = |&[px, py]: &[f32; 2]| (x - px).hypot(y - py) >= SPACING_M;
        if way.last().is_none_or(far) {
            way.push([x, y]);
        }
    }
    match way.len() {
        // It is there already, or the path is empty, which means to stop.
        0 | 1 => Command::Move(Locomotion::stand()),
        count => {
            let kept = count.min(MAX_POINTS);
            let nth = |nth: usize| way[nth * (count - 1) / (kept - 1)];
            let points = (0..kept).map(nth).map(|[x, y]| Vec3::new(x, y, 0.0));
            Command::Act(LivePath::through(points).into())
        }
    }
}

#[cfg(test)]
#[path = "steering_tests.rs"]
mod tests;
