//! The data of each tenant: sessions, added styles, scenes and object definitions. A tenant cannot
//! see the data of another.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, RwLock, RwLockReadGuard};

use super::uploads::SharedUploads;
use super::{LivePacks, Sessions};
use crate::packs::{LoadedPack, Shape};
use crate::world::{Folders, LoadError, Store};
use troupe_base::tenant::Tenant;
use troupe_character::style::StyleTable;

/// Separates tenant and name in the name of a record. It cannot occur in either.
const BETWEEN: char = '/';

/// The data of one tenant.
#[derive(Debug)]
pub struct Space {
    /// `None` for callers without a tenant.
    pub tenant: Tenant,
    /// The server's packs with the tenant's styles.
    pub packs: LivePacks,
    /// Scenes and object definitions.
    pub store: Arc<Store>,
    /// The tenant's open sessions.
    pub sessions: Arc<Sessions>,
    /// Rises with every use of any space, so the space with the lowest number is idle for longest.
    used: AtomicU64,
}

impl Space {
    /// The name of this tenant's record for the session or scene `name`.
    pub(super) fn record_name(&self, name: &str) -> String {
        record_name(&self.tenant, name)
    }

    /// Whether the tenant has no sessions, scenes, uploads, calls and streams. `self` is the only
    /// handle then.
    fn is_empty(self: &Arc<Self>) -> bool {
        let handles = [
            Arc::strong_count(self),
            Arc::strong_count(&self.sessions),
            Arc::strong_count(&self.store),
        ];
        handles == [1; 3]
            && self.sessions.registry().page(None, 1).1 == 0
            && self.store.scenes().all().is_empty()
            && self.store.definitions().snapshot().iter().len() == 0
            && self.store.skeletons().count() == 0
            && self.added_styles() == 0
            && self.store.journal().is_empty()
    }

    fn added_styles(&self) -> usize {
        let packs = self.packs.table();
        let tables = packs.all().flat_map(|loaded| &loaded.styles);
        let added = |table: &Arc<StyleTable>| table.list().iter().filter(|style| !style.built_in).count();
        tables.map(added).sum()
    }
}

/// The name of a tenant's record for the session or scene `name`.
pub(super) fn record_name(tenant: &Tenant, name: &str) -> String {
    match tenant {
        Some(tenant) => format!("{tenant}{BETWEEN}{name}"),
        None => name.to_owned(),
    }
}

/// Splits the name of a record into the tenant and the name of the session or scene.
pub(super) fn of_record(name: &str) -> (Tenant, &str) {
    match name.split_once(BETWEEN) {
        Some((tenant, name)) => (Some(tenant.into()), name),
        None => (None, name),
    }
}

/// Options for tenants.
#[derive(Debug, Clone, Default)]
pub struct TenantOptions {
    /// Has a subfolder for each tenant. `None`: uploads are lost when the server stops.
    pub folder: Option<PathBuf>,
    /// Maximum number of tenants at the same time. One without sessions, scenes, uploads, calls and
    /// streams makes room for another.
    pub most: usize,
}

/// Why a tenant is not served.
#[derive(Debug, Clone, thiserror::Error)]
pub enum SpaceError {
    /// The server has no room for another tenant.
    #[error(
        "the server has no room for another tenant; allowed: at most {most} that have sessions, scenes, uploads, \
         calls or streams"
    )]
    TooMany {
        /// Maximum number of tenants.
        most: usize,
    },
    /// The tenant's files cannot be read. Only the log has the reason, because it names files of
    /// the server.
    #[error("the files of tenant {tenant:?} cannot be read; the server's log has the reason")]
    Unreadable {
        /// The tenant, as its key names it.
        tenant: Arc<str>,
    },
}

/// Counts added styles as memory of uploads.
fn count_styles<'a>(packs: impl IntoIterator<Item = &'a Arc<LoadedPack>>, store: &Store) {
    for table in packs.into_iter().flat_map(|loaded| &loaded.styles) {
        store.memory().count(table);
    }
}

fn unreadable(tenant: &Arc<str>, error: &dyn std::fmt::Display) -> SpaceError {
    tracing::error!(%error, %tenant, "the files of a tenant cannot be read");
    SpaceError::Unreadable {
        tenant: tenant.clone(),
    }
}

/// The data of all tenants.
#[derive(Debug)]
pub struct Spaces {
    /// For callers without a tenant.
    common: Arc<Space>,
    tenants: RwLock<ByTenant>,
    /// Held while a space is made or packs change, so that only one is made at a time, and all have
    /// the same packs. It has the shapes of packs that were served before.
    making: Mutex<Shapes>,
    uses: AtomicU64,
    options: TenantOptions,
    /// Empty unless other servers share the store.
    uploads: OnceLock<Arc<SharedUploads>>,
}

/// By the names of packs.
type Shapes = BTreeMap<String, Shape>;

type ByTenant = BTreeMap<Arc<str>, Arc<Space>>;

impl Spaces {
    /// Starts with the space of callers without a tenant. Other spaces are made on first use.
    pub fn new(packs: LivePacks, store: Arc<Store>, sessions: Arc<Sessions>, options: TenantOptions) -> Self {
        count_styles(packs.table().all(), &store);
        Self {
            common: Arc::new(Space {
                tenant: None,
                packs,
                store,
                sessions,
                used: AtomicU64::default(),
            }),
            tenants: RwLock::default(),
            making: Mutex::default(),
            uses: AtomicU64::default(),
            options,
            uploads: OnceLock::new(),
        }
    }

    fn read(&self) -> RwLockReadGuard<'_, ByTenant> {
        self.tenants.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// The space of callers without a tenant.
    pub fn common(&self) -> &Arc<Space> {
        &self.common
    }

    /// The space of `tenant`, if it was made already.
    pub fn known(&self, tenant: &Tenant) -> Option<Arc<Space>> {
        match tenant {
            None => Some(self.common.clone()),
            Some(tenant) => {
                let space = self.read().get(tenant).cloned()?;
                let use_number = self.uses.fetch_add(1, Ordering::Relaxed);
                space.used.store(use_number, Ordering::Relaxed);
                Some(space)
            }
        }
    }

    /// As [`Spaces::known`], without a use of it.
    pub(super) fn unused(&self, tenant: &Tenant) -> Option<Arc<Space>> {
        match tenant {
            None => Some(self.common.clone()),
            Some(tenant) => self.read().get(tenant).cloned(),
        }
    }

    /// The uploads that are shared with other servers. `None`: none are.
    pub(super) fn uploads(&self) -> Option<&Arc<SharedUploads>> {
        self.uploads.get()
    }

    /// From now on, uploads of all tenants are shared with other servers. Only the first call
    /// counts.
    pub(super) fn share_uploads(&self, uploads: SharedUploads) {
        let _one = self.making();
        self.uploads.get_or_init(|| Arc::new(uploads));
        self.all().for_each(|space| space.store.journal().share());
    }

    /// The space of `tenant`. The first call for a tenant reads its files and what other servers
    /// share, which blocks. If there are too many tenants, the one makes room that has nothing and
    /// is idle for longest.
    ///
    /// # Errors
    /// [`SpaceError`] if there are too many tenants, or a file cannot be read.
    pub fn of(&self, tenant: &Tenant) -> Result<Arc<Space>, SpaceError> {
        if let Some(space) = self.known(tenant) {
            return Ok(space);
        }
        let Some(name) = tenant else {
            return Ok(self.common.clone());
        };
        // Files are read without the lock of `tenants`, so callers of other tenants do not wait.
        let making = self.making();
        if let Some(space) = self.known(tenant) {
            return Ok(space);
        }
        self.make_room()?;
        let space = Arc::new(self.make(name)?);
        if let Some(uploads) = self.uploads() {
            space.store.journal().share();
            uploads.load(&space);
        }
        let mut tenants = self.tenants.write().unwrap_or_else(PoisonError::into_inner);
        tenants.insert(name.clone(), space.clone());
        drop(making);
        Ok(space)
    }

    fn make_room(&self) -> Result<(), SpaceError> {
        // Handles are only made under the lock, so an empty space stays empty.
        let mut tenants = self.tenants.write().unwrap_or_else(PoisonError::into_inner);
        let most = self.options.most;
        if tenants.len() < most {
            return Ok(());
        }
        let empty = tenants.iter().filter(|(_, space)| space.is_empty());
        let idle = empty.min_by_key(|(_, space)| space.used.load(Ordering::Relaxed));
        let name = idle
            .map(|(name, _)| name.clone())
            .ok_or(SpaceError::TooMany { most })?;
        tenants.remove(&name);
        tracing::debug!(tenant = %name, "an idle tenant makes room for another");
        Ok(())
    }

    /// A folder of a tenant.
    fn folder_of(&self, tenant: &Arc<str>, name: &str) -> Option<PathBuf> {
        let all = self.options.folder.as_ref()?;
        Some(all.join(&**tenant).join(name))
    }

    fn make(&self, tenant: &Arc<str>) -> Result<Space, SpaceError> {
        let inside = |name: &str| self.folder_of(tenant, name);
        let packs = self.common.packs.of_tenant(inside("styles").as_deref());
        let packs = packs.map_err(|error| unreadable(tenant, &error))?;
        let folders = Folders {
            scenes: inside("scenes"),
            objects: inside("objects"),
            skeletons: inside("skeletons"),
        };
        let table = packs.table();
        let rigs = table.all().map(|loaded| &*loaded.pack.rig);
        let store = self.common.store.beside(folders, rigs);
        let store = store.map_err(|error| unreadable(tenant, &error))?;
        count_styles(table.all(), &store);
        let tenant = Some(tenant.clone());
        Ok(Space {
            sessions: Arc::new(self.common.sessions.of_tenant(tenant.clone())),
            tenant,
            packs,
            store: Arc::new(store),
            used: AtomicU64::new(self.uses.fetch_add(1, Ordering::Relaxed)),
        })
    }

    fn making(&self) -> MutexGuard<'_, Shapes> {
        self.making.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// All spaces. The iterator holds one at a time: a space that is held cannot make room.
    pub fn all(&self) -> impl Iterator<Item = Arc<Space>> {
        let tenants: Vec<_> = self.read().keys().cloned().collect();
        let others = tenants.into_iter();
        let others = others.filter_map(|tenant| self.read().get(&tenant).cloned());
        std::iter::once(self.common.clone()).chain(others)
    }
}

mod change;

pub use change::ChangeError;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_named_for_its_tenant() {
        assert_eq!(of_record("walker-1"), (None, "walker-1"));
        assert_eq!(of_record("studio/walker-1"), (Some("studio".into()), "walker-1"));
    }
}
