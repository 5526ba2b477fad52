//! Smart primitives: from a command and a character's state to keyframe constraints (paper section
//! 6).

use serde::{Deserialize, Serialize};
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

/// What a locomotion command asks for, in the native convention.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LocomotionCommand {
    /// World velocity over the ground, m/s; y is 0.
    pub velocity: Vec3,
    /// Where to face, radians. `None`: where it goes, or where it faces when it stands.
    pub facing: Option<f32>,
    /// Style to move in.
    #[serde(with = "crate::saved::style")]
    pub style: Arc<Style>,
    /// Name of the only gait to use.
    pub gait: Option<String>,
    /// Height of the root joint, metres.
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
}

/// The state that a plan starts from: four consecutive frames in the world.
#[derive(Debug, Clone, Copy)]
pub struct PlanContext<'a> {
    /// Frame of the session's timeline of the last of them.
    pub frame: u64,
    /// Roots, oldest first.
    pub roots: [GlobalRoot; 4],
    /// Poses, `4 * joints`, oldest first: joint 0 in the world, others relative to their parents.
    pub rotations: &'a [Quat],
    /// Mean velocity of the root over the last [`VELOCITY_FRAMES`](recipe::VELOCITY_FRAMES) frames,
    /// world m/s; over fewer where the timeline is younger. One frame's difference would carry the
    /// sway of a step.
    pub velocity: Vec3,
    /// What it differs by from others of its style; 0 is the style itself.
    pub seed: u64,
    /// The pack's skeleton.
    pub skeleton: &'a Skeleton,
    /// The pack's frames a second.
    pub fps: f32,
    /// The pack's frames of a token.
    pub frames_per_token: usize,
    /// Frames that the plan should have, context included. `None`: as many as usual.
    pub plan_frames: Option<usize>,
}

/// A target keyframe in the world, with any subset of its parts.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TargetKey {
    /// Where the root is and faces.
    pub root: Option<GlobalRoot>,
    /// How the root moves.
    pub velocity: Option<LocalRoot>,
    /// The pose: joint 0 in the world, others relative to their parents.
    pub rotations: Option<Vec<Quat>>,
    /// Height of the root joint in metres, where there is no root.
    pub height_m: Option<f32>,
}

/// A pose inside the gap, for the pose stage and the decoder only: the root stage does not see it.
#[derive(Debug, Clone, PartialEq)]
pub struct GapPose {
    /// Frame of the segment, between the context and the targets.
    pub frame: usize,
    /// The pose: joint 0 in the world, others relative to their parents.
    pub rotations: Vec<Quat>,
    /// Height of the root joint, metres.
    pub height_m: f32,
}

/// The path that the root is to follow, and how closely: r_g3 becomes `r_g3 + ratio * (path -
/// r_g3)` from the last context frame on, before the pose stage and the decoder see it.
#[derive(Debug, Clone, PartialEq)]
pub struct Guide {
    /// One root for each frame of the segment from its first context frame on, in the world.
    pub path: Vec<GlobalRoot>,
    /// For places on the ground: 0 leaves them to the root stage, 1 takes the path, up to 1.2. The
    /// style's.
    pub position_ratio: f32,
    /// For heights, 0 to 1.
    pub height_ratio: f32,
    /// For headings, 0 to 1.
    pub heading_ratio: f32,
}

/// A path for a body that is planned for by paths.
#[derive(Debug, Clone, PartialEq)]
pub struct PathGoal {
    /// One root for each frame of the segment from its first context frame on, in the world.
    /// Heights do not count.
    pub roots: Vec<GlobalRoot>,
    /// Words that say how to move, with their weights.
    pub words: Vec<(String, f32)>,
}

/// What a primitive asks of the networks.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanTargets {
    /// One to four consecutive keyframes; the last is the segment's last frame.
    pub targets: Vec<TargetKey>,
    /// Poses between context and targets, in the order of their frames; mostly none.
    pub gap_poses: Vec<GapPose>,
    /// Frames of the segment from the first context frame on. `None`: the root module chooses.
    pub frames: Option<usize>,
    /// Without `frames`: the token counts that it may choose from. Empty: all.
    pub allowed_token_counts: Vec<u32>,
    /// Root interpolation between the root module's path and the spring's.
    pub guide: Option<Guide>,
    /// Poses of a gait that the networks do not know; with a guide.
    pub follow: Option<Follow>,
    /// r_g1: where the command alone would have the root at the horizon.
    pub r_g1: GlobalRoot,
    /// r_g2: the spring's path, one root for each frame of the segment.
    pub r_g2: Vec<GlobalRoot>,
    /// Where plans are asked for by paths: what to follow. There are no targets, gap poses or guide
    /// then.
    pub path: Option<PathGoal>,
    /// The turn goes on beyond the plan, which leaves off at [`recipe::MAX_TURN`].
    pub unfinished: bool,
    /// How much of each gait went into the target pose.
    pub gaits: Vec<(String, f32)>,
}
