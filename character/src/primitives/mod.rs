//! Smart primitives: turn a command and a character's state into keyframe constraints (paper
//! section 6).

use serde::{Deserialize, Serialize};
mod bands;
mod blend;
mod follow;
mod heading;
mod locomotion;
mod matching;
pub mod object;
pub mod path;
mod ramp;
mod reach;
pub mod recipe;
mod variation;

use std::sync::Arc;

use troupe_motion::{GlobalRoot, LocalRoot, Quat, Skeleton, Vec3};

use crate::style::Style;

pub use follow::Follow;
pub use locomotion::Locomotion;
pub use path::PathCommand;
pub use reach::Instead;

/// Context frames of a plan.
const CONTEXT_FRAMES: usize = 4;

/// A command to move over the ground, in the native convention.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LocomotionCommand {
    /// World velocity over the ground, m/s; y is 0.
    pub velocity: Vec3,
    /// Heading, radians. `None`: the direction of travel, or the present heading for standing.
    pub facing: Option<f32>,
    /// The style to move in.
    #[serde(with = "crate::saved::style")]
    pub style: Arc<Style>,
    /// Name of the only gait to use. `None`: any gait of the style.
    pub gait: Option<String>,
    /// Height of the root joint, metres. `None`: the gaits' own.
    pub height_m: Option<f32>,
}

impl LocomotionCommand {
    /// The command to stand, in `style`.
    pub fn standing(style: &Arc<Style>) -> Self {
        Self {
            velocity: Vec3::ZERO,
            facing: None,
            style: Arc::clone(style),
            gait: None,
            height_m: None,
        }
    }

    /// Whether two commands ask for the same motion.
    pub(crate) fn is_same_as(&self, other: &Self) -> bool {
        (Arc::ptr_eq(&self.style, &other.style) || self.style == other.style)
            && (self.velocity, self.facing) == (other.velocity, other.facing)
            && (&self.gait, self.height_m) == (&other.gait, other.height_m)
    }
}

/// The state that a plan starts from: four consecutive frames in the world.
#[derive(Debug, Clone, Copy)]
pub struct PlanContext<'a> {
    /// Timeline frame of the last of the four.
    pub frame: u64,
    /// Roots, oldest first.
    pub roots: [GlobalRoot; 4],
    /// Poses, `4 * joints`, oldest first: joint 0 in the world, others relative to their parents.
    pub rotations: &'a [Quat],
    /// Mean velocity of the root over the last [`VELOCITY_FRAMES`](recipe::VELOCITY_FRAMES) frames,
    /// or as many as there are, world m/s. The difference of two frames would include the sway of a
    /// step.
    pub velocity: Vec3,
    /// Chooses the character's variation of its style; 0 is the style itself.
    pub seed: u64,
    /// The pack's skeleton.
    pub skeleton: &'a Skeleton,
    /// Frame rate of the pack, Hz.
    pub fps: f32,
    /// Frames a token, in this pack.
    pub frames_per_token: usize,
    /// Frames that the plan should have, context included. `None`: as many as usual.
    pub plan_frames: Option<usize>,
}

/// A target keyframe in the world, with any subset of its parts.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TargetKey {
    /// Position and heading of the root.
    pub root: Option<GlobalRoot>,
    /// Velocity of the root.
    pub velocity: Option<LocalRoot>,
    /// The pose: joint 0 in the world, others relative to their parents.
    pub rotations: Option<Vec<Quat>>,
    /// Height of the root joint, metres, for a key without a root.
    pub height_m: Option<f32>,
}

/// A pose inside the gap, for the pose stage and the decoder only: the root stage does not see it.
#[derive(Debug, Clone, PartialEq)]
pub struct GapPose {
    /// Index of the segment's frame, between context and targets.
    pub frame: usize,
    /// The pose: joint 0 in the world, others relative to their parents.
    pub rotations: Vec<Quat>,
    /// Height of the root joint, metres.
    pub height_m: f32,
}

/// The path that the root should follow, and how closely. From the last context frame on, r_g3
/// becomes `r_g3 + ratio * (path - r_g3)` before the pose stage and the decoder see it.
#[derive(Debug, Clone, PartialEq)]
pub struct Guide {
    /// One root for each frame of the segment from its first context frame on, in the world.
    pub path: Vec<GlobalRoot>,
    /// For positions on the ground: 0 leaves them to the root stage, 1 takes the path; up to 1.2.
    /// Set by the style.
    pub position_ratio: f32,
    /// For heights, 0 to 1.
    pub height_ratio: f32,
    /// For headings, 0 to 1.
    pub heading_ratio: f32,
}

/// A path, for a body that is planned for by paths.
#[derive(Debug, Clone, PartialEq)]
pub struct PathGoal {
    /// One root for each frame of the segment from its first context frame on, in the world.
    /// Heights are ignored.
    pub roots: Vec<GlobalRoot>,
    /// Words that say how to move, with their weights.
    pub words: Vec<(String, f32)>,
}

/// What a primitive asks of the networks.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanTargets {
    /// One to four consecutive keyframes; the last is the segment's last frame.
    pub targets: Vec<TargetKey>,
    /// Poses between context and targets, in the order of their frames. Mostly none.
    pub gap_poses: Vec<GapPose>,
    /// Frames of the segment, context included. `None`: the root stage chooses.
    pub frames: Option<usize>,
    /// The token counts that the root stage may choose from, if `frames` is none. Empty: all.
    pub allowed_token_counts: Vec<u32>,
    /// The path that the root should follow, and how closely.
    pub guide: Option<Guide>,
    /// Poses of a gait that the networks do not know. Comes with a guide.
    pub follow: Option<Follow>,
    /// r_g1: the root at the horizon by the command alone.
    pub r_g1: GlobalRoot,
    /// r_g2: the spring's path, one root for each frame of the segment.
    pub r_g2: Vec<GlobalRoot>,
    /// The path to follow, for a body that is planned for by paths. Such a plan has no targets, gap
    /// poses or guide.
    pub path: Option<PathGoal>,
    /// The turn goes on beyond the plan, which stops it at [`recipe::MAX_TURN`].
    pub unfinished: bool,
    /// The gaits in the target pose, with their weights.
    pub gaits: Vec<(String, f32)>,
}
