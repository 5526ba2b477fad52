//! The stream of a crowd on the server's clock: a task of the connection's runtime.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::sync::Notify;
use troupe_client::{Drive, DriveEvent};

use super::columns::{Columns, Exchange};
use super::notes::{Note, Notes, TROUPE_NO_CHARACTER, TroupeNoteKind};
use super::orders::{Orders, to_drive};
use crate::status::{TroupeStatus, of_client};

/// Time without a tick after which the stream may be broken, in ticks. From then on commands wait
/// for the client, which would begin again to reopen the stream at each of them.
const QUIET_TICKS: u32 = 4;

/// What the task shares with the calls.
#[derive(Debug)]
pub(crate) struct Shared {
    pub(crate) exchange: Exchange,
    pub(crate) orders: Orders,
    pub(crate) notes: Notes,
    /// Commands wait.
    pub(crate) commanded: Notify,
    /// The crowd closes.
    pub(crate) stop: Notify,
}

/// The characters of a stream by their sessions.
pub(crate) struct Cast {
    pub(crate) ids: Vec<String>,
    pub(crate) by_id: HashMap<String, u32>,
}

impl Cast {
    pub(crate) fn new(ids: Vec<String>) -> Self {
        let by_id = ids.iter().cloned().zip(0..).collect();
        Self { ids, by_id }
    }

    fn character(&self, id: &str) -> u32 {
        self.by_id.get(id).copied().unwrap_or(TROUPE_NO_CHARACTER)
    }
}

/// Sends commands, and publishes ticks and notes, until the crowd closes or the stream ends.
pub(crate) async fn run(
    mut drive: Drive,
    cast: Cast,
    shared: Arc<Shared>,
    mut columns: Columns,
    period: Duration,
) {
    let mut last = None::<Instant>;
    loop {
        shared.orders.give(|character, order| {
            if let Some(id) = cast.ids.get(character as usize) {
                to_drive(&mut drive, id, order);
            }
        });
        drive.flush();
        let ticks_come = last.is_some_and(|last| last.elapsed() < period * QUIET_TICKS);
        let update = tokio::select! {
            biased;
            () = shared.stop.notified() => break,
            () = shared.commanded.notified(), if ticks_come => continue,
            update = drive.next() => update,
        };
        let update = match update {
            Ok(Some(update)) => update,
            Ok(None) => return end(&shared, TroupeStatus::StreamEnded, "the stream is over"),
            Err(error) => return end(&shared, of_client(&error), &error.to_string()),
        };
        for event in &update.events {
            note(event, &cast, &shared.notes);
        }
        if let Some(tick) = update.tick {
            last = Some(Instant::now());
            columns.begin(1);
            (columns.tick, columns.missed) = (tick.number(), tick.dropped());
            for (id, frames) in tick.characters() {
                columns.put(cast.character(id) as usize, frames);
            }
            shared.exchange.publish(&mut columns);
        }
    }
    // The server frees the sessions, so that they can be closed. If it does not answer, they
    // expire.
    let _ = drive.close().await;
}

fn end(shared: &Shared, status: TroupeStatus, message: &str) {
    shared.notes.push(Note {
        message: message.to_owned(),
        ..Note::new(TroupeNoteKind::Ended, TROUPE_NO_CHARACTER)
    });
    shared.exchange.end(status, message.to_owned());
}

fn note(event: &DriveEvent, cast: &Cast, notes: &Notes) {
    use TroupeNoteKind as Of;
    match event {
        DriveEvent::Attached { .. } => {}
        DriveEvent::Resumed {
            session,
            frame,
            restored,
            lost_commands,
        } => notes.push(Note {
            frame: *frame,
            values: [*lost_commands as f32, f32::from(u8::from(*restored))],
            ..Note::new(Of::Resumed, cast.character(session))
        }),
        DriveEvent::NotAttached { id, problem, .. } | DriveEvent::Left { id, problem, .. } => {
            notes.push(Note::problem(Of::Left, cast.character(id), problem));
        }
        DriveEvent::Refused { session, problem } => {
            notes.push(Note::problem(Of::Refused, cast.character(session), problem));
        }
        DriveEvent::Happened { session, events, .. } => {
            let character = cast.character(session);
            events
                .iter()
                .for_each(|event| notes.push(Note::event(character, event)));
        }
    }
}
