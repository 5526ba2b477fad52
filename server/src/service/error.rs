//! Every error of the calls below the edge.

use crate::inbetween::NotFeasible;
use troupe_base::offload::WorkerStopped;
use troupe_batch::SubmitError;
use troupe_character::FieldError;
use troupe_character::post::NonFinite;
use troupe_live::packs::{CannotDo, UnknownPack};
use troupe_live::session::{SessionError, SpaceError};
use troupe_live::world::WorldError;

/// Why a call was not served.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum ServiceError {
    /// The packs are not there yet.
    #[error("the server is starting: its packs are not loaded yet")]
    Starting,
    /// The caller's tenant is not served.
    #[error(transparent)]
    Space(#[from] SpaceError),
    /// A value that is not accepted.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// A strict request whose answer would not be feasible.
    #[error(transparent)]
    NotFeasible(#[from] NotFeasible),
    /// A pack that is not loaded.
    #[error(transparent)]
    UnknownPack(#[from] UnknownPack),
    /// A pack that cannot do what is asked of it.
    #[error(transparent)]
    CannotDo(#[from] CannotDo),
    /// Only of a call about scenes, definitions or styles.
    #[error(transparent)]
    World(WorldError),
    /// Only of a call about sessions or styles.
    #[error(transparent)]
    Session(SessionError),
    /// The queue or the engine of a pack.
    #[error(transparent)]
    Batch(#[from] SubmitError),
    /// An engine whose frames are of no use.
    #[error(transparent)]
    Frames(#[from] NonFinite),
    /// The work of a call did not come to its end.
    #[error(transparent)]
    Stopped(#[from] WorkerStopped),
}

/// What several kinds of calls can meet has one variant here, whichever layer noticed it.
impl From<SessionError> for ServiceError {
    fn from(error: SessionError) -> Self {
        match error {
            SessionError::Field(error) => Self::Field(error),
            SessionError::UnknownPack(error) => Self::UnknownPack(error),
            SessionError::CannotDo(error) => Self::CannotDo(error),
            SessionError::World(error) => error.into(),
            SessionError::Plan(error) => Self::Batch(error),
            SessionError::Stopped(error) => Self::Stopped(error),
            error => Self::Session(error),
        }
    }
}

impl From<WorldError> for ServiceError {
    fn from(error: WorldError) -> Self {
        match error {
            WorldError::Field(error) => Self::Field(error),
            error => Self::World(error),
        }
    }
}
