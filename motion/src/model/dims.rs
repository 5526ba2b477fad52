//! Sizes of a pack: the length of its segments, and the width of its numbers.

/// Numbers of a pose feature a joint: position (3) and 6D rotation (6).
pub const POSE_FEATURES: usize = crate::features::FEATURES_PER_JOINT;
/// Numbers of a local root: velocity x and z, angular velocity, height.
pub const LOCAL_ROOT: usize = 4;
/// Numbers of a global root: position (3), cosine and sine of the heading.
pub const GLOBAL_ROOT: usize = 5;
/// Numbers of a 6D rotation.
pub const SIX_D: usize = 6;

/// Sizes of a pack. Tensor shapes and request limits follow from them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dims {
    /// Number of joints of the skeleton.
    pub joints: usize,
    /// Number of contact joints.
    pub contacts: usize,
    /// Codebooks of a token.
    pub heads: usize,
    /// Codes of a codebook.
    pub codes: usize,
    /// Fewest tokens of a segment.
    pub min_tokens: usize,
    /// Most tokens of a segment.
    pub max_tokens: usize,
    /// Frames of one token.
    pub frames_per_token: usize,
    /// Context keyframes of a request, the first frames of the segment.
    pub context_frames: usize,
    /// Most target keyframes of a request.
    pub max_targets: usize,
    /// Normal random numbers by which the root stage chooses one of the ways to the targets. 0 if
    /// it knows only the likeliest.
    pub root_choices: usize,
}

impl Dims {
    /// Fewest frames of a segment.
    pub fn min_frames(&self) -> usize {
        self.min_tokens * self.frames_per_token
    }

    /// Most frames of a segment: the longest frame axis of a tensor.
    pub fn max_frames(&self) -> usize {
        self.max_tokens * self.frames_per_token
    }

    /// Number of token counts to choose from.
    pub fn counts(&self) -> usize {
        self.max_tokens - self.min_tokens + 1
    }

    /// Keyframe slots of the root stage: the context frames, then the segment's last frames.
    pub fn slots(&self) -> usize {
        self.context_frames + self.max_targets
    }

    /// Numbers of one pose feature.
    pub fn pose(&self) -> usize {
        self.joints * POSE_FEATURES
    }

    /// Tokens that a segment of `frames` frames needs.
    pub fn tokens_for(&self, frames: usize) -> usize {
        frames.div_ceil(self.frames_per_token)
    }
}
