//! The recording of one session.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use serde::Serialize;

use super::format::{Ending, Event, Head, Why};

/// Maximum size of a recording, bytes. A walk takes about 90 bytes a frame, so this is 13 minutes
/// at 30 Hz.
pub const MAX_RECORDING_BYTES: usize = 2 << 20;
/// Room for the last line.
const END_BYTES: usize = 128;

/// The lines of a recording. The session writes them, and clients read them.
#[derive(Debug)]
pub(crate) struct Tape(Mutex<Lines>);

#[derive(Debug)]
struct Lines {
    text: Vec<u8>,
    /// The last frame that the session gave.
    frame: u64,
    /// No line follows.
    ended: bool,
    /// When the session ended.
    over: Option<Instant>,
}

impl Tape {
    /// A recording that begins with this head.
    pub(super) fn new(head: &Head) -> Self {
        let mut text = Vec::new();
        add(&mut text, head);
        Self(Mutex::new(Lines {
            text,
            frame: 0,
            ended: false,
            over: None,
        }))
    }

    fn lines(&self) -> MutexGuard<'_, Lines> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes an event. Answers whether the recording goes on. If there is no room for the event,
    /// the recording ends.
    pub(super) fn write(&self, event: &Event) -> bool {
        let mut lines = self.lines();
        if lines.ended {
            return false;
        }
        let before = lines.text.len();
        add(&mut lines.text, event);
        if lines.text.len() + END_BYTES > MAX_RECORDING_BYTES {
            lines.text.truncate(before);
            lines.end(Why::Full);
            return false;
        }
        if let Event::Frame(shown) = event {
            lines.frame = shown.number;
        }
        true
    }

    /// Ends the recording, if it goes on.
    pub(super) fn end(&self, why: Why) {
        self.lines().end(why);
    }

    /// Notes that the session ended at `now`.
    pub(super) fn session_ended(&self, now: Instant) {
        let mut lines = self.lines();
        lines.end(Why::SessionEnded);
        lines.over.get_or_insert(now);
    }

    /// Ends the recording and frees its memory.
    pub(super) fn discard(&self) {
        let mut lines = self.lines();
        lines.ended = true;
        lines.text = Vec::new();
    }

    /// When the session ended. `None` while it is open.
    pub(super) fn over(&self) -> Option<Instant> {
        self.lines().over
    }

    /// The lines so far, and whether the recording has ended.
    pub(super) fn read(&self) -> (String, bool) {
        let lines = self.lines();
        (String::from_utf8_lossy(&lines.text).into_owned(), lines.ended)
    }
}

impl Lines {
    fn end(&mut self, why: Why) {
        if !self.ended {
            self.ended = true;
            let frame = self.frame;
            add(&mut self.text, &Event::End(Ending { why, frame }));
        }
    }
}

fn add(text: &mut Vec<u8>, line: &impl Serialize) {
    // It cannot fail: a vector takes any bytes, and no value is a map with keys that are no text.
    if let Err(error) = serde_json::to_writer(&mut *text, line) {
        unreachable!("a line of a recording cannot be written: {error}");
    }
    text.push(b'\n');
}
