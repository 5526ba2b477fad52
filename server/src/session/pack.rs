//! Packs as sessions know them: with what their characters' plans are measured by.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex};

use super::metrics::SessionMetrics;
use crate::packs::{LoadedPack, PackTable, UnknownPack};
use crate::telemetry::{Seldom, Telemetry};
use troupe_character::live::load::PlanLoad;
use troupe_character::style::StyleError;
use troupe_motion::model::Rig;

/// A pack with a tenant's styles, and what the sessions of all tenants share of it.
#[derive(Debug)]
pub struct LivePack {
    /// The pack.
    pub loaded: Arc<LoadedPack>,
    /// The metrics of its sessions.
    pub metrics: Arc<SessionMetrics>,
    /// When it was last told that a plan failed.
    pub failures: Arc<Mutex<Seldom>>,
    /// How busy it is with their plans.
    pub load: Arc<PlanLoad>,
}

impl LivePack {
    /// A pack without sessions.
    pub fn new(loaded: Arc<LoadedPack>, telemetry: &Telemetry) -> Self {
        let version = &loaded.pack.manifest.version;
        Self {
            metrics: Arc::new(SessionMetrics::new(telemetry, loaded.pack.name(), version)),
            failures: Arc::default(),
            load: Arc::default(),
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

    /// The same packs for a tenant, with added styles of its own, kept in `folder`.
    ///
    /// # Errors
    /// [`StyleError`] where its styles cannot be read.
    pub fn of_tenant(&self, folder: Option<&Path>) -> Result<Self, StyleError> {
        let styles = |loaded: &LoadedPack| {
            let folder = folder.map(Path::to_owned);
            loaded.styles.beside(&loaded.pack.rig, folder)
        };
        let table = self.table.with_styles(styles)?;
        let live = |loaded: &Arc<LoadedPack>| {
            let name = loaded.pack.name().to_owned();
            let common = &self.by_name[&name];
            let pack = LivePack {
                loaded: loaded.clone(),
                metrics: common.metrics.clone(),
                failures: common.failures.clone(),
                load: common.load.clone(),
            };
            (name, Arc::new(pack))
        };
        let by_name = Arc::new(table.all().map(live).collect());
        Ok(Self { table, by_name })
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
