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

    /// Counts the uploads of `holder` until it is dropped. A holder that is counted already counts
    /// once: a pack that takes the place of another has its styles.
    pub fn count<H: Holder + 'static>(&self, holder: &Arc<H>) {
        let holder: Weak<H> = Arc::downgrade(holder);
        let mut holders = self.holders.lock().unwrap_or_else(PoisonError::into_inner);
        holders.retain(|holder| holder.strong_count() > 0);
        let is_it = |other: &Weak<dyn Holder>| std::ptr::addr_eq(other.as_ptr(), holder.as_ptr());
        if !holders.iter().any(is_it) {
            holders.push(holder);
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug)]
    struct Bytes(usize);

    impl Holder for Bytes {
        fn bytes(&self) -> usize {
            self.0
        }
    }

    #[test]
    fn a_holder_counts_once_and_until_it_is_dropped() {
        let memory = UploadMemory::new(10);
        let (one, other) = (Arc::new(Bytes(4)), Arc::new(Bytes(1)));
        for holder in [&one, &other, &one] {
            memory.count(holder);
        }
        assert_eq!(memory.check(5, 0), Ok(()));
        assert_eq!(memory.check(6, 0).unwrap_err().taken, 5);
        drop(one);
        assert_eq!(memory.check(9, 0), Ok(()));
    }
}
