//! The outbound queue of a stream: a few control messages, and the frames of one tick. The next
//! tick replaces a tick that its reader has not taken yet, so a slow reader always gets the latest.
//! A tick is encoded once for all its readers.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use bytes::Bytes;
use tokio::sync::Notify;
use troupe_proto::v1;
use troupe_proto::v1::drive_response::Message;

use super::said::{Closing, Said};
use crate::session::LivePack;

/// Maximum number of waiting control messages. At this number the stream stops reading its client's
/// messages.
const MAX_CONTROL: usize = 64;
/// Maximum size of the waiting control messages, bytes. The message that exceeds it is still
/// queued.
const MAX_CONTROL_BYTES: usize = 1 << 20;

/// The message of a tick, shared by all its readers.
#[derive(Debug)]
pub struct TickMessage {
    response: v1::DriveResponse,
    binary: OnceLock<Bytes>,
}

impl TickMessage {
    /// The decoded message.
    pub fn response(&self) -> &v1::DriveResponse {
        &self.response
    }

    /// The message as protobuf, encoded by the first call.
    pub fn binary(&self) -> Bytes {
        let bytes = self
            .binary
            .get_or_init(|| prost::Message::encode_to_vec(&self.response).into());
        bytes.clone()
    }
}

/// The frames of one tick, for one reader.
#[derive(Debug)]
pub struct Tick {
    message: Arc<TickMessage>,
    /// Number of frames by pack, for the metrics. Empty for watchers.
    counts: Vec<(Arc<LivePack>, usize)>,
}

impl Tick {
    /// Makes the tick of the stream's own client. `counts` is the number of frames by pack.
    pub fn new(frames: v1::DriveFrames, counts: Vec<(Arc<LivePack>, usize)>) -> Self {
        let response = v1::DriveResponse {
            message: Some(Message::Frames(frames)),
        };
        let binary = OnceLock::new();
        Self {
            message: Arc::new(TickMessage { response, binary }),
            counts,
        }
    }

    /// The same tick for a watcher. The metrics of packs do not count it.
    pub(super) fn watched(&self) -> Self {
        Self {
            message: self.message.clone(),
            counts: Vec::new(),
        }
    }

    /// Counts the tick as not sent.
    fn dropped(&self) {
        for (pack, count) in &self.counts {
            pack.metrics.dropped(*count as u64);
        }
    }
}

#[derive(Debug, Default)]
struct State {
    control: VecDeque<Message>,
    control_bytes: usize,
    tick: Option<Tick>,
    /// Sent after all other messages.
    closing: Option<Message>,
    finished: bool,
    reader_gone: bool,
    /// Since when the reader has left a message waiting.
    waits_since: Option<Instant>,
}

impl State {
    fn waits(&self) -> bool {
        !self.control.is_empty() || self.tick.is_some() || self.closing.is_some()
    }
}

#[derive(Debug, Default)]
pub(super) struct Shared {
    state: Mutex<State>,
    /// Wakes the reader: a message is waiting.
    readable: Notify,
    /// Wakes the stream: the reader is gone.
    gone: Notify,
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Changes the queue and wakes the reader.
    fn put<T>(&self, change: impl FnOnce(&mut State) -> T) -> T {
        let result = {
            let mut state = self.state();
            let result = change(&mut state);
            if state.waits() {
                state.waits_since.get_or_insert_with(Instant::now);
            }
            result
        };
        self.readable.notify_one();
        result
    }

    pub(super) fn has_room(&self) -> bool {
        let state = self.state();
        state.control.len() < MAX_CONTROL && state.control_bytes < MAX_CONTROL_BYTES
    }

    pub(super) fn post(&self, message: Message) {
        self.put(|state| {
            state.control_bytes += message.encoded_len();
            state.control.push_back(message);
        });
    }

    /// See [`Outbox::send`].
    pub(super) fn send(&self, tick: Tick) -> bool {
        let replaced = self.put(|state| state.tick.replace(tick));
        if let Some(tick) = &replaced {
            tick.dropped();
        }
        replaced.is_some()
    }
}

/// The sending end of a stream's queue. After it is dropped, the reader gets the waiting messages
/// and then the end.
#[derive(Debug)]
pub struct Outbox {
    shared: Arc<Shared>,
    write: fn(Said) -> Message,
}

/// A message on its way to a reader.
#[derive(Debug)]
pub enum Outgoing {
    /// A control message.
    Control(v1::DriveResponse),
    /// A tick's frames.
    Frames(Arc<TickMessage>),
}

impl Outgoing {
    /// The decoded message.
    pub fn response(&self) -> &v1::DriveResponse {
        match self {
            Self::Control(response) => response,
            Self::Frames(message) => message.response(),
        }
    }

    /// The message, copied if it has other readers.
    pub fn into_response(self) -> v1::DriveResponse {
        match self {
            Self::Control(response) => response,
            Self::Frames(message) => match Arc::try_unwrap(message) {
                Ok(message) => message.response,
                Err(message) => message.response.clone(),
            },
        }
    }
}

/// The receiving end of a stream's queue. Dropping it wakes [`Outbox::reader_gone`].
#[derive(Debug)]
pub struct Outlet(Arc<Shared>);

/// Makes both ends of an empty queue. `write` turns what the stream says into messages.
pub fn outbox(write: fn(Said) -> Message) -> (Outbox, Outlet) {
    let shared = Arc::new(Shared::default());
    let outbox = Outbox {
        shared: shared.clone(),
        write,
    };
    (outbox, Outlet(shared))
}

impl Outbox {
    /// Whether there is room for control messages that answer the client.
    pub fn has_room(&self) -> bool {
        self.shared.has_room()
    }

    /// Sends a control message.
    pub fn say(&self, said: Said) {
        self.shared.post((self.write)(said));
    }

    /// Turns what the stream says into a message, without sending it.
    pub(in crate::session) fn message(&self, said: Said) -> Message {
        (self.write)(said)
    }

    /// Sends a finished control message.
    pub(in crate::session) fn post(&self, message: Message) {
        self.shared.post(message);
    }

    /// The queue itself, for an audience.
    pub(super) fn shared(&self) -> Arc<Shared> {
        self.shared.clone()
    }

    /// Sends a tick's frames. Answers whether they replaced a tick that the reader has not taken.
    pub fn send(&self, tick: Tick) -> bool {
        self.shared.send(tick)
    }

    /// How long, at `now`, the reader has left a message waiting.
    pub fn stalled(&self, now: Instant) -> Duration {
        let since = self.shared.state().waits_since;
        since.map_or(Duration::ZERO, |since| now.saturating_duration_since(since))
    }

    /// Waits until the reader is gone.
    pub async fn reader_gone(&self) {
        loop {
            let gone = self.shared.gone.notified();
            if self.shared.state().reader_gone {
                return;
            }
            gone.await;
        }
    }

    /// Sends `closing` as the last message, after those that wait.
    pub fn close(self, closing: Closing) {
        let message = (self.write)(Said::Closing(closing));
        self.shared.put(|state| state.closing = Some(message));
    }
}

impl Drop for Outbox {
    fn drop(&mut self) {
        self.shared.put(|state| state.finished = true);
    }
}

impl Outlet {
    /// Waits for the next message. Control messages come first. `None` at the end.
    pub async fn next(&mut self) -> Option<Outgoing> {
        loop {
            let readable = self.0.readable.notified();
            {
                let mut state = self.0.state();
                let message = Self::take(&mut state);
                state.waits_since = state.waits().then(Instant::now);
                if message.is_some() || state.finished {
                    return message;
                }
            }
            readable.await;
        }
    }

    fn take(state: &mut State) -> Option<Outgoing> {
        let control = |message| {
            Outgoing::Control(v1::DriveResponse {
                message: Some(message),
            })
        };
        if let Some(message) = state.control.pop_front() {
            state.control_bytes -= message.encoded_len();
            return Some(control(message));
        }
        if let Some(Tick { message, counts }) = state.tick.take() {
            for (pack, count) in counts {
                pack.metrics.sent(count);
            }
            return Some(Outgoing::Frames(message));
        }
        state.closing.take().map(control)
    }
}

impl Drop for Outlet {
    fn drop(&mut self) {
        self.0.state().reader_gone = true;
        self.0.gone.notify_one();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tick(number: u64) -> Tick {
        let frames = v1::DriveFrames {
            tick: number,
            ..v1::DriveFrames::default()
        };
        Tick::new(frames, Vec::new())
    }

    fn left() -> Said {
        Said::Left(Vec::new())
    }

    /// Turns what a stream says into messages. Only events keep their content.
    fn write(said: Said) -> Message {
        match said {
            Said::Left(_) => Message::Left(v1::DriveLeft::default()),
            Said::Closing(_) => Message::Closing(v1::DriveClosing::default()),
            Said::Events(sessions) => Message::Events(v1::DriveEvents { sessions }),
            other => panic!("{other:?}"),
        }
    }

    fn name(message: Option<Outgoing>) -> String {
        match message.and_then(|message| message.into_response().message) {
            Some(Message::Frames(frames)) => format!("tick {}", frames.tick),
            Some(Message::Left(_)) => "left".to_owned(),
            Some(Message::Closing(_)) => "closing".to_owned(),
            Some(other) => panic!("{other:?}"),
            None => "end".to_owned(),
        }
    }

    #[tokio::test]
    async fn the_latest_tick_wins_and_control_messages_all_arrive() {
        let (outbox, mut outlet) = outbox(write);
        assert!(!outbox.send(tick(0)));
        outbox.say(left());
        assert!(outbox.send(tick(1)) && outbox.send(tick(2)));
        outbox.say(left());
        outbox.close(Closing::ClientDone);
        let mut said = Vec::new();
        for _ in 0..6 {
            said.push(name(outlet.next().await));
        }
        assert_eq!(said, ["left", "left", "tick 2", "closing", "end", "end"]);
    }

    #[tokio::test]
    async fn a_reader_that_waits_is_woken() {
        let (outbox, mut outlet) = outbox(write);
        let reading = tokio::spawn(async move { name(outlet.next().await) });
        tokio::task::yield_now().await;
        outbox.send(tick(7));
        assert_eq!(reading.await.unwrap(), "tick 7");
        outbox.reader_gone().await;
    }

    #[tokio::test]
    async fn a_reader_that_takes_nothing_stalls() {
        let (outbox, mut outlet) = outbox(write);
        let later = Instant::now() + Duration::from_secs(60);
        assert_eq!(outbox.stalled(later), Duration::ZERO);
        outbox.send(tick(0));
        outbox.send(tick(1));
        assert!(outbox.stalled(later) > Duration::from_secs(59));
        outlet.next().await;
        assert_eq!(outbox.stalled(later), Duration::ZERO, "all is taken");
    }

    #[test]
    fn the_queue_has_an_end() {
        let (outbox, _outlet) = outbox(write);
        for _ in 0..MAX_CONTROL {
            assert!(outbox.has_room());
            outbox.say(left());
        }
        assert!(!outbox.has_room());
    }

    #[tokio::test]
    async fn large_messages_fill_it_sooner() {
        let (outbox, mut outlet) = outbox(write);
        let events = vec![v1::SessionEvents {
            session_id: "x".repeat(MAX_CONTROL_BYTES),
            ..v1::SessionEvents::default()
        }];
        outbox.say(Said::Events(events));
        assert!(!outbox.has_room());
        outlet.next().await;
        assert!(outbox.has_room());
    }
}
