//! Reopens streams that broke. Their sessions go on from the last frame that the client saw.

use std::time::Duration;

use tokio::time::{Instant, sleep};
use tonic::Code;
use troupe_motion::rotation::to_wxyz;
use troupe_proto::v1;

use super::super::drive_event::DriveEvent;
use super::super::frames::Frame;
use super::Drive;
use crate::error::ClientError;
use crate::problem::{Problem, ProblemKind};

/// Pauses between tries: the first, and the longest. Sessions of a dead server can be resumed from
/// the end of its leases on, and should not wait for long then.
const PAUSE: (Duration, Duration) = (Duration::from_millis(50), Duration::from_millis(250));
/// Sessions of one call, as many as a server takes by default.
const CHUNK: usize = 1024;

/// Whether the stream broke without either side ending it for good. A server that stops may be
/// restarted.
pub(super) fn is_break(error: &ClientError) -> bool {
    match error {
        ClientError::StreamEnded(problem) => match &problem.kind {
            ProblemKind::Draining | ProblemKind::SessionMoved | ProblemKind::SessionElsewhere => true,
            ProblemKind::Other(kind) => kind.is_empty(),
            _ => false,
        },
        error => may_pass(error),
    }
}

/// Whether the next try may succeed.
fn may_pass(error: &ClientError) -> bool {
    match error {
        ClientError::Unreachable { .. } | ClientError::TimedOut { .. } => true,
        ClientError::Refused(refusal) => matches!(refusal.code, Code::Unavailable | Code::ResourceExhausted),
        _ => false,
    }
}

/// The last frame of a session that the client saw.
fn seen(id: &str, frame: u64, shown: Option<Frame<'_>>) -> v1::SessionResume {
    let pose = shown.map(|shown| match shown.qpos {
        [] => v1::Keyframe {
            root: Some(v1::Root {
                position: Some(v1::Vec3 {
                    x: shown.root.x,
                    y: shown.root.y,
                    z: shown.root.z,
                }),
                heading: None,
            }),
            pose: Some(v1::Pose {
                rotations: shown
                    .rotations
                    .iter()
                    .flat_map(|&rotation| to_wxyz(rotation))
                    .collect(),
                root_height: None,
            }),
            ..v1::Keyframe::default()
        },
        qpos => v1::Keyframe {
            qpos: qpos.to_vec(),
            ..v1::Keyframe::default()
        },
    });
    v1::SessionResume {
        session_id: id.to_owned(),
        frame: Some(frame),
        pose,
    }
}

impl Drive {
    /// Reopens the stream and resumes its sessions, for at most `limit`. Events report how each
    /// goes on.
    ///
    /// # Errors
    /// Why the last try failed.
    pub(super) async fn reconnect(&mut self, limit: Duration) -> Result<(), ClientError> {
        let (until, mut pause) = (Instant::now() + limit, PAUSE.0);
        // Without a word from a server, the router decides.
        match &self.broken {
            Some(ClientError::StreamEnded(why)) if why.kind == ProblemKind::SessionElsewhere => {}
            _ => self.client.way.forget(),
        }
        loop {
            let error = match self.take_up().await {
                Ok(()) => return Ok(()),
                Err(error) => error,
            };
            // A server that drains may resume the sessions, and end the new stream at once.
            if !is_break(&error) || Instant::now() + pause > until {
                return Err(error);
            }
            sleep(pause).await;
            pause = (pause * 2).min(PAUSE.1);
        }
    }

    /// The last frame of each session that this client saw, on this stream or one before. Sessions
    /// that never had a frame come without.
    fn last_seen(&self) -> Vec<v1::SessionResume> {
        let before = |id: &String| {
            let seen = self.seen.binary_search_by(|one| one.session_id.cmp(id));
            match seen {
                Ok(index) => self.seen[index].clone(),
                Err(_) => v1::SessionResume {
                    session_id: id.clone(),
                    ..v1::SessionResume::default()
                },
            }
        };
        let mut all: Vec<_> = self.sessions.keys().map(before).collect();
        for block in &self.blocks {
            for (place, slot) in block.slots().iter().enumerate() {
                let Some(id) = self.slots.get(slot) else {
                    continue;
                };
                let frames = block.frames(place);
                if let Ok(index) = all.binary_search_by(|one| one.session_id.cmp(id)) {
                    let last = frames.len().saturating_sub(1) as u64;
                    all[index] = seen(id, frames.first_frame() + last, frames.last());
                }
            }
        }
        all
    }

    /// Resumes the sessions on the server that the router, or another server, names.
    ///
    /// # Errors
    /// [`ClientError::Unreachable`] if one is not there yet: its old server has a lease of it, or
    /// has not noticed that the old stream is gone, or the store does not answer.
    async fn resume(&self) -> Result<(Vec<v1::ResumedSession>, Vec<v1::SessionProblem>), ClientError> {
        let (mut resumed, mut problems) = (Vec::new(), Vec::new());
        for chunk in self.seen.chunks(CHUNK) {
            let request = v1::ResumeSessionsRequest {
                sessions: chunk.to_vec(),
            };
            let answer = self
                .client
                .unary(|mut rpc| async move { rpc.resume_sessions(request).await })
                .await?;
            resumed.extend(answer.sessions);
            problems.extend(answer.problems);
        }
        let Some(passing) = problems.iter().find_map(passing) else {
            return Ok((resumed, problems));
        };
        // Those that are here already keep this client here.
        if resumed.is_empty() {
            self.client.way.follow(&passing);
        }
        Err(ClientError::Unreachable {
            url: self.client.url().to_owned(),
            reason: passing.message,
        })
    }

    async fn take_up(&mut self) -> Result<(), ClientError> {
        self.seen = self.last_seen();
        let (resumed, problems) = match self.resume().await {
            // The server that was named may be the one that is lost.
            Err(error @ (ClientError::Refused(_) | ClientError::TimedOut { .. })) => {
                self.client.way.forget();
                return Err(error);
            }
            answer => answer?,
        };
        let again = self.client.drive(self.options).await?;
        (self.asks, self.answers) = (again.asks, again.answers);
        self.slots.clear();
        self.blocks.clear();
        for of in problems {
            let (session, id, problem) = self.give_back(of);
            self.events.push(DriveEvent::NotAttached { id, session, problem });
        }
        for one in resumed {
            let now = one.session.unwrap_or_default();
            let Some(session) = self.sessions.get_mut(&now.id) else {
                continue;
            };
            let intent = session.intent_mut();
            let lost_commands = intent.sequence().saturating_sub(now.last_sequence);
            intent.seen(now.last_sequence);
            intent.doubt();
            self.events.push(DriveEvent::Resumed {
                session: now.id,
                frame: now.frame,
                restored: one.restored,
                lost_commands,
            });
        }
        let all: Vec<_> = std::mem::take(&mut self.sessions).into_values().collect();
        self.attach(all).await
    }
}

/// The problem of a session that may be resumed a little later.
fn passing(of: &v1::SessionProblem) -> Option<Problem> {
    let problem = Problem::from(of.problem.clone()?);
    problem.kind.may_pass().then_some(problem)
}
