//! What each tenant has of its own: sessions, added styles, scenes and object definitions. Those of
//! one do not exist for another.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError, RwLock, RwLockReadGuard};

use super::{LivePacks, Sessions};
use crate::world::{Folders, Store};
use troupe_base::tenant::Tenant;

/// Between a tenant and what it names, in the names of records. Neither has it in its name.
const BETWEEN: char = '/';

/// One tenant's own.
#[derive(Debug)]
pub struct Space {
    /// Whose it is.
    pub tenant: Tenant,
    /// The packs, with its styles.
    pub packs: LivePacks,
    /// Its scenes and definitions.
    pub store: Arc<Store>,
    /// Its sessions.
    pub sessions: Arc<Sessions>,
}

impl Space {
    /// The name of a record of this tenant.
    pub(super) fn record_name(&self, name: &str) -> String {
        match &self.tenant {
            Some(tenant) => format!("{tenant}{BETWEEN}{name}"),
            None => name.to_owned(),
        }
    }
}

/// Whose record has this name, and what it is called there.
pub(super) fn of_record(name: &str) -> (Tenant, &str) {
    match name.split_once(BETWEEN) {
        Some((tenant, name)) => (Some(tenant.into()), name),
        None => (None, name),
    }
}

/// Where tenants keep their own, and how many there may be.
#[derive(Debug, Clone, Default)]
pub struct TenantOptions {
    /// A folder with a folder for each. `None`: what they upload lasts until the server stops.
    pub folder: Option<PathBuf>,
    /// Most tenants at a time.
    pub most: usize,
}

/// Why a tenant is not served.
#[derive(Debug, Clone, thiserror::Error)]
pub enum SpaceError {
    /// The server has no room for another tenant.
    #[error("the server has no room for another tenant; allowed: at most {most}")]
    TooMany {
        /// Most tenants of a server.
        most: usize,
    },
    /// The tenant's files cannot be read. The reason names files of the server, so it is only in
    /// the log.
    #[error("the files of tenant {tenant:?} cannot be read; the server's log has the reason")]
    Unreadable {
        /// Name of the tenant.
        tenant: Arc<str>,
    },
}

/// Added styles take of the memory of uploads.
fn count_styles(packs: &LivePacks, store: &Store) {
    for table in packs.table().all().flat_map(|loaded| &loaded.styles) {
        store.memory().count(table);
    }
}

/// What all tenants have.
#[derive(Debug)]
pub struct Spaces {
    /// That of callers without a tenant.
    common: Arc<Space>,
    tenants: RwLock<ByTenant>,
    /// One is made at a time.
    making: Mutex<()>,
    options: TenantOptions,
}

type ByTenant = BTreeMap<Arc<str>, Arc<Space>>;

impl Spaces {
    /// With that of callers without a tenant; those of others are made when they are asked for.
    pub fn new(packs: LivePacks, store: Arc<Store>, sessions: Arc<Sessions>, options: TenantOptions) -> Self {
        count_styles(&packs, &store);
        Self {
            common: Arc::new(Space {
                tenant: None,
                packs,
                store,
                sessions,
            }),
            tenants: RwLock::default(),
            making: Mutex::default(),
            options,
        }
    }

    fn read(&self) -> RwLockReadGuard<'_, ByTenant> {
        self.tenants.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// That of callers without a tenant.
    pub fn common(&self) -> &Arc<Space> {
        &self.common
    }

    /// That of `tenant`, if it is there already.
    pub fn known(&self, tenant: &Tenant) -> Option<Arc<Space>> {
        match tenant {
            None => Some(self.common.clone()),
            Some(tenant) => self.read().get(tenant).cloned(),
        }
    }

    /// That of `tenant`. The first time this reads its files, which blocks.
    ///
    /// # Errors
    /// [`SpaceError`].
    pub fn of(&self, tenant: &Tenant) -> Result<Arc<Space>, SpaceError> {
        if let Some(space) = self.known(tenant) {
            return Ok(space);
        }
        let Some(name) = tenant else {
            return Ok(self.common.clone());
        };
        // Files are read under this lock alone, so that callers of other tenants do not wait for
        // them.
        let making = self.making.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(space) = self.known(tenant) {
            return Ok(space);
        }
        let most = self.options.most;
        if self.read().len() >= most {
            return Err(SpaceError::TooMany { most });
        }
        let space = Arc::new(self.make(name)?);
        let mut tenants = self.tenants.write().unwrap_or_else(PoisonError::into_inner);
        tenants.insert(name.clone(), space.clone());
        drop(making);
        Ok(space)
    }

    fn make(&self, tenant: &Arc<str>) -> Result<Space, SpaceError> {
        let folder = self.options.folder.as_ref().map(|all| all.join(&**tenant));
        let inside = |name: &str| folder.as_ref().map(|folder| folder.join(name));
        let styles = inside("styles");
        let packs = self.common.packs.of_tenant(styles.as_deref());
        let unreadable = |error: &dyn std::fmt::Display| {
            tracing::error!(%error, %tenant, "the files of a tenant cannot be read");
            SpaceError::Unreadable {
                tenant: tenant.clone(),
            }
        };
        let packs = packs.map_err(|error| unreadable(&error))?;
        let folders = Folders {
            scenes: inside("scenes"),
            objects: inside("objects"),
        };
        let rigs = packs.table().all().map(|loaded| &*loaded.pack.rig);
        let store = self.common.store.beside(folders, rigs);
        let store = store.map_err(|error| unreadable(&error))?;
        count_styles(&packs, &store);
        let tenant = Some(tenant.clone());
        Ok(Space {
            sessions: Arc::new(self.common.sessions.of_tenant(tenant.clone())),
            tenant,
            packs,
            store: Arc::new(store),
        })
    }

    /// All that there are.
    pub fn all(&self) -> Vec<Arc<Space>> {
        let tenants = self.read();
        let all = std::iter::once(&self.common).chain(tenants.values());
        all.cloned().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_is_named_for_its_tenant() {
        assert_eq!(of_record("walker-1"), (None, "walker-1"));
        assert_eq!(of_record("studio/walker-1"), (Some("studio".into()), "walker-1"));
    }
}
