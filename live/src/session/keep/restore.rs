//! Restores sessions and the objects of scenes from their records.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use troupe_motion::model::Capability;

use super::{FORMAT, Record, Stamp, Stamps, stamp};
use crate::records::{Kind, RecordStore, RecordsError};
use crate::session::LivePacks;
use crate::session::cell::{SessionCell, SessionParts};
use crate::session::space::{Spaces, of_record};
use crate::world::Store;
use troupe_character::Path;
use troupe_character::live::World;
use troupe_character::saved::{self, Surroundings};
use troupe_character::scene::Holder;

/// Restores sessions. Returns the restored ones and those that could not be restored.
pub(super) fn restore(
    spaces: &Spaces,
    records: &mut dyn RecordStore,
) -> Result<(Stamps, Stamps), RecordsError> {
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

pub(in crate::session) fn restore_session(
    spaces: &Spaces,
    name: &str,
    record: &[u8],
) -> Result<Arc<SessionCell>, String> {
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

/// The scene of a session, by its record.
pub(in crate::session) fn scene_of(record: &[u8]) -> Option<&str> {
    postcard::from_bytes::<Record<'_>>(record).ok()?.scene
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
    (pack.loaded().require(Capability::Live, "pack")).map_err(|error| text(&error))?;
    let (pack, dress) = match record.skeleton {
        "" => (pack, None),
        name => {
            let worn = world.skeletons().wear("skeleton", name, &pack, &packs.table());
            let (pack, mut dress) = worn.map_err(|error| text(&error))?;
            if !record.worn.is_some_and(|last| dress.resume(last)) {
                return Err(format!("skeleton {name:?} has other joints now"));
            }
            (pack, Some(dress))
        }
    };
    let scale = pack.worn().map_or(1.0, |worn| worn.scale());
    // Rounding differs between machines.
    if (scale - record.scale).abs() > 1e-4 * record.scale {
        return Err(format!(
            "skeleton {:?} has another size now: {scale}, and {} before",
            record.skeleton, record.scale
        ));
    }
    let style = pack.styles().get(record.style);
    let style = style.ok_or_else(|| format!("there is no style {:?}", record.style))?;
    let resident =
        (record.scene.map(|name| world.scenes().enter(name)).transpose()).map_err(|error| text(&error))?;
    let around = Surroundings {
        rig: pack.rig().clone(),
        styles: pack.styles(),
        skills: pack.loaded().skills.clone(),
        world: resident.as_ref().map(|resident| World {
            scene: resident.cell().clone(),
            definitions: world.definitions().clone(),
            holder: Holder::new(id.clone()),
            scale,
        }),
    };
    let character = saved::restore(record.character, &around).map_err(|error| text(&error))?;
    Ok(SessionParts {
        id: id.clone(),
        dress,
        pack,
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
pub(super) fn restore_scenes(
    spaces: &Spaces,
    records: &mut dyn RecordStore,
) -> Result<HashMap<String, u64>, RecordsError> {
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
