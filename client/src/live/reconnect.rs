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

/// Pauses between tries: the first, and the longest.
const PAUSE: (Duration, Duration) = (Duration::from_millis(50), Duration::from_secs(1));
/// Sessions of one call, as many as a server takes by default.
const CHUNK: usize = 1024;

/// Whether the stream broke without either side ending it for good. A server that stops may be
/// restarted.
pub(super) fn is_break(error: &ClientError) -> bool {
    match error {
        ClientError::StreamEnded(problem) => match &problem.kind {
            ProblemKind::Draining => true,
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

    /// The last frame of each session that this client saw. Sessions without frames are left out.
    fn last_seen(&self) -> Vec<v1::SessionResume> {
        let unseen = |id: &String| v1::SessionResume {
            session_id: id.clone(),
            ..v1::SessionResume::default()
        };
        let mut all: Vec<_> = self.sessions.keys().map(unseen).collect();
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

    async fn take_up(&mut self) -> Result<(), ClientError> {
        let (mut resumed, mut problems) = (Vec::new(), Vec::new());
        for chunk in self.last_seen().chunks(CHUNK) {
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
        // The server may not have noticed yet that the old stream is gone.
        if let Some(busy) = problems.iter().find_map(busy) {
            return Err(ClientError::Unreachable {
                url: self.client.url().to_owned(),
                reason: busy.message,
            });
        }
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

/// The problem of a session that another client advances.
fn busy(of: &v1::SessionProblem) -> Option<Problem> {
    let problem = Problem::from(of.problem.clone()?);
    (problem.kind == ProblemKind::SessionBusy).then_some(problem)
}
