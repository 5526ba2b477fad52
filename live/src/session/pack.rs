//! Packs as sessions know them: with what their characters' plans are measured by.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex};

use super::metrics::SessionMetrics;
use super::words::Places;
use super::{SessionError, WordsPacks};
use crate::packs::{LoadedPack, PackTable};
use troupe_base::telemetry::{Seldom, Telemetry};
use troupe_character::live::load::PlanLoad;
use troupe_character::style::{StyleError, StyleTable};
use troupe_motion::model::{Body, Rig};

/// A pack and one of its bodies with a tenant's styles, and what the sessions of all tenants and
/// bodies share of it.
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
    /// The packs whose words its characters can act out.
    pub words: Arc<WordsPacks>,
    /// Place of the body among the pack's.
    place: usize,
}

impl LivePack {
    /// A pack without sessions, with the first of its bodies.
    pub fn new(loaded: Arc<LoadedPack>, telemetry: &Telemetry) -> Self {
        let version = &loaded.pack.manifest.version;
        Self {
            metrics: Arc::new(SessionMetrics::new(telemetry, loaded.pack.name(), version)),
            failures: Arc::default(),
            load: Arc::default(),
            words: Arc::default(),
            loaded,
            place: 0,
        }
    }

    /// The same pack, as `loaded` has it, with another body, whose characters can act out `words`.
    fn of(&self, loaded: &Arc<LoadedPack>, place: usize, words: WordsPacks) -> Self {
        Self {
            loaded: loaded.clone(),
            metrics: self.metrics.clone(),
            failures: self.failures.clone(),
            load: self.load.clone(),
            words: Arc::new(words),
            place,
        }
    }

    /// The pack's name.
    pub fn name(&self) -> &str {
        self.loaded.pack.name()
    }

    /// The body of its characters, for packs of many.
    pub fn body(&self) -> Option<&Arc<Body>> {
        self.loaded.pack.bodies.get(self.place)
    }

    /// The name of the body; empty for packs of one skeleton.
    pub fn body_name(&self) -> &str {
        self.body().map_or("", |body| &body.name)
    }

    /// The skeleton of its characters, and how they are planned for.
    pub fn rig(&self) -> &Arc<Rig> {
        self.loaded.rig(self.place)
    }

    /// The styles of its characters.
    pub fn styles(&self) -> &Arc<StyleTable> {
        &self.loaded.styles[self.place]
    }
}

/// By the pack's name, in the order of its bodies.
type ByName = BTreeMap<String, Vec<Arc<LivePack>>>;

/// All packs of a server, with their sessions. Clones share them.
#[derive(Debug, Clone)]
pub struct LivePacks {
    table: PackTable,
    by_name: Arc<ByName>,
    /// Places for characters that act out words.
    places: Places,
}

impl LivePacks {
    /// Those of `table`, without sessions.
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

    /// The same packs for a tenant, with added styles of its own, kept in `folder`.
    ///
    /// # Errors
    /// [`StyleError`] where its styles cannot be read.
    pub fn of_tenant(&self, folder: Option<&Path>) -> Result<Self, StyleError> {
        let table = self.table.of_tenant(folder.map(Path::to_owned))?;
        Ok(Self::of(table, self.places.clone(), |loaded| {
            self.by_name[loaded.pack.name()][0].of(loaded, 0, WordsPacks::default())
        }))
    }

    /// The packs themselves.
    pub fn table(&self) -> &PackTable {
        &self.table
    }

    /// A pack with one of its bodies. The request named them in the fields `pack` and `body` of
    /// `path`; the defaults where they are empty.
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
