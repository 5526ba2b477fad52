//! The way of words: from a character's request through the batcher of a pack of words, and back
//! part by part.
//!
//! A session has one stream of words at most. Parts are read as they come, and frames wait with the
//! character. Every request leads to its last part or to
//! [`words_failed`](troupe_character::live::Character::words_failed), a panic on the way included.

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

/// Shortest wait before a place in a full queue is asked for again.
const MIN_RETRY: Duration = Duration::from_millis(5);
/// Words that have not begun by then are of no use to a stream.
const MAX_WAIT: Duration = Duration::from_secs(10);

/// Has words made, and tells the character and whoever waits for it. Returns at once.
pub fn ask(cell: &Arc<SessionCell>, request: WordsRequest, patience: Patience) {
    let number = request.number;
    let awaited = Awaited {
        cell: cell.clone(),
        number,
        answered: false,
    };
    let Some(words) = cell.pack().words.get(&request.command.pack) else {
        let name = &request.command.pack;
        return awaited.failed(&format!("the pack {name:?} is not loaded any more"));
    };
    let Some(place) = cell.pack().words.places.take() else {
        return awaited.failed(&format!(
            "{MAX_PERFORMERS} characters perform, and there is no place for more"
        ));
    };
    let (batcher, reader) = (words.loaded.batcher.clone(), words.reader.clone());
    let order = order(cell, &request, patience);
    let task = task(&request.command, request.past, request.seed);
    let turns = Turns::current();
    // A tick's words enter the queue now, and not when their task first runs.
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

/// Words have no owner: a session's plans do not wait for them.
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

/// Words that a character waits for. Where they are dropped before their last part, they have
/// failed.
struct Awaited {
    cell: Arc<SessionCell>,
    number: u64,
    answered: bool,
}

impl Awaited {
    /// A stream of parts. Where there is no place for it, it is asked for again.
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

    /// Brings the character one part after another, until the last or until nobody wants more.
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

    /// Hands over frames; whether more are wanted.
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

/// The frames of a part.
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
