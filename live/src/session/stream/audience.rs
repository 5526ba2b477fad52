//! The watchers of a stream. They get the same ticks as its client. Each tick is encoded once for
//! all of them.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::oneshot;
use troupe_proto::v1;
use troupe_proto::v1::drive_response::Message;

use super::outbox::{Outbox, Shared, Tick};

/// Why the server ends a watcher's stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// The stream that it watched has ended.
    WatchedEnded,
    /// The watcher's queue was full when a message came that must not be lost.
    TooSlow,
}

/// The audience's end of a watcher. The watcher's [`Ticket`] has the other end of `too_slow`.
#[derive(Debug)]
struct Seat {
    to: Arc<Shared>,
    too_slow: oneshot::Sender<()>,
}

#[derive(Debug, Default)]
struct State {
    /// The sessions on the stream.
    sessions: Vec<v1::Attached>,
    seats: Vec<Seat>,
    ended: bool,
}

/// The watchers of a stream.
#[derive(Debug, Default)]
pub struct Audience(Mutex<State>);

/// Membership of a watcher in the audience. Dropping it leaves the audience.
#[derive(Debug)]
pub struct Ticket(oneshot::Receiver<()>);

impl Ticket {
    /// Waits until the server ends the watcher's stream.
    pub async fn ended(&mut self) -> Ending {
        match (&mut self.0).await {
            Ok(()) => Ending::TooSlow,
            Err(_) => Ending::WatchedEnded,
        }
    }
}

impl Audience {
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a watcher and sends it the list of sessions on the stream. `None` if the stream has
    /// ended.
    pub fn join(&self, outbox: &Outbox) -> Option<Ticket> {
        let mut state = self.state();
        if state.ended {
            return None;
        }
        let (too_slow, ticket) = oneshot::channel();
        let to = outbox.shared();
        to.post(Message::Attached(v1::DriveAttached {
            sessions: state.sessions.clone(),
            problems: Vec::new(),
        }));
        state.seats.push(Seat { to, too_slow });
        Some(Ticket(ticket))
    }

    /// Passes on a message of the stream if it is about sessions.
    pub(in crate::session) fn pass_on(&self, message: &Message) {
        let mut state = self.state();
        let message = match message {
            Message::Attached(attached) if !attached.sessions.is_empty() => {
                state.sessions.extend_from_slice(&attached.sessions);
                // Problems concern only the client that attached the sessions.
                Message::Attached(v1::DriveAttached {
                    sessions: attached.sessions.clone(),
                    problems: Vec::new(),
                })
            }
            Message::Left(left) => {
                let has_left = |slot| left.sessions.iter().any(|session| session.slot == slot);
                state.sessions.retain(|session| !has_left(session.slot));
                message.clone()
            }
            Message::Events(_) => message.clone(),
            _ => return,
        };
        let seats = std::mem::take(&mut state.seats);
        for seat in seats.into_iter().filter(|seat| !seat.too_slow.is_closed()) {
            if seat.to.has_room() {
                seat.to.post(message.clone());
                state.seats.push(seat);
            } else {
                // The watcher may have gone meanwhile.
                let _ = seat.too_slow.send(());
            }
        }
    }

    /// Passes on a tick. It replaces a tick that a watcher has not taken yet.
    pub(in crate::session) fn send(&self, tick: &Tick) {
        let mut state = self.state();
        state.seats.retain(|seat| !seat.too_slow.is_closed());
        for seat in &state.seats {
            seat.to.send(tick.watched());
        }
    }

    /// Ends the streams of all watchers, because the watched stream has ended.
    pub(in crate::session) fn end(&self) {
        let mut state = self.state();
        state.ended = true;
        state.seats.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::super::outbox::outbox;
    use super::super::said::{Closing, Said};
    use super::*;

    fn write(said: Said) -> Message {
        match said {
            Said::Closing(_) => Message::Closing(v1::DriveClosing::default()),
            other => panic!("{other:?}"),
        }
    }

    fn tick(number: u64) -> Tick {
        let frames = v1::DriveFrames {
            tick: number,
            ..v1::DriveFrames::default()
        };
        Tick::new(frames, Vec::new())
    }

    fn attached(slots: &[u32]) -> Message {
        let sessions = slots.iter().map(|&slot| v1::Attached {
            session_id: format!("s{slot}"),
            slot,
        });
        Message::Attached(v1::DriveAttached {
            sessions: sessions.collect(),
            problems: vec![v1::SessionProblem::default()],
        })
    }

    fn left(slot: u32) -> Message {
        let gone = v1::SessionProblem {
            slot,
            ..v1::SessionProblem::default()
        };
        Message::Left(v1::DriveLeft { sessions: vec![gone] })
    }

    #[tokio::test]
    async fn all_read_the_same_bytes_of_a_tick() {
        let audience = Audience::default();
        let (own, mut own_outlet) = outbox(write);
        let mut readers = Vec::new();
        for _ in 0..3 {
            let (outbox, mut outlet) = outbox(write);
            let ticket = audience.join(&outbox).unwrap();
            outlet.next().await;
            readers.push((outbox, outlet, ticket));
        }
        let tick = tick(7);
        audience.send(&tick);
        own.send(tick);
        let mut binaries = Vec::new();
        for outlet in readers
            .iter_mut()
            .map(|(_, outlet, _)| outlet)
            .chain([&mut own_outlet])
        {
            match outlet.next().await {
                Some(super::super::Outgoing::Frames(message)) => binaries.push(message.binary()),
                other => panic!("{other:?}"),
            }
        }
        assert_eq!(binaries.len(), 4);
        assert!(!binaries[0].is_empty());
        let first = binaries[0].as_ptr();
        assert!(binaries.iter().all(|bytes| bytes.as_ptr() == first), "one buffer");
    }

    #[tokio::test]
    async fn a_late_watcher_gets_the_list_of_sessions() {
        let audience = Audience::default();
        audience.pass_on(&attached(&[0, 1, 2]));
        audience.pass_on(&left(1));
        let (outbox, mut outlet) = outbox(write);
        let _ticket = audience.join(&outbox).unwrap();
        audience.pass_on(&attached(&[3]));
        let mut slots = Vec::new();
        for _ in 0..2 {
            match outlet.next().await.unwrap().into_response().message {
                Some(Message::Attached(attached)) => {
                    assert!(
                        attached.problems.is_empty(),
                        "those are for the stream's own client"
                    );
                    slots.extend(attached.sessions.into_iter().map(|session| session.slot));
                }
                other => panic!("{other:?}"),
            }
        }
        assert_eq!(slots, [0, 2, 3]);
    }

    #[tokio::test]
    async fn a_watcher_that_reads_nothing_loses_its_place_and_the_others_keep_theirs() {
        let audience = Audience::default();
        let (slow, _slow_outlet) = outbox(write);
        let (quick, mut quick_outlet) = outbox(write);
        let mut slow_ticket = audience.join(&slow).unwrap();
        let mut quick_ticket = audience.join(&quick).unwrap();
        let mut slot = 0;
        while slow.has_room() {
            audience.pass_on(&attached(&[slot]));
            quick_outlet.next().await;
            slot += 1;
        }
        audience.pass_on(&attached(&[slot]));
        assert_eq!(slow_ticket.ended().await, Ending::TooSlow);
        audience.end();
        assert_eq!(quick_ticket.ended().await, Ending::WatchedEnded);
        let (late, _outlet) = outbox(write);
        assert!(audience.join(&late).is_none());
        late.close(Closing::WatchedEnded);
    }
}
