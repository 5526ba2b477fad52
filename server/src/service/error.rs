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
    /// As many tenants as there may be.
    #[error("the server has no room for another tenant; allowed: at most {most} at a time (max_tenants)")]
    TooManyTenants {
        /// How many there may be.
        most: usize,
    },
    /// What the caller's tenant keeps cannot be read.
    #[error("what the caller's tenant keeps cannot be read; the server's log has the reason")]
    Tenant,
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
    /// A call about scenes or definitions.
    #[error(transparent)]
    World(#[from] WorldError),
    /// A call about sessions or styles.
    #[error(transparent)]
    Session(#[from] SessionError),
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

impl From<SpaceError> for ServiceError {
    fn from(error: SpaceError) -> Self {
        match error {
            SpaceError::TooMany { most } => Self::TooManyTenants { most },
            error => {
                tracing::error!(%error, "a tenant is not served");
                Self::Tenant
            }
        }
    }
}
