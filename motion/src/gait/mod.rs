//! Gaits: turns a clip of somebody who walks, runs or stands into one cycle that repeats for ever.
//!
//! [`find_cycles`] looks for steps. A left strike is the moment at which the left foot is farthest
//! ahead of the right in the direction of travel. A cycle reaches from one left strike to the next,
//! so phase 0 means the same in every gait, and gaits can be blended phase by phase.
//! [`ClosedCycle`] removes the difference between a cycle's two ends, and repeats it.
//! [`find_stand`] looks for the frame that stands best.
//!
//! Velocities are relative to the cycle's heading line, the straight line through the pelvis'
//! heading over one cycle: `left` and `forward` of it. The rest of the pelvis' movement, its sway,
//! stays in the poses.

mod closed;
mod cycle;
mod stand;
mod steps;
#[cfg(test)]
mod tests;

pub use closed::ClosedCycle;
pub use cycle::{Cycle, CycleOptions, Way, find_cycles};
pub use stand::{Stand, StandOptions, find_stand};
pub use steps::{Feet, feet};

/// Why a clip has no gait of that kind.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GaitError {
    /// The contact joints are not on both sides of the body.
    #[error("the skeleton's contact joints are not on both sides of the body, so steps cannot be found")]
    NoFeet,
    /// The clip has fewer frames than a cycle.
    #[error("{frames} frames are too few for a gait; at least {least} are needed")]
    TooShort {
        /// Number of frames.
        frames: usize,
        /// Fewest frames that are enough.
        least: usize,
    },
    /// The character does not travel.
    #[error("it does not go anywhere: its median speed is {speed_mps:.2} m/s; a gait that stands is static")]
    Stands {
        /// Median speed over the ground, m/s.
        speed_mps: f32,
    },
    /// The feet do not alternate often enough.
    #[error("{strikes} left strikes are too few for a cycle, which reaches from one to the next")]
    NoSteps {
        /// Number of left strikes.
        strikes: usize,
    },
    /// No two left strikes are as far apart as a cycle allows.
    #[error("left strikes lie {shortest} to {longest} frames apart; a cycle takes {least} to {most}")]
    Period {
        /// Shortest time between left strikes, frames.
        shortest: usize,
        /// Longest time between left strikes, frames.
        longest: usize,
        /// Fewest frames of a cycle.
        least: usize,
        /// Most frames of a cycle.
        most: usize,
    },
    /// The steps differ too much from each other.
    #[error(
        "no two steps are alike: the best cycle ends {closure_m:.3} m a joint from where it starts; {limit_m} m is allowed"
    )]
    Open {
        /// Root mean square distance of the joints between the ends of the best cycle, metres.
        closure_m: f32,
        /// Largest distance that is allowed, metres.
        limit_m: f32,
    },
    /// No frame stands still.
    #[error(
        "no frame stands: the stillest with both feet down has a joint that moves at {speed_mps:.2} m/s; {limit_mps} m/s is allowed"
    )]
    Restless {
        /// Speed of the fastest joint, m/s; infinite if the feet are never both down.
        speed_mps: f32,
        /// Highest speed that is allowed, m/s.
        limit_mps: f32,
    },
}
