//! Saves sessions and the objects of scenes, so that they survive a restart.
//!
//! A round collects everything that has changed since the last round and writes it in one
//! transaction, so the file always has one consistent state. A session is locked only while it is
//! copied, for a few microseconds.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tokio::time::Instant;
use troupe_motion::conventions::Convention;
use troupe_motion::model::Capability;

use super::LivePacks;
use super::cell::{SessionCell, SessionParts};
use super::space::{Spaces, of_record};
use crate::records::{Changes, Kind, Records, RecordsError};
use crate::world::Store;
use troupe_base::telemetry::{Counter, Gauge, Labels, Metric, Seldom, Telemetry};
use troupe_character::Path;
use troupe_character::live::World;
use troupe_character::saved::{self, Surroundings};
use troupe_character::scene::Holder;

const AGE: Metric = Metric::new(
    "troupe_store_age_seconds",
    "Time since the state of sessions and scenes was last written",
);
const BYTES: Metric = Metric::new("troupe_store_written_bytes_total", "Bytes of records written");
const FAILURES: Metric = Metric::new(
    "troupe_store_failures_total",
    "Failed attempts to write the state of sessions and scenes",
);
const RESTORED: Metric = Metric::new(
    "troupe_store_sessions_total",
    "Sessions found in the store at the start, by result: restored or left_out",
);

/// Version of the record format. Records of other versions are not restored.
const FORMAT: u32 = 2;
/// Number of sessions that are read from the registry under one lock.
const PAGE: usize = 256;
/// Rounds take at most one part in this many of one core's time.
const SHARE: u32 = 10;

/// A saved session. The name of the record has its tenant and id.
#[derive(Debug, Serialize, Deserialize)]
struct Record<'a> {
    format: u32,
    pack: &'a str,
    /// Empty for packs with one skeleton.
    body: &'a str,
    convention: Convention,
    seed: u64,
    scene: Option<&'a str>,
    ttl_ms: u64,
    priority: f32,
    style: &'a str,
    character: &'a [u8],
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

/// The result of a round.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Round {
    /// Records of sessions and scenes that were written or removed.
    pub records: usize,
    /// Total size of the written records, bytes.
    pub bytes: usize,
}

/// Saves and restores the sessions of a server.
#[derive(Debug)]
pub struct Keeper {
    spaces: Arc<Spaces>,
    records: Records,
    sessions: Stamps,
    /// Saved revisions, by the names of the records.
    scenes: HashMap<String, u64>,
    buffer: Vec<u8>,
    age: Gauge,
    bytes: Counter,
    failures: Counter,
    /// Limits how often a failure is logged.
    reported: Seldom,
    written: Instant,
}

impl Keeper {
    /// Restores the sessions and scenes of `records`. A record that cannot be restored causes a
    /// warning, and the next round removes it.
    ///
    /// # Errors
    /// [`RecordsError`] if the records cannot be read.
    pub fn new(
        spaces: &Arc<Spaces>,
        mut records: Records,
        telemetry: &Telemetry,
    ) -> Result<Self, RecordsError> {
        let labels = Labels::default();
        let scenes = restore_scenes(spaces, &mut records)?;
        let (restored, left_out) = restore(spaces, &mut records)?;
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
            records,
            sessions,
            scenes,
            buffer: Vec::new(),
            age: telemetry.gauge(&AGE, &labels),
            bytes: telemetry.counter(&BYTES, &labels),
            failures: telemetry.counter(&FAILURES, &labels),
            reported: Seldom::default(),
            written: Instant::now(),
        })
    }
}

/// Restores sessions. Returns the restored ones and those that could not be restored.
fn restore(spaces: &Spaces, records: &mut Records) -> Result<(Stamps, Stamps), RecordsError> {
    let (mut restored, mut left_out) = (Stamps::new(), Stamps::new());
    for (name, record) in records.all(Kind::Session)? {
        match restore_session(spaces, &name, &record) {
            Ok(cell) => drop(restored.insert(name, stamp(&cell))),
            Err(reason) => {
                tracing::warn!(
                    session = name,
                    reason,
                    "a session of the last run cannot be restored"
                );
                left_out.insert(name, Stamp::NONE);
            }
        }
    }
    Ok((restored, left_out))
}

fn restore_session(spaces: &Spaces, name: &str, record: &[u8]) -> Result<Arc<SessionCell>, String> {
    let (tenant, id) = of_record(name);
    let space = spaces.of(&tenant).map_err(|error| error.to_string())?;
    let parts = parts(&Arc::from(id), record, &space.packs, &space.store)?;
    let time = space.sessions.time();
    let cell = Arc::new(SessionCell::new(parts, time.clone()));
    let inserted = space
        .sessions
        .registry()
        .insert(std::slice::from_ref(&cell), time.now(), |_| "id".to_owned());
    inserted.map(|()| cell).map_err(|error| error.to_string())
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

/// Reads the parts of a session from its record.
fn parts(id: &Arc<str>, record: &[u8], packs: &LivePacks, world: &Store) -> Result<SessionParts, String> {
    let text = |error: &dyn std::fmt::Display| error.to_string();
    let record: Record<'_> = postcard::from_bytes(record).map_err(|error| text(&error))?;
    if record.format != FORMAT {
        return Err(format!(
            "the record has format {}; allowed: {FORMAT}",
            record.format
        ));
    }
    let pack = packs.find(&Path::root(), record.pack, record.body);
    let pack = pack.map_err(|error| text(&error))?;
    (pack.loaded.require(Capability::Live, "pack")).map_err(|error| text(&error))?;
    let style = pack.styles().get(record.style);
    let style = style.ok_or_else(|| format!("there is no style {:?}", record.style))?;
    let resident =
        (record.scene.map(|name| world.scenes().enter(name)).transpose()).map_err(|error| text(&error))?;
    let around = Surroundings {
        rig: pack.rig().clone(),
        styles: pack.styles().clone(),
        skills: pack.loaded.skills.clone(),
        world: resident.as_ref().map(|resident| World {
            scene: resident.cell().clone(),
            definitions: world.definitions().clone(),
            holder: Holder::new(id.clone()),
        }),
    };
    let character = saved::restore(record.character, &around).map_err(|error| text(&error))?;
    Ok(SessionParts {
        id: id.clone(),
        pack: pack.clone(),
        convention: record.convention,
        seed: record.seed,
        ttl: Duration::from_millis(record.ttl_ms),
        character,
        style,
        priority: record.priority,
        resident,
        woken: true,
    })
}

/// Reads the record of a session, for fuzz targets.
///
/// # Errors
/// The reason why the session cannot be restored.
#[cfg(feature = "testing")]
pub fn read_record(id: &str, record: &[u8], packs: &LivePacks, world: &Store) -> Result<(), String> {
    parts(&Arc::from(id), record, packs, world).map(drop)
}

/// Restores the objects of scenes. Returns a revision for every record, so that the next round
/// writes or removes it.
fn restore_scenes(spaces: &Spaces, records: &mut Records) -> Result<HashMap<String, u64>, RecordsError> {
    let mut revisions = HashMap::new();
    for (name, record) in records.all(Kind::Scene)? {
        let (tenant, scene) = of_record(&name);
        let space = spaces.of(&tenant).map_err(|error| error.to_string());
        if let Err(reason) = space.and_then(|space| space.store.restore_scene(scene, &record)) {
            tracing::warn!(
                scene = name,
                reason,
                "the objects of a scene cannot be restored and stay as in its file"
            );
        }
        // No scene has this revision.
        revisions.insert(name, u64::MAX);
    }
    Ok(revisions)
}

impl Keeper {
    /// Writes what has changed since the last round. This blocks.
    ///
    /// # Errors
    /// [`RecordsError`]. The next round then writes the same changes.
    pub fn round(&mut self) -> Result<Round, RecordsError> {
        let mut changes = Changes::default();
        let sessions = self.note_sessions(&mut changes);
        let scenes = self.note_scenes(&mut changes);
        let round = Round {
            records: changes.len(),
            bytes: changes.bytes(),
        };
        if !changes.is_empty() {
            self.records.write(&changes)?;
        }
        self.sessions = sessions;
        self.scenes = scenes;
        self.bytes.increment(round.bytes as u64);
        self.written = Instant::now();
        Ok(round)
    }

    /// Does a round and returns the time to wait until the next. Rounds start every `interval`, or
    /// less often if they take long. A failure is logged at most once a minute.
    pub fn go_on(&mut self, interval: Duration) -> Duration {
        let begun = Instant::now();
        if let Err(error) = self.round() {
            self.failures.increment(1);
            if let Some(held_back) = self.reported.next(begun.into_std()) {
                tracing::error!(%error, held_back, "the state of sessions cannot be saved");
            }
        }
        self.age.set(self.written.elapsed().as_secs_f64());
        let took = begun.elapsed();
        interval.saturating_sub(took).max(took * (SHARE - 1))
    }

    /// Adds changed and ended sessions to `changes`. Returns the stamps of all open sessions.
    fn note_sessions(&mut self, changes: &mut Changes) -> Stamps {
        let mut now = Stamps::with_capacity(self.sessions.len());
        for space in self.spaces.all() {
            let mut after: Option<Arc<str>> = None;
            loop {
                let (page, _) = space.sessions.registry().page(after.as_deref(), PAGE);
                for cell in &page {
                    let (name, stamp) = (space.record_name(cell.id()), stamp(cell));
                    if self.sessions.get(&name) != Some(&stamp) && cell.end().is_none() {
                        changes.put(Kind::Session, &*name, self.record(cell));
                    }
                    now.insert(name, stamp);
                }
                match page.last() {
                    Some(last) if page.len() == PAGE => after = Some(last.id().clone()),
                    _ => break,
                }
            }
        }
        for name in self.sessions.keys().filter(|name| !now.contains_key(*name)) {
            changes.remove(Kind::Session, &**name);
        }
        now
    }

    fn record(&mut self, cell: &SessionCell) -> Vec<u8> {
        self.buffer.clear();
        let (priority, style) = {
            let live = cell.live();
            saved::save(&live.character, &mut self.buffer);
            (live.priority, live.style.clone())
        };
        let record = Record {
            format: FORMAT,
            pack: cell.pack().name(),
            body: cell.pack().body_name(),
            convention: cell.convention(),
            seed: cell.seed(),
            scene: cell.scene().map(|name| &**name),
            ttl_ms: cell.ttl().as_millis() as u64,
            priority,
            style: &style.name,
            character: &self.buffer,
        };
        // Writing to a vector does not fail.
        postcard::to_allocvec(&record).unwrap_or_default()
    }

    /// Adds changed and deleted scenes to `changes`. Returns the revisions of all scenes.
    fn note_scenes(&self, changes: &mut Changes) -> HashMap<String, u64> {
        let mut now = HashMap::new();
        for space in self.spaces.all() {
            for (scene, cell) in space.store.scenes().all().iter() {
                let (name, snapshot) = (space.record_name(scene), cell.snapshot());
                if self.scenes.get(&name) != Some(&snapshot.revision())
                    && let Some(record) = space.store.record_of(scene, &snapshot)
                {
                    changes.put(Kind::Scene, &*name, record);
                }
                now.insert(name, snapshot.revision());
            }
        }
        for name in self.scenes.keys().filter(|name| !now.contains_key(*name)) {
            changes.remove(Kind::Scene, name.as_str());
        }
        now
    }
}
