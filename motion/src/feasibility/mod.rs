//! Whether a motion stays within what the data of its pack does: figures of its frames and of the
//! keyframes that were asked for, each beside a limit that was measured on the training clips.
//!
//! [`Limits`] is the table `[limits]` of a pack; `troupe-train limits` measures it
//! (`training/troupe_training/data/limits.py`, which computes the same figures). [`Judge`] reads
//! frames, [`Feasibility`] is what it found.

mod doc;
mod judge;
mod keys;
mod limits;

pub use doc::{BendDoc, LimitsDoc, LimitsError};
pub use judge::Judge;
pub use keys::{Key, farthest, reach_of};
pub use limits::{Bend, Limits, Reach};

/// What is measured of a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Figure {
    /// Speed of the root over the ground, m/s.
    RootSpeed,
    /// Acceleration of the root, m/s².
    RootAcceleration,
    /// How fast the pelvis turns, about any axis, rad/s.
    Turning,
    /// Speed of the fastest joint relative to the root, m/s.
    JointSpeed,
    /// Largest acceleration of a joint relative to the root, m/s².
    JointAcceleration,
    /// How far the lowest joint is below the ground, metres.
    BelowGround,
    /// How high the lowest joint is over the ground, metres.
    OffGround,
    /// Angle of the pelvis from how it usually stands, radians.
    Tilt,
    /// How far a joint is bent beyond the range that it has in the data, radians.
    Bend,
    /// From where the context's velocity leads to a target, over the ground, metres.
    RootReach,
    /// Angle between the pelvis of the last context frame and of a target, radians.
    TurnReach,
    /// From the joints of the last context frame to those of a target, over the projected root,
    /// metres in the mean.
    PoseReach,
}

impl Figure {
    /// How many there are.
    pub const COUNT: usize = 12;

    /// All of them.
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
    ];

    /// Its name, as in messages.
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
        }
    }

    /// The unit of its values.
    pub fn unit(self) -> &'static str {
        match self {
            Self::RootSpeed | Self::JointSpeed => "m/s",
            Self::RootAcceleration | Self::JointAcceleration => "m/s²",
            Self::Turning => "rad/s",
            Self::Tilt | Self::Bend | Self::TurnReach => "rad",
            Self::BelowGround | Self::OffGround | Self::RootReach | Self::PoseReach => "m",
        }
    }

    /// By which power of the time a motion takes its value falls: 1 for speeds, 2 for
    /// accelerations, 0 for what a pose has.
    pub fn power_of_time(self) -> i32 {
        match self {
            Self::RootSpeed | Self::Turning | Self::JointSpeed => 1,
            Self::RootAcceleration | Self::JointAcceleration => 2,
            _ => 0,
        }
    }
}

/// The largest value of a figure, and its limit.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Reading {
    /// The value, in the figure's unit.
    pub value: f32,
    /// What all but a few windows of the training data stay within.
    pub limit: f32,
    /// The frame that has the value, from the first one that was judged.
    pub frame: usize,
    /// The joint that has it, where it is one's.
    pub joint: Option<usize>,
}

impl Reading {
    /// The value in limits: above 1 is beyond it. A value that is no number is beyond everything.
    pub fn ratio(&self) -> f32 {
        match self.value.is_nan() {
            true => f32::INFINITY,
            false => self.value / self.limit,
        }
    }
}

/// What was found of a motion: a reading of every figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feasibility {
    readings: [Reading; Figure::COUNT],
}

impl Feasibility {
    /// Nothing was seen yet.
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

    /// The figure that is farthest beyond its limit, or nearest to it.
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

    /// Whether no figure is beyond its limit.
    pub fn is_feasible(&self) -> bool {
        self.readings.iter().all(|reading| reading.ratio() <= 1.0)
    }

    /// Of every figure the reading that is farther beyond its limit.
    #[must_use]
    pub fn worse_of(mut self, other: &Self) -> Self {
        for (own, other) in self.readings.iter_mut().zip(&other.readings) {
            if other.ratio() > own.ratio() {
                *own = *other;
            }
        }
        self
    }

    /// Takes a value in where it is beyond what was there.
    pub(crate) fn see(&mut self, figure: Figure, seen: Reading) {
        let own = &mut self.readings[figure as usize];
        if seen.ratio() > own.ratio() {
            *own = seen;
        }
    }
}

#[cfg(test)]
mod tests;
