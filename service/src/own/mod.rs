//! Requests on a skeleton of the user's own. They become requests on the pack's skeleton, and their
//! answers come back on the user's.
//!
//! | files, bottom up | hold |
//! |---|---|
//! | [`pins`] | poses that the user gave, which frames meet exactly |
//! | [`keys`] | keyframes of the user for the pack |
//! | [`frames`] | frames of the pack for the user |
//! | [`body`] | columns of an answer on the body of another pack |
//! | [`segment`], [`path`] | in-betweens; motions along paths and of words |
//! | [`calls`] | `troupe.v1.Skeletons` |

mod body;
mod calls;
mod frames;
mod keys;
mod path;
mod pins;
mod segment;

pub(crate) use path::{OwnAnswer, take_generate};
pub(crate) use segment::{OwnSegment, take_in_between};

use std::sync::Arc;

use troupe_base::offload::offload;
use troupe_live::packs::LoadedPack;
use troupe_live::skeleton::Worn;

use crate::{Service, ServiceError};

impl Service {
    /// The skeleton called `name` on a body of a pack. None for an empty name. The first call for a
    /// body takes milliseconds, in the pool for blocking work.
    pub(crate) async fn worn(
        &self,
        name: &str,
        (loaded, place): (&LoadedPack, usize),
    ) -> Result<Option<Arc<Worn>>, ServiceError> {
        if name.is_empty() {
            return Ok(None);
        }
        let space = self.space()?.clone();
        let (name, pack) = (name.to_owned(), loaded.pack.name().to_owned());
        let worn = offload(usize::MAX, 0, move || {
            let table = space.packs.table();
            let loaded = table.find("pack", &pack)?;
            space
                .store
                .skeletons()
                .worn("skeleton", &name, (loaded, place), &table)
        });
        Ok(Some(worn.await??))
    }
}
