//! Clients that come back after a restart of the server or a broken connection.

use std::sync::Arc;

use troupe_proto::v1;

use super::cell::{Live, SessionCell};
use super::owner::Owner;
use super::results::SessionProblem;
use super::{SessionError, Sessions, describe};
use crate::wire::{check_frame, to_native, units};
use troupe_base::turns::Turns;
use troupe_character::live::{LastSeen, MAX_REJOIN_FRAMES, MAX_REJOIN_M, RejoinError};
use troupe_character::{FieldError, Path};
use troupe_motion::{Quat, Vec3};

/// Whether a client may join the session to the last frame that it saw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Return {
    /// No: the session never stopped, or a client has joined it.
    Over,
    /// Yes: the session was restored, and no client has resumed it.
    Awaited,
    /// Yes, while the session is at this frame: it was restored, and calls have resumed it without
    /// a frame.
    AwaitedAt(u64),
}

impl Return {
    pub(super) fn of(is_restored: bool) -> Self {
        match is_restored {
            true => Self::Awaited,
            false => Self::Over,
        }
    }

    fn is_awaited(self, frame: u64) -> bool {
        match self {
            Self::Over => false,
            Self::Awaited => true,
            Self::AwaitedAt(at) => at == frame,
        }
    }
}

/// The answer to a call that resumes sessions.
#[derive(Debug, Default)]
pub struct Resumed {
    /// Sessions that were resumed.
    pub sessions: Vec<v1::ResumedSession>,
    /// Sessions that could not be resumed.
    pub problems: Vec<SessionProblem>,
}

impl Sessions {
    /// `troupe.v1.Sessions/ResumeSessions`.
    ///
    /// # Errors
    /// [`SessionError::Field`] for a list that is empty or too long. The error of a single session
    /// is among the problems.
    pub async fn resume(
        self: &Arc<Self>,
        request: v1::ResumeSessionsRequest,
        turns: Turns,
    ) -> Result<Resumed, SessionError> {
        let root = Path::root();
        let count = request.sessions.len();
        units::length(&root.field("sessions"), count, 1, self.limits().per_request)?;
        self.bring(request.sessions.iter().map(|asked| &asked.session_id))
            .await;
        let this = self.clone();
        let work = async move { this.resume_all(&request).await };
        Ok(self.executor().run(turns, work).await?)
    }

    async fn resume_all(&self, request: &v1::ResumeSessionsRequest) -> Resumed {
        let (root, mut turn) = (Path::root(), super::executor::Turn::begin());
        let mut resumed = Resumed::default();
        for (index, asked) in request.sessions.iter().enumerate() {
            match self.resume_one(&root.element("sessions", index), asked) {
                Ok(session) => resumed.sessions.push(session),
                Err(error) => {
                    let problem = SessionProblem::new(index, &asked.session_id, error);
                    resumed.problems.push(problem);
                }
            }
            turn.pause().await;
        }
        resumed
    }

    fn resume_one(
        &self,
        path: &Path<'_>,
        asked: &v1::SessionResume,
    ) -> Result<v1::ResumedSession, SessionError> {
        let field = || path.field("session_id").to_string();
        let now = self.time().now();
        let cell = self.registry().get(&asked.session_id, now, &field)?;
        let seen = seen(path, asked, &cell)?;
        // While this owns the session, no other call advances it.
        let held = cell.take(Owner::Step, &field)?;
        let mut live = cell.live();
        let found = live.character.frame();
        let restored = live.client_return.is_awaited(found);
        let mut left = Return::Over;
        if restored {
            match &seen {
                Some(seen) => join(path, &cell, &mut live, seen)?,
                // A later call may still know the client's last frame.
                None => left = Return::AwaitedAt(found),
            }
        }
        live.client_return = left;
        drop(held);
        Ok(v1::ResumedSession {
            restored,
            restored_frame: found,
            session: Some(describe::session_of(&cell, &live, now)),
        })
    }
}

/// Has a restored character go on from what its client saw last.
fn join(path: &Path<'_>, cell: &SessionCell, live: &mut Live, seen: &Seen) -> Result<(), SessionError> {
    let joined = live.character.rejoin(&seen.last);
    joined.map_err(|error| unfit(&path.sized(cell.size()), error))?;
    if let Some((root, rotations)) = &seen.own {
        live.begin_at(*root, rotations);
    }
    Ok(())
}

/// What a client saw last.
struct Seen {
    /// On the pack's skeleton.
    last: LastSeen,
    /// Root and rotations as the client gave them, on a skeleton of its own.
    own: Option<(Vec3, Vec<Quat>)>,
}

/// The last frame that the client saw, according to its request. `None` if the request has none.
fn seen(path: &Path<'_>, asked: &v1::SessionResume, cell: &SessionCell) -> Result<Option<Seen>, FieldError> {
    let Some(frame) = asked.frame else {
        return match asked.pose {
            None => Ok(None),
            Some(_) => Err(path
                .field("frame")
                .error("is missing", "the number of the frame that pose is of")),
        };
    };
    let Some(pose) = &asked.pose else {
        let last = LastSeen { frame, pose: None };
        return Ok(Some(Seen { last, own: None }));
    };
    let native = to_native(pose, cell.convention());
    let shown = check_frame(&path.field("pose"), &native, cell.pack().shown())?;
    let (pose, own) = match cell.pack().worn() {
        Some(worn) => {
            let back = worn.back(&[(shown.root, &shown.rotations)]).pop();
            (back, Some((shown.root, shown.rotations)))
        }
        None => (Some((shown.root, shown.rotations)), None),
    };
    let last = LastSeen { frame, pose };
    Ok(Some(Seen { last, own }))
}

fn unfit(path: &Path<'_>, error: RejoinError) -> FieldError {
    match error {
        RejoinError::Frame { frame, .. } => path.field("frame").error(
            error.to_string(),
            format!("at most {}", frame + MAX_REJOIN_FRAMES),
        ),
        RejoinError::Place { metres } => {
            let error = RejoinError::Place {
                metres: path.metres(metres),
            };
            let allowed = format!("at most {} m", path.metres(MAX_REJOIN_M));
            path.field("pose").error(error.to_string(), allowed)
        }
    }
}
