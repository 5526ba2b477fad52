//! Characters of one stream, which are followed over a restart of their server.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use tokio::sync::mpsc;
use troupe_client::{Client, ClientError, Drive, DriveEvent, DriveOptions, Session};
use troupe_motion::Vec3;

use crate::host::turning_walk;

/// Time for which the client reopens a stream that breaks: longer than a server takes to start,
/// even on a slow machine.
const RECONNECT: Duration = Duration::from_secs(60);

/// What the client saw of a character.
#[derive(Debug, Default)]
pub struct Follower {
    /// Number and root of the last frame, metres.
    last: Option<(u64, Vec3)>,
    largest_step_m: f32,
    /// When each command was given.
    commands: Vec<Instant>,
    /// Frames whose number was below that of the frame before. A character that waits for a plan
    /// slows down, so numbers may repeat.
    pub went_back: u64,
    /// Set once the stream has resumed it.
    pub resumed: Option<Resumed>,
    /// The first frame after that.
    pub first_after: Option<FirstFrame>,
}

/// The report of the client when the stream resumed a session.
#[derive(Debug)]
pub struct Resumed {
    pub at: Instant,
    /// Whether the server had kept the session.
    pub restored: bool,
    pub lost_commands: u64,
    /// Commands given by then.
    given: usize,
}

/// The first frame after a restart.
#[derive(Debug)]
pub struct FirstFrame {
    pub at: Instant,
    /// Distance from the root of the last frame before.
    pub jump_m: f32,
    /// The largest distance between two frames before.
    pub largest_step_m: f32,
}

impl Follower {
    /// Time from the oldest lost command to the signal that ended the server, ms. None if no
    /// command was lost.
    pub fn lost_ms(&self, stopped: Instant) -> Option<f64> {
        let resumed = self.resumed.as_ref().filter(|one| one.lost_commands > 0)?;
        let oldest = resumed.given.checked_sub(resumed.lost_commands as usize)?;
        let given = self.commands.get(oldest)?;
        Some(1e3 * stopped.saturating_duration_since(*given).as_secs_f64())
    }

    fn frame(&mut self, number: u64, root: Vec3, at: Instant) {
        let before = self.last.replace((number, root));
        let Some((last, place)) = before else { return };
        self.went_back += u64::from(number < last);
        let step_m = place.distance(root);
        if self.resumed.is_some() && self.first_after.is_none() {
            self.first_after = Some(FirstFrame {
                at,
                jump_m: step_m,
                largest_step_m: self.largest_step_m,
            });
        } else if self.resumed.is_none() && number == last + 1 {
            self.largest_step_m = self.largest_step_m.max(step_m);
        }
    }
}

/// A stream and its characters.
pub struct Followed {
    drive: Drive,
    followers: BTreeMap<String, Follower>,
    every: Duration,
}

impl Followed {
    /// Puts sessions onto a stream. Each gets a new command after each time `every`.
    pub async fn open(client: &Client, sessions: Vec<Session>, every: Duration) -> Result<Self, ClientError> {
        let options = DriveOptions {
            every_tick: true,
            reconnect: Some(RECONNECT),
            ..DriveOptions::default()
        };
        let mut drive = client.drive(options).await?;
        let ids = sessions.iter().map(|session| session.id().to_owned());
        let followers = ids.map(|id| (id, Follower::default())).collect();
        drive.attach(sessions).await?;
        Ok(Self {
            drive,
            followers,
            every,
        })
    }

    /// Follows the characters over a restart. Reports on `done` once all go on, and ends once that
    /// channel is closed.
    pub async fn follow(mut self, done: mpsc::Sender<()>) -> Result<Vec<Follower>, ClientError> {
        let begun = Instant::now();
        let mut has_reported = false;
        loop {
            self.command(begun);
            let update = tokio::select! {
                update = self.drive.next() => update?,
                () = done.closed() => break,
            };
            let Some(update) = update else { break };
            let now = Instant::now();
            for event in update.events {
                note(&mut self.followers, event, now);
            }
            let Some(tick) = update.tick else { continue };
            for (id, frames) in tick.characters() {
                let (number, Some(frame)) = (frames.first_frame(), frames.last()) else {
                    continue;
                };
                if let Some(follower) = self.followers.get_mut(id) {
                    follower.frame(number, frame.root, now);
                }
            }
            if !has_reported && self.followers.values().all(|one| one.first_after.is_some()) {
                has_reported = true;
                let _ = done.try_send(());
            }
        }
        Ok(self.followers.into_values().collect())
    }

    /// Gives the commands that are due.
    fn command(&mut self, begun: Instant) {
        let (every_s, count) = (self.every.as_secs_f32(), self.followers.len());
        let now = Instant::now();
        let since_s = now.duration_since(begun).as_secs_f32();
        for (nth, (id, follower)) in self.followers.iter_mut().enumerate() {
            let Some(intent) = self.drive.intent_mut(id) else {
                continue;
            };
            let wanted = turning_walk((nth, count), since_s, every_s);
            if *intent != wanted {
                *intent = wanted;
                follower.commands.push(now);
            }
        }
    }
}

fn note(followers: &mut BTreeMap<String, Follower>, event: DriveEvent, at: Instant) {
    match event {
        DriveEvent::Resumed {
            session,
            restored,
            lost_commands,
            ..
        } => {
            if let Some(follower) = followers.get_mut(&session) {
                follower.resumed = Some(Resumed {
                    at,
                    restored,
                    lost_commands,
                    given: follower.commands.len(),
                });
            }
        }
        DriveEvent::NotAttached { id, problem, .. } | DriveEvent::Left { id, problem, .. } => {
            eprintln!("{id} is not on the stream any more: {problem:?}");
        }
        DriveEvent::Refused { session, problem } => eprintln!("{session} refused a command: {problem:?}"),
        DriveEvent::Attached { .. } | DriveEvent::Happened { .. } => {}
    }
}
