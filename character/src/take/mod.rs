//! Takes: motions of any length, made window by window.
//!
//! A [`Take`] says what a motion must meet: a path over the ground, poses, places of joints. A
//! [`Making`] asks a generator for one window at a time. A body with styles goes from keyframe to
//! keyframe and walks between them ([`walk`]); a body whose network takes paths follows one
//! ([`follow`], [`path_plan`]). [`finish`] then has the whole motion meet what it must, perhaps
//! on another body ([`Onto`]). A take in
//! parts has each window meet it ([`settle`]), so that frames are final as they are made; [`along`]
//! plans such a take for a path. [`steady`] does it for windows of a [`path_plan`], and [`ending`]
//! for motion of words that must end at a place or in given frames.

mod along;
mod ending;
mod finish;
mod follow;
mod ground;
mod making;
mod met;
mod note;
mod onto;
mod path_plan;
mod request;
mod seed;
mod settle;
mod start;
mod steady;
#[cfg(test)]
mod testing;
mod track;
mod trajectory;
mod walk;
mod way;

pub use along::{TooFast, WalkPath, WalkRequest, falls_behind};
pub use ending::{Ending, top_speed_mps};
pub use finish::Made;
pub use ground::Ground;
pub use making::Making;
pub use note::{Note, Severity};
pub use onto::Onto;
pub use path_plan::{PathPlan, PathRequest, speed_mps};
pub use request::{
    Clock, Effector, Follower, Knot, Look, MotionFrames, PoseKey, Prompt, Subject, Take, TakeSegment, Wanted,
};
pub use steady::Steady;
pub use track::Track;
pub use trajectory::{Shape, Trajectory, trajectory};
