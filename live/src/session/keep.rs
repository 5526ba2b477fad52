//! Saves sessions and the objects of scenes, so that they survive a restart.
//!
//! A round writes changed sessions in one transaction, those with the oldest unkept change first,
//! until it has enough bytes. A scene and its sessions are written together, so the file always has
//! one consistent state. A session is locked only while it is copied, for a few microseconds.

mod moved;
mod restore;

use std::collections::{HashMap, HashSet};
use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tokio::time::Instant;
use troupe_motion::conventions::Convention;

use super::backlog::Backlog;
use super::cell::SessionCell;
use super::space::{Space, Spaces};
use super::uploads::SharedUploads;
use crate::records::{Changes, Kind, RecordStore, RecordsError, Tended};
use crate::skeleton::{Dress, Last};
use crate::world::Store;
use troupe_base::telemetry::{Counter, Labels, Metric, Telemetry};
use troupe_character::saved;
use troupe_character::scene::SceneCell;

#[cfg(feature = "testing")]
pub use restore::read_record;
use restore::{restore, restore_scenes};
pub(super) use restore::{restore_session, scene_of};

const BYTES: Metric = Metric::new("troupe_store_written_bytes_total", "Bytes of records written");
const FAILURES: Metric = Metric::new(
    "troupe_store_failures_total",
    "Failed attempts to write the state of sessions and scenes",
);
pub(super) const RESTORED: Metric = Metric::new(
    "troupe_store_sessions_total",
    "Sessions found in the store, by result: restored or left_out",
);

/// Version of the record format. Records of other versions are not restored.
const FORMAT: u32 = 4;
/// Number of sessions that are read from the registry under one lock.
const PAGE: usize = 256;
/// Bytes after which a round ends: about 600 walking people, which take a tenth of a core's time at
/// four rounds a second. A larger scene makes a larger round, and the next one waits longer.
const ROUND_BYTES: usize = 16 << 20;
/// A round is followed by a pause of at least one part in this many of its time.
const PAUSE: u32 = 4;

/// A saved session. The name of the record has its tenant and id.
#[derive(Debug, Serialize, Deserialize)]
struct Record<'a> {
    format: u32,
    pack: &'a str,
    /// Empty for packs with one skeleton.
    body: &'a str,
    /// The skeleton that it wears. Empty: the pack's.
    skeleton: &'a str,
    /// Metres of its user for a metre of the character.
    scale: f32,
    convention: Convention,
    seed: u64,
    scene: Option<&'a str>,
    ttl_ms: u64,
    priority: f32,
    style: &'a str,
    character: &'a [u8],
    /// What its skeleton keeps of the frames so far.
    worn: Option<Last>,
}

/// The state of a session when it was last saved. A different stamp means that it has changed.
#[derive(Debug, PartialEq)]
struct Stamp {
    /// Differs for a later session with the same id.
    owner: u64,
    character: (i64, u64, i64),
    priority: f32,
}

/// By the names of the records.
type Stamps = HashMap<String, Stamp>;

/// The records with changes that are not in the store, by name: the latest time before the first
/// of these changes.
type Unkept = HashMap<String, Instant>;

/// Sessions, and perhaps a scene, that must be written together.
struct Unit {
    scene: Option<ChangedScene>,
    cells: Vec<(String, Stamp, Arc<SessionCell>)>,
    /// The oldest of its unkept changes.
    since: Instant,
}

/// A scene whose objects have changed.
struct ChangedScene {
    /// Of its record.
    name: String,
    scene: String,
    cell: Arc<SceneCell>,
    store: Arc<Store>,
}

/// The result of a round.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Round {
    /// Total size of the written records, bytes.
    pub bytes: usize,
    /// Whether changed sessions were left to the next round.
    pub is_partial: bool,
}

/// Saves and restores the sessions of a server.
#[derive(Debug)]
pub struct Keeper {
    spaces: Arc<Spaces>,
    records: Box<dyn RecordStore>,
    /// As they are in the store.
    sessions: Stamps,
    /// Saved revisions, by the names of the records.
    scenes: HashMap<String, u64>,
    /// The sessions, and the scenes with sessions, that the last round found.
    open: HashSet<(Kind, String)>,
    unkept_sessions: Unkept,
    unkept_scenes: Unkept,
    /// When the last round looked for changes. What is new since then has changed later.
    looked: Instant,
    buffer: Vec<u8>,
    backlog: Arc<Backlog>,
    bytes: Counter,
    failures: Counter,
}

impl Keeper {
    /// Restores the sessions and scenes of `records`. A record that cannot be restored causes a
    /// warning, and the next round removes it.
    ///
    /// # Errors
    /// [`RecordsError`] if the records cannot be read.
    pub fn new(
        spaces: &Arc<Spaces>,
        mut records: Box<dyn RecordStore>,
        telemetry: &Telemetry,
    ) -> Result<Self, RecordsError> {
        if let Some(leases) = records.leases() {
            spaces.common().sessions.share(leases, spaces, telemetry);
        }
        if let Some(log) = records.uploads() {
            spaces.share_uploads(SharedUploads::new(log, spaces, telemetry));
            if let Some(Err(error)) = spaces.uploads().map(|uploads| uploads.round()) {
                tracing::warn!(%error, "the server begins without the uploads in the shared store");
            }
        }
        let labels = Labels::default();
        let scenes = restore_scenes(spaces, &mut *records)?;
        let (restored, left_out) = restore(spaces, &mut *records)?;
        for space in spaces.all() {
            let known = |id: &str| restored.contains_key(&space.record_name(id));
            space.store.free_all_but(known);
        }
        for (result, count) in [("restored", restored.len()), ("left_out", left_out.len())] {
            let counter = telemetry.counter(&RESTORED, &labels.with("result", result));
            counter.increment(count as u64);
        }
        if !restored.is_empty() {
            tracing::info!(
                sessions = restored.len(),
                "sessions of the last run were restored"
            );
        }
        let mut sessions = restored;
        // The registry does not have these, so the first round removes their records.
        sessions.extend(left_out);
        Ok(Self {
            spaces: spaces.clone(),
            backlog: Arc::new(Backlog::new(telemetry, records.leases().is_some())),
            records,
            sessions,
            scenes,
            open: HashSet::new(),
            unkept_sessions: Unkept::new(),
            unkept_scenes: Unkept::new(),
            looked: Instant::now(),
            buffer: Vec::new(),
            bytes: telemetry.counter(&BYTES, &labels),
            failures: telemetry.counter(&FAILURES, &labels),
        })
    }

    /// How far the store is behind. Others read it while this keeper writes.
    pub fn backlog(&self) -> &Arc<Backlog> {
        &self.backlog
    }
}

impl Stamp {
    /// A stamp that no session has.
    const NONE: Self = Self {
        owner: u64::MAX,
        character: (0, 0, 0),
        priority: 0.0,
    };
}

fn stamp(cell: &SessionCell) -> Stamp {
    let live = cell.live();
    Stamp {
        owner: cell.owner_id().0,
        character: live.character.stamp(),
        priority: live.priority,
    }
}

impl Keeper {
    /// Writes what changed first, about `max_bytes` of it. This blocks.
    ///
    /// # Errors
    /// [`RecordsError`]. Later rounds then write the same changes.
    pub fn round(&mut self, max_bytes: usize) -> Result<Round, RecordsError> {
        let mut changes = Changes::default();
        let looked = Instant::now();
        let mut units = self.look(&mut changes);
        self.looked = looked;
        self.show();
        units.sort_by_key(|unit| unit.since);
        let (mut sessions, mut scenes) = (Vec::new(), Vec::new());
        let mut is_partial = false;
        for unit in units {
            if changes.bytes() >= max_bytes.max(1) {
                is_partial = true;
                break;
            }
            for (name, stamp, cell) in unit.cells {
                changes.put_for(cell.ttl(), Kind::Session, &*name, self.record(&cell));
                sessions.push((name, stamp));
            }
            if let Some(changed) = unit.scene {
                let snapshot = changed.cell.snapshot();
                // A scene without a file has no record.
                if let Some(record) = changed.store.record_of(&changed.scene, &snapshot) {
                    changes.put(Kind::Scene, &*changed.name, record);
                }
                scenes.push((changed.name, snapshot.revision()));
            }
        }
        let tended = match changes.is_empty() {
            true => Tended::default(),
            false => match self.records.write(&changes) {
                Ok(tended) => tended,
                Err(error) => {
                    // A failed write may have gone through. These records must be written again or
                    // removed.
                    let written = sessions.into_iter().map(|(name, _)| (name, Stamp::NONE));
                    self.sessions.extend(written);
                    self.scenes
                        .extend(scenes.into_iter().map(|(name, _)| (name, u64::MAX)));
                    return Err(error);
                }
            },
        };
        for (kind, name) in changes.removed() {
            match kind {
                Kind::Session => {
                    self.sessions.remove(name);
                    self.unkept_sessions.remove(name);
                }
                Kind::Scene => {
                    self.scenes.remove(name);
                    self.unkept_scenes.remove(name);
                }
            }
        }
        for (name, stamp) in sessions {
            self.unkept_sessions.remove(&name);
            self.sessions.insert(name, stamp);
        }
        for (name, revision) in scenes {
            self.unkept_scenes.remove(&name);
            self.scenes.insert(name, revision);
        }
        self.settle(tended);
        let open = std::mem::take(&mut self.open);
        let unkept = &self.unkept_scenes;
        let is_open = |kind, name: &str| {
            open.contains(&(kind, name.to_owned())) || (kind == Kind::Scene && unkept.contains_key(name))
        };
        let tended = self.records.tend(&is_open)?;
        self.settle(tended);
        self.show();
        self.bytes.increment(changes.bytes() as u64);
        if let Some(uploads) = self.spaces.uploads() {
            uploads.round()?;
        }
        Ok(Round {
            bytes: changes.bytes(),
            is_partial,
        })
    }

    /// Does a round and returns the time to wait until the next. Rounds start every `interval`, or
    /// less often if they write much or take long.
    ///
    /// # Errors
    /// [`RecordsError`], with the time to wait.
    pub fn go_on(&mut self, interval: Duration) -> (Duration, Result<(), RecordsError>) {
        let begun = Instant::now();
        let result = self.counted(ROUND_BYTES);
        let bytes = result.as_ref().map_or(0, |round| round.bytes);
        let intervals = u32::try_from(bytes / ROUND_BYTES).unwrap_or(u32::MAX).max(1);
        let took = begun.elapsed();
        let wait = interval.saturating_mul(intervals).saturating_sub(took);
        (wait.max(took / PAUSE), result.map(|_| ()))
    }

    /// Writes everything that has changed. This blocks.
    ///
    /// # Errors
    /// [`RecordsError`]. [`Keeper::backlog`] says how many sessions are not in the store.
    pub fn finish(&mut self) -> Result<(), RecordsError> {
        while self.counted(ROUND_BYTES)?.is_partial {}
        self.records.leave();
        Ok(())
    }

    fn counted(&mut self, max_bytes: usize) -> Result<Round, RecordsError> {
        let result = self.round(max_bytes);
        self.failures.increment(u64::from(result.is_err()));
        self.backlog
            .set_error(result.as_ref().err().map(ToString::to_string));
        result
    }

    fn show(&self) {
        let since = self.unkept_sessions.values().chain(self.unkept_scenes.values());
        let kept_until = since.min().copied().unwrap_or(self.looked);
        self.backlog.set(kept_until, self.unkept_sessions.len());
    }

    /// Finds all changes. Adds the removed records to `changes`, because they are small.
    fn look(&mut self, changes: &mut Changes) -> Vec<Unit> {
        let (mut units, mut sessions, mut scenes) = (Vec::new(), Unkept::new(), Unkept::new());
        let (mut open, mut there) = (HashSet::new(), HashSet::new());
        self.open.clear();
        for space in self.spaces.all() {
            let mut of_scene = self.changed_scenes(&space, &mut scenes, &mut there);
            let mut after: Option<Arc<str>> = None;
            loop {
                let (page, _) = space.sessions.registry().page(after.as_deref(), PAGE);
                after = (page.len() == PAGE).then(|| page[PAGE - 1].id().clone());
                for cell in page.into_iter().filter(|cell| cell.end().is_none()) {
                    let (name, stamp) = (space.record_name(cell.id()), stamp(&cell));
                    open.insert(name.clone());
                    if let Some(scene) = cell.scene() {
                        self.open.insert((Kind::Scene, space.record_name(scene)));
                    }
                    self.open.insert((Kind::Session, name.clone()));
                    if self.sessions.get(&name) == Some(&stamp) {
                        continue;
                    }
                    let since = *self.unkept_sessions.get(&name).unwrap_or(&self.looked);
                    sessions.insert(name.clone(), since);
                    let fresh = || Unit::new(since);
                    let mut alone = None;
                    let unit = match cell.scene() {
                        Some(scene) => of_scene.entry(scene.to_string()).or_insert_with(fresh),
                        None => alone.insert(fresh()),
                    };
                    unit.since = unit.since.min(since);
                    unit.cells.push((name, stamp, cell));
                    units.extend(alone);
                }
                if after.is_none() {
                    break;
                }
            }
            units.extend(of_scene.into_values());
        }
        for name in self.sessions.keys().filter(|name| !open.contains(*name)) {
            changes.remove(Kind::Session, &**name);
            let since = *self.unkept_sessions.get(name).unwrap_or(&self.looked);
            sessions.insert(name.clone(), since);
        }
        for name in self.scenes.keys().filter(|name| !there.contains(*name)) {
            changes.remove(Kind::Scene, &**name);
            let since = *self.unkept_scenes.get(name).unwrap_or(&self.looked);
            scenes.insert(name.clone(), since);
        }
        (self.unkept_sessions, self.unkept_scenes) = (sessions, scenes);
        units
    }

    /// The changed scenes of a space by name. Adds them to `unkept`, and all of its scenes to
    /// `there`.
    fn changed_scenes(
        &self,
        space: &Arc<Space>,
        unkept: &mut Unkept,
        there: &mut HashSet<String>,
    ) -> HashMap<String, Unit> {
        let mut units = HashMap::new();
        for (scene, cell) in space.store.scenes().all().iter() {
            let name = space.record_name(scene);
            there.insert(name.clone());
            let is_kept = self.scenes.get(&name) == Some(&cell.snapshot().revision());
            if is_kept || !self.records.owns(Kind::Scene, &name) {
                continue;
            }
            let since = *self.unkept_scenes.get(&name).unwrap_or(&self.looked);
            unkept.insert(name.clone(), since);
            let mut unit = Unit::new(since);
            unit.scene = Some(ChangedScene {
                name,
                scene: scene.clone(),
                cell: cell.clone(),
                store: space.store.clone(),
            });
            units.insert(scene.clone(), unit);
        }
        units
    }

    fn record(&mut self, cell: &SessionCell) -> Vec<u8> {
        self.buffer.clear();
        let (priority, style, worn) = {
            let live = cell.live();
            saved::save(&live.character, &mut self.buffer);
            let worn = live.dress.as_ref().map(Dress::last);
            (live.priority, live.style.clone(), worn)
        };
        let record = Record {
            format: FORMAT,
            pack: cell.pack().name(),
            body: cell.pack().body_name(),
            skeleton: cell.pack().worn().map_or("", |worn| worn.name()),
            scale: cell.measure().scale(),
            convention: cell.convention(),
            seed: cell.seed(),
            scene: cell.scene().map(|name| &**name),
            ttl_ms: cell.ttl().as_millis() as u64,
            priority,
            style: &style.name,
            character: &self.buffer,
            worn,
        };
        // Writing to a vector does not fail.
        postcard::to_allocvec(&record).unwrap_or_default()
    }
}

impl Unit {
    fn new(since: Instant) -> Self {
        Self {
            scene: None,
            cells: Vec::new(),
            since,
        }
    }
}

#[cfg(test)]
#[path = "keep_tests.rs"]
pub(super) mod tests;
