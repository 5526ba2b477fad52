//! Uploads of a store that servers share: scenes, object definitions, styles and skeletons.
//!
//! Each round of the keeper writes what has changed here and takes in what has changed elsewhere.
//! The uploads of a tenant are read when this server first serves the tenant. Until then, and for
//! what does not fit here, only their versions are known.

mod items;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

use super::space::{Space, Spaces};
use super::styles;
use crate::records::RecordsError;
use crate::records::shared::{UploadLog, Version, Write};
use crate::uploads::Upload;
use items::{Items, State};
use troupe_base::telemetry::{Counter, Labels, Metric, Telemetry};
use troupe_base::tenant::Tenant;

const UPLOADS: Metric = Metric::new(
    "troupe_store_uploads_total",
    "Uploads in a shared store, by what became of them here: written, taken, removed, or left_out because they do not \
     fit or cannot be read",
);
/// Largest record of an upload. The largest scene takes about a quarter of it.
const MAX_RECORD_BYTES: usize = 64 << 20;
/// About the most bytes that are read or written at a time.
const BATCH_BYTES: usize = 4 << 20;
/// Time after which uploads that did not fit are tried again.
const RETRY: Duration = Duration::from_secs(30);

/// The uploads that a server shares.
#[derive(Debug)]
pub(super) struct SharedUploads {
    spaces: Weak<Spaces>,
    known: Mutex<Known>,
    /// Whether the store did not answer lately. Then new tenants do not wait for it.
    is_away: AtomicBool,
    max_record_bytes: usize,
    counters: Counters,
}

/// What this server knows of the store.
#[derive(Debug)]
struct Known {
    log: UploadLog,
    /// 0: nothing was ever written.
    epoch: u64,
    /// Position of the newest change that was read.
    seen: u64,
    tenants: BTreeMap<Tenant, Items>,
    /// When uploads that did not fit were last tried.
    tried: Instant,
}

#[derive(Debug)]
struct Counters {
    written: Counter,
    taken: Counter,
    removed: Counter,
    left_out: Counter,
}

/// What became of a change from another server.
enum Outcome {
    Done,
    /// It must wait: a call changes uploads now, or the store lacks a newer change.
    Later,
    /// The upload is in use here, so it stays. It is written again.
    InUse,
}

impl SharedUploads {
    pub(super) fn new(log: UploadLog, spaces: &Arc<Spaces>, telemetry: &Telemetry) -> Self {
        let counter = |result| telemetry.counter(&UPLOADS, &Labels::default().with("result", result));
        Self {
            spaces: Arc::downgrade(spaces),
            known: Mutex::new(Known {
                log,
                epoch: 0,
                seen: 0,
                tenants: BTreeMap::new(),
                tried: Instant::now(),
            }),
            is_away: AtomicBool::new(false),
            max_record_bytes: MAX_RECORD_BYTES,
            counters: Counters {
                written: counter("written"),
                taken: counter("taken"),
                removed: counter("removed"),
                left_out: counter("left_out"),
            },
        }
    }

    fn known(&self) -> MutexGuard<'_, Known> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes what has changed here, and takes in what has changed elsewhere. This blocks.
    ///
    /// # Errors
    /// [`RecordsError`]. Later rounds then do the rest.
    pub(super) fn round(&self) -> Result<(), RecordsError> {
        let Some(spaces) = self.spaces.upgrade() else {
            return Ok(());
        };
        let mut known = self.known();
        let written = self.write(&mut known, &spaces);
        // A store that is full can still be read.
        let taken = self.take_all(&mut known, &spaces);
        let result = written.and(taken);
        self.is_away.store(result.is_err(), Ordering::Relaxed);
        result
    }

    /// Takes in the uploads of a tenant that this server begins to serve. If the store does not
    /// answer, later rounds do so. This blocks.
    pub(super) fn load(&self, space: &Arc<Space>) {
        let Some(spaces) = self.spaces.upgrade() else {
            return;
        };
        if self.is_away.load(Ordering::Relaxed) {
            return;
        }
        let mut known = self.known();
        let loaded = self
            .read(&mut known, &spaces)
            .and_then(|()| self.take(&mut known, space));
        if let Err(error) = loaded {
            self.is_away.store(true, Ordering::Relaxed);
            tracing::warn!(%error, "a tenant begins without the uploads in the shared store");
        }
    }

    /// A pack gets its styles, and the definitions that wait for it. This blocks.
    pub(super) fn pack_came(&self, pack: &str) {
        for items in self.known().tenants.values_mut() {
            items.pack_came(pack);
        }
        if let Err(error) = self.round() {
            tracing::warn!(%error, pack, "a pack begins without the styles in the shared store");
        }
    }

    /// Writes the changes of all tenants.
    fn write(&self, known: &mut Known, spaces: &Spaces) -> Result<(), RecordsError> {
        for space in spaces.all() {
            let mut changed: Vec<Upload> = space.store.journal().take().into_iter().collect();
            while !changed.is_empty() {
                let items = known.of(&space);
                let (writes, count) = self.batch(&space, &changed, items);
                let done = match known.log.write(&writes) {
                    Ok(done) => done,
                    Err(error) => {
                        let mut journal = space.store.journal().change();
                        changed.into_iter().for_each(|upload| journal.note(upload));
                        return Err(error);
                    }
                };
                let later = changed.split_off(count);
                let items = known.of(&space);
                for (write, at) in writes.iter().zip(done) {
                    let Some((_, upload)) = Upload::of_field(&write.field) else {
                        continue;
                    };
                    match at {
                        Some(at) => {
                            let bytes = write.record.as_ref().map(Vec::len);
                            items.set(upload, at, bytes, State::Taken);
                            self.counters.written.increment(1);
                        }
                        None => space.store.journal().change().note(upload),
                    }
                }
                changed = later;
            }
        }
        Ok(())
    }

    /// The first of `uploads` as they are now, and how many of the uploads these are.
    fn batch(&self, space: &Space, uploads: &[Upload], items: &Items) -> (Vec<Write>, usize) {
        let (mut writes, mut bytes, mut count) = (Vec::new(), 0, 0);
        for upload in uploads {
            if bytes >= BATCH_BYTES {
                break;
            }
            count += 1;
            match self.record(space, upload) {
                Ok(record) => {
                    bytes += record.as_ref().map_or(0, Vec::len);
                    writes.push(Write {
                        field: upload.field(&space.tenant),
                        rank: items.rank(upload),
                        record,
                    });
                }
                Err(reason) => {
                    self.counters.left_out.increment(1);
                    tracing::warn!(
                        upload = upload.field(&space.tenant),
                        reason,
                        "an upload stays on this server, because the shared store cannot have it"
                    );
                }
            }
        }
        (writes, count)
    }

    /// An upload as it is now. `None`: it was removed.
    fn record(&self, space: &Space, upload: &Upload) -> Result<Option<Vec<u8>>, String> {
        let record = match upload {
            Upload::Definition(name) => space.store.write_definition(name)?,
            Upload::Skeleton(name) => space.store.skeletons().write_shared(name)?,
            Upload::Scene(name) => space.store.write_scene(name)?,
            Upload::Style { pack, body, name } => {
                let style = styles::write_shared(&space.packs.table(), (pack, body, name))?;
                // Styles are never removed.
                Some(style.ok_or("its pack is not loaded any more")?)
            }
        };
        let bytes = record.as_ref().map_or(0, Vec::len);
        match bytes <= self.max_record_bytes {
            true => Ok(record),
            false => Err(format!(
                "it takes {bytes} bytes; allowed: at most {}",
                self.max_record_bytes
            )),
        }
    }

    /// Reads the log, and takes in what has changed.
    fn take_all(&self, known: &mut Known, spaces: &Spaces) -> Result<(), RecordsError> {
        self.read(known, spaces)?;
        if known.tried.elapsed() >= RETRY {
            known.tried = Instant::now();
            known.tenants.values_mut().for_each(Items::retry);
        }
        let tenants: Vec<Tenant> = known.tenants.keys().cloned().collect();
        for tenant in tenants {
            if let Some(space) = spaces.unused(&tenant) {
                self.take(known, &space)?;
            }
        }
        Ok(())
    }

    /// Reads which uploads have changed.
    fn read(&self, known: &mut Known, spaces: &Spaces) -> Result<(), RecordsError> {
        let mut changes = known.log.since(known.seen)?;
        if known.epoch != 0 && (changes.epoch != known.epoch || changes.version < known.seen) {
            tracing::warn!("the shared store has lost uploads, and gets those of this server again");
            self.write_again(known, spaces)?;
            known.tenants.values_mut().for_each(Items::only_taken);
            known.seen = 0;
            changes = known.log.since(0)?;
        } else if known.seen != 0 && known.seen < changes.floor {
            // Removals were forgotten before this server read them.
            changes = known.log.since(0)?;
            let listed: BTreeSet<&str> = changes.list.iter().map(|change| change.field.as_str()).collect();
            for (tenant, items) in &mut known.tenants {
                items.keep(changes.floor, |upload| {
                    listed.contains(upload.field(tenant).as_str())
                });
            }
        }
        known.epoch = changes.epoch;
        for change in changes.list {
            known.seen = known.seen.max(change.at.position);
            // Later versions of the server may have uploads of other kinds.
            let Some((tenant, upload)) = Upload::of_field(&change.field) else {
                continue;
            };
            known
                .tenants
                .entry(tenant)
                .or_default()
                .changed(upload, change.at, change.bytes);
        }
        for items in known.tenants.values_mut() {
            items.forget(changes.floor);
        }
        Ok(())
    }

    /// Writes everything that is here, with the ranks that it had in the store.
    fn write_again(&self, known: &mut Known, spaces: &Spaces) -> Result<(), RecordsError> {
        let Known { log, tenants, .. } = known;
        for (tenant, items) in tenants {
            let Some(space) = spaces.unused(tenant).filter(|space| items.are_of(space)) else {
                continue;
            };
            let (mut writes, mut bytes) = (Vec::new(), 0);
            for (upload, rank, is_there) in items.taken() {
                let record = match is_there {
                    true => self.record(&space, upload),
                    false => Ok(None),
                };
                // One that was removed since is in the journal.
                let Some(record) = record.ok().filter(|record| record.is_some() == is_there) else {
                    continue;
                };
                bytes += record.as_ref().map_or(0, Vec::len);
                writes.push(Write {
                    field: upload.field(tenant),
                    rank,
                    record,
                });
                if bytes >= BATCH_BYTES {
                    log.write_again(&std::mem::take(&mut writes))?;
                    bytes = 0;
                }
            }
            log.write_again(&writes)?;
        }
        Ok(())
    }

    /// Takes in the uploads of a tenant that are new. Scenes go before their definitions go, and
    /// come after their definitions come.
    fn take(&self, known: &mut Known, space: &Arc<Space>) -> Result<(), RecordsError> {
        known.of(space);
        let Known { log, tenants, .. } = known;
        let Some(items) = tenants.get_mut(&space.tenant) else {
            return Ok(());
        };
        let (scenes, others): (Vec<_>, Vec<_>) = items
            .pending(false)
            .into_iter()
            .partition(|(upload, ..)| matches!(upload, Upload::Scene(_)));
        for (upload, ..) in scenes {
            self.take_one(space, items, upload, None);
        }
        let mut pending = items.pending(true);
        while !pending.is_empty() {
            let mut bytes = 0;
            let fitting = pending.iter().take_while(|(_, size)| {
                let has_room = bytes < BATCH_BYTES;
                bytes += size;
                has_room
            });
            let count = fitting.count();
            let later = pending.split_off(count);
            let fields: Vec<String> = pending
                .iter()
                .map(|(upload, _)| upload.field(&space.tenant))
                .collect();
            let records = log.records(&fields)?;
            for ((upload, _), record) in pending.into_iter().zip(records) {
                // One that was just removed comes with the next round.
                if let Some(record) = record {
                    self.take_one(space, items, upload, Some(&record));
                }
            }
            pending = later;
        }
        for (upload, ..) in others {
            self.take_one(space, items, upload, None);
        }
        Ok(())
    }

    fn take_one(&self, space: &Space, items: &mut Items, upload: Upload, record: Option<&[u8]>) {
        match taken(space, &upload, record) {
            Ok(Outcome::Later) => {}
            Ok(Outcome::Done) => {
                let counter = match record {
                    Some(_) => &self.counters.taken,
                    None => &self.counters.removed,
                };
                counter.increment(1);
                items.took(&upload);
            }
            Ok(Outcome::InUse) => {
                tracing::warn!(
                    upload = upload.field(&space.tenant),
                    "an upload that another server has removed is in use, so it is written again"
                );
                items.took(&upload);
            }
            Err(reason) => {
                self.counters.left_out.increment(1);
                if items.leave_out(&upload, &reason) {
                    tracing::warn!(
                        upload = upload.field(&space.tenant),
                        reason,
                        "an upload of another server is left out"
                    );
                }
            }
        }
    }
}

impl Known {
    /// What is known of a tenant's uploads. If its space is new, all of them are yet to be taken
    /// in.
    fn of(&mut self, space: &Arc<Space>) -> &mut Items {
        let items = self.tenants.entry(space.tenant.clone()).or_default();
        items.belong_to(space);
        items
    }
}

/// Takes in an upload of another server, or removes one.
fn taken(space: &Space, upload: &Upload, record: Option<&[u8]>) -> Result<Outcome, String> {
    let Space { packs, store, .. } = space;
    let Some(mut changed) = store.journal().try_change() else {
        return Ok(Outcome::Later);
    };
    if changed.has(upload) {
        return Ok(Outcome::Later);
    }
    let is_dropped = match (upload, record) {
        (Upload::Definition(name), Some(record)) => {
            store.take_definition(name, record, &packs.table())?;
            true
        }
        (Upload::Definition(name), None) => store.drop_definition(name),
        (Upload::Style { pack, body, name }, Some(record)) => {
            styles::take_shared(&packs.table(), (pack, body, name), record, store.memory())?;
            true
        }
        // Styles are never removed.
        (Upload::Style { .. }, None) => true,
        (Upload::Skeleton(name), Some(record)) => {
            store.skeletons().take_shared(name, record, store.memory())?;
            true
        }
        (Upload::Skeleton(name), None) => store.skeletons().drop_shared(name),
        (Upload::Scene(name), Some(record)) => {
            store.take_scene(name, record)?;
            true
        }
        (Upload::Scene(name), None) => store.drop_scene(name),
    };
    if is_dropped {
        return Ok(Outcome::Done);
    }
    changed.note(upload.clone());
    Ok(Outcome::InUse)
}

#[cfg(test)]
#[path = "uploads_tests.rs"]
mod tests;
