//! Packs, with the metrics and load that the sessions of a pack share.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex};

use super::metrics::SessionMetrics;
use super::words::Places;
use super::{SessionError, WordsPacks};
use crate::packs::{LoadedPack, PackTable};
use crate::skeleton::Worn;
use troupe_base::telemetry::{Seldom, Telemetry};
use troupe_character::live::load::PlanLoad;
use troupe_character::style::{StyleError, StyleTable};
use troupe_motion::Skeleton;
use troupe_motion::model::{Body, Rig};

/// One body of a pack with a tenant's styles. Metrics and load are shared by the sessions of all
/// tenants and bodies of the pack.
#[derive(Debug)]
pub struct LivePack {
    /// The pack, with the tenant's styles.
    pub loaded: Arc<LoadedPack>,
    /// The metrics of its sessions.
    pub metrics: Arc<SessionMetrics>,
    /// Limits how often a failed plan is logged.
    pub failures: Arc<Mutex<Seldom>>,
    /// The measured load of the networks by plans.
    pub load: Arc<PlanLoad>,
    /// The packs that can turn sentences into motion for its characters.
    pub words: Arc<WordsPacks>,
    /// Index of the body in the pack's bodies.
    place: usize,
    /// The skeleton of the user's own that its characters wear.
    worn: Option<Arc<Worn>>,
}

impl LivePack {
    /// Makes a pack without sessions, with its first body.
    pub fn new(loaded: Arc<LoadedPack>, telemetry: &Telemetry) -> Self {
        let version = &loaded.pack.manifest.version;
        Self {
            metrics: Arc::new(SessionMetrics::new(telemetry, loaded.pack.name(), version)),
            failures: Arc::default(),
            load: Arc::default(),
            words: Arc::default(),
            loaded,
            place: 0,
            worn: None,
        }
    }

    /// The same pack for a tenant's `loaded` and for the body with index `place`. Its characters
    /// can act out `words`.
    fn of(&self, loaded: &Arc<LoadedPack>, place: usize, words: WordsPacks) -> Self {
        Self {
            loaded: loaded.clone(),
            metrics: self.metrics.clone(),
            failures: self.failures.clone(),
            load: self.load.clone(),
            words: Arc::new(words),
            place,
            worn: None,
        }
    }

    /// The same pack, whose characters wear a skeleton of the user's own.
    pub(crate) fn wearing(&self, worn: Arc<Worn>) -> Self {
        Self {
            loaded: self.loaded.clone(),
            metrics: self.metrics.clone(),
            failures: self.failures.clone(),
            load: self.load.clone(),
            words: self.words.clone(),
            place: self.place,
            worn: Some(worn),
        }
    }

    /// Index of the body in the pack's bodies.
    pub(crate) fn place(&self) -> usize {
        self.place
    }

    /// The skeleton of the user's own that its characters wear.
    pub fn worn(&self) -> Option<&Arc<Worn>> {
        self.worn.as_ref()
    }

    /// The skeleton of keyframes and frames: what its characters wear, or the pack's.
    pub fn shown(&self) -> &Skeleton {
        match &self.worn {
            Some(worn) => worn.skeleton(),
            None => &self.rig().skeleton,
        }
    }

    /// Name of the pack, without that of the body.
    pub fn name(&self) -> &str {
        self.loaded.pack.name()
    }

    /// The body of its characters. `None` for packs with one skeleton.
    pub fn body(&self) -> Option<&Arc<Body>> {
        self.loaded.pack.bodies.get(self.place)
    }

    /// Name of the body. Empty for packs with one skeleton.
    pub fn body_name(&self) -> &str {
        self.body().map_or("", |body| &body.name)
    }

    /// Skeleton, frame rate and dimensions of its characters.
    pub fn rig(&self) -> &Arc<Rig> {
        self.loaded.rig(self.place)
    }

    /// The styles of its characters.
    pub fn styles(&self) -> &Arc<StyleTable> {
        &self.loaded.styles[self.place]
    }
}

/// By the pack's name: one entry per body, in the order of the bodies.
type ByName = BTreeMap<String, Vec<Arc<LivePack>>>;

/// All packs of a server, as sessions use them. Clones share metrics and load.
#[derive(Debug, Clone)]
pub struct LivePacks {
    table: PackTable,
    by_name: Arc<ByName>,
    /// Limits how many characters act out words at a time.
    places: Places,
}

impl LivePacks {
    /// The packs of `table`, without sessions.
    pub fn new(table: PackTable, telemetry: &Telemetry) -> Self {
        Self::of(table, Places::default(), |loaded| {
            LivePack::new(loaded.clone(), telemetry)
        })
    }

    fn of(table: PackTable, places: Places, live: impl Fn(&Arc<LoadedPack>) -> LivePack) -> Self {
        let all = |loaded: &Arc<LoadedPack>| {
            let first = live(loaded);
            let bodies = 0..loaded.styles.len();
            let packs = (bodies.map(|place| {
                let words = WordsPacks::new(&table, loaded.rig(place), &places);
                Arc::new(first.of(loaded, place, words))
            }))
            .collect();
            (loaded.pack.name().to_owned(), packs)
        };
        let by_name = Arc::new(table.all().map(all).collect());
        Self {
            table,
            by_name,
            places,
        }
    }

    /// The same packs for a tenant, with the tenant's own styles, which `folder` keeps.
    ///
    /// # Errors
    /// [`StyleError`] if the tenant's styles cannot be read.
    pub fn of_tenant(&self, folder: Option<&Path>) -> Result<Self, StyleError> {
        let table = self.table.of_tenant(folder.map(Path::to_owned))?;
        Ok(Self::of(table, self.places.clone(), |loaded| {
            self.by_name[loaded.pack.name()][0].of(loaded, 0, WordsPacks::default())
        }))
    }

    /// The packs without the data of sessions.
    pub fn table(&self) -> &PackTable {
        &self.table
    }

    /// Finds a pack and one of its bodies, named in the fields `pack` and `body` of `path`. An
    /// empty name means the default.
    ///
    /// # Errors
    /// [`SessionError::UnknownPack`] or [`SessionError::UnknownBody`].
    pub fn find(
        &self,
        path: &troupe_character::Path<'_>,
        name: &str,
        body: &str,
    ) -> Result<&Arc<LivePack>, SessionError> {
        let loaded = self.table.find(path.field("pack"), name)?;
        let place = loaded.place_of(path.field("body"), body)?;
        Ok(&self.by_name[loaded.pack.name()][place])
    }
}
