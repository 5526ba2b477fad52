//! The lines of a recording: a head, then events in the order in which the character took them.
//! `docs/recordings.md` describes them.

use serde::{Deserialize, Serialize};
use troupe_character::live::Clock;
use troupe_proto::v1;

use super::digest::Digest;

/// Version of the format. It rises with every change that an older server would misread.
pub(super) const FORMAT: u32 = 1;
/// Most bytes of a line that an error repeats.
const MAX_ECHO: usize = 200;

/// Why a recording cannot be played.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RecordingError {
    /// It is too large.
    #[error("the recording has {bytes} bytes; allowed: at most {most}")]
    TooLarge {
        /// Its size.
        bytes: usize,
        /// Maximum size.
        most: usize,
    },
    /// A line is not one of a recording.
    #[error("line {line} of the recording: {problem}")]
    Line {
        /// Number of the line, from 1.
        line: usize,
        /// What is wrong with it.
        problem: String,
    },
    /// A newer server wrote it.
    #[error("the recording has format {found}; allowed: 1 to {FORMAT}, or a newer server")]
    Newer {
        /// The format of the recording.
        found: u32,
    },
    /// It was made with something else than this server has, so frames would differ.
    #[error("the recording was made with something else: {}", .0.join("; "))]
    Differs(Vec<String>),
}

/// The first line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Head {
    /// The format.
    pub(super) troupe_recording: u32,
    /// What decides the bits of frames, apart from the session.
    pub(super) made_with: Origin,
    /// The request that opened the session, with the names of its pack and style.
    pub(super) session: v1::SessionOptions,
}

/// What decides the bits of a session's frames, apart from its options and inputs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Origin {
    /// Version of the server.
    pub(super) server: String,
    /// Name and version of the pack, and the hash of its networks.
    pub(super) pack: String,
    pub(super) pack_version: String,
    pub(super) content_hash: String,
    /// Name of the body. Empty for packs with one skeleton.
    pub(super) body: String,
    /// Name of the engine.
    pub(super) engine: String,
    /// Model of the CPU. Another one may round differently with the same engine.
    pub(super) cpu: String,
    /// The style at the start.
    pub(super) style: Digest,
    /// The user's own skeleton that the character wears.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) skeleton: Option<Digest>,
}

/// A line after the first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Event {
    /// The session accepted this command.
    Command(Box<v1::Command>),
    /// Name and checksum of the style that the command before set.
    Style(String, Digest),
    /// The load of the networks, from now on.
    Load(Load),
    /// Whether the cursor waits for plans, from now on.
    Clock(ClockWord),
    /// The cursor moves by this number of sub-frames.
    Go(u32),
    /// The plan of this number comes.
    Plan(u64),
    /// The plan of this number fails, or a newer one replaced it in the queue.
    Failed(u64),
    /// The session gives a frame.
    Frame(Shown),
    /// Nothing follows.
    End(Ending),
}

/// The load of the networks for one character.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Load {
    pub(super) expected_frames: u32,
    pub(super) lead_frames: u32,
    pub(super) stretch: f32,
}

/// Who moves the cursor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum ClockWord {
    /// A step, which waits for plans.
    Waits,
    /// A stream, which does not.
    Runs,
}

impl From<Clock> for ClockWord {
    fn from(clock: Clock) -> Self {
        match clock {
            Clock::Waits => Self::Waits,
            Clock::Runs => Self::Runs,
        }
    }
}

impl From<ClockWord> for Clock {
    fn from(word: ClockWord) -> Self {
        match word {
            ClockWord::Waits => Self::Waits,
            ClockWord::Runs => Self::Runs,
        }
    }
}

/// A frame as checksums.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Shown {
    /// Frame of the timeline.
    pub(super) number: u64,
    pub(super) root: Digest,
    pub(super) rotations: Digest,
    pub(super) contacts: u8,
    /// The character slowed down because a plan was late.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(super) underrun: bool,
    /// Angles and rates of a robot's hinges.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) hinges: Option<Digest>,
}

impl Shown {
    /// The first field that differs from `other`'s.
    pub(super) fn differs(&self, other: &Self) -> Option<&'static str> {
        [
            ("frame", self.number != other.number),
            ("underrun", self.underrun != other.underrun),
            ("root", self.root != other.root),
            ("rotations", self.rotations != other.rotations),
            ("contacts", self.contacts != other.contacts),
            ("hinges", self.hinges != other.hinges),
        ]
        .into_iter()
        .find_map(|(field, differs)| differs.then_some(field))
    }
}

/// The last line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Ending {
    pub(super) why: Why,
    /// The last frame that the session gave.
    pub(super) frame: u64,
}

/// Why a recording ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Why {
    /// A client closed the session, or it expired or moved to another server.
    SessionEnded,
    /// The recording had as many bytes as it may have.
    Full,
    /// A command asked for a sentence. When its parts come is not recorded.
    Sentence,
    /// Another version took the place of the session's pack.
    Swap,
}

impl Why {
    /// For people.
    pub(super) fn text(self) -> &'static str {
        match self {
            Self::SessionEnded => "the session ended",
            Self::Full => "it was full",
            Self::Sentence => "a command asked for a sentence, which is not recorded",
            Self::Swap => "another version took the place of its pack",
        }
    }
}

/// The lines of a recording, one after another.
#[derive(Debug)]
pub(super) struct Reader {
    text: String,
    /// Where the next line begins.
    at: usize,
    /// Number of the line that was read last.
    line: usize,
}

impl Reader {
    /// Reads the head.
    ///
    /// # Errors
    /// [`RecordingError`] if the text does not begin with one that this server understands.
    pub(super) fn new(text: String) -> Result<(Self, Head), RecordingError> {
        /// The part of a head that every version has.
        #[derive(Deserialize)]
        struct Format {
            troupe_recording: u32,
        }

        let mut reader = Self { text, at: 0, line: 0 };
        let Some(line) = reader.next_line() else {
            return Err(RecordingError::Line {
                line: 1,
                problem: "it is not whole; allowed: the head of a recording".to_owned(),
            });
        };
        let wrong = |error| wrong(1, error);
        let Format { troupe_recording } = serde_json::from_str(line).map_err(wrong)?;
        if troupe_recording > FORMAT {
            return Err(RecordingError::Newer {
                found: troupe_recording,
            });
        }
        let head = serde_json::from_str(line).map_err(wrong)?;
        Ok((reader, head))
    }

    /// The next event. `None` at the end, and at a last line that is cut off.
    ///
    /// # Errors
    /// [`RecordingError::Line`] for a whole line that is no event.
    pub(super) fn next(&mut self) -> Result<Option<Event>, RecordingError> {
        let number = self.line + 1;
        let line = self.next_line();
        line.map(|line| serde_json::from_str(line).map_err(|error| wrong(number, error)))
            .transpose()
    }

    /// The error of a line that was read, but makes no sense.
    pub(super) fn wrong(&self, problem: impl Into<String>) -> RecordingError {
        RecordingError::Line {
            line: self.line,
            problem: problem.into(),
        }
    }

    /// The next line that has an end.
    fn next_line(&mut self) -> Option<&str> {
        let rest = &self.text[self.at..];
        let end = rest.find('\n')?;
        self.at += end + 1;
        self.line += 1;
        Some(rest[..end].trim_end_matches('\r'))
    }
}

fn wrong(line: usize, error: serde_json::Error) -> RecordingError {
    RecordingError::Line {
        line,
        problem: error.to_string().chars().take(MAX_ECHO).collect(),
    }
}
