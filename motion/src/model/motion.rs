//! The answers of a generator, in the segment frame.

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
    /// What the family's networks made on the way, for families with such steps.
    pub trace: Option<Box<Trace>>,
}

impl Motion {
    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.root.len() / GLOBAL_ROOT
    }

    /// Appends the frames that follow. A trace is unchanged.
    pub fn append(&mut self, mut more: Self) {
        self.root.append(&mut more.root);
        self.rotations.append(&mut more.rotations);
        self.contacts.append(&mut more.contacts);
    }

    /// Whether all numbers are finite.
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
    /// Number of tokens of the segment.
    pub num_tokens: usize,
    /// Probability of each token count, from the pack's minimum on.
    pub count_probs: Vec<f32>,
    /// r_g3 from the root stage, before any guide: `[4 * num_tokens, 5]`.
    pub root_r_g3: Vec<f32>,
    /// Pose tokens: `[num_tokens, heads]`.
    pub tokens: Vec<u32>,
}

/// The answer of a job.
#[derive(Debug, Clone, PartialEq)]
pub enum Output {
    /// Frames of one character.
    Motion(Motion),
    /// Frames of several characters.
    Motions(Vec<Motion>),
    /// A description in words.
    Text(String),
    /// Codes of audio.
    Audio(Vec<u32>),
}

impl Output {
    /// The frames, if these are frames of one character.
    pub fn into_motion(self) -> Option<Motion> {
        match self {
            Self::Motion(motion) => Some(motion),
            Self::Motions(_) | Self::Text(_) | Self::Audio(_) => None,
        }
    }

    /// Appends the part that follows. A part of another kind replaces the answer.
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

/// Whether all numbers are finite. Checks all of them without an early exit, which lets the
/// compiler vectorise.
pub fn all_finite(values: &[f32]) -> bool {
    values
        .iter()
        .fold(true, |finite, value| finite & value.is_finite())
}
