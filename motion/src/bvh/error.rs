//! Errors of BVH texts.

use super::MAX_NAME_BYTES;

/// An error in a BVH text, with its line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}: {kind}")]
pub struct BvhError {
    /// Line, counted from 1.
    pub line: usize,
    /// The error in that line.
    pub kind: BvhErrorKind,
}

/// Errors of a BVH text.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BvhErrorKind {
    /// Bytes that are not UTF-8.
    #[error("the text is not UTF-8")]
    NotUtf8,
    /// Something else stands where `expected` should stand.
    #[error("expected {expected}, found {found:?}")]
    Expected {
        /// What should stand there.
        expected: &'static str,
        /// What stands there, cut to a few characters; empty at the end of the text.
        found: String,
    },
    /// The text ends too early.
    #[error("the text ends where {0} should stand")]
    UnexpectedEnd(&'static str),
    /// A joint name that is empty, or longer than [`MAX_NAME_BYTES`].
    #[error("a joint name must have 1 to {MAX_NAME_BYTES} bytes")]
    Name,
    /// OFFSET or CHANNELS stands twice in a joint, or after its children.
    #[error("{0} may stand once in a joint, before its children")]
    Repeated(&'static str),
    /// A joint or End Site has no OFFSET.
    #[error("{0:?} has no OFFSET")]
    NoOffset(String),
    /// The number of channels is not 0 to 6.
    #[error("the number of channels must be 0 to 6, not {0:?}")]
    ChannelCount(String),
    /// A joint has a channel twice.
    #[error("channel {0} stands twice in one joint")]
    DuplicateChannel(&'static str),
    /// No joint has channels, so there can be no motion.
    #[error("no joint has channels")]
    NoChannels,
    /// Something exceeds a limit.
    #[error("more than {limit} {what}")]
    TooMany {
        /// What there is too much of.
        what: &'static str,
        /// The most that is allowed.
        limit: usize,
    },
    /// NaN, infinity, or a number too large for double precision.
    #[error("{0:?} is not a finite number")]
    NotFinite(String),
    /// A frame time that is not positive.
    #[error("the frame time must be positive, not {0}")]
    FrameTime(f64),
    /// A row has too few or too many numbers.
    #[error("frame {frame} has {found} values for {expected} channels")]
    RowLength {
        /// Index of the frame, from 0.
        frame: usize,
        /// Numbers in the row; counting stops at one more than `expected`.
        found: usize,
        /// Channels of the hierarchy.
        expected: usize,
    },
    /// There are more or fewer rows than declared.
    #[error("{declared} frames are declared, but there {found}")]
    FrameCount {
        /// The number after `Frames:`.
        declared: usize,
        /// The rows that there are.
        found: FoundFrames,
    },
}

/// Number of rows, compared with the declared number.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FoundFrames {
    /// Fewer rows: this many.
    #[error("are {0}")]
    Only(usize),
    /// At least one more.
    #[error("are more")]
    More,
}
