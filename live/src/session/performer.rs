//! Generates the motion of sentences. A character's request goes through the batcher of a pack that
//! understands words, and frames come back in parts.
//!
//! A session has at most one such request at a time. The character buffers the frames of all parts.
//! Every request ends with its last part or with
//! [`words_failed`](troupe_character::live::Character::words_failed), even after a panic.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::cell::SessionCell;
use super::wants::Patience;
use super::words::{MAX_PERFORMERS, Performer, task};
use troupe_base::turns::Turns;
use troupe_batch::{AnswerStream, Batcher, Class, Order, Piece, SubmitError};
use troupe_character::live::{PartReader, WordsPart, WordsRequest};
use troupe_engine::EngineError;
use troupe_motion::model::{Output, Task};

/// Minimum wait before the next attempt to enter a full queue.
const MIN_RETRY: Duration = Duration::from_millis(5);
/// On a stream, words must begin within this time. Later they are of no use.
const MAX_WAIT: Duration = Duration::from_secs(10);

/// Requests the motion of words for a character and wakes the session's owner when frames come.
/// Returns at once.
pub fn ask(cell: &Arc<SessionCell>, request: WordsRequest, patience: Patience) {
    let number = request.number;
    let awaited = Awaited {
        cell: cell.clone(),
        number,
        answered: false,
    };
    let packs = cell.pack().words();
    let Some(words) = packs.get(&request.command.pack) else {
        let name = &request.command.pack;
        return awaited.failed(&format!("the pack {name:?} is no longer loaded"));
    };
    let Some(place) = packs.places.take() else {
        return awaited.failed(&format!(
            "{MAX_PERFORMERS} characters perform already; allowed: at most {MAX_PERFORMERS}"
        ));
    };
    let (batcher, reader) = (words.loaded.batcher.clone(), words.reader.clone());
    let turns = Turns::current();
    let order = order(cell, &request, patience).of(turns.client());
    let task = task(&request.command, request.past, request.seed);
    // On a stream, words enter the queue now instead of when their task first runs.
    let entered = match patience {
        Patience::Fails => Ok(batcher.stream(task, order)),
        Patience::Waits => Err(task),
    };
    let work = async move {
        let stream = match entered {
            Ok(stream) => stream,
            Err(task) => awaited.patient_stream(&batcher, task, order).await,
        };
        match stream {
            Ok(stream) => awaited.follow(stream, reader).await,
            Err(error) => awaited.failed(&error.to_string()),
        }
    };
    let performer = Performer::new(number, place, tokio::spawn(turns.take(work)));
    cell.live().performer = Some(performer);
}

/// The batcher's order for words. It has no owner, so that the session's plans do not wait for it.
fn order(cell: &SessionCell, request: &WordsRequest, patience: Patience) -> Order {
    let frames = request.splice_in_frames as f32;
    let now = Instant::now();
    let live = Order {
        owner: None,
        ..Order::live(
            cell.owner_id(),
            now + Duration::from_secs_f32(frames / cell.pack().rig().fps),
        )
    };
    match patience {
        Patience::Fails => live.expiring(now + MAX_WAIT),
        Patience::Waits => Order {
            class: Class::Step,
            ..live
        },
    }
}

/// Words that a character waits for. If this is dropped before the last part, the words fail.
struct Awaited {
    cell: Arc<SessionCell>,
    number: u64,
    answered: bool,
}

impl Awaited {
    /// Enters the queue and returns the stream of parts. Tries again while the queue is full.
    async fn patient_stream(
        &self,
        batcher: &Batcher,
        task: Task,
        order: Order,
    ) -> Result<AnswerStream, SubmitError> {
        loop {
            match batcher.stream(task.clone(), order) {
                Err(SubmitError::QueueFull { retry_after, .. }) if self.cell.end().is_none() => {
                    tokio::time::sleep(retry_after.max(MIN_RETRY)).await;
                }
                result => return result,
            }
        }
    }

    /// Hands the parts to the character, until the last one or until the character wants no more.
    async fn follow(mut self, mut stream: AnswerStream, mut reader: PartReader) {
        while let Some(piece) = stream.next().await {
            let is_last = piece.as_ref().is_ok_and(|piece| piece.is_last);
            let part = piece.and_then(|piece| read(&mut reader, piece));
            match part {
                Ok(part) => {
                    let goes_on = self.arrived(part, is_last);
                    if !goes_on {
                        self.answered = true;
                        return;
                    }
                }
                Err(error) => return self.failed(&error.to_string()),
            }
        }
    }

    /// Hands frames to the character. Answers whether it wants more.
    fn arrived(&self, part: WordsPart, is_last: bool) -> bool {
        let wanted = {
            let mut live = self.cell.live();
            live.character.words_arrived(self.number, part, is_last);
            live.character.wants_words(self.number)
        };
        self.cell.wake();
        wanted && self.cell.end().is_none()
    }

    fn failed(mut self, reason: &str) {
        self.fail(reason);
    }

    fn fail(&mut self, reason: &str) {
        self.answered = true;
        let is_wanted = {
            let mut live = self.cell.live();
            let is_wanted = live.character.wants_words(self.number);
            live.character.words_failed(self.number, reason.to_owned());
            is_wanted
        };
        if is_wanted {
            tracing::debug!(session = %self.cell.id(), reason, "words failed");
        }
        self.cell.wake();
    }
}

impl Drop for Awaited {
    fn drop(&mut self) {
        if !self.answered {
            let lost = match std::thread::panicking() {
                true => EngineError::Panicked("its words were not finished".to_owned()),
                false => EngineError::Stopped,
            };
            self.fail(&lost.to_string());
        }
    }
}

/// Reads the frames of a part.
fn read(reader: &mut PartReader, piece: Piece) -> Result<WordsPart, SubmitError> {
    let motion = match piece.output {
        Output::Motion(motion) => motion,
        Output::Motions(motions) => motions.into_iter().next().unwrap_or_default(),
        Output::Text(_) | Output::Audio(_) => Default::default(),
    };
    reader.read(&motion).map_err(|_| {
        SubmitError::Engine(EngineError::Output {
            stage: troupe_engine::pack::Stage::Decoder,
            problem: "frames that are not finite".to_owned(),
        })
    })
}
