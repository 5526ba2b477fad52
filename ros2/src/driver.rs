//! The session of one robot: orders go in, frames come out.

use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::Vec3;
use tokio::sync::watch;
use tokio::time::{sleep, timeout};
use troupe_client::live::Session;
use troupe_client::{
    Client, ClientError, Drive, DriveEvent, DriveOptions, Encoding, FrameOptions, Pack, Rate, SessionOptions,
};
use troupe_motion::conventions::Convention;
use troupe_proto::v1;
use v1::session_event::Kind;

use crate::body::Place;
use crate::inbox::Inbox;
use crate::log::Log;
use crate::output::Output;
use crate::steering::{Command, Steering};

/// Pause before the next try to open a session.
const PAUSE: Duration = Duration::from_millis(500);
/// Sessions without a stream end after this time. A stream that breaks is resumed for 10 s.
const TTL: Duration = Duration::from_secs(15);
/// Longest wait for the server when the node ends.
const GOODBYE: Duration = Duration::from_secs(2);

/// Opens sessions of one robot.
#[derive(Debug, Clone)]
pub(crate) struct Link {
    pub(crate) client: Client,
    pub(crate) pack: Pack,
    pub(crate) seed: u64,
    /// Style of the next session. Empty: the pack's.
    pub(crate) style: String,
}

/// Drives one robot until the node ends.
pub(crate) struct Driver {
    pub(crate) link: Link,
    pub(crate) output: Output,
    pub(crate) inbox: Arc<Inbox>,
    pub(crate) steering: Steering,
    /// Becomes true when the node ends.
    pub(crate) stop: watch::Receiver<bool>,
}

/// Why a session is not driven any more.
enum Ended {
    /// The node ends.
    Stopped,
    /// The session or the server is gone.
    Lost(String),
}

impl From<ClientError> for Ended {
    fn from(error: ClientError) -> Self {
        Self::Lost(error.to_string())
    }
}

impl Link {
    /// Opens a session that stands at a place.
    ///
    /// # Errors
    /// See [`ClientError`].
    pub(crate) async fn open(&self, place: Place) -> Result<Session, ClientError> {
        let mut options = SessionOptions::new()
            .convention(Convention::Ros)
            .seed(self.seed)
            .at(Vec3::new(place.x, place.y, 0.0), place.heading)
            .ttl(TTL);
        if !self.style.is_empty() {
            options = options.style(&self.style);
        }
        self.client.session(&self.pack, &options).await
    }

    /// Opens a stream with a session.
    async fn drive(&self, rate: Rate, session: Session) -> Result<Drive, ClientError> {
        let options = DriveOptions {
            frames: FrameOptions {
                rate,
                encoding: Encoding::Qpos,
                positions: false,
            },
            ..DriveOptions::default()
        };
        let mut drive = self.client.drive(options).await?;
        drive.attach([session]).await?;
        Ok(drive)
    }
}

impl Driver {
    /// Drives the robot until the node ends. A session that is lost is followed by another at the
    /// same place.
    pub(crate) async fn run(mut self, session: Session) {
        let mut session = Some(session);
        loop {
            match self.follow(session.take()).await {
                Ended::Stopped => return,
                Ended::Lost(why) => self.output.ports.log.warn(&why),
            }
            self.steering.forget();
            let mut stop = self.stop.clone();
            let pause = async {
                tokio::select! {
                    () = sleep(PAUSE) => false,
                    () = stopped(&mut stop) => true,
                }
            };
            if self.output.while_waiting(pause).await {
                return;
            }
        }
    }

    async fn follow(&mut self, session: Option<Session>) -> Ended {
        let mut stop = self.stop.clone();
        let (mut drive, id) = tokio::select! {
            begun = self.begin(session) => match begun {
                Ok(begun) => begun,
                Err(error) => return error.into(),
            },
            () = stopped(&mut stop) => return Ended::Stopped,
        };
        loop {
            self.steer(&mut drive, &id);
            let went = tokio::select! {
                went = step(&mut drive, &mut self.output) => went,
                () = stopped(&mut stop) => {
                    close(drive).await;
                    return Ended::Stopped;
                }
            };
            if let Err(ended) = went {
                return ended;
            }
        }
    }

    /// Puts a session on a stream: the given one, or a new one where the robot is.
    async fn begin(&mut self, session: Option<Session>) -> Result<(Drive, String), ClientError> {
        let (link, place, rate) = (&self.link, self.output.place(), self.output.rate);
        let begun = async {
            let session = match session {
                Some(session) => session,
                None => link.open(place).await?,
            };
            let id = session.id().to_owned();
            Ok::<_, ClientError>((link.drive(rate, session).await?, id))
        };
        let (drive, id) = self.output.while_waiting(begun).await?;
        let url = link.client.url();
        let root = self.output.body.root();
        self.output
            .ports
            .log
            .info(&format!("session {id} on {url} moves odom -> {root}"));
        Ok((drive, id))
    }

    /// Gives the session what is due.
    fn steer(&mut self, drive: &mut Drive, id: &str) {
        let (now, place) = (Instant::now(), self.output.place());
        let (order, style) = self.inbox.take();
        if let Some(style) = style
            && let Some(intent) = drive.intent_mut(id)
        {
            intent.style = Some(style.clone());
            self.link.style = style;
        }
        let at_once = order.and_then(|(order, came)| self.steering.take(order, came, place));
        for command in at_once.into_iter().chain(self.steering.due(now, place)) {
            match command {
                Command::Act(act) => drive.act(id, &act),
                Command::Move(locomotion) => {
                    if let Some(intent) = drive.intent_mut(id) {
                        // The style stays.
                        let style = intent.style.take();
                        *intent = locomotion;
                        intent.style = style;
                    }
                }
            }
        }
    }
}

/// Waits until the node ends.
async fn stopped(stop: &mut watch::Receiver<bool>) {
    // An error means that the node is gone.
    let _ = stop.wait_for(|stops| *stops).await;
}

/// Waits for the next frame or event of a stream, and shows it.
async fn step(drive: &mut Drive, output: &mut Output) -> Result<(), Ended> {
    let next = output.while_waiting(drive.next()).await?;
    let Some(update) = next else {
        return Err(Ended::Lost("the server ended the stream".to_owned()));
    };
    for event in update.events {
        if matches!(event, DriveEvent::Resumed { .. } | DriveEvent::Attached { .. }) {
            output.begin();
        }
        note(&output.ports.log, event)?;
    }
    if let Some(tick) = update.tick {
        for (_, frames) in tick.characters() {
            if let Some(frame) = frames.last() {
                output.show(tick.number(), frame);
            }
        }
    }
    Ok(())
}

/// Notes an event of the stream. A session that is not on it any more is lost.
fn note(log: &Log, event: DriveEvent) -> Result<(), Ended> {
    match event {
        DriveEvent::Attached { .. } => {}
        DriveEvent::Resumed {
            frame,
            restored,
            lost_commands,
            ..
        } => {
            let how = match restored {
                true => "the server is back",
                false => "the connection is back",
            };
            log.info(&format!(
                "{how}: the session goes on at frame {frame}, {lost_commands} commands were lost"
            ));
        }
        DriveEvent::NotAttached { problem, .. } | DriveEvent::Left { problem, .. } => {
            return Err(Ended::Lost(problem.to_string()));
        }
        DriveEvent::Refused { problem, .. } => log.warn(&format!("refused: {problem}")),
        DriveEvent::Happened { events, .. } => {
            for kind in events.into_iter().filter_map(|event| event.kind) {
                happened(log, kind);
            }
        }
    }
    Ok(())
}

fn happened(log: &Log, kind: Kind) {
    match kind {
        Kind::Arrived(arrived) => {
            log.info(&format!("arrived, {:.2} m from the end of the path", arrived.off));
        }
        Kind::Performing(performing) if performing.unknown_words.is_empty() => {
            log.info(&format!("acts out {:?}", performing.text));
        }
        Kind::Performing(performing) => {
            let unknown = performing.unknown_words.join(", ");
            log.warn(&format!(
                "acts out {:?}, but has not learnt: {unknown}",
                performing.text
            ));
        }
        Kind::Performed(performed) => {
            let v1::PerformanceEnded { reason, message, .. } = performed;
            log.info(format!("the sentence ended: {reason} {message}").trim_end());
        }
        Kind::Bounded(bounded) => log.warn(&format!(
            "cmd_vel asks for {:.2} m/s, which the style cannot do; it does what comes nearest",
            bounded.wanted_speed
        )),
        // Those of objects and falls, which have no topic here.
        _ => {}
    }
}

/// Ends the session on the server.
async fn close(drive: Drive) {
    let all = async {
        for session in drive.close().await? {
            session.close().await?;
        }
        Ok::<_, ClientError>(())
    };
    // A server that does not answer ends the session by itself.
    if let Ok(Err(error)) = timeout(GOODBYE, all).await {
        tracing::debug!("a session was not closed: {error}");
    }
}
