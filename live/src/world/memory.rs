//! The memory that uploads of all tenants share: scenes, object definitions, styles and skeletons.

use std::fmt::Debug;
use std::sync::{Arc, Mutex, PoisonError, Weak};

use troupe_character::object::Definitions;
use troupe_character::scene::SceneTable;
use troupe_character::style::StyleTable;

/// A table that holds uploads.
pub trait Holder: Debug + Send + Sync {
    /// Estimated memory of its uploads, bytes.
    fn bytes(&self) -> usize;
}

impl Holder for SceneTable {
    fn bytes(&self) -> usize {
        self.all().values().map(|cell| cell.snapshot().bytes()).sum()
    }
}

impl Holder for Definitions {
    fn bytes(&self) -> usize {
        let all = self.snapshot();
        all.iter().map(|listed| listed.definition.bytes()).sum()
    }
}

impl Holder for StyleTable {
    fn bytes(&self) -> usize {
        let all = self.list();
        all.iter()
            .filter(|style| !style.built_in)
            .map(|style| style.bytes())
            .sum()
    }
}

/// With a new upload, all uploads together would exceed their memory limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "takes about {bytes} bytes, and all other scenes, definitions, styles and skeletons take {taken}; \
     allowed: at most {most} in all (max_scene_memory_mib)"
)]
pub struct NoMemory {
    /// Estimated size of the new upload, bytes.
    pub bytes: usize,
    /// Estimated size of all other uploads, bytes.
    pub taken: usize,
    /// Limit for all uploads, bytes.
    pub most: usize,
}

/// The memory limit that all uploads of a server share.
#[derive(Debug)]
pub struct UploadMemory {
    max_bytes: usize,
    holders: Mutex<Vec<Weak<dyn Holder>>>,
}

impl UploadMemory {
    /// Makes a limit of `max_bytes`.
    pub fn new(max_bytes: usize) -> Self {
        Self {
            max_bytes,
            holders: Mutex::default(),
        }
    }

    /// Counts the uploads of `holder` until it is dropped.
    pub fn count<H: Holder + 'static>(&self, holder: &Arc<H>) {
        let holder: Weak<H> = Arc::downgrade(holder);
        let mut holders = self.holders.lock().unwrap_or_else(PoisonError::into_inner);
        holders.retain(|holder| holder.strong_count() > 0);
        holders.push(holder);
    }

    /// Checks that there is room for an upload of `bytes`, which replaces one of `replaced` bytes.
    /// Nothing is reserved, so two concurrent uploads can exceed the limit together.
    ///
    /// # Errors
    /// [`NoMemory`] if there is no room.
    pub fn check(&self, bytes: usize, replaced: usize) -> Result<(), NoMemory> {
        let holders = self.holders.lock().unwrap_or_else(PoisonError::into_inner);
        let all = holders.iter().filter_map(Weak::upgrade);
        let taken = all
            .map(|holder| holder.bytes())
            .sum::<usize>()
            .saturating_sub(replaced);
        match taken + bytes <= self.max_bytes {
            true => Ok(()),
            false => Err(NoMemory {
                bytes,
                taken,
                most: self.max_bytes,
            }),
        }
    }
}
