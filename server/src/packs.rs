//! The packs that a server has loaded.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::batch::{Batcher, PackMetrics};
use troupe_character::style::StyleTable;
use troupe_engine::pack::Pack;

/// Most characters of a pack's name that an error echoes.
const MAX_ECHO: usize = 64;

/// A pack and the way to its engine.
#[derive(Debug)]
pub struct LoadedPack {
    /// The pack.
    pub pack: Arc<Pack>,
    /// The way to its engine.
    pub batcher: Batcher,
    /// The engine's name.
    pub engine: &'static str,
    /// Its locomotion styles.
    pub styles: StyleTable,
    /// Its metrics.
    pub metrics: PackMetrics,
}

/// A pack that is not loaded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no pack {name:?}; loaded: {}", loaded.join(", "))]
pub struct UnknownPack {
    /// The name that was asked for.
    pub name: String,
    /// The field of the request that named it.
    pub field: String,
    /// The names that there are.
    pub loaded: Vec<String>,
}

/// All packs of a server.
#[derive(Debug, Clone)]
pub struct PackTable {
    packs: BTreeMap<String, Arc<LoadedPack>>,
    default: String,
}

impl PackTable {
    /// A table whose default is `default`, one of the names of `packs`.
    pub fn new(packs: Vec<LoadedPack>, default: String) -> Self {
        let packs = packs
            .into_iter()
            .map(|loaded| (loaded.pack.name().to_owned(), Arc::new(loaded)))
            .collect();
        Self { packs, default }
    }

    /// The pack of that name, which the request gave in `field`; the default where it is empty.
    ///
    /// # Errors
    /// [`UnknownPack`].
    pub fn find(&self, field: impl ToString, name: &str) -> Result<&Arc<LoadedPack>, UnknownPack> {
        let wanted = if name.is_empty() { &self.default } else { name };
        self.packs.get(wanted).ok_or_else(|| UnknownPack {
            name: wanted.chars().take(MAX_ECHO).collect(),
            field: field.to_string(),
            loaded: self.packs.keys().cloned().collect(),
        })
    }

    /// All of them, by name.
    pub fn all(&self) -> impl Iterator<Item = &Arc<LoadedPack>> {
        self.packs.values()
    }

    /// Whether a request that names no pack gets this one.
    pub fn is_default(&self, loaded: &LoadedPack) -> bool {
        loaded.pack.name() == self.default
    }
}
