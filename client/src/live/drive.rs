//! Characters on the server's clock.

use std::collections::{BTreeMap, HashMap};
use std::time::Duration;

use futures_util::FutureExt as _;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Streaming;
use troupe_motion::conventions::Convention;
use troupe_proto::v1;
use v1::drive_request::Message as Ask;
use v1::drive_response::Message as FromServer;

use super::act::Act;
use super::drive_event::DriveEvent;
use super::frames::{Block, Frames};
use super::locomotion::Locomotion;
use super::options::FrameOptions;
use super::session::Session;
use crate::connection::Client;
use crate::error::{AnswerError, ClientError};
use crate::problem::{Problem, ProblemKind};

/// Messages that may wait to be sent. Further changes wait in the intents of their sessions, in
/// which a newer change replaces an older one.
const QUEUE: usize = 64;

/// Options of a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DriveOptions {
    /// Rate and form of frames.
    pub frames: FrameOptions,
    /// Give every tick that arrives, in order, for instance for a recording. By default
    /// [`Drive::next`] gives the newest and counts the ticks that it skips.
    pub every_tick: bool,
    /// Close the sessions of the stream when it ends. By default they wait for their time to live.
    pub close_sessions: bool,
    /// Time for which the client reopens a stream that breaks, or whose sessions have all moved to
    /// another server. They go on from the last frame that came, on whatever server has them then.
    /// None: a stream that breaks ends with an error. 10 s by default.
    pub reconnect: Option<Duration>,
}

impl Default for DriveOptions {
    fn default() -> Self {
        Self {
            frames: FrameOptions::default(),
            every_tick: false,
            close_sessions: false,
            reconnect: Some(Duration::from_secs(10)),
        }
    }
}

/// A stream on which the server advances many characters at 30, 50 or 60 Hz, opened by
/// [`Client::drive`].
///
/// The stream owns its sessions, and returns them when they leave. A stream that breaks is
/// reopened, and its sessions go on after the last frame that came ([`DriveOptions::reconnect`],
/// [`DriveEvent::Resumed`]). If that fails the stream ends. Then take the sessions with
/// [`Self::into_sessions`] and attach them to another.
///
/// ```no_run
/// use glam::Vec3;
/// use troupe_client::{Client, DriveOptions, Locomotion, SessionOptions};
///
/// # async fn example() -> Result<(), troupe_client::ClientError> {
/// let client = Client::connect("http://127.0.0.1:8080").await?;
/// let pack = client.pack("").await?;
/// let guard = client.session(&pack, &SessionOptions::new().id("guard")).await?;
///
/// let mut drive = client.drive(DriveOptions::default()).await?;
/// drive.attach([guard]).await?;
/// if let Some(intent) = drive.intent_mut("guard") {
///     *intent = Locomotion::walk(Vec3::Z * 1.4);
/// }
/// while let Some(update) = drive.next().await? {
///     if let Some(tick) = update.tick {
///         for (id, frames) in tick.characters() {
///             println!("{id} is at {:?}", frames.last().map(|f| f.root));
///         }
///     }
///     for event in update.events {
///         println!("{event:?}");
///     }
/// }
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Drive {
    client: Client,
    options: DriveOptions,
    asks: mpsc::Sender<v1::DriveRequest>,
    answers: Streaming<v1::DriveResponse>,
    sessions: BTreeMap<String, Session>,
    /// Names of the sessions in the stream's slots.
    slots: HashMap<u32, String>,
    blocks: Vec<Block>,
    /// Objects in the characters' hands.
    held: Vec<v1::HeldObject>,
    /// Ticks that came but were skipped for newer ones.
    skipped: u64,
    events: Vec<DriveEvent>,
    /// How the stream ended. The caller gets this after all earlier messages.
    end: Option<Result<(), ClientError>>,
    ended: bool,
    /// Why the stream broke, until it is reopened.
    broken: Option<ClientError>,
    /// The last frames that came before the stream was last reopened, by session.
    seen: Vec<v1::SessionResume>,
}

#[derive(Debug, Clone, Copy)]
struct TickHead {
    number: u64,
    dropped: u64,
    underruns: u32,
}

/// All that came since the last call.
#[derive(Debug)]
pub struct Update<'a> {
    /// The newest tick, if one came.
    pub tick: Option<Tick<'a>>,
    /// Events of sessions.
    pub events: Vec<DriveEvent>,
}

/// A tick of frames, borrowed from the stream.
#[derive(Debug, Clone, Copy)]
pub struct Tick<'a> {
    head: TickHead,
    skipped: u64,
    drive: &'a Drive,
}

impl Client {
    /// Opens a stream on which the server advances sessions.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn drive(&self, options: DriveOptions) -> Result<Drive, ClientError> {
        let (asks, queue) = mpsc::channel(QUEUE);
        let open = v1::DriveOpen {
            rate_hz: options.frames.rate.hz(),
            encoding: options.frames.encoding.to_wire(),
            return_positions: options.frames.positions,
            close_sessions: options.close_sessions,
            return_six_d: false,
            watch: String::new(),
        };
        // The queue is empty, so it has room.
        let _ = asks.try_send(request(Ask::Open(open)));
        let queue = ReceiverStream::new(queue);
        let answers = self
            .unary(|mut rpc| async move { rpc.drive(queue).await })
            .await?;
        Ok(Drive {
            client: self.clone(),
            options,
            asks,
            answers,
            sessions: BTreeMap::new(),
            slots: HashMap::new(),
            blocks: Vec::new(),
            held: Vec::new(),
            skipped: 0,
            events: Vec::new(),
            end: None,
            ended: false,
            broken: None,
            seen: Vec::new(),
        })
    }
}

impl Drive {
    /// Takes sessions onto the stream. For each, an event reports whether it is on the stream.
    ///
    /// # Errors
    /// [`ClientError::Unreachable`] if the stream is broken.
    pub async fn attach(&mut self, sessions: impl IntoIterator<Item = Session>) -> Result<(), ClientError> {
        let mut session_ids = Vec::new();
        for session in sessions {
            session_ids.push(session.id().to_owned());
            self.sessions.insert(session.id().to_owned(), session);
        }
        if session_ids.is_empty() {
            return Ok(());
        }
        self.ask(Ask::Attach(v1::DriveAttach { session_ids })).await
    }

    /// Takes sessions off the stream. Each comes back with a [`DriveEvent::Left`].
    ///
    /// # Errors
    /// [`ClientError::Unreachable`] if the stream is broken.
    pub async fn detach(
        &mut self,
        ids: impl IntoIterator<Item = impl Into<String>>,
    ) -> Result<(), ClientError> {
        let session_ids: Vec<String> = ids.into_iter().map(Into::into).collect();
        if session_ids.is_empty() {
            return Ok(());
        }
        self.ask(Ask::Detach(v1::DriveDetach { session_ids })).await
    }

    async fn ask(&mut self, ask: Ask) -> Result<(), ClientError> {
        let sent = self.asks.send(request(ask)).await;
        sent.map_err(|_| ClientError::Unreachable {
            url: self.client.url().to_owned(),
            reason: "the stream is broken".to_owned(),
        })
    }

    /// A session of the stream.
    pub fn session(&self, id: &str) -> Option<&Session> {
        self.sessions.get(id)
    }

    /// The stream's sessions, by name.
    pub fn sessions(&self) -> impl Iterator<Item = &Session> {
        self.sessions.values()
    }

    /// The intent of a session, for changes. [`Self::next`] and [`Self::flush`] send it.
    pub fn intent_mut(&mut self, id: &str) -> Option<&mut Locomotion> {
        let session = self.sessions.get_mut(id)?;
        Some(session.intent_mut().wanted_mut())
    }

    /// Has a character do something, such as use an object of its scene. [`Self::next`] and
    /// [`Self::flush`] send it. Nothing happens if the session is not on the stream.
    pub fn act(&mut self, id: &str, act: &Act) {
        if let Some(session) = self.sessions.get_mut(id) {
            session.act(act);
        }
    }

    /// Sets the priority of a session for plans, 0 to 1, for instance by its distance from the
    /// camera. Every change is a command, so use steps of a tenth or so. [`Self::next`] and
    /// [`Self::flush`] send it. Nothing happens if the session is not on the stream.
    pub fn set_priority(&mut self, id: &str, priority: f32) {
        if let Some(session) = self.sessions.get_mut(id) {
            session.priority(priority);
        }
    }

    /// Sends the changed intents. If the connection is busy they stay for the next time, and the
    /// newest goes then.
    pub fn flush(&mut self) {
        let changed = self.sessions.iter_mut();
        let commands = changed
            .flat_map(|(id, session)| session.intent_mut().commands(id))
            .collect::<Vec<_>>();
        if commands.is_empty() {
            return;
        }
        let ask = request(Ask::Command(v1::CommandRequest { commands }));
        let Err(unsent) = self.asks.try_send(ask) else {
            return;
        };
        if let Some(Ask::Command(unsent)) = unsent.into_inner().message {
            // The last command is put back first, so that the order stays the same.
            for command in unsent.commands.into_iter().rev() {
                if let Some(session) = self.sessions.get_mut(&command.session_id) {
                    session.intent_mut().unsent(command);
                }
            }
        }
    }

    /// Sends changed intents, and waits for the next tick or event. It gives the newest of several
    /// ticks, unless [`DriveOptions::every_tick`] is set. None once the stream has ended as this
    /// client asked.
    ///
    /// Nothing is lost if the future is dropped before it is ready.
    ///
    /// # Errors
    /// See [`ClientError`]; [`ClientError::StreamEnded`] with the server's reason. The stream has
    /// ended then.
    pub async fn next(&mut self) -> Result<Option<Update<'_>>, ClientError> {
        if let Some(end) = self.end.take() {
            self.ended = true;
            end?;
        }
        if self.ended {
            return Ok(None);
        }
        if self.broken.is_some() {
            self.mend().await?;
        }
        self.flush();
        let mut newest = None;
        // Messages without a tick or event, such as late commands, do not end the wait.
        while newest.is_none() && self.events.is_empty() && self.end.is_none() {
            if self.broken.is_some() {
                self.mend().await?;
                self.flush();
                continue;
            }
            let first = self.answers.message().await;
            // There is no await after this, so nothing is lost if the future is dropped.
            let mut came = Some(first);
            while let Some(message) = came {
                self.sort(message, &mut newest)?;
                let enough = self.end.is_some()
                    || self.broken.is_some()
                    || (self.options.every_tick && newest.is_some());
                came = if enough {
                    None
                } else {
                    self.answers.message().now_or_never()
                };
            }
        }
        let head = match newest {
            Some(frames) => Some(self.read(frames)?),
            None => None,
        };
        let events = std::mem::take(&mut self.events);
        if head.is_none() && events.is_empty() {
            // It ended without an error.
            self.ended = true;
            return match self.end.take() {
                Some(Err(error)) => Err(error),
                _ => Ok(None),
            };
        }
        let tick = head.map(|head| Tick {
            head,
            skipped: self.skipped,
            drive: self,
        });
        Ok(Some(Update { tick, events }))
    }

    /// Reopens a stream that broke. Until that succeeds it counts as broken.
    ///
    /// # Errors
    /// Why it broke, if it cannot be reopened in time.
    async fn mend(&mut self) -> Result<(), ClientError> {
        let limit = self.options.reconnect.unwrap_or_default();
        let mended = self.reconnect(limit).await;
        self.ended = mended.is_err();
        match (self.broken.take(), mended) {
            (Some(why), Err(_)) => Err(why),
            _ => Ok(()),
        }
    }

    /// Notes that the stream ended with an error: for good, or until it is reopened.
    fn ends(&mut self, error: ClientError) {
        match self.options.reconnect.is_some() && reconnect::is_break(&error) {
            true => self.broken = Some(error),
            false => self.end = Some(Err(error)),
        }
    }

    /// Sorts one message of the server.
    fn sort(
        &mut self,
        message: Result<Option<v1::DriveResponse>, tonic::Status>,
        newest: &mut Option<v1::DriveFrames>,
    ) -> Result<(), ClientError> {
        let message = match message {
            Ok(Some(message)) => message.message.ok_or(AnswerError::Missing("message"))?,
            Ok(None) => {
                if self.end.is_none() && self.broken.is_none() {
                    self.ends(ended_without_a_word());
                }
                return Ok(());
            }
            Err(status) => {
                self.ends(self.client.sort(&status));
                return Ok(());
            }
        };
        match message {
            FromServer::Frames(frames) => {
                if newest.replace(frames).is_some() {
                    self.skipped += 1;
                }
            }
            FromServer::Attached(attached) => self.attached(attached),
            FromServer::Left(left) => self.left(left),
            FromServer::Commands(commands) => self.refused(commands),
            FromServer::Events(happened) => {
                for of in happened.sessions {
                    self.events.push(DriveEvent::Happened {
                        session: of.session_id,
                        events: of.events,
                        dropped: of.events_dropped,
                    });
                }
            }
            FromServer::Closing(closing) => {
                let problem = Problem::from(closing.reason.unwrap_or_default());
                match problem.kind {
                    ProblemKind::ClientDone => self.end = Some(Ok(())),
                    _ => self.ends(ClientError::StreamEnded(Box::new(problem))),
                }
            }
        }
        Ok(())
    }

    fn attached(&mut self, attached: v1::DriveAttached) {
        for v1::Attached { session_id, slot } in attached.sessions {
            self.slots.insert(slot, session_id.clone());
            self.events.push(DriveEvent::Attached { session: session_id });
        }
        for of in attached.problems {
            let problem = Problem::from(of.problem.clone().unwrap_or_default());
            // Another server came back between the calls, and got the stream.
            let is_elsewhere = problem.kind == ProblemKind::SessionElsewhere && self.slots.is_empty();
            if is_elsewhere && self.options.reconnect.is_some() && self.client.way.follow(&problem) {
                self.ends(ClientError::StreamEnded(Box::new(problem)));
                continue;
            }
            let (session, id, problem) = self.give_back(of);
            self.events.push(DriveEvent::NotAttached { id, session, problem });
        }
    }

    /// Takes sessions off the stream. If the last ones have moved to another server, the stream
    /// follows them.
    fn left(&mut self, left: v1::DriveLeft) {
        for left in &left.sessions {
            self.slots.remove(&left.slot);
        }
        let follows = self.slots.is_empty() && self.options.reconnect.is_some();
        for left in left.sessions {
            let problem = Problem::from(left.problem.clone().unwrap_or_default());
            if follows && problem.kind == ProblemKind::SessionMoved {
                self.ends(ClientError::StreamEnded(Box::new(problem)));
                continue;
            }
            let (session, id, problem) = self.give_back(left);
            self.events.push(DriveEvent::Left { id, session, problem });
        }
    }

    /// Takes a session off the stream, and returns it unless it is gone.
    fn give_back(&mut self, of: v1::SessionProblem) -> (Option<Box<Session>>, String, Problem) {
        let problem = Problem::from(of.problem.unwrap_or_default());
        let session = self.sessions.remove(&of.session_id).map(Box::new);
        (
            session.filter(|_| !problem.kind.is_gone()),
            of.session_id,
            problem,
        )
    }

    fn refused(&mut self, commands: v1::CommandResponse) {
        for result in commands.results {
            if result.status() == v1::CommandStatus::Refused {
                self.events.push(DriveEvent::Refused {
                    session: result.session_id,
                    problem: result.problem.unwrap_or_default().into(),
                });
            }
        }
    }

    /// Decodes a tick. Blocks without a known character are skipped.
    fn read(&mut self, frames: v1::DriveFrames) -> Result<TickHead, ClientError> {
        self.blocks.iter_mut().for_each(Block::clear);
        let (slots, sessions) = (&self.slots, &self.sessions);
        let of = |slot: u32| slots.get(&slot).and_then(|id| sessions.get(id));
        for (nth, message) in frames.blocks.into_iter().enumerate() {
            let Some(known) = message.slots.iter().find_map(|&slot| of(slot)) else {
                continue;
            };
            if nth >= self.blocks.len() {
                self.blocks.resize_with(nth + 1, Block::default);
            }
            let skeleton = known.pack().skeleton();
            self.blocks[nth].read(message, skeleton, |slot| {
                of(slot).map_or(Convention::Native, Session::convention)
            })?;
        }
        self.held = frames.held;
        Ok(TickHead {
            number: frames.tick,
            dropped: frames.dropped_ticks,
            underruns: frames.underruns,
        })
    }

    /// Ends the stream, waits until the server has freed its sessions, and returns them.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub async fn close(self) -> Result<Vec<Session>, ClientError> {
        let Self {
            client,
            asks,
            mut answers,
            sessions,
            ..
        } = self;
        drop(asks);
        let rest = async { while let Ok(Some(_)) = answers.message().await {} };
        let limit = client.request_timeout();
        match tokio::time::timeout(limit, rest).await {
            Ok(()) => Ok(sessions.into_values().collect()),
            Err(_) => Err(ClientError::TimedOut {
                url: client.url().to_owned(),
                after: limit,
            }),
        }
    }

    /// The sessions of the stream, for instance after an error. The server may call them busy until
    /// it notices that the stream is gone.
    pub fn into_sessions(self) -> Vec<Session> {
        self.sessions.into_values().collect()
    }
}

impl<'a> Tick<'a> {
    /// Number of the tick, from 0.
    pub fn number(&self) -> u64 {
        self.head.number
    }

    /// Ticks so far that the game did not get. The server did not send them because this client was
    /// slow, or a newer one had come too.
    pub fn dropped(&self) -> u64 {
        self.head.dropped + self.skipped
    }

    /// Characters of this tick that had to slow down because a plan was late.
    pub fn underruns(&self) -> u32 {
        self.head.underruns
    }

    /// Objects in the characters' hands, by the ids of their sessions.
    pub fn held(&self) -> impl Iterator<Item = (&'a str, &'a v1::HeldObject)> + use<'a> {
        let drive = self.drive;
        let each = drive.held.iter();
        each.filter_map(move |held| Some((drive.slots.get(&held.slot)?.as_str(), held)))
    }

    /// The characters by the ids of their sessions, each with one frame.
    pub fn characters(&self) -> impl Iterator<Item = (&'a str, Frames<'a>)> + use<'a> {
        let drive = self.drive;
        drive.blocks.iter().flat_map(move |block| {
            let places = block.slots().iter().enumerate();
            places.filter_map(move |(place, slot)| {
                let id = drive.slots.get(slot)?;
                Some((id.as_str(), block.frames(place)))
            })
        })
    }
}

fn request(message: Ask) -> v1::DriveRequest {
    v1::DriveRequest {
        message: Some(message),
    }
}

fn ended_without_a_word() -> ClientError {
    ClientError::StreamEnded(Box::new(Problem {
        kind: ProblemKind::Other(String::new()),
        message: "it did not say why".to_owned(),
        field: None,
        allowed: None,
    }))
}

#[path = "reconnect.rs"]
mod reconnect;

#[cfg(test)]
#[path = "drive_tests.rs"]
mod tests;
