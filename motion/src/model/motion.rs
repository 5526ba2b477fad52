//! What a generator answers, in the segment frame.

use super::GLOBAL_ROOT;

/// Frames of one character.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Motion {
    /// Roots, `[frames, 5]`: position (m), cosine and sine of the heading. MotionBricks: r_g4.
    pub root: Vec<f32>,
    /// World rotations in 6D form, `[frames, joints, 6]`.
    pub rotations: Vec<f32>,
    /// Contact probabilities, `[frames, contacts]`.
    pub contacts: Vec<f32>,
    /// What the family's networks made on the way, where it has such steps.
    pub trace: Option<Box<Trace>>,
}

impl Motion {
    /// Frames that it holds.
    pub fn frames(&self) -> usize {
        self.root.len() / GLOBAL_ROOT
    }

    /// Adds the frames that follow. What there is of a trace stays.
    pub fn append(&mut self, mut more: Self) {
        self.root.append(&mut more.root);
        self.rotations.append(&mut more.rotations);
        self.contacts.append(&mut more.contacts);
    }

    /// Whether all its numbers are finite.
    pub fn is_finite(&self) -> bool {
        let own = [&self.root, &self.rotations, &self.contacts];
        let traced = self.trace.as_deref();
        let traced = traced
            .into_iter()
            .flat_map(|trace| [&trace.count_probs, &trace.root_r_g3]);
        own.into_iter().chain(traced).all(|values| all_finite(values))
    }
}

/// What the stages of MotionBricks made on the way to a motion.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Trace {
    /// Tokens of the segment.
    pub num_tokens: usize,
    /// Probability of each token count, from the pack's minimum on.
    pub count_probs: Vec<f32>,
    /// r_g3, as the root stage gave it, before any guide: `[4 * num_tokens, 5]`.
    pub root_r_g3: Vec<f32>,
    /// Pose tokens: `[num_tokens, heads]`.
    pub tokens: Vec<u32>,
}

/// What a job gives.
#[derive(Debug, Clone, PartialEq)]
pub enum Output {
    /// Frames.
    Motion(Motion),
    /// Words.
    Text(String),
}

impl Output {
    /// The frames, where it is these.
    pub fn into_motion(self) -> Option<Motion> {
        match self {
            Self::Motion(motion) => Some(motion),
            Self::Text(_) => None,
        }
    }
}

/// Whether all numbers are finite. Looks at each, without a way out in the middle, so several go at once.
pub fn all_finite(values: &[f32]) -> bool {
    values
        .iter()
        .fold(true, |finite, value| finite & value.is_finite())
}
