//! The characters of a connection.

use std::collections::HashMap;
use std::sync::Arc;

use tokio::sync::mpsc;
use tokio::task::JoinSet;
use troupe_client::{Client, Drive, DriveEvent, Frame, Problem, Session};

use super::Note;
use super::actor::{Actor, Phase};
use super::opening::{Opened, Openings};
use super::orders::Order;

/// The characters of a connection, and the tasks that open and close them.
pub(super) struct Cast {
    client: Client,
    openings: Arc<Openings>,
    opened: mpsc::Sender<Opened>,
    /// Characters that are being opened.
    opening: Vec<Arc<Actor>>,
    /// Characters on the stream, by their sessions.
    playing: HashMap<String, Member>,
    closing: JoinSet<()>,
}

struct Member {
    actor: Arc<Actor>,
    /// A stream that is opened again attaches its sessions once more.
    was_attached: bool,
}

impl Cast {
    pub(super) fn new(client: Client, opened: mpsc::Sender<Opened>) -> Self {
        Self {
            openings: Arc::new(Openings::new(client.clone())),
            client,
            opened,
            opening: Vec::new(),
            playing: HashMap::new(),
            closing: JoinSet::new(),
        }
    }

    /// Whether no character is on the stream.
    pub(super) fn is_empty(&self) -> bool {
        self.playing.is_empty()
    }

    /// Serves a character that changed. If it leaves the stream its session comes back.
    pub(super) fn attend(&mut self, drive: &mut Drive, actor: &Arc<Actor>) -> Option<String> {
        match actor.phase() {
            Phase::New if !actor.leaves() => self.open(actor),
            Phase::Playing(id) if actor.leaves() => return Some(id),
            Phase::Playing(id) => command(drive, &id, actor),
            // One that leaves while it is being opened is closed then.
            Phase::New | Phase::Opening | Phase::Gone => {}
        }
        None
    }

    fn open(&mut self, actor: &Arc<Actor>) {
        actor.set_phase(Phase::Opening);
        self.opening.push(actor.clone());
        let (openings, opened, actor) = (self.openings.clone(), self.opened.clone(), actor.clone());
        tokio::spawn(async move {
            // A connection that has ended does not wait for it.
            let _ = opened.send(openings.open(actor).await).await;
        });
    }

    /// Takes a character whose session is open.
    pub(super) fn enter(&mut self, Opened { actor, session }: Opened) -> Option<(Session, Arc<Actor>)> {
        self.opening.retain(|other| !Arc::ptr_eq(other, &actor));
        let session = match session {
            Ok(session) => session,
            Err(error) => {
                actor.fail(error.to_string());
                return None;
            }
        };
        let id = session.id().to_owned();
        if actor.leaves() {
            self.close(id);
            return None;
        }
        actor.set_phase(Phase::Playing(id.clone()));
        let member = Member {
            actor: actor.clone(),
            was_attached: false,
        };
        self.playing.insert(id, member);
        Some((session, actor))
    }

    /// Gives a frame to a character.
    pub(super) fn show(&self, id: &str, frame: Frame<'_>) {
        if let Some(member) = self.playing.get(id) {
            member.actor.show(frame);
        }
    }

    fn note(&self, id: &str, note: Note) {
        if let Some(member) = self.playing.get(id) {
            member.actor.note(note);
        }
    }

    /// Takes an event of the stream.
    pub(super) fn take(&mut self, event: DriveEvent) {
        match event {
            DriveEvent::Attached { session } => {
                if let Some(member) = self.playing.get_mut(&session)
                    && !std::mem::replace(&mut member.was_attached, true)
                {
                    member.actor.note(Note::Opened);
                }
            }
            DriveEvent::Resumed {
                session,
                lost_commands,
                ..
            } => self.note(&session, Note::resumed(lost_commands)),
            DriveEvent::Refused { session, problem } => {
                self.note(&session, Note::Refused(words(&problem)));
            }
            DriveEvent::Happened { session, events, .. } => {
                for note in events.iter().filter_map(Note::of) {
                    self.note(&session, note);
                }
            }
            DriveEvent::NotAttached { id, problem, .. } | DriveEvent::Left { id, problem, .. } => {
                if let Some(member) = self.playing.remove(&id) {
                    member.actor.fail(words(&problem));
                }
                if !problem.kind.is_gone() {
                    self.close(id);
                }
            }
        }
    }

    /// Closes a session, without a wait. One that cannot be closed expires.
    fn close(&mut self, id: String) {
        while self.closing.try_join_next().is_some() {}
        let client = self.client.clone();
        self.closing.spawn(async move {
            let _ = client.close_sessions([id]).await;
        });
    }

    /// Ends all characters.
    pub(super) fn fail(&self, message: &str) {
        let playing = self.playing.values().map(|member| &member.actor);
        for actor in playing.chain(&self.opening) {
            actor.fail(message.to_owned());
        }
    }

    /// Closes all sessions, and some that are not on the stream.
    pub(super) async fn close_all(mut self, others: Vec<String>) {
        let ids = self.playing.into_keys().chain(others);
        let _ = self.client.close_sessions(ids).await;
        while self.closing.join_next().await.is_some() {}
    }
}

/// Gives the waiting commands of a character to the stream.
pub(super) fn command(drive: &mut Drive, id: &str, actor: &Actor) {
    for order in actor.take_orders() {
        match order {
            Order::Move(wanted) => {
                if let Some(intent) = drive.intent_mut(id) {
                    *intent = wanted;
                }
            }
            Order::Act(act) => drive.act(id, &act),
            Order::Priority(priority) => drive.set_priority(id, priority),
        }
    }
}

/// A problem for people.
fn words(problem: &Problem) -> String {
    match &problem.allowed {
        Some(allowed) => format!("{} (allowed: {allowed})", problem.message),
        None => problem.message.clone(),
    }
}
