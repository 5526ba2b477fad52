//! Keeps sessions, and what moves in scenes, so that they outlive the process.
//!
//! A round notes all that has changed since the last, and writes it at once: what is on the disk is a moment of every session. A session
//! is locked for the few microseconds that it takes to copy it.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use tokio::time::Instant;
use troupe_motion::conventions::Convention;
use troupe_motion::model::Capability;

use super::cell::{Parts, SessionCell};
use super::{LivePacks, Registry, Sessions};
use crate::records::{Changes, Kind, Records, RecordsError};
use crate::telemetry::{Counter, Gauge, Labels, Metric, Seldom, Telemetry};
use crate::world::Store;
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
const FORMAT: u32 = 1;
/// Sessions of one look at the registry.
const PAGE: usize = 256;
/// Rounds take at most this share of the time of one core.
const SHARE: u32 = 10;

/// A session as it is kept. Its id is the record's name.
#[derive(Debug, Serialize, Deserialize)]
struct Record<'a> {
    format: u32,
    pack: &'a str,
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

/// By id.
type Stamps = HashMap<Arc<str>, Stamp>;

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
    registry: Arc<Registry>,
    world: Arc<Store>,
    records: Records,
    sessions: Stamps,
    /// Revisions.
    scenes: HashMap<String, u64>,
    buffer: Vec<u8>,
    age: Gauge,
    bytes: Counter,
    failures: Counter,
    told: Seldom,
    written: Instant,
}

impl Sessions {
    /// Restores the sessions and scenes of `records`, and gives what keeps them from now on. What cannot be restored is left out with
    /// a warning, and goes with the next round.
    ///
    /// # Errors
    /// [`RecordsError`] where the records cannot be read.
    pub fn keeper(
        &self,
        packs: &LivePacks,
        world: &Arc<Store>,
        mut records: Records,
        telemetry: &Telemetry,
    ) -> Result<Keeper, RecordsError> {
        let labels = Labels::default();
        let scenes = restore_scenes(world, &mut records)?;
        let (restored, left_out) = self.restore(packs, world, &mut records)?;
        let known = |id: &str| restored.contains_key(id);
        world.free_all_but(known);
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
        Ok(Keeper {
            registry: self.registry().clone(),
            world: world.clone(),
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

    /// Restores what sessions can be: those, and those that cannot.
    fn restore(
        &self,
        packs: &LivePacks,
        world: &Store,
        records: &mut Records,
    ) -> Result<(Stamps, Stamps), RecordsError> {
        let (mut restored, mut left_out) = (Stamps::new(), Stamps::new());
        for (id, record) in records.all(Kind::Session)? {
            let id: Arc<str> = Arc::from(id);
            let made = parts(&id, &record, packs, world).and_then(|parts| {
                let cell = Arc::new(SessionCell::new(parts, self.time().clone()));
                let inserted = self
                    .registry()
                    .insert(std::slice::from_ref(&cell), self.time().now(), |_| {
                        "id".to_owned()
                    });
                inserted.map(|()| cell).map_err(|error| error.to_string())
            });
            match made {
                Ok(cell) => drop(restored.insert(id, stamp(&cell))),
                Err(reason) => {
                    tracing::warn!(
                        session = &*id,
                        reason,
                        "a session of the process before is left out"
                    );
                    left_out.insert(id, Stamp::NONE);
                }
            }
        }
        Ok((restored, left_out))
    }
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
    let pack = packs.find("pack", record.pack).map_err(|error| told(&error))?;
    (pack.loaded.require(Capability::Live, "pack")).map_err(|error| told(&error))?;
    let style = pack.loaded.styles.get(record.style);
    let style = style.ok_or_else(|| format!("there is no style {:?}", record.style))?;
    let resident =
        (record.scene.map(|name| world.scenes().enter(name)).transpose()).map_err(|error| told(&error))?;
    let around = Surroundings {
        rig: pack.rig().clone(),
        styles: pack.loaded.styles.clone(),
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
fn restore_scenes(world: &Store, records: &mut Records) -> Result<HashMap<String, u64>, RecordsError> {
    let mut revisions = HashMap::new();
    for (name, record) in records.all(Kind::Scene)? {
        if let Err(reason) = world.restore_scene(&name, &record) {
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

    /// A round. Says where it fails, once a minute. Answers how long to wait until the next, where rounds come every `interval`.
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
        let mut after: Option<Arc<str>> = None;
        loop {
            let (page, _) = self.registry.page(after.as_deref(), PAGE);
            for cell in &page {
                let stamp = stamp(cell);
                if self.sessions.get(cell.id()) != Some(&stamp) && cell.end().is_none() {
                    changes.put(Kind::Session, &**cell.id(), self.record(cell));
                }
                now.insert(cell.id().clone(), stamp);
            }
            match page.last() {
                Some(last) if page.len() == PAGE => after = Some(last.id().clone()),
                _ => break,
            }
        }
        for id in self.sessions.keys().filter(|id| !now.contains_key(*id)) {
            changes.remove(Kind::Session, &**id);
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
            pack: cell.pack().rig().name(),
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
        for (name, cell) in self.world.scenes().all().iter() {
            let scene = cell.snapshot();
            if self.scenes.get(name) != Some(&scene.revision()) {
                self.world.note_scene(name, &scene, changes);
            }
            now.insert(name.clone(), scene.revision());
        }
        for name in self.scenes.keys().filter(|name| !now.contains_key(*name)) {
            changes.remove(Kind::Scene, name.as_str());
        }
        now
    }
}
