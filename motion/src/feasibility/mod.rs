//! Whether a motion stays within what the data of its pack does, and within what a robot's hinges
//! can do. Figures of its frames, and of the keyframes that were asked for, are compared with
//! limits that were measured on the training clips. Those of hinges come from the robot.
//!
//! [`Limits`] is the table `[limits]` of a pack. `troupe-train limits` measures it
//! (`training/troupe_training/data/limits.py` computes the same figures). [`Judge`] reads frames,
//! and [`Feasibility`] has its readings.

mod doc;
mod judge;
mod keys;
mod limits;

pub use doc::{BendDoc, LimitsDoc, LimitsError};
pub use judge::Judge;
pub use keys::{Key, farthest, reach_of};
pub use limits::{Bend, Limits, Reach};

/// A quantity that is measured in a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Figure {
    /// Speed of the root over the ground, m/s.
    RootSpeed,
    /// Acceleration of the root, m/s².
    RootAcceleration,
    /// Turning rate of the pelvis about any axis, rad/s.
    Turning,
    /// Speed of the fastest joint relative to the root, m/s.
    JointSpeed,
    /// Largest acceleration of a joint relative to the root, m/s².
    JointAcceleration,
    /// Depth of the lowest joint below the ground, metres.
    BelowGround,
    /// Height of the lowest joint over the ground, metres.
    OffGround,
    /// Angle between the pelvis and its usual direction, radians.
    Tilt,
    /// Excess of a joint over its range in the data, radians.
    Bend,
    /// Distance over the ground from where the context's velocity leads to a target, metres.
    RootReach,
    /// Angle between the pelvis in the last context frame and in a target, radians.
    TurnReach,
    /// Mean distance between the joints of the last context frame and those of a target, over the
    /// projected root, metres.
    PoseReach,
    /// Speed of the hinge that is nearest to its highest speed or farthest beyond it, rad/s. For
    /// robots.
    HingeSpeed,
    /// Acceleration of the hinge that is nearest to its limit or farthest beyond it, rad/s². For
    /// robots whose hinges have such limits.
    HingeAcceleration,
}

impl Figure {
    /// Number of figures.
    pub const COUNT: usize = 14;

    /// Every figure once.
    pub const ALL: [Self; Self::COUNT] = [
        Self::RootSpeed,
        Self::RootAcceleration,
        Self::Turning,
        Self::JointSpeed,
        Self::JointAcceleration,
        Self::BelowGround,
        Self::OffGround,
        Self::Tilt,
        Self::Bend,
        Self::RootReach,
        Self::TurnReach,
        Self::PoseReach,
        Self::HingeSpeed,
        Self::HingeAcceleration,
    ];

    /// The figure's name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::RootSpeed => "root_speed",
            Self::RootAcceleration => "root_acceleration",
            Self::Turning => "turning",
            Self::JointSpeed => "joint_speed",
            Self::JointAcceleration => "joint_acceleration",
            Self::BelowGround => "below_ground",
            Self::OffGround => "off_ground",
            Self::Tilt => "tilt",
            Self::Bend => "bend",
            Self::RootReach => "root_reach",
            Self::TurnReach => "turn_reach",
            Self::PoseReach => "pose_reach",
            Self::HingeSpeed => "hinge_speed",
            Self::HingeAcceleration => "hinge_acceleration",
        }
    }

    /// The unit of the figure's values.
    pub fn unit(self) -> &'static str {
        match self {
            Self::RootSpeed | Self::JointSpeed => "m/s",
            Self::RootAcceleration | Self::JointAcceleration => "m/s²",
            Self::Turning | Self::HingeSpeed => "rad/s",
            Self::HingeAcceleration => "rad/s²",
            Self::Tilt | Self::Bend | Self::TurnReach => "rad",
            Self::BelowGround | Self::OffGround | Self::RootReach | Self::PoseReach => "m",
        }
    }

    /// The power of a motion's duration by which the value falls: 1 for speeds, 2 for
    /// accelerations, 0 for what belongs to a pose.
    pub fn power_of_time(self) -> i32 {
        match self {
            Self::RootSpeed | Self::Turning | Self::JointSpeed | Self::HingeSpeed => 1,
            Self::RootAcceleration | Self::JointAcceleration | Self::HingeAcceleration => 2,
            _ => 0,
        }
    }
}

/// The largest value of a figure, and its limit.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Reading {
    /// The value, in the figure's unit.
    pub value: f32,
    /// The limit: all but a few windows of the training data stay within it. Infinite if there is
    /// none: the body is no robot, or its hinges have no such limit.
    pub limit: f32,
    /// The frame with that value, counted from the first judged frame.
    pub frame: usize,
    /// The joint with that value, for a figure of joints.
    pub joint: Option<usize>,
}

impl Reading {
    /// Value divided by limit: above 1 it is beyond. A value that is not a number is beyond
    /// everything.
    pub fn ratio(&self) -> f32 {
        match self.value.is_nan() {
            true => f32::INFINITY,
            false => self.value / self.limit,
        }
    }
}

/// What a motion does: a reading of every figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feasibility {
    readings: [Reading; Figure::COUNT],
}

impl Feasibility {
    /// Readings before any frame.
    pub(crate) fn nothing(limits: &Limits) -> Self {
        let mut readings = [Reading::default(); Figure::COUNT];
        for figure in Figure::ALL {
            readings[figure as usize].limit = limits.of(figure);
        }
        Self { readings }
    }

    /// The reading of a figure.
    pub fn get(&self, figure: Figure) -> Reading {
        self.readings[figure as usize]
    }

    /// The figure farthest beyond its limit, or nearest to it.
    pub fn worst(&self) -> (Figure, Reading) {
        let pairs = Figure::ALL.map(|figure| (figure, self.get(figure)));
        pairs
            .into_iter()
            .reduce(|worst, one| {
                if one.1.ratio() > worst.1.ratio() {
                    one
                } else {
                    worst
                }
            })
            .unwrap_or((Figure::RootSpeed, Reading::default()))
    }

    /// Whether every figure is within its limit.
    pub fn is_feasible(&self) -> bool {
        self.readings.iter().all(|reading| reading.ratio() <= 1.0)
    }

    /// For every figure, the reading that is farther beyond its limit.
    #[must_use]
    pub fn worse_of(mut self, other: &Self) -> Self {
        for (own, other) in self.readings.iter_mut().zip(&other.readings) {
            if other.ratio() > own.ratio() {
                *own = *other;
            }
        }
        self
    }

    /// Takes a value if it is beyond the one so far.
    pub(crate) fn see(&mut self, figure: Figure, seen: Reading) {
        let own = &mut self.readings[figure as usize];
        if seen.ratio() > own.ratio() {
            *own = seen;
        }
    }
}

#[cfg(test)]
mod tests;
