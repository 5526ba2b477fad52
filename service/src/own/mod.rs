//! Requests on a skeleton of the user's own. They become requests on the pack's skeleton, and their
//! answers come back on the user's.
//!
//! | files, bottom up | hold |
//! |---|---|
//! | [`pins`] | poses that the user gave, which frames meet exactly |
//! | [`keys`] | keyframes of the user for the pack |
//! | [`frames`] | frames of the pack for the user |
//! | [`segment`], [`path`] | in-betweens; motions along paths and of words |
//! | [`calls`] | `troupe.v1.Skeletons` |

mod calls;
mod frames;
mod keys;
mod path;
mod pins;
mod segment;

pub(crate) use path::{OwnAnswer, take_generate};
pub(crate) use segment::{OwnSegment, take_in_between};

use std::sync::Arc;

use troupe_live::packs::LoadedPack;
use troupe_live::skeleton::Worn;

use crate::{Service, ServiceError};

impl Service {
    /// The skeleton called `name` on a body of a pack. None for an empty name.
    pub(crate) fn worn(
        &self,
        name: &str,
        of: (&LoadedPack, usize),
    ) -> Result<Option<Arc<Worn>>, ServiceError> {
        if name.is_empty() {
            return Ok(None);
        }
        let space = self.space()?;
        let skeletons = space.store.skeletons();
        Ok(Some(skeletons.worn("skeleton", name, of, space.packs.table())?))
    }
}
