//! A stream that watches another stream.

use std::sync::Arc;
use std::time::{Duration, Instant};

use futures_util::{Stream, StreamExt as _};
use tokio::sync::watch;
use troupe_character::{FieldError, Path};
use troupe_proto::v1;
use troupe_proto::v1::drive_request::Message as Ask;

use super::hear::{command, drained};
use crate::session::owner::Owner;
use crate::session::sessions::Sessions;
use crate::session::stream::{Closing, Ending, Outbox, Said, Ticket};

/// Interval of the check whether the reader takes messages.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// An open stream that watches another stream.
pub struct Watching {
    sessions: Arc<Sessions>,
    ticket: Ticket,
}

impl Watching {
    /// Becomes a watcher of the stream that drives the session `open.watch`.
    ///
    /// # Errors
    /// [`FieldError`] if no stream drives that session, or if `open` sets a rate or form of its
    /// own.
    pub fn join(sessions: &Arc<Sessions>, open: &v1::DriveOpen, outbox: &Outbox) -> Result<Self, FieldError> {
        let root = Path::root();
        let path = root.field("open");
        let own = [
            ("rate_hz", open.rate_hz != 0),
            ("encoding", open.encoding != 0),
            ("return_positions", open.return_positions),
            ("close_sessions", open.close_sessions),
            ("return_six_d", open.return_six_d),
        ];
        if let Some((name, _)) = own.iter().find(|(_, is_set)| *is_set) {
            let wanted = "no value: a watcher gets the rate and form of the stream that it watches";
            return Err(path.field(name).error("is set together with watch", wanted));
        }
        let now = sessions.time().now();
        let cell = sessions.registry().get(&open.watch, now, &String::new).ok();
        let cell = cell.filter(|cell| cell.owner() == Owner::Drive);
        let ticket = cell.and_then(|cell| cell.audience()?.join(outbox));
        match ticket {
            Some(ticket) => Ok(Self {
                sessions: sessions.clone(),
                ticket,
            }),
            None => Err(path.field("watch").error(
                "names a session that no stream drives",
                "the id of a session that a stream drives now",
            )),
        }
    }

    /// Handles the client's messages until the end. Frames come from the stream that is watched.
    pub async fn run<I>(
        &mut self,
        inbound: &mut I,
        outbox: &Outbox,
        draining: &mut watch::Receiver<bool>,
    ) -> Closing
    where
        I: Stream<Item = Result<v1::DriveRequest, v1::Problem>> + Unpin,
    {
        let limit = self.sessions.limits().stall_timeout;
        let mut looks = tokio::time::interval(LOOK_EVERY);
        loop {
            tokio::select! {
                biased;
                () = outbox.reader_gone() => return Closing::Gone,
                () = drained(draining) => return Closing::Draining,
                ending = self.ticket.ended() => return match ending {
                    Ending::WatchedEnded => Closing::WatchedEnded,
                    Ending::TooSlow => Closing::SlowReader(limit),
                },
                _ = looks.tick() => {
                    if outbox.stalled(Instant::now()) >= limit {
                        return Closing::SlowReader(limit);
                    }
                }
                asked = inbound.next(), if outbox.has_room() => {
                    let answered = match asked {
                        None => return Closing::ClientDone,
                        Some(Err(problem)) => return Closing::Unreadable(problem),
                        Some(Ok(asked)) => self.hear(asked).await,
                    };
                    match answered {
                        Ok(Some(answer)) => outbox.say(answer),
                        Ok(None) => {}
                        Err(error) => return error.into(),
                    }
                }
            }
        }
    }

    async fn hear(&mut self, asked: v1::DriveRequest) -> Result<Option<Said>, FieldError> {
        let root = Path::root();
        match asked.message {
            Some(Ask::Command(request)) => command(&self.sessions, &request).await,
            Some(Ask::Open(_) | Ask::Attach(_) | Ask::Detach(_)) => Err(root
                .field("message")
                .error("is not a command, but the stream only watches", "command")),
            None => Err(root.field("message").error("is missing", "command")),
        }
    }
}
