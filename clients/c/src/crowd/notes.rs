//! What happens to characters, in a queue of a fixed length.

use std::collections::VecDeque;
use std::ffi::{CString, c_char};
use std::sync::{Mutex, MutexGuard, PoisonError};

use troupe_client::Problem;
use troupe_proto::v1;
use troupe_proto::v1::session_event::Kind;

use crate::sized::Versioned;
use crate::status::text;

/// Notes that may wait. Then the oldest are dropped, and counted.
const MOST: usize = 1024;

/// What a note is about. The columns of the table are fields of `TroupeNote`.
///
/// | kind | subject | detail | values |
/// |---|---|---|---|
/// | `RESUMED` | | | commands that were lost; 1 if the server was restarted |
/// | `LEFT` | | the server's word for the reason | |
/// | `REFUSED` | field of the command | the server's word for the reason | |
/// | `ENDED` | | | |
/// | `STARTED` | object | definition, or skill | |
/// | `SET_ENTERED` | object | set | |
/// | `KEYFRAME_REACHED` | object | set | index of the keyframe; distance of the root, metres |
/// | `OBJECT_ATTACHED` | object | socket | |
/// | `OBJECT_RELEASED` | object | | |
/// | `DONE`, `INTERRUPTED` | object | | |
/// | `FAILED` | object | reason, such as `BLOCKED` | |
/// | `FELL` | | | height, metres |
/// | `LANDED` | | | height, metres; speed, metres a second |
/// | `ARRIVED` | | | delay, seconds; distance from the last point, metres |
/// | `PERFORMING` | sentence | pack | |
/// | `PERFORMED` | | reason, such as `DONE` | |
/// | `BOUNDED` | | | wanted speed and speed, metres a second |
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TroupeNoteKind {
    /// A kind that this library does not know.
    Other = 0,
    /// The connection broke, and the character goes on after the last frame that came.
    Resumed = 1,
    /// The character left the crowd: its session is gone. It has no frames from now on.
    Left = 2,
    /// The server refused a command. The character goes on as before.
    Refused = 3,
    /// The stream ended, and no frames come from now on. `character` is `TROUPE_NO_CHARACTER`.
    Ended = 4,
    /// An interaction or a skill began.
    Started = 5,
    /// A set of keyframes began.
    SetEntered = 6,
    /// The character reached a keyframe.
    KeyframeReached = 7,
    /// The object is in the character's hand.
    ObjectAttached = 8,
    /// The character put the object down.
    ObjectReleased = 9,
    /// An interaction ended as planned.
    Done = 10,
    /// An interaction failed, and the character stands.
    Failed = 11,
    /// A command broke an interaction off.
    Interrupted = 12,
    /// The ground ended, and the character falls.
    Fell = 13,
    /// The character landed.
    Landed = 14,
    /// The character came to the end of its path, and stands there.
    Arrived = 15,
    /// The character began to act out a sentence.
    Performing = 16,
    /// A performance ended.
    Performed = 17,
    /// A command asks for more than the style can do. The character does what comes nearest.
    Bounded = 18,
}

/// Something that happened. Its texts are UTF-8, never null, and hold until the next
/// `troupe_crowd_note` or `troupe_crowd_close` of this crowd.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct TroupeNote {
    /// `sizeof(TroupeNote)`.
    pub size: u32,
    /// What it is about.
    pub kind: TroupeNoteKind,
    /// Index of the character, or `TROUPE_NO_CHARACTER`.
    pub character: u32,
    /// Zero.
    pub reserved: u32,
    /// Frame of the character's timeline, which has 30 frames a second.
    pub frame: u64,
    /// Notes of this crowd that were dropped so far, because they were not taken.
    pub dropped: u64,
    /// See `TroupeNoteKind`.
    pub subject: *const c_char,
    /// See `TroupeNoteKind`.
    pub detail: *const c_char,
    /// A sentence for people, for refusals and failures.
    pub message: *const c_char,
    /// See `TroupeNoteKind`.
    pub values: [f32; 2],
}

impl Versioned for TroupeNote {
    const NAME: &'static str = "TroupeNote";
}

/// The `character` of notes that are about the whole crowd.
pub const TROUPE_NO_CHARACTER: u32 = 0xffff_ffff;

/// A note that waits.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Note {
    pub(crate) kind: TroupeNoteKind,
    pub(crate) character: u32,
    pub(crate) frame: u64,
    pub(crate) subject: String,
    pub(crate) detail: String,
    pub(crate) message: String,
    pub(crate) values: [f32; 2],
}

impl Note {
    /// A note without texts.
    pub(crate) fn new(kind: TroupeNoteKind, character: u32) -> Self {
        Self {
            kind,
            character,
            frame: 0,
            subject: String::new(),
            detail: String::new(),
            message: String::new(),
            values: [0.0; 2],
        }
    }

    /// A problem of a character.
    pub(crate) fn problem(kind: TroupeNoteKind, character: u32, problem: &Problem) -> Self {
        let mut message = problem.message.clone();
        if let Some(allowed) = &problem.allowed {
            message.push_str(&format!(" (allowed: {allowed})"));
        }
        Self {
            subject: problem.field.clone().unwrap_or_default(),
            detail: format!("{:?}", problem.kind),
            message,
            ..Self::new(kind, character)
        }
    }

    /// An event of a character's session.
    pub(crate) fn event(character: u32, event: &v1::SessionEvent) -> Self {
        let mut note = match &event.kind {
            Some(kind) => of_kind(character, kind),
            None => Self::new(TroupeNoteKind::Other, character),
        };
        note.frame = event.frame;
        note
    }
}

fn of_kind(character: u32, kind: &Kind) -> Note {
    use TroupeNoteKind as Of;
    let note = |kind, subject: &str, detail: &str, values| Note {
        subject: subject.to_owned(),
        detail: detail.to_owned(),
        values,
        ..Note::new(kind, character)
    };
    let none = [0.0; 2];
    match kind {
        Kind::Started(of) => note(Of::Started, &of.instance, &of.definition, none),
        Kind::Entered(of) => note(Of::SetEntered, &of.instance, &of.set, none),
        Kind::Reached(of) => {
            let off = of.after.as_ref().map_or(0.0, |after| after.root_m);
            note(
                Of::KeyframeReached,
                &of.instance,
                &of.set,
                [of.keyframe as f32, off],
            )
        }
        Kind::Attached(of) => note(Of::ObjectAttached, &of.instance, &of.socket, none),
        Kind::Released(of) => note(Of::ObjectReleased, &of.instance, "", none),
        Kind::Done(of) => note(Of::Done, &of.instance, "", none),
        Kind::Failed(of) => Note {
            message: of.message.clone(),
            ..note(Of::Failed, &of.instance, &of.reason, none)
        },
        Kind::Interrupted(of) => note(Of::Interrupted, &of.instance, "", none),
        Kind::Fell(of) => note(Of::Fell, "", "", [of.height.unwrap_or_default(), 0.0]),
        Kind::Landed(of) => note(Of::Landed, "", "", [of.height, of.speed]),
        Kind::Arrived(of) => note(Of::Arrived, "", "", [of.late, of.off]),
        Kind::Performing(of) => note(Of::Performing, &of.text, &of.pack, none),
        Kind::Performed(of) => Note {
            message: of.message.clone(),
            ..note(Of::Performed, "", &of.reason, none)
        },
        Kind::Bounded(of) => note(Of::Bounded, "", "", [of.wanted_speed, of.speed]),
    }
}

/// The notes that wait.
#[derive(Debug, Default)]
pub(crate) struct Notes(Mutex<Queue>);

#[derive(Debug, Default)]
struct Queue {
    waiting: VecDeque<Note>,
    dropped: u64,
}

impl Notes {
    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a note. The oldest makes room if there is none.
    pub(crate) fn push(&self, note: Note) {
        let mut queue = self.lock();
        if queue.waiting.len() >= MOST {
            queue.waiting.pop_front();
            queue.dropped += 1;
        }
        queue.waiting.push_back(note);
    }

    /// The oldest note, and the number of those that were dropped so far.
    pub(crate) fn pop(&self) -> Option<(Note, u64)> {
        let mut queue = self.lock();
        let note = queue.waiting.pop_front()?;
        Some((note, queue.dropped))
    }
}

/// The texts of the note that was taken last.
#[derive(Debug, Default)]
pub(crate) struct Taken([CString; 3]);

impl Taken {
    /// Keeps the texts of a note, and gives it to C.
    pub(crate) fn keep(&mut self, note: &Note, dropped: u64) -> TroupeNote {
        self.0 = [text(&note.subject), text(&note.detail), text(&note.message)];
        let [subject, detail, message] = &self.0;
        TroupeNote {
            size: 0,
            kind: note.kind,
            character: note.character,
            reserved: 0,
            frame: note.frame,
            dropped,
            subject: subject.as_ptr(),
            detail: detail.as_ptr(),
            message: message.as_ptr(),
            values: note.values,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_note_makes_room() {
        let notes = Notes::default();
        for character in 0..MOST as u32 + 3 {
            notes.push(Note::new(TroupeNoteKind::Left, character));
        }
        let (first, dropped) = notes.pop().unwrap();
        assert_eq!((first.character, dropped), (3, 3));
        let rest = std::iter::from_fn(|| notes.pop()).count();
        assert_eq!(rest, MOST - 1);
    }

    #[test]
    fn an_event_keeps_its_names_and_numbers() {
        let arrived = v1::SessionEvent {
            frame: 70,
            kind: Some(Kind::Arrived(v1::PathArrived {
                late: 0.5,
                off: 0.125,
            })),
        };
        let note = Note::event(2, &arrived);
        assert_eq!(
            (note.kind, note.character, note.frame),
            (TroupeNoteKind::Arrived, 2, 70)
        );
        assert_eq!(note.values, [0.5, 0.125]);
        let failed = v1::SessionEvent {
            frame: 1,
            kind: Some(Kind::Failed(v1::InteractionFailed {
                instance: "chair".to_owned(),
                reason: "BLOCKED".to_owned(),
                message: "a wall".to_owned(),
            })),
        };
        let note = Note::event(0, &failed);
        assert_eq!(
            (note.subject.as_str(), note.detail.as_str(), note.message.as_str()),
            ("chair", "BLOCKED", "a wall")
        );
        let unknown = v1::SessionEvent { frame: 1, kind: None };
        assert_eq!(Note::event(0, &unknown).kind, TroupeNoteKind::Other);
    }
}
