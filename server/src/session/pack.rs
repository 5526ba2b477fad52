//! Packs as sessions know them: with what their characters' plans are measured by.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use super::metrics::SessionMetrics;
use crate::packs::{LoadedPack, PackTable, UnknownPack};
use crate::telemetry::{Seldom, Telemetry};
use troupe_character::live::load::PlanLoad;
use troupe_motion::model::Rig;

/// A pack and its sessions.
#[derive(Debug)]
pub struct LivePack {
    /// The pack.
    pub loaded: Arc<LoadedPack>,
    /// The metrics of its sessions.
    pub metrics: SessionMetrics,
    /// When it was last told that a plan failed.
    pub failures: Mutex<Seldom>,
    /// How busy it is with their plans.
    pub load: PlanLoad,
}

impl LivePack {
    /// A pack without sessions.
    pub fn new(loaded: Arc<LoadedPack>, telemetry: &Telemetry) -> Self {
        let version = &loaded.pack.manifest.version;
        Self {
            metrics: SessionMetrics::new(telemetry, loaded.pack.name(), version),
            failures: Mutex::default(),
            load: PlanLoad::default(),
            loaded,
        }
    }

    /// The skeleton of its characters, and how they are planned for.
    pub fn rig(&self) -> &Arc<Rig> {
        &self.loaded.pack.rig
    }
}

/// All packs of a server, with their sessions. Clones share them.
#[derive(Debug, Clone)]
pub struct LivePacks {
    table: PackTable,
    by_name: Arc<BTreeMap<String, Arc<LivePack>>>,
}

impl LivePacks {
    /// Those of `table`, without sessions.
    pub fn new(table: PackTable, telemetry: &Telemetry) -> Self {
        let live = |loaded: &Arc<LoadedPack>| {
            let pack = LivePack::new(loaded.clone(), telemetry);
            (loaded.pack.name().to_owned(), Arc::new(pack))
        };
        let by_name = Arc::new(table.all().map(live).collect());
        Self { table, by_name }
    }

    /// The packs themselves.
    pub fn table(&self) -> &PackTable {
        &self.table
    }

    /// [`PackTable::find`].
    ///
    /// # Errors
    /// [`UnknownPack`].
    pub fn find(&self, field: impl ToString, name: &str) -> Result<&Arc<LivePack>, UnknownPack> {
        let loaded = self.table.find(field, name)?;
        Ok(&self.by_name[loaded.pack.name()])
    }
}
