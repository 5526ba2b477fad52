//! The records that outlive the server, and the characters in them.

use std::cell::OnceCell;
use std::path::PathBuf;

use troupe_character::saved::{FORMAT, RestoreError, Surroundings, restore, save};

use crate::home::Local;
use crate::planted;

/// Bytes of the format and the checksum before a saved character.
pub const HEAD_BYTES: usize = 8;
/// The server's record of the scene's objects at the start.
const OBJECTS: &[u8] = include_bytes!("../corpus/snapshot/objects.bin");

/// A server with a store, and the surroundings for the characters to restore.
struct Kept {
    local: Local,
    around: Surroundings,
}

thread_local! {
    static KEPT: OnceCell<Kept> = const { OnceCell::new() };
}

impl Kept {
    fn new() -> Self {
        let thread = std::thread::current().id();
        let name = format!("troupe-fuzz-{}-{thread:?}", std::process::id());
        let folder: PathBuf = std::env::temp_dir().join(name);
        let local = Local::start(Some(folder.clone()));
        // From here on all scenes are in memory, and the store keeps its file open, so the folder
        // can go.
        let _ = std::fs::remove_dir_all(folder);
        let around = local.service().surroundings("toy", "yard", "a").expect("a scene");
        Self { local, around }
    }
}

/// A character (`c`), the record of a session (`s`) or of the objects of a scene (`o`). A record
/// that the server cannot restore gives an error; a restored one is the same when it is saved
/// again.
pub fn snapshot(bytes: &[u8]) {
    let Some((kind, bytes)) = bytes.split_first() else {
        return;
    };
    KEPT.with(|kept| {
        let kept = kept.get_or_init(Kept::new);
        match kind {
            b'c' => character(bytes, &kept.around),
            b's' => explained(kept.local.service().read_session("c", bytes)),
            b'o' => objects(bytes, kept),
            _ => {}
        }
    });
}

fn explained(read: Result<(), String>) {
    if let Err(reason) = read {
        assert!(!reason.is_empty());
    }
}

/// The body of a character. It gets a valid head, because random bytes would never pass a checksum.
fn character(body: &[u8], around: &Surroundings) {
    let mut whole = body.to_vec();
    whole.splice(
        0..0,
        FORMAT
            .to_le_bytes()
            .into_iter()
            .chain(crc32fast::hash(body).to_le_bytes()),
    );
    let character = match restore(&whole, around) {
        Ok(character) => character,
        Err(RestoreError::Unfit(reason)) => return assert!(!reason.is_empty()),
        Err(other) => panic!("{other}"),
    };
    let mut saved = Vec::new();
    save(&character, &mut saved);
    let again = restore(&saved, around).expect("what was saved is restored");
    let mut twice = Vec::new();
    save(&again, &mut twice);
    assert_eq!(saved, twice);
    planted(|| [character.frame() > 1 << 10, character.stats().underruns > 1 << 10]);
}

fn objects(record: &[u8], kept: &Kept) {
    let store = kept.local.service().store().expect("a store");
    let cell = store.scenes().get("yard").expect("a scene");
    let restored = store.restore_scene("yard", record);
    let scene = cell.snapshot();
    assert!(
        scene
            .instances()
            .all(|object| object.transform.position.is_finite())
    );
    explained(restored);
    store.free_all_but(|_| false);
    let emptied = cell.update(|scene| {
        let all: Vec<_> = scene.instances().map(|object| object.id.clone()).collect();
        all.iter().try_for_each(|id| scene.remove(id).map(drop))
    });
    emptied.expect("objects that no character holds can go");
    store
        .restore_scene("yard", &OBJECTS[1..])
        .expect("a record of the server");
}
