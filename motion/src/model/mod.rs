//! What characters and generators share: the body that a model animates, its tasks, and its
//! answers.
//!
//! A model of any family takes [`Task`]s and gives [`Output`]s. Everything is in the segment frame:
//! the origin is under the last context root, with +Z along its heading.

mod body;
mod capability;
mod dims;
mod motion;
mod rig;
mod root_override;
mod task;

pub use body::{
    Body, BodyError, BodyParts, DESCRIPTION, InlineJoint, InlineSkeleton, MAX_BODY_JOINTS, SLOTS, Sway,
    SwayDoc,
};
pub use capability::{Capabilities, Capability};
pub use dims::{Dims, GLOBAL_ROOT, LOCAL_ROOT, POSE_FEATURES, SIX_D};
pub use motion::{Motion, Output, Trace, all_finite};
pub use rig::{ByPath, Rig};
pub use root_override::{RootKey, RootOverride};
pub use task::{
    AgentTask, Audio, DescribeTask, GapPose, KeyTensors, KeyframeTask, PathTask, PromptTask, RootGuide,
    SamplingTask, Sound, Task, Telling, USUAL_WORK, work_of,
};
