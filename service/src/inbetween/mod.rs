//! In-betweening: from a request to the input of the stages, and from their output to frames.
//!
//! [`prepare`] checks every value of a request. It moves each character into its segment frame, in
//! which the model works: the projected root of the last context frame at the origin, heading 0.
//! [`finish`] turns the output of the stages into frames. It makes rotations relative to parents,
//! pins roots and poses to the keyframes, moves the segment back into the world, holds standing
//! feet still, and brings a robot's poses onto its hinges.

mod counts;
mod describe;
mod feasible;
mod finish;
#[cfg(test)]
mod live_equals_tests;
mod parts;
mod path;
mod prepare;
mod prompt;
mod root;
mod sampling;
mod words;

pub use counts::{count_generate, count_in_between};
pub use describe::prepare_describe;
pub use feasible::{NotFeasible, refuse, refuse_frames, refuse_keyframes};
pub use finish::{finish, finish_judged};
pub use parts::{PartWriter, write_description};
pub use path::{
    MAX_PATH_KEYFRAMES, MAX_PATH_POINTS, Walking, path_judge, prepare_path, prepare_walk, refuse_path,
    refuse_walk, walk_judge,
};
pub use prepare::{ExtraOutputs, Plan, RequestLimits, prepare};
pub(crate) use prompt::target_role;
pub use prompt::{MAX_GENERATED_FRAMES, Prepared, leads_to_place, prepare_prompt};
pub use root::GivenRoot;
pub use sampling::no_sampling;
pub use words::{check_description, check_words, fitting, most_past};

/// Most bytes of a character's id.
pub const MAX_ID_BYTES: usize = 128;
/// Most passes of the pose stage.
pub const MAX_POSE_STEPS: u32 = 10;
