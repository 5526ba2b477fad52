//! What a robot shows: each frame that comes, or the last one while none comes.

use std::pin::pin;
use std::time::Duration;

use ros2_client::builtin_interfaces::Time;
use tokio::time::{Instant, sleep_until};
use troupe_client::{Frame, Rate};

use crate::body::{Body, Place, Shown};
use crate::ports::Ports;

/// A robot whose frames are so late holds its pose.
const LATE: Duration = Duration::from_millis(300);

/// Publishes the poses of one robot.
pub(crate) struct Output {
    pub(crate) ports: Ports,
    pub(crate) body: Body,
    pub(crate) rate: Rate,
    start: Place,
    shown: Option<Shown>,
    /// When the newest frame came.
    came: Instant,
    /// Stamp of the newest pose.
    stamped: Option<Time>,
    holds: bool,
}

impl Output {
    pub(crate) fn new(ports: Ports, body: Body, rate: Rate, start: Place) -> Self {
        Self {
            ports,
            body,
            rate,
            start,
            shown: None,
            came: Instant::now(),
            stamped: None,
            holds: false,
        }
    }

    /// Where the robot is.
    pub(crate) fn place(&self) -> Place {
        self.shown.as_ref().map_or(self.start, Shown::place)
    }

    /// Shows the frame of a tick.
    pub(crate) fn show(&mut self, tick: u64, frame: Frame<'_>) {
        let rate_hz = f64::from(self.rate.hz());
        let shown = self.body.shown(tick, rate_hz, frame.qpos, self.shown.as_ref());
        let Some(shown) = shown else {
            return self
                .ports
                .log
                .warn("a frame has other hinges than the robot; it is left out");
        };
        self.shown = Some(shown);
        self.came = Instant::now();
        if std::mem::take(&mut self.holds) {
            self.ports.log.info("frames come again");
        }
        self.publish();
    }

    /// The stream begins again, with other numbers of ticks.
    pub(crate) fn begin(&mut self) {
        if let Some(shown) = &mut self.shown {
            shown.begin();
        }
    }

    /// Waits for something. If frames are late meanwhile, it holds the pose.
    pub(crate) async fn while_waiting<T>(&mut self, work: impl Future<Output = T>) -> T {
        let mut work = pin!(work);
        let mut next = (self.came + LATE).max(Instant::now());
        loop {
            tokio::select! {
                biased;
                done = &mut work => return done,
                () = sleep_until(next) => self.hold(),
            }
            next += self.rate.period();
        }
    }

    fn hold(&mut self) {
        let Some(shown) = &mut self.shown else {
            return;
        };
        if !std::mem::replace(&mut self.holds, true) {
            shown.stop();
            let late = LATE.as_millis();
            self.ports
                .log
                .warn(&format!("no frame came for {late} ms: the robot holds its pose"));
        }
        self.publish();
    }

    /// Sends the pose, unless time stands still: a transform may have one value for a time.
    fn publish(&mut self) {
        let (Some(shown), Some(stamp)) = (&self.shown, self.ports.stamp()) else {
            return;
        };
        if self.stamped == Some(stamp) {
            return;
        }
        self.stamped = Some(stamp);
        let joints = self.body.joint_state(shown, stamp);
        self.ports.publish(joints, self.body.transform(shown, stamp));
    }
}
