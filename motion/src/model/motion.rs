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
    /// Frames of each of several characters.
    Motions(Vec<Motion>),
    /// Words.
    Text(String),
    /// Codes of audio.
    Audio(Vec<u32>),
}

impl Output {
    /// The frames, where it is these of one character.
    pub fn into_motion(self) -> Option<Motion> {
        match self {
            Self::Motion(motion) => Some(motion),
            Self::Motions(_) | Self::Text(_) | Self::Audio(_) => None,
        }
    }

    /// Adds the part that follows, which is of the same kind; one of another takes its place.
    pub fn append(&mut self, more: Self) {
        match (self, more) {
            (Self::Motion(motion), Self::Motion(more)) => motion.append(more),
            (Self::Motions(motions), Self::Motions(more)) if motions.len() == more.len() => {
                for (motion, more) in motions.iter_mut().zip(more) {
                    motion.append(more);
                }
            }
            (Self::Text(text), Self::Text(more)) => text.push_str(&more),
            (Self::Audio(codes), Self::Audio(mut more)) => codes.append(&mut more),
            (whole, more) => *whole = more,
        }
    }
}

/// Whether all numbers are finite. Looks at each, without a way out in the middle, so several go at
/// once.
pub fn all_finite(values: &[f32]) -> bool {
    values
        .iter()
        .fold(true, |finite, value| finite & value.is_finite())
}
