//! All open sessions by id, and the ids of those that expired lately.

use std::collections::{BTreeMap, HashMap, HashSet, VecDeque};
use std::ops::Bound;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};
use std::time::{Duration, Instant};

use super::SessionError;
use super::cell::{End, SessionCell};
use super::metrics::Eviction;
use super::options::MAX_ID_CHARS;

/// About the most memory that an open session takes, bytes: 38 KiB were measured for one that walks in the default pack, and one
/// in a scene keeps events and keyframes besides.
pub const MAX_SESSION_BYTES: u64 = 64 << 10;
/// Most ids of expired sessions that are remembered: a few megabytes.
const MAX_TOMBSTONES: usize = 65_536;

type ById = BTreeMap<Arc<str>, Arc<SessionCell>>;

/// All open sessions.
#[derive(Debug)]
pub struct Registry {
    open: RwLock<ById>,
    expired: Mutex<Tombstones>,
    limit: usize,
}

impl Registry {
    /// A registry of at most `limit` sessions.
    pub fn new(limit: usize) -> Self {
        Self {
            open: RwLock::default(),
            expired: Mutex::new(Tombstones::new(MAX_TOMBSTONES)),
            limit,
        }
    }

    fn read(&self) -> RwLockReadGuard<'_, ById> {
        self.open.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn write(&self) -> RwLockWriteGuard<'_, ById> {
        self.open.write().unwrap_or_else(PoisonError::into_inner)
    }

    /// Open sessions.
    pub fn len(&self) -> usize {
        self.read().len()
    }

    /// Whether no session is open.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether `more` sessions may be opened: a look ahead of the work of making them. Those whose time is up at `now` make
    /// room, and so do those that nobody has wanted for `usual_ttl` although they may live longer.
    ///
    /// # Errors
    /// [`SessionError::TooMany`].
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

    /// Ends sessions that nobody has wanted for `usual_ttl`, although they may live longer, until there is room for `more`: the
    /// longest idle first. Where there is room enough for all others they stay.
    fn expire_idle(&self, more: usize, usual_ttl: Duration, now: Instant) {
        let (mut idle, open): (Vec<_>, usize) = {
            let open = self.read();
            let idle = open.values().filter(|cell| cell.left(now) < cell.ttl());
            let idle = idle.map(|cell| (cell.idle(now), cell.clone()));
            (idle.filter(|(time, _)| *time >= usual_ttl).collect(), open.len())
        };
        let missing = (open + more).saturating_sub(self.limit);
        if missing > idle.len() {
            return;
        }
        idle.sort_by_key(|(time, _)| std::cmp::Reverse(*time));
        for (_, cell) in idle.into_iter().take(missing) {
            if cell.expire_after(usual_ttl, now) {
                self.bury(&cell);
            }
        }
    }

    fn check_room(&self, open: usize, more: usize) -> Result<(), SessionError> {
        match open + more <= self.limit {
            true => Ok(()),
            false => Err(SessionError::TooMany {
                open,
                limit: self.limit,
                place: "",
            }),
        }
    }

    /// Opens sessions, all or none. `field` names the id of one by its place. An id whose session's time is up at `now` is
    /// free.
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
        let mut open = self.write();
        self.check_room(open.len(), cells.len())?;
        let mut new = HashSet::with_capacity(cells.len());
        for (index, cell) in cells.iter().enumerate() {
            if open.contains_key(cell.id()) || !new.insert(cell.id()) {
                return Err(SessionError::Exists {
                    id: cell.id().to_string(),
                    field: field(index),
                });
            }
        }
        let mut expired = self.tombstones();
        for cell in cells {
            open.insert(cell.id().clone(), cell.clone());
            expired.forget(cell.id());
            cell.pack().metrics.opened(1);
        }
        Ok(())
    }

    /// Ends the sessions that have an id of `cells` and whose time is up.
    fn expire_named(&self, cells: &[Arc<SessionCell>], now: Instant) {
        let named: Vec<Arc<SessionCell>> = {
            let open = self.read();
            cells
                .iter()
                .filter_map(|cell| open.get(cell.id()).cloned())
                .collect()
        };
        for cell in named {
            if cell.expire(now) {
                self.bury(&cell);
            }
        }
    }

    fn tombstones(&self) -> MutexGuard<'_, Tombstones> {
        self.expired.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The session of that id, which the request gave in `field`.
    ///
    /// # Errors
    /// [`SessionError::Expired`] where its time is up at `now`, or was lately; [`SessionError::Unknown`].
    pub fn get(
        &self,
        id: &str,
        now: Instant,
        field: &dyn Fn() -> String,
    ) -> Result<Arc<SessionCell>, SessionError> {
        let found = self.read().get(id).cloned();
        match found {
            Some(cell) => {
                if cell.expire(now) {
                    self.bury(&cell);
                }
                cell.gone(field).map_or(Ok(cell), Err)
            }
            None if self.tombstones().knows(id) => Err(SessionError::Expired {
                id: id.to_owned(),
                field: field(),
            }),
            None => Err(SessionError::Unknown {
                id: id.chars().take(MAX_ID_CHARS).collect(),
                field: field(),
            }),
        }
    }

    /// Up to `count` sessions whose ids come after `after`, by id, and how many are open in all.
    pub fn page(&self, after: Option<&str>, count: usize) -> (Vec<Arc<SessionCell>>, usize) {
        let open = self.read();
        let from = after.map_or(Bound::Unbounded, Bound::Excluded);
        let range = open.range::<str, _>((from, Bound::Unbounded));
        (
            range.take(count).map(|(_, cell)| cell.clone()).collect(),
            open.len(),
        )
    }

    /// Closes the session of that id. Answers whether it was open at `now`.
    pub fn close(&self, id: &str, now: Instant) -> bool {
        let Ok(cell) = self.get(id, now, &String::new) else {
            return false;
        };
        self.close_cell(&cell)
    }

    /// Closes a session. Answers whether it was open.
    pub fn close_cell(&self, cell: &SessionCell) -> bool {
        let closed = cell.finish(End::Closed);
        if closed {
            let removed = self.write().remove(cell.id());
            cell.pack().metrics.ended(Eviction::Closed);
            // A character is freed outside the lock.
            drop(removed);
        }
        closed
    }

    /// Ends sessions whose time is up at `now`; answers how many.
    pub fn sweep(&self, now: Instant) -> usize {
        let due: Vec<Arc<SessionCell>> = {
            let open = self.read();
            open.values()
                .filter(|cell| cell.left(now).is_zero())
                .cloned()
                .collect()
        };
        let mut ended = 0;
        for cell in due {
            if cell.expire(now) {
                self.bury(&cell);
                ended += 1;
            }
        }
        ended
    }

    /// Removes an expired session and remembers its id.
    fn bury(&self, cell: &SessionCell) {
        // In this order, so that nobody finds it neither open nor expired.
        self.tombstones().add(cell.id().clone());
        let removed = self.write().remove(cell.id());
        cell.pack().metrics.ended(Eviction::Expired);
        drop(removed);
    }
}

/// The ids of the last so many expired sessions.
#[derive(Debug)]
struct Tombstones {
    /// By age; an entry counts only while `by_id` has the same number for its id.
    by_age: VecDeque<(u64, Arc<str>)>,
    by_id: HashMap<Arc<str>, u64>,
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

    fn add(&mut self, id: Arc<str>) {
        self.next += 1;
        self.by_id.insert(id.clone(), self.next);
        self.by_age.push_back((self.next, id));
        if self.by_age.len() > self.limit
            && let Some((number, id)) = self.by_age.pop_front()
            && self.by_id.get(&id) == Some(&number)
        {
            self.by_id.remove(&id);
        }
    }

    fn forget(&mut self, id: &str) {
        self.by_id.remove(id);
    }

    fn knows(&self, id: &str) -> bool {
        self.by_id.contains_key(id)
    }
}

#[cfg(test)]
#[path = "registry_tests.rs"]
pub(super) mod tests;
