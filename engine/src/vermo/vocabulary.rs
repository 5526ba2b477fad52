//! The ids of a pack's tokens: special tokens, lengths, text pieces, motion codes, audio codes, in
//! this order.

use std::ops::Range;

use crate::pack::{MessageTask, VerMoDoc};

/// Fills the columns of a call behind a row's last token.
pub const PAD: u32 = 0;
/// Begins a message.
pub const BOS: u32 = 1;
/// Ends a message.
pub const EOS: u32 = 2;
/// Begins the instruction.
pub const INSTRUCTION: u32 = 3;
/// Begins the condition.
pub const CONDITION: u32 = 4;
/// Begins the reply.
pub const REPLY: u32 = 5;
/// Marks the gap that an in-between fills.
pub const GAP: u32 = 6;
/// Separates the items of several agents.
pub const AGENT_SEP: u32 = 7;
/// The first of the tasks' tokens.
const FIRST_TASK: u32 = 8;
/// Number of special tokens.
const SPECIALS: u32 = FIRST_TASK + MessageTask::ALL.len() as u32;

/// Sizes of the parts of a pack's vocabulary.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Vocabulary {
    max_tokens: u32,
    text_pieces: u32,
    motion_codes: u32,
    audio_codes: u32,
}

/// The kinds of codes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Pieces of text.
    Text,
    /// Motion codes: each stands for four frames.
    Motion,
    /// Codes of audio.
    Audio,
}

impl Vocabulary {
    /// The vocabulary of a pack whose replies have up to `max_tokens` motion tokens.
    pub fn new(table: &VerMoDoc, max_tokens: usize) -> Self {
        Self {
            max_tokens: max_tokens as u32,
            text_pieces: table.text_pieces as u32,
            motion_codes: table.motion_codes as u32,
            audio_codes: table.audio_codes as u32,
        }
    }

    /// Number of all tokens, which is that of the logits' columns.
    pub fn len(&self) -> usize {
        self.range(Kind::Audio).end as usize
    }

    /// Always false: a vocabulary has special tokens.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The token that names a task.
    pub fn task(task: MessageTask) -> u32 {
        let place = MessageTask::ALL.iter().position(|&other| other == task);
        FIRST_TASK + place.unwrap_or(0) as u32
    }

    /// The token that fixes the reply's length at `tokens`: 1 to the pack's most.
    pub fn length(&self, tokens: usize) -> u32 {
        SPECIALS + (tokens as u32).clamp(1, self.max_tokens) - 1
    }

    /// The ids of a kind's codes.
    pub fn range(&self, kind: Kind) -> Range<u32> {
        let text = SPECIALS + self.max_tokens;
        let motion = text + self.text_pieces;
        let audio = motion + self.motion_codes;
        match kind {
            Kind::Text => text..motion,
            Kind::Motion => motion..audio,
            Kind::Audio => audio..audio + self.audio_codes,
        }
    }

    /// The tokens of codes of one kind.
    pub fn tokens<'a>(&self, kind: Kind, codes: &'a [u32]) -> impl Iterator<Item = u32> + use<'a> {
        let first = self.range(kind).start;
        codes.iter().map(move |code| first + code)
    }

    /// The code of a token; none if the token is of another kind.
    pub fn code(&self, kind: Kind, token: u32) -> Option<u32> {
        let range = self.range(kind);
        range.contains(&token).then(|| token - range.start)
    }
}
