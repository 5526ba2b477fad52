//! All open sessions by tenant and id, and the ids of recently expired sessions.

use std::collections::{BTreeMap, HashMap, HashSet, VecDeque};
use std::ops::Bound;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::time::{Duration, Instant};

use super::SessionError;
use super::away::{Away, AwayTable};
use super::cell::{ClientPlace, SessionCell};
use super::id::MAX_ID_CHARS;
use super::metrics::Eviction;
use super::owner::End;
use troupe_base::tenant::Tenant;

/// Estimated maximum memory of an open session, bytes. A session that walks in the default pack was
/// measured at 38 KiB. A session in a scene also keeps events and keyframes. A path of 1,024 points
/// takes 28 KiB, twice if another one waits.
pub const MAX_SESSION_BYTES: u64 = 128 << 10;
/// Maximum number of remembered ids of expired sessions. They take a few megabytes.
const MAX_TOMBSTONES: usize = 65_536;

type ById = BTreeMap<Arc<str>, Arc<SessionCell>>;

/// The open sessions of one tenant. All tenants share the limit, but a registry finds only the
/// sessions of its own tenant.
#[derive(Debug)]
pub struct Registry {
    all: Arc<All>,
    tenant: Tenant,
}

/// The sessions of all tenants.
#[derive(Debug)]
struct All {
    open: RwLock<Open>,
    expired: Mutex<Tombstones>,
    /// Sessions that other servers have.
    away: Mutex<AwayTable>,
    limit: usize,
}

#[derive(Debug, Default)]
struct Open {
    of: HashMap<Tenant, ById>,
    count: usize,
}

impl Open {
    fn add(&mut self, tenant: &Tenant, cell: &Arc<SessionCell>) {
        let own = match self.of.get_mut(tenant) {
            Some(own) => own,
            None => self.of.entry(tenant.clone()).or_default(),
        };
        if own.insert(cell.id().clone(), cell.clone()).is_none() {
            self.count += 1;
        }
    }

    fn remove(&mut self, tenant: &Tenant, id: &str) -> Option<Arc<SessionCell>> {
        let own = self.of.get_mut(tenant)?;
        let removed = own.remove(id)?;
        if own.is_empty() {
            self.of.remove(tenant);
        }
        self.count -= 1;
        Some(removed)
    }

    /// All sessions, each with its tenant.
    fn each(&self) -> impl Iterator<Item = (&Tenant, &Arc<SessionCell>)> {
        let of = |(tenant, own)| ById::values(own).map(move |cell| (tenant, cell));
        self.of.iter().flat_map(of)
    }
}

impl All {
    fn read(&self) -> RwLockReadGuard<'_, Open> {
        self.open.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn write(&self) -> RwLockWriteGuard<'_, Open> {
        self.open.write().unwrap_or_else(PoisonError::into_inner)
    }

    fn tombstones(&self) -> MutexGuard<'_, Tombstones> {
        self.expired.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn away(&self) -> MutexGuard<'_, AwayTable> {
        self.away.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Removes a session that a client did not close, and remembers how it ended.
    fn bury(&self, tenant: &Tenant, cell: &SessionCell, end: End) {
        // In this order, so that at every moment the id is open or expired.
        self.tombstones().add((tenant.clone(), cell.id().clone()), end);
        let removed = self.write().remove(tenant, cell.id());
        cell.pack().metrics.ended(Eviction::Expired);
        drop(removed);
    }
}

impl Registry {
    /// Makes a registry for callers without a tenant. `limit` counts the sessions of all tenants.
    pub fn new(limit: usize) -> Self {
        Self {
            all: Arc::new(All {
                open: RwLock::default(),
                expired: Mutex::new(Tombstones::new(MAX_TOMBSTONES)),
                away: Mutex::default(),
                limit,
            }),
            tenant: None,
        }
    }

    /// The registry of another tenant, with the same limit.
    pub fn of_tenant(&self, tenant: Tenant) -> Self {
        Self {
            all: self.all.clone(),
            tenant,
        }
    }

    /// The tenant whose sessions it finds.
    pub(super) fn tenant(&self) -> &Tenant {
        &self.tenant
    }

    /// Number of open sessions of all tenants.
    pub fn len(&self) -> usize {
        self.all.read().count
    }

    /// Checks that `more` sessions may be opened, before the work of creating them. To make room,
    /// this ends sessions that are expired at `now`. If that is not enough, it also ends idle
    /// sessions: no step or stream advances them, and no command came for `usual_ttl`, even if
    /// their own time to live is longer.
    ///
    /// # Errors
    /// [`SessionError::TooMany`] if there is not enough room.
    pub fn room_for(&self, more: usize, usual_ttl: Duration, now: Instant) -> Result<(), SessionError> {
        if self.check_room(self.len(), more).is_ok() {
            return Ok(());
        }
        self.sweep(now);
        if self.check_room(self.len(), more).is_err() {
            self.expire_idle(more, usual_ttl, now);
        }
        self.check_room(self.len(), more)
    }

    /// Ends sessions that were not used for `usual_ttl`, until there is room for `more`. It starts
    /// with the one that is idle for longest. If this cannot make enough room, it ends none.
    fn expire_idle(&self, more: usize, usual_ttl: Duration, now: Instant) {
        let (mut idle, open): (Vec<_>, usize) = {
            let open = self.all.read();
            let idle = open.each().filter(|(_, cell)| cell.left(now) < cell.ttl());
            let idle = idle.map(|(tenant, cell)| (cell.idle(now), tenant.clone(), cell.clone()));
            (idle.filter(|(time, ..)| *time >= usual_ttl).collect(), open.count)
        };
        let missing = (open + more).saturating_sub(self.all.limit);
        if missing > idle.len() {
            return;
        }
        idle.sort_by_key(|(time, ..)| std::cmp::Reverse(*time));
        for (_, tenant, cell) in idle.into_iter().take(missing) {
            if cell.end_if_idle(usual_ttl, now, End::MadeRoom) {
                self.all.bury(&tenant, &cell, End::MadeRoom);
            }
        }
    }

    fn check_room(&self, open: usize, more: usize) -> Result<(), SessionError> {
        match open + more <= self.all.limit {
            true => Ok(()),
            false => Err(SessionError::TooMany {
                open,
                limit: self.all.limit,
                place: "",
            }),
        }
    }

    /// Opens all of `cells` or none. `field` returns the field of the request that has the id of
    /// the cell with that index. The id of a session that is expired at `now` is free.
    ///
    /// # Errors
    /// [`SessionError::Exists`] or [`SessionError::TooMany`].
    pub fn insert(
        &self,
        cells: &[Arc<SessionCell>],
        now: Instant,
        field: impl Fn(usize) -> String,
    ) -> Result<(), SessionError> {
        self.expire_named(cells, now);
        let mut open = self.all.write();
        self.check_room(open.count, cells.len())?;
        let mut new = HashSet::with_capacity(cells.len());
        for (index, cell) in cells.iter().enumerate() {
            let own = open.of.get(&self.tenant);
            if own.is_some_and(|own| own.contains_key(cell.id())) || !new.insert(cell.id()) {
                return Err(SessionError::Exists {
                    id: cell.id().to_string(),
                    field: field(index),
                });
            }
        }
        let (mut expired, mut away) = (self.all.tombstones(), self.all.away());
        for cell in cells {
            open.add(&self.tenant, cell);
            let name = (self.tenant.clone(), cell.id().clone());
            expired.forget(&name);
            away.forget(&name);
            cell.pack().metrics.opened(1);
        }
        Ok(())
    }

    /// Ends expired sessions that have the id of one of `cells`.
    fn expire_named(&self, cells: &[Arc<SessionCell>], now: Instant) {
        let named: Vec<Arc<SessionCell>> = {
            let open = self.all.read();
            let own = open.of.get(&self.tenant);
            cells
                .iter()
                .filter_map(|cell| own?.get(cell.id()).cloned())
                .collect()
        };
        for cell in named {
            if cell.expire(now) {
                self.all.bury(&self.tenant, &cell, End::Expired);
            }
        }
    }

    fn find(&self, id: &str) -> Option<Arc<SessionCell>> {
        self.all.read().of.get(&self.tenant)?.get(id).cloned()
    }

    /// The open session with this id. `field` is the field of the request that has the id.
    ///
    /// # Errors
    /// [`SessionError::Expired`] if the session has expired by `now` and the registry remembers it,
    /// [`SessionError::Unknown`] for any other id.
    pub fn get(
        &self,
        id: &str,
        now: Instant,
        field: &dyn Fn() -> String,
    ) -> Result<Arc<SessionCell>, SessionError> {
        match self.find(id) {
            Some(cell) => {
                if cell.expire(now) {
                    self.all.bury(&self.tenant, &cell, End::Expired);
                }
                cell.gone(field).map_or(Ok(cell), Err)
            }
            None => Err(self.missing(id, now, field())),
        }
    }

    /// Whether a session with this id is open.
    pub(super) fn has(&self, id: &str) -> bool {
        self.find(id).is_some()
    }

    /// Whether the store should be asked for a session: it is not open, and the store was not asked
    /// just now.
    pub(super) fn lacks(&self, id: &str, now: Instant) -> bool {
        let name = (self.tenant.clone(), Arc::from(id));
        !self.has(id) && self.all.away().get(&name).is_none_or(|away| away.is_old(now))
    }

    /// Notes why a session is not here.
    pub(super) fn note_away(&self, id: &str, away: Away, now: Instant) {
        let name = (self.tenant.clone(), Arc::from(id));
        self.all.away().note(name, away, now);
    }

    /// Notes that no server has a session.
    pub(super) fn forget_away(&self, id: &str) {
        self.all.away().forget(&(self.tenant.clone(), Arc::from(id)));
    }

    /// Ends a session that another server has taken over. Answers whether it was open.
    pub(super) fn give_up(&self, id: &str, away: Away, now: Instant) -> bool {
        self.note_away(id, away, now);
        let Some(cell) = self.find(id) else { return false };
        let ended = cell.finish(End::Moved);
        if ended {
            let removed = self.all.write().remove(&self.tenant, id);
            cell.pack().metrics.ended(Eviction::Moved);
            drop(removed);
        }
        ended
    }

    fn away_error(&self, id: &str, now: Instant, field: String) -> Option<SessionError> {
        let away = self.all.away();
        away.get(&(self.tenant.clone(), Arc::from(id)))?
            .error(id, field, now)
    }

    /// The error for an id that no open session has.
    fn missing(&self, id: &str, now: Instant, field: String) -> SessionError {
        if let Some(away) = self.away_error(id, now, field.clone()) {
            return away;
        }
        let ended = self.all.tombstones().end_of(&self.tenant, id);
        let id = id.chars().take(MAX_ID_CHARS).collect();
        match ended {
            Some(End::MadeRoom) => SessionError::MadeRoom { id, field },
            Some(_) => SessionError::Expired { id, field },
            None => SessionError::Unknown { id, field },
        }
    }

    /// Has an open session keep `place` until it ends.
    pub fn hold(&self, id: &str, place: ClientPlace) {
        if let Some(cell) = self.find(id) {
            cell.hold(place);
        }
    }

    /// At most `count` sessions with ids after `after`, sorted by id, and the number of all
    /// sessions of the tenant.
    pub fn page(&self, after: Option<&str>, count: usize) -> (Vec<Arc<SessionCell>>, usize) {
        let open = self.all.read();
        let Some(own) = open.of.get(&self.tenant) else {
            return (Vec::new(), 0);
        };
        let from = after.map_or(Bound::Unbounded, Bound::Excluded);
        let range = own.range::<str, _>((from, Bound::Unbounded));
        (
            range.take(count).map(|(_, cell)| cell.clone()).collect(),
            own.len(),
        )
    }

    /// All open sessions of the tenant.
    pub(super) fn everything(&self) -> Vec<Arc<SessionCell>> {
        self.page(None, usize::MAX).0
    }

    /// Closes the session with this id. Answers whether it was open at `now`. `field` is the field
    /// of the request that has the id.
    ///
    /// # Errors
    /// [`SessionError`] if the session may be open on another server.
    pub fn close(&self, id: &str, now: Instant, field: &dyn Fn() -> String) -> Result<bool, SessionError> {
        match self.get(id, now, field) {
            Ok(cell) => Ok(self.close_cell(&cell)),
            Err(error) if error.may_be_elsewhere() => Err(error),
            Err(_) => Ok(false),
        }
    }

    /// Closes a session. Answers whether it was open.
    pub fn close_cell(&self, cell: &SessionCell) -> bool {
        let closed = cell.finish(End::Closed);
        if closed {
            let removed = self.all.write().remove(&self.tenant, cell.id());
            cell.pack().metrics.ended(Eviction::Closed);
            // A character is freed outside the lock.
            drop(removed);
        }
        closed
    }

    /// Ends sessions of all tenants that are expired at `now`. Returns their number.
    pub fn sweep(&self, now: Instant) -> usize {
        let due: Vec<(Tenant, Arc<SessionCell>)> = {
            let open = self.all.read();
            let due = open.each().filter(|(_, cell)| cell.left(now).is_zero());
            due.map(|(tenant, cell)| (tenant.clone(), cell.clone())).collect()
        };
        let mut ended = 0;
        for (tenant, cell) in due {
            if cell.expire(now) {
                self.all.bury(&tenant, &cell, End::Expired);
                ended += 1;
            }
        }
        ended
    }
}

/// A session's tenant and id.
type Name = (Tenant, Arc<str>);

/// The ids of sessions that expired or made room lately. Beyond `limit`, the oldest are forgotten.
#[derive(Debug)]
struct Tombstones {
    /// Oldest first. An entry is valid only while `by_id` has the same number for its id.
    by_age: VecDeque<(u64, Name)>,
    by_id: HashMap<Name, (u64, End)>,
    next: u64,
    limit: usize,
}

impl Tombstones {
    fn new(limit: usize) -> Self {
        Self {
            by_age: VecDeque::new(),
            by_id: HashMap::new(),
            next: 0,
            limit,
        }
    }

    fn add(&mut self, id: Name, end: End) {
        self.next += 1;
        self.by_id.insert(id.clone(), (self.next, end));
        self.by_age.push_back((self.next, id));
        if self.by_age.len() > self.limit
            && let Some((number, id)) = self.by_age.pop_front()
            && self.by_id.get(&id).is_some_and(|(newest, _)| *newest == number)
        {
            self.by_id.remove(&id);
        }
    }

    fn forget(&mut self, id: &Name) {
        self.by_id.remove(id);
    }

    fn end_of(&self, tenant: &Tenant, id: &str) -> Option<End> {
        let (_, end) = self.by_id.get(&(tenant.clone(), Arc::from(id)))?;
        Some(*end)
    }
}

#[cfg(test)]
#[path = "registry_tests.rs"]
pub(super) mod tests;
