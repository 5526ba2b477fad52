//! Every error of the calls below the edge.

use crate::batch::SubmitError;
use crate::offload::WorkerStopped;
use crate::packs::{CannotDo, UnknownPack};
use crate::session::SessionError;
use crate::world::WorldError;
use troupe_character::FieldError;
use troupe_character::post::NonFinite;

/// Why a call was not served.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum ServiceError {
    /// The packs are not there yet.
    #[error("the server is starting: its packs are not loaded yet")]
    Starting,
    /// A value that is not accepted.
    #[error(transparent)]
    Field(#[from] FieldError),
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
