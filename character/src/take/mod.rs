//! Takes: motions of any length, made window after window.
//!
//! A [`Take`] says what a motion must meet: a path over the ground, poses, places of joints. A
//! [`Making`] asks a generator for one window at a time. A body with styles goes from keyframe to
//! keyframe and walks between them ([`walk`]); a body whose network takes paths follows one
//! ([`follow`], [`path_plan`]). [`finish`] then has the whole motion meet what it must.

mod finish;
mod follow;
mod ground;
mod making;
mod note;
mod path_plan;
mod request;
mod seed;
mod start;
#[cfg(test)]
mod testing;
mod track;
mod trajectory;
mod walk;
mod way;

pub use finish::Made;
pub use ground::Ground;
pub use making::Making;
pub use note::{Note, Severity};
pub use path_plan::{PathPlan, PathRequest, speed_mps};
pub use request::{
    Clock, Effector, Follower, Knot, Look, MotionFrames, Part, PoseKey, Prompt, Subject, Take, Wanted,
};
pub use track::Track;
pub use trajectory::{Shape, Trajectory, trajectory};
