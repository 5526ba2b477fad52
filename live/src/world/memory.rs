//! What clients have uploaded and the server holds in memory, all tenants together: scenes, object
//! definitions, styles.

use std::fmt::Debug;
use std::sync::{Arc, Mutex, PoisonError, Weak};

use troupe_character::object::Definitions;
use troupe_character::scene::SceneTable;
use troupe_character::style::StyleTable;

/// Something that holds uploads.
pub trait Holder: Debug + Send + Sync {
    /// About how much memory they take, bytes.
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

/// Uploads would take more memory than they may.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "takes about {bytes} bytes, and all other scenes, definitions and styles {taken}; allowed: at most {most} in all (max_scene_memory_mib)"
)]
pub struct NoMemory {
    /// What the new one takes.
    pub bytes: usize,
    /// What the others take.
    pub taken: usize,
    /// What all may take.
    pub most: usize,
}

/// The memory that all uploads of a server share.
#[derive(Debug)]
pub struct UploadMemory {
    max_bytes: usize,
    holders: Mutex<Vec<Weak<dyn Holder>>>,
}

impl UploadMemory {
    /// Of so many bytes.
    pub fn new(max_bytes: usize) -> Self {
        Self {
            max_bytes,
            holders: Mutex::default(),
        }
    }

    /// Counts what `holder` holds, as long as it is there.
    pub fn count<H: Holder + 'static>(&self, holder: &Arc<H>) {
        let holder: Weak<H> = Arc::downgrade(holder);
        let mut holders = self.holders.lock().unwrap_or_else(PoisonError::into_inner);
        holders.retain(|holder| holder.strong_count() > 0);
        holders.push(holder);
    }

    /// Whether there is room for `bytes` in the place of `replaced`. Two that ask at the same time
    /// may both get the last room.
    ///
    /// # Errors
    /// [`NoMemory`].
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
