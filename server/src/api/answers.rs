//! Messages of answers in which some parts may be errors.

use troupe_proto::v1;
use troupe_proto::v1::drive_response::Message;

use super::ApiError;
use troupe_character::live::CommandOutcome;
use troupe_live::session::End;
use troupe_live::session::stream::{Closing, Departure, Said};
use troupe_live::session::{Closed, CommandResult, Resumed, SessionError, SessionProblem, Stepped};
use troupe_live::world::ObjectsChanged;
use troupe_service::ServiceError;

/// An error inside an answer that also holds results.
fn problem(error: impl Into<ServiceError>) -> v1::Problem {
    ApiError::from(error.into()).problem()
}

/// The answer to a command request: a result for each command.
pub(super) fn commands(results: Vec<CommandResult>) -> v1::CommandResponse {
    v1::CommandResponse {
        results: results.into_iter().map(command).collect(),
    }
}

fn command(result: CommandResult) -> v1::CommandResult {
    let (status, problem) = match result.outcome {
        Ok(CommandOutcome::Accepted) => (v1::CommandStatus::Accepted, None),
        Ok(CommandOutcome::Repeated) => (v1::CommandStatus::Repeated, None),
        Ok(CommandOutcome::Late) => (v1::CommandStatus::Late, None),
        Err(error) => (v1::CommandStatus::Refused, Some(problem(error))),
    };
    v1::CommandResult {
        session_id: result.session_id,
        sequence: result.sequence,
        status: status.into(),
        problem,
    }
}

fn session_problem(found: SessionProblem) -> v1::SessionProblem {
    v1::SessionProblem {
        slot: found.slot,
        session_id: found.session_id,
        problem: Some(problem(found.error)),
    }
}

/// The answer to a step.
pub(super) fn step(stepped: Stepped) -> v1::StepResponse {
    v1::StepResponse {
        blocks: stepped.blocks,
        command_results: stepped.commands.into_iter().map(command).collect(),
        problems: stepped.problems.into_iter().map(session_problem).collect(),
        events: stepped.events,
        held: stepped.held,
        total_us: stepped.total.as_micros() as u64,
        waited_us: stepped.waited.as_micros() as u64,
    }
}

/// The answer to a resume request.
pub(super) fn resumed(resumed: Resumed) -> v1::ResumeSessionsResponse {
    v1::ResumeSessionsResponse {
        sessions: resumed.sessions,
        problems: resumed.problems.into_iter().map(session_problem).collect(),
    }
}

/// The answer to a request that closes sessions.
pub(super) fn closed(closed: Closed) -> v1::CloseSessionsResponse {
    v1::CloseSessionsResponse {
        closed: closed.closed,
        problems: closed.problems.into_iter().map(session_problem).collect(),
    }
}

/// The answer to a change of objects: a result for each object.
pub(super) fn objects(changed: ObjectsChanged) -> v1::ObjectsResponse {
    let each = changed.objects.into_iter().map(|object| v1::ObjectResult {
        id: object.id,
        problem: object.error.map(problem),
    });
    v1::ObjectsResponse {
        results: each.collect(),
        revision: changed.revision,
    }
}

/// A message of a live stream.
pub(super) fn drive(said: Said) -> Message {
    match said {
        Said::Attached(attached) => Message::Attached(v1::DriveAttached {
            sessions: attached.sessions,
            problems: attached.problems.into_iter().map(session_problem).collect(),
        }),
        Said::Left(left) => Message::Left(v1::DriveLeft {
            sessions: left.into_iter().map(departure).collect(),
        }),
        Said::Commands(results) => Message::Commands(commands(results)),
        Said::Events(sessions) => Message::Events(v1::DriveEvents { sessions }),
        Said::Closing(closing) => Message::Closing(v1::DriveClosing {
            reason: Some(reason(closing)),
        }),
    }
}

fn departure(left: Departure) -> v1::SessionProblem {
    let id = &left.session_id;
    let ended = |reason: &str| v1::Problem {
        reason: reason.to_owned(),
        message: format!("session {id:?} has left the stream"),
        ..v1::Problem::default()
    };
    let why = match left.end {
        None => ended("DETACHED"),
        Some(End::Closed) => ended("SESSION_CLOSED"),
        Some(End::Expired) => problem(SessionError::Expired {
            id: id.clone(),
            field: String::new(),
        }),
        Some(End::MadeRoom) => problem(SessionError::MadeRoom {
            id: id.clone(),
            field: String::new(),
        }),
        Some(End::Moved) => problem(SessionError::Moved {
            id: id.clone(),
            field: String::new(),
        }),
    };
    v1::SessionProblem {
        slot: left.slot,
        problem: Some(why),
        session_id: left.session_id,
    }
}

/// Sent to the client of a stream when the server stops.
const STREAM_DRAINS: &str =
    "the server is shutting down; open the stream again in a few seconds, or with another server";

fn reason(closing: Closing) -> v1::Problem {
    let because = |reason: &str, message: String| v1::Problem {
        reason: reason.to_owned(),
        message,
        ..v1::Problem::default()
    };
    let invalid = |problem| v1::Problem {
        reason: "INVALID_REQUEST".to_owned(),
        ..problem
    };
    match closing {
        Closing::ClientDone | Closing::Gone => because("CLIENT_DONE", "the client is done".to_owned()),
        Closing::Draining => because("DRAINING", STREAM_DRAINS.to_owned()),
        Closing::WatchedEnded => because(
            "WATCHED_ENDED",
            "the stream that was watched has ended".to_owned(),
        ),
        Closing::SlowReader(limit) => because(
            "SLOW_READER",
            format!("nothing was read for {} ms", limit.as_millis()),
        ),
        Closing::Unreadable(problem) => invalid(problem),
        Closing::Invalid(error) => invalid(problem(error)),
    }
}
