//! The packs that a server has loaded.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::batch::{Batcher, PackMetrics};
use troupe_character::style::StyleTable;
use troupe_engine::pack::Pack;
use troupe_motion::model::Capability;

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
    pub styles: Arc<StyleTable>,
    /// Its metrics.
    pub metrics: PackMetrics,
}

/// A pack that is not loaded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown pack {name:?}; loaded: {}", loaded.join(", "))]
pub struct UnknownPack {
    /// The name that was asked for.
    pub name: String,
    /// The field of the request that named it.
    pub field: String,
    /// The names that there are.
    pub loaded: Vec<String>,
}

/// A pack that cannot do what is asked of it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "the pack {pack} cannot do this: it has no capability {wanted}; it has: {}",
    names(can)
)]
pub struct CannotDo {
    /// The pack's name.
    pub pack: String,
    /// What it would need.
    pub wanted: Capability,
    /// The field of the request that named it.
    pub field: String,
    /// What it can do.
    pub can: Vec<Capability>,
}

fn names(capabilities: &[Capability]) -> String {
    let names: Vec<&str> = capabilities.iter().map(|able| able.name()).collect();
    names.join(", ")
}

impl LoadedPack {
    /// Checks that the pack can do what the request asks for; `field` names the pack in the request.
    ///
    /// # Errors
    /// [`CannotDo`].
    pub fn require(&self, capability: Capability, field: impl ToString) -> Result<(), CannotDo> {
        let capabilities = self.pack.manifest.capabilities;
        match capabilities.has(capability) {
            true => Ok(()),
            false => Err(CannotDo {
                pack: self.pack.name().to_owned(),
                wanted: capability,
                field: field.to_string(),
                can: capabilities.list().collect(),
            }),
        }
    }

    /// The pack with other styles.
    pub fn with_styles(&self, styles: StyleTable) -> Self {
        Self {
            pack: self.pack.clone(),
            batcher: self.batcher.clone(),
            engine: self.engine,
            styles: Arc::new(styles),
            metrics: self.metrics.clone(),
        }
    }
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

    /// A table of the same packs with other styles.
    ///
    /// # Errors
    /// That of `styles`.
    pub fn with_styles<E>(&self, styles: impl Fn(&LoadedPack) -> Result<StyleTable, E>) -> Result<Self, E> {
        let of = |loaded: &Arc<LoadedPack>| {
            let name = loaded.pack.name().to_owned();
            Ok((name, Arc::new(loaded.with_styles(styles(loaded)?))))
        };
        Ok(Self {
            packs: self.all().map(of).collect::<Result<_, E>>()?,
            default: self.default.clone(),
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
