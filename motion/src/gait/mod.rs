//! Gaits: from a clip of somebody who walks, runs or stands to one cycle that repeats for ever.
//!
//! [`find_cycles`] looks for steps. A left strike is where the left foot is furthest ahead of the
//! right in the direction of travel; a cycle reaches from one left strike to the next, so that
//! phase 0 means the same in every gait and gaits can be blended phase by phase. [`ClosedCycle`]
//! takes out what is left between a cycle's two ends and repeats it. [`find_stand`] looks for the
//! frame that stands best.
//!
//! Velocities are in the frame of the cycle's heading line, the straight line through the pelvis'
//! heading over one cycle: `left` along its left, `forward` along its forward. What the pelvis does
//! besides, its sway, stays in the poses.

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

/// Why a clip has no such gait.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GaitError {
    /// Feet cannot be told.
    #[error("the skeleton's contact joints do not lie on both sides of the body, so steps cannot be told")]
    NoFeet,
    /// Fewer frames than a cycle takes.
    #[error("{frames} frames are too few for a gait; at least {least} are needed")]
    TooShort {
        /// Frames of the clip.
        frames: usize,
        /// Fewest that would do.
        least: usize,
    },
    /// The character does not move.
    #[error("it does not go anywhere: its median speed is {speed_mps:.2} m/s; a gait that stands is static")]
    Stands {
        /// Median speed over the ground, m/s.
        speed_mps: f32,
    },
    /// The feet do not take turns often enough.
    #[error("{strikes} left strikes are too few for a cycle, which reaches from one to the next")]
    NoSteps {
        /// Left strikes found.
        strikes: usize,
    },
    /// No two left strikes are as far apart as a cycle may be.
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
    /// Steps differ too much from each other.
    #[error(
        "no two steps are alike: the best cycle ends {closure_m:.3} m a joint from where it starts; {limit_m} m is allowed"
    )]
    Open {
        /// Root mean square distance of the joints, metres.
        closure_m: f32,
        /// Largest that is allowed.
        limit_m: f32,
    },
    /// No frame stands still.
    #[error(
        "no frame stands: the stillest with both feet down has a joint that moves at {speed_mps:.2} m/s; {limit_mps} m/s is allowed"
    )]
    Restless {
        /// Speed of the fastest joint, m/s; infinite where the feet are never both down.
        speed_mps: f32,
        /// Largest that is allowed.
        limit_mps: f32,
    },
}
