//! Notes on robots, for whoever reads them.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use tokio::sync::mpsc::{Receiver, Sender, channel};

/// Notes that wait for a reader. Those that come when so many wait are counted and left out.
const MOST: usize = 64;

/// Something worth knowing about a robot.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// Index of the robot.
    pub robot: usize,
    /// A sentence.
    pub text: String,
}

/// Where notes are made.
#[derive(Debug, Clone)]
pub(crate) struct Notes {
    notes: Sender<Note>,
    left_out: Arc<AtomicU64>,
}

/// Where notes are read.
#[derive(Debug)]
pub(crate) struct NoteReader {
    notes: Receiver<Note>,
    left_out: Arc<AtomicU64>,
}

/// Both ends.
pub(crate) fn notes() -> (Notes, NoteReader) {
    let ((send, receive), left_out) = (channel(MOST), Arc::default());
    let notes = Notes {
        notes: send,
        left_out: Arc::clone(&left_out),
    };
    let reader = NoteReader {
        notes: receive,
        left_out,
    };
    (notes, reader)
}

impl Notes {
    /// Makes a note. It never waits.
    pub(crate) fn note(&self, robot: usize, text: String) {
        if self.notes.try_send(Note { robot, text }).is_err() {
            self.left_out.fetch_add(1, Ordering::Relaxed);
        }
    }
}

impl NoteReader {
    /// The next note. The one that is read after others were left out says how many.
    pub(crate) async fn next(&mut self) -> Option<Note> {
        let mut note = self.notes.recv().await?;
        match self.left_out.swap(0, Ordering::Relaxed) {
            0 => {}
            count => note.text += &format!(" ({count} later notes were left out, because {MOST} waited)"),
        }
        Some(note)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn notes_without_a_place_are_counted() {
        let (notes, mut reader) = notes();
        for number in 0..MOST + 3 {
            notes.note(1, number.to_string());
        }
        let first = reader.next().await.unwrap();
        assert_eq!(first.text, "0 (3 later notes were left out, because 64 waited)");
        for number in 1..MOST {
            assert_eq!(reader.next().await.unwrap().text, number.to_string());
        }
        notes.note(0, "again".to_owned());
        let again = reader.next().await.unwrap();
        assert_eq!((again.robot, again.text.as_str()), (0, "again"));
        drop(notes);
        assert_eq!(reader.next().await, None);
    }
}
