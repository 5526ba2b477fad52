//! Errors of calls, below the edge.

use crate::inbetween::NotFeasible;
use crate::life::LifeError;
use troupe_base::offload::WorkerStopped;
use troupe_batch::SubmitError;
use troupe_character::FieldError;
use troupe_character::post::NonFinite;
use troupe_live::packs::{CannotDo, UnknownPack};
use troupe_live::session::{SessionError, SpaceError, StoreBehind};
use troupe_live::skeleton::SkeletonError;
use troupe_live::world::WorldError;

/// Why a call was not served.
#[derive(Debug, Clone, thiserror::Error)]
pub enum ServiceError {
    /// The packs are still loading.
    #[error("the server is starting: its packs are not loaded yet")]
    Starting,
    /// Only for the readiness of the server.
    #[error(transparent)]
    Store(#[from] StoreBehind),
    /// The caller's tenant cannot be served.
    #[error(transparent)]
    Space(#[from] SpaceError),
    /// A value is not accepted.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// The answer to a strict request would not be feasible.
    #[error(transparent)]
    NotFeasible(#[from] NotFeasible),
    /// No loaded pack has this name.
    #[error(transparent)]
    UnknownPack(#[from] UnknownPack),
    /// The pack lacks the capability for the call.
    #[error(transparent)]
    CannotDo(#[from] CannotDo),
    /// Only for calls about skeletons, or that name one.
    #[error(transparent)]
    Skeleton(SkeletonError),
    /// Only for calls about scenes, definitions or styles.
    #[error(transparent)]
    World(WorldError),
    /// Only for calls about sessions or styles.
    #[error(transparent)]
    Session(SessionError),
    /// A pack was not loaded, unloaded or swapped.
    #[error(transparent)]
    Life(#[from] LifeError),
    /// An error of a pack's queue or engine.
    #[error(transparent)]
    Batch(#[from] SubmitError),
    /// An engine made frames with numbers that are not finite.
    #[error(transparent)]
    Frames(#[from] NonFinite),
    /// The work of a call stopped early.
    #[error(transparent)]
    Stopped(#[from] WorkerStopped),
}

/// Errors that several kinds of calls share have one variant, whichever layer noticed them.
impl From<SessionError> for ServiceError {
    fn from(error: SessionError) -> Self {
        match error {
            SessionError::Field(error) => Self::Field(error),
            SessionError::UnknownPack(error) => Self::UnknownPack(error),
            SessionError::CannotDo(error) => Self::CannotDo(error),
            SessionError::World(error) => error.into(),
            SessionError::Skeleton(error) => error.into(),
            SessionError::Plan(error) => Self::Batch(error),
            SessionError::Stopped(error) => Self::Stopped(error),
            error => Self::Session(error),
        }
    }
}

impl From<SkeletonError> for ServiceError {
    fn from(error: SkeletonError) -> Self {
        match error {
            SkeletonError::Field(error) => Self::Field(error),
            SkeletonError::UnknownPack(error) => Self::UnknownPack(error),
            SkeletonError::UnknownBody(error) => Self::Session(error.into()),
            error => Self::Skeleton(error),
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
