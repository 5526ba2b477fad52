//! Takes: motions of any length, made window by window.
//!
//! A [`Take`] holds the constraints of a motion: a path over the ground, poses, positions of
//! joints. A
//! [`Making`] needs a generator for one window at a time. A body with styles goes from keyframe to
//! keyframe and walks between them ([`walk`]). A body whose network follows paths gets one
//! ([`follow`], [`path_plan`]). At the end, [`finish`] makes the whole motion meet its constraints.

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
    Clock, Effector, Follower, Knot, Look, MotionFrames, PoseKey, Prompt, Subject, Take, TakeSegment, Wanted,
};
pub use track::Track;
pub use trajectory::{Shape, Trajectory, trajectory};
