//! Errors of sessions, styles and commands.

use std::time::Duration;

use super::row::{
    EXISTS, FULL, GONE, INTERNAL, INVALID, MISDIRECTED, NOT_FOUND, NOT_NOW, Row, TOO_LARGE, Tabled,
    UNAVAILABLE,
};
use troupe_character::live::{CommandError, MAX_WAITING_COMMANDS};
use troupe_live::packs::{CannotDo, UnknownBody, UnknownPack};
use troupe_live::session::recording::RecordingError;
use troupe_live::session::{SessionError, SpaceError};

/// Retry hint if it is unknown when a place becomes free.
const WHEN_A_PLACE_IS_FREE: Duration = Duration::from_secs(1);

/// Retry hint while the store does not answer. It is asked twice a second.
const WHEN_THE_STORE_IS_BACK: Duration = Duration::from_secs(1);

impl Tabled for SessionError {
    fn row(&self) -> Row<'_> {
        match self {
            Self::Field(error) => error.row(),
            Self::UnknownPack(error) => error.row(),
            Self::Skeleton(error) => error.row(),
            Self::UnknownBody(error) => error.row(),
            Self::CannotDo(error) => error.row(),
            Self::World(error) => error.row(),
            // One reason for both, because a client does the same: it opens another session.
            Self::Expired { field, .. } | Self::MadeRoom { field, .. } => {
                GONE.because("SESSION_EXPIRED").field(field)
            }
            Self::Unknown { field, .. } => NOT_FOUND.because("UNKNOWN_SESSION").field(field),
            Self::Exists { field, .. } => EXISTS
                .because("SESSION_EXISTS")
                .field(field)
                .allowed("an id that is free, or none"),
            Self::Elsewhere {
                owner,
                ends_in_ms,
                field,
                ..
            } => MISDIRECTED
                .because("SESSION_ELSEWHERE")
                .field(field)
                .allowed(owner.as_str())
                .retry_after(Duration::from_millis(*ends_in_ms)),
            Self::Moved { field, .. } => MISDIRECTED.because("SESSION_MOVED").field(field),
            Self::NoStore { field, .. } => UNAVAILABLE
                .because("STORE_UNREACHABLE")
                .field(field)
                .retry_after(WHEN_THE_STORE_IS_BACK),
            Self::Busy { field, .. } => NOT_NOW.because("SESSION_BUSY").field(field),
            Self::TooMany { limit, .. } => no_place("TOO_MANY_SESSIONS", *limit),
            Self::TooManyStreams { limit } => no_place("TOO_MANY_STREAMS", *limit),
            Self::ShuttingDown => UNAVAILABLE.because("NOT_READY"),
            Self::Refused { refusal, field } => refusal.row().field(field),
            Self::UnknownStyle { field, there_are, .. } => INVALID
                .because("UNKNOWN_STYLE")
                .field(field)
                .allowed(there_are.join(", ")),
            Self::StyleIsBuiltIn { field, .. } => NOT_NOW
                .because("STYLE_IS_BUILT_IN")
                .field(field)
                .allowed("a name that none of the pack's own styles has"),
            Self::NotRecorded { .. } => NOT_FOUND.because("UNKNOWN_RECORDING").field("session_id"),
            Self::Recording(error) => error.row(),
            Self::TooManyReplays { limit } => no_place("TOO_MANY_REPLAYS", *limit),
            Self::Plan(error) => error.row(),
            Self::Stopped(error) => error.row(),
        }
    }
}

impl Tabled for RecordingError {
    fn row(&self) -> Row<'_> {
        let row = match self {
            Self::TooLarge { most, .. } => TOO_LARGE
                .because("RECORDING_TOO_LARGE")
                .allowed(format!("at most {most} bytes")),
            Self::Line { .. } => INVALID.because("MALFORMED_RECORDING"),
            Self::Newer { .. } => INVALID.because("NEWER_RECORDING"),
            Self::Differs(_) => NOT_NOW
                .because("RECORDING_DIFFERS")
                .allowed("a server like the one that recorded it, or anyway"),
        };
        row.field("recording")
    }
}

/// All places are taken.
fn no_place(reason: &'static str, limit: usize) -> Row<'static> {
    FULL.because(reason)
        .allowed(format!("at most {limit}"))
        .retry_after(WHEN_A_PLACE_IS_FREE)
}

impl Tabled for SpaceError {
    fn row(&self) -> Row<'_> {
        match self {
            Self::TooMany { most } => FULL
                .because("TOO_MANY_TENANTS")
                .allowed(format!("at most {most}")),
            Self::Unreadable { .. } => INTERNAL.because("TENANT_NOT_READ"),
        }
    }
}

impl Tabled for UnknownPack {
    fn row(&self) -> Row<'_> {
        NOT_FOUND
            .because("UNKNOWN_PACK")
            .field(&self.field)
            .allowed(self.loaded.join(", "))
    }
}

impl Tabled for UnknownBody {
    fn row(&self) -> Row<'_> {
        INVALID
            .because("UNKNOWN_BODY")
            .field(&self.field)
            .allowed(match self.there_are.is_empty() {
                true => "none: the pack has one skeleton".to_owned(),
                false => self.there_are.join(", "),
            })
    }
}

impl Tabled for CannotDo {
    fn row(&self) -> Row<'_> {
        INVALID
            .because("PACK_CANNOT")
            .field(&self.field)
            .allowed(format!("a pack with the capability {}", self.wanted))
    }
}

impl Tabled for CommandError {
    fn row(&self) -> Row<'_> {
        match self {
            Self::NoScene => NOT_NOW.because("NO_SCENE"),
            Self::ByPath | Self::SkillByPath => INVALID
                .because("PACK_CANNOT")
                .allowed("a pack whose characters go to keyframes"),
            Self::PathTooFar { most_m, .. } => NOT_NOW
                .because("PATH_TOO_FAR")
                .allowed(format!("at most {most_m} m")),
            Self::UnknownObject { .. } => NOT_FOUND.because("UNKNOWN_OBJECT"),
            Self::WrongPack { .. } => NOT_NOW.because("WRONG_PACK"),
            Self::UnknownSkill { there_are, .. } => INVALID.because("UNKNOWN_SKILL").allowed(match there_are
                .is_empty()
            {
                true => "none: the pack has no skills".to_owned(),
                false => there_are.join(", "),
            }),
            Self::TooShort { short, .. } => INVALID.because("TOO_SHORT").allowed(format!(
                "one whose sets have at least {} frames, or a pack that makes fewer at a time",
                short.least
            )),
            Self::UnknownVariant { there_are, .. } | Self::UnknownSkillVariant { there_are, .. } => {
                INVALID.because("UNKNOWN_VARIANT").allowed(there_are.join(", "))
            }
            Self::UnknownApproach { there_are, .. } => {
                INVALID.because("UNKNOWN_APPROACH").allowed(there_are.join(", "))
            }
            Self::Taken { .. } => NOT_NOW.because("OBJECT_TAKEN"),
            Self::Blocked { .. } => NOT_NOW.because("BLOCKED"),
            Self::HandFull { .. } => NOT_NOW.because("HAND_FULL"),
            Self::TooManyCommands => FULL
                .because("TOO_MANY_COMMANDS")
                .allowed(format!("at most {MAX_WAITING_COMMANDS} that wait")),
        }
    }
}
