//! Keeps sessions, and what moves in scenes, so that they outlive the process.
//!
//! A round notes all that has changed since the last, and writes it at once: what is on the disk is
//! a moment of every session. A session is locked for the few microseconds that it takes to copy
//! it.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tokio::time::Instant;
use troupe_motion::conventions::Convention;
use troupe_motion::model::Capability;

use super::LivePacks;
use super::cell::{Parts, SessionCell};
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
    "Time since the state of sessions and scenes was written last",
);
const BYTES: Metric = Metric::new("troupe_store_written_bytes_total", "Bytes of records written");
const FAILURES: Metric = Metric::new(
    "troupe_store_failures_total",
    "Times that the state could not be written",
);
const RESTORED: Metric = Metric::new(
    "troupe_store_sessions_total",
    "Sessions of the process before, by whether they were restored or left out",
);

/// Changes with what a record is. Records of another format are left out.
const FORMAT: u32 = 2;
/// Sessions of one look at the registry.
const PAGE: usize = 256;
/// Rounds take at most this share of the time of one core.
const SHARE: u32 = 10;

/// A session as it is kept. Its tenant and id are the record's name.
#[derive(Debug, Serialize, Deserialize)]
struct Record<'a> {
    format: u32,
    pack: &'a str,
    /// Empty for packs of one skeleton.
    body: &'a str,
    convention: Convention,
    seed: u64,
    scene: Option<&'a str>,
    ttl_ms: u64,
    priority: f32,
    style: &'a str,
    character: &'a [u8],
}

/// What is known of a session when it was noted last.
#[derive(Debug, PartialEq)]
struct Stamp {
    /// Tells it from a later session of its id.
    owner: u64,
    character: (i64, u64, i64),
    priority: f32,
}

/// By the names of records.
type Stamps = HashMap<String, Stamp>;

/// What a round did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Round {
    /// Records that were written or removed: sessions and scenes.
    pub records: usize,
    /// Bytes of them.
    pub bytes: usize,
}

/// Keeps the sessions of a server.
#[derive(Debug)]
pub struct Keeper {
    spaces: Arc<Spaces>,
    records: Records,
    sessions: Stamps,
    /// Revisions, by the names of records.
    scenes: HashMap<String, u64>,
    buffer: Vec<u8>,
    age: Gauge,
    bytes: Counter,
    failures: Counter,
    told: Seldom,
    written: Instant,
}

impl Keeper {
    /// Restores the sessions and scenes of `records`, and keeps them from now on. What cannot be
    /// restored is left out with a warning, and goes with the next round.
    ///
    /// # Errors
    /// [`RecordsError`] where the records cannot be read.
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
            tracing::info!(sessions = restored.len(), "sessions of the process before go on");
        }
        let mut sessions = restored;
        // They are not there, so the first round removes their records.
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
            told: Seldom::default(),
            written: Instant::now(),
        })
    }
}

/// Restores what sessions can be: those, and those that cannot.
fn restore(spaces: &Spaces, records: &mut Records) -> Result<(Stamps, Stamps), RecordsError> {
    let (mut restored, mut left_out) = (Stamps::new(), Stamps::new());
    for (name, record) in records.all(Kind::Session)? {
        match restore_session(spaces, &name, &record) {
            Ok(cell) => drop(restored.insert(name, stamp(&cell))),
            Err(reason) => {
                tracing::warn!(
                    session = name,
                    reason,
                    "a session of the process before is left out"
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
    /// That of no session.
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

/// A session as its record has it.
fn parts(id: &Arc<str>, record: &[u8], packs: &LivePacks, world: &Store) -> Result<Parts, String> {
    let told = |error: &dyn std::fmt::Display| error.to_string();
    let record: Record<'_> = postcard::from_bytes(record).map_err(|error| told(&error))?;
    if record.format != FORMAT {
        return Err(format!("it is of format {}; allowed: {FORMAT}", record.format));
    }
    let pack = packs.find(&Path::root(), record.pack, record.body);
    let pack = pack.map_err(|error| told(&error))?;
    (pack.loaded.require(Capability::Live, "pack")).map_err(|error| told(&error))?;
    let style = pack.styles().get(record.style);
    let style = style.ok_or_else(|| format!("there is no style {:?}", record.style))?;
    let resident =
        (record.scene.map(|name| world.scenes().enter(name)).transpose()).map_err(|error| told(&error))?;
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
    let character = saved::restore(record.character, &around).map_err(|error| told(&error))?;
    Ok(Parts {
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
/// Why it would be left out.
#[cfg(feature = "testing")]
pub fn read_record(id: &str, record: &[u8], packs: &LivePacks, world: &Store) -> Result<(), String> {
    parts(&Arc::from(id), record, packs, world).map(drop)
}

/// Restores what scenes can be; their revisions. Those that cannot have none.
fn restore_scenes(spaces: &Spaces, records: &mut Records) -> Result<HashMap<String, u64>, RecordsError> {
    let mut revisions = HashMap::new();
    for (name, record) in records.all(Kind::Scene)? {
        let (tenant, scene) = of_record(&name);
        let space = spaces.of(&tenant).map_err(|error| error.to_string());
        if let Err(reason) = space.and_then(|space| space.store.restore_scene(scene, &record)) {
            tracing::warn!(
                scene = name,
                reason,
                "objects of a scene are left where its file has them"
            );
        }
        // The next round writes it as it is, or removes it.
        revisions.insert(name, u64::MAX);
    }
    Ok(revisions)
}

impl Keeper {
    /// Writes what has changed since the last round. This blocks.
    ///
    /// # Errors
    /// [`RecordsError`]; the next round writes it then.
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

    /// A round. Says where it fails, once a minute. Answers how long to wait until the next, where
    /// rounds come every `interval`.
    pub fn go_on(&mut self, interval: Duration) -> Duration {
        let begun = Instant::now();
        if let Err(error) = self.round() {
            self.failures.increment(1);
            if let Some(held_back) = self.told.next(begun.into_std()) {
                tracing::error!(%error, held_back, "the state of sessions is not kept");
            }
        }
        self.age.set(self.written.elapsed().as_secs_f64());
        let took = begun.elapsed();
        interval.saturating_sub(took).max(took * (SHARE - 1))
    }

    /// Notes sessions that changed, and those that are gone. What is known of all of them then.
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
        // A vector takes all that there is.
        postcard::to_allocvec(&record).unwrap_or_default()
    }

    /// Notes scenes that changed, and those that are gone; the revisions of all.
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
