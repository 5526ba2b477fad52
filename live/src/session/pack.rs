//! Packs, with the metrics and load that the sessions of a pack share.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError, RwLock, Weak};

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

/// A body of a pack as it serves now. All sessions of the body share it, so that they go on with
/// another version of the pack once that takes its place.
#[derive(Debug)]
pub(super) struct Serving(RwLock<Served>);

#[derive(Debug, Clone)]
struct Served {
    loaded: Arc<LoadedPack>,
    words: Arc<WordsPacks>,
}

impl Serving {
    fn new(loaded: Arc<LoadedPack>) -> Arc<Self> {
        let words = Arc::default();
        Arc::new(Self(RwLock::new(Served { loaded, words })))
    }

    fn now(&self) -> Served {
        self.0.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn set(&self, loaded: Arc<LoadedPack>, words: WordsPacks) {
        let words = Arc::new(words);
        let served = Served { loaded, words };
        let mut now = self.0.write().unwrap_or_else(PoisonError::into_inner);
        let before = std::mem::replace(&mut *now, served);
        drop(now);
        // Outside the lock: this may be the last holder of a pack.
        drop(before);
    }
}

/// One body of a pack with a tenant's styles. Metrics and load are shared by the sessions of all
/// tenants and bodies of the pack.
#[derive(Debug, Clone)]
pub struct LivePack {
    /// The metrics of its sessions.
    pub metrics: Arc<SessionMetrics>,
    /// Limits how often a failed plan is logged.
    pub failures: Arc<Mutex<Seldom>>,
    /// The measured load of the networks by plans.
    pub load: Arc<PlanLoad>,
    name: Arc<str>,
    rig: Arc<Rig>,
    body: Option<Arc<Body>>,
    serving: Arc<Serving>,
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
            name: loaded.pack.name().into(),
            rig: loaded.rig(0).clone(),
            body: loaded.pack.bodies.first().cloned(),
            serving: Serving::new(loaded),
            place: 0,
            worn: None,
        }
    }

    /// The body with index `place` of a tenant's `loaded`. It serves in the place of `before`, if
    /// there is that.
    fn of(&self, loaded: &Arc<LoadedPack>, place: usize, before: Option<&Self>) -> Self {
        let serving = before.map(|before| before.serving.clone());
        Self {
            rig: loaded.rig(place).clone(),
            body: loaded.pack.bodies.get(place).cloned(),
            serving: serving.unwrap_or_else(|| Serving::new(loaded.clone())),
            place,
            worn: None,
            ..self.clone()
        }
    }

    /// The same pack, whose characters wear a skeleton of the user's own.
    pub(crate) fn wearing(&self, worn: Arc<Worn>) -> Self {
        Self {
            worn: Some(worn),
            ..self.clone()
        }
    }

    /// Whether sessions of both count for the same version of the pack.
    pub(crate) fn is_version_of(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.metrics, &other.metrics) && Arc::ptr_eq(&self.serving, &other.serving)
    }

    /// The pack that serves now, with the tenant's styles.
    pub fn loaded(&self) -> Arc<LoadedPack> {
        self.serving.now().loaded
    }

    /// The packs that can turn sentences into motion for its characters.
    pub(super) fn words(&self) -> Arc<WordsPacks> {
        self.serving.now().words
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
            None => &self.rig.skeleton,
        }
    }

    /// Name of the pack, without that of the body.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The body of its characters. `None` for packs with one skeleton.
    pub fn body(&self) -> Option<&Arc<Body>> {
        self.body.as_ref()
    }

    /// Name of the body. Empty for packs with one skeleton.
    pub fn body_name(&self) -> &str {
        self.body().map_or("", |body| &body.name)
    }

    /// Skeleton, frame rate and dimensions of its characters.
    pub fn rig(&self) -> &Arc<Rig> {
        &self.rig
    }

    /// The styles of its characters.
    pub fn styles(&self) -> Arc<StyleTable> {
        self.loaded().styles[self.place].clone()
    }
}

/// By the pack's name: one entry per body, in the order of the bodies.
type ByName = BTreeMap<String, Vec<Arc<LivePack>>>;

/// All packs of a server, as sessions use them. Clones share them.
#[derive(Debug, Clone)]
pub struct LivePacks {
    now: Arc<RwLock<Arc<Listed>>>,
    /// Limits how many characters act out words at a time.
    places: Places,
    telemetry: Telemetry,
}

/// The packs that new requests get.
#[derive(Debug, Default)]
struct Listed {
    table: Arc<PackTable>,
    by_name: ByName,
    /// Bodies of packs that are not in the table any more, but may have sessions.
    left: Vec<(Arc<Rig>, Weak<Serving>)>,
}

impl LivePacks {
    /// The packs of `table`, without sessions.
    pub fn new(table: PackTable, telemetry: &Telemetry) -> Self {
        Self::of(Places::default(), table, None, telemetry)
    }

    fn of(places: Places, table: PackTable, common: Option<&Self>, telemetry: &Telemetry) -> Self {
        let packs = Self {
            now: Arc::default(),
            places,
            telemetry: telemetry.clone(),
        };
        packs.serve(table, common);
        packs
    }

    /// The same packs for a tenant, with the tenant's own styles, which `folder` keeps.
    ///
    /// # Errors
    /// [`StyleError`] if the tenant's styles cannot be read.
    pub fn of_tenant(&self, folder: Option<&Path>) -> Result<Self, StyleError> {
        let table = self.table().of_tenant(folder.map(Path::to_owned))?;
        Ok(Self::of(self.places.clone(), table, Some(self), &self.telemetry))
    }

    fn listed(&self) -> Arc<Listed> {
        self.now.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The packs without the data of sessions.
    pub fn table(&self) -> Arc<PackTable> {
        self.listed().table.clone()
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
    ) -> Result<Arc<LivePack>, SessionError> {
        let listed = self.listed();
        let loaded = listed.table.find(path.field("pack"), name)?;
        let place = loaded.place_of(path.field("body"), body)?;
        Ok(listed.by_name[loaded.pack.name()][place].clone())
    }

    /// New requests get the packs of `table` from now on. Sessions of a pack whose place another
    /// version takes make their next plans with that. Sessions of a pack that is not in the table
    /// go on with it. A tenant's packs share metrics and load with those of `common`. Only one
    /// caller at a time may do this.
    pub(super) fn serve(&self, table: PackTable, common: Option<&Self>) {
        let before = self.listed();
        let common = common.map(Self::listed);
        let mut by_name = ByName::new();
        for loaded in table.all() {
            let name = loaded.pack.name();
            let old = before.by_name.get(name);
            let base = match &common {
                Some(common) => common.by_name[name][0].clone(),
                None => Arc::new(self.base(loaded, old.map(|bodies| &*bodies[0]))),
            };
            let body = |place: usize| {
                let old = old.and_then(|bodies| bodies.get(place));
                match old.filter(|old| Arc::ptr_eq(&old.loaded(), loaded)) {
                    Some(same) => same.clone(),
                    None => Arc::new(base.of(loaded, place, old.map(|old| &**old))),
                }
            };
            by_name.insert(name.to_owned(), (0..loaded.styles.len()).map(body).collect());
        }
        let words = |rig: &Arc<Rig>| WordsPacks::new(&table, rig, &self.places);
        for live in by_name.values().flatten() {
            let loaded = table.get(live.name()).cloned().unwrap_or_else(|| live.loaded());
            live.serving.set(loaded, words(&live.rig));
        }
        let mut left: Vec<_> = before.left.clone();
        let gone = before
            .by_name
            .iter()
            .filter(|(name, _)| !by_name.contains_key(*name));
        let gone = gone.flat_map(|(_, bodies)| bodies);
        left.extend(gone.map(|live| (live.rig.clone(), Arc::downgrade(&live.serving))));
        left.retain(|(rig, serving)| {
            let serving = serving.upgrade();
            // Its sessions act out words of the packs that serve now, and let go of others.
            let set = serving.map(|serving| serving.set(serving.now().loaded, words(rig)));
            set.is_some()
        });
        let listed = Arc::new(Listed {
            table: Arc::new(table),
            by_name,
            left,
        });
        let mut now = self.now.write().unwrap_or_else(PoisonError::into_inner);
        let old = std::mem::replace(&mut *now, listed);
        drop(now);
        drop((old, before));
    }

    /// The first body of a pack. Its load is that of `old`, the version before, if there is one.
    fn base(&self, loaded: &Arc<LoadedPack>, old: Option<&LivePack>) -> LivePack {
        match old {
            Some(old) if Arc::ptr_eq(&old.loaded(), loaded) => old.clone(),
            Some(old) => LivePack {
                failures: old.failures.clone(),
                load: old.load.clone(),
                ..LivePack::new(loaded.clone(), &self.telemetry)
            },
            None => LivePack::new(loaded.clone(), &self.telemetry),
        }
    }
}

#[cfg(test)]
#[path = "pack_tests.rs"]
pub(super) mod tests;
