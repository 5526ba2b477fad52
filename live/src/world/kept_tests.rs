use super::super::{Folders, Store};
use super::*;
use troupe_character::document::Format;
use troupe_character::object::testing::{CUP, definition};
use troupe_character::scene::NamedScene;
use troupe_character::scene::testing::place;
use troupe_character::style::testing::{TempFolder, walker_rig};

const YARD: &str = r#"
format = 1
name = "yard"

[[objects]]
id = "mine"
definition = "cup"
position_m = [0.0, 1.0, 2.0]

[[objects]]
id = "gone"
definition = "cup"
position_m = [1.0, 1.0, 2.0]
"#;

fn load(folder: &TempFolder) -> Store {
    let folders = Folders {
        scenes: Some(folder.path().join("scenes")),
        objects: Some(folder.path().join("objects")),
        skeletons: Some(folder.path().join("skeletons")),
    };
    Store::load(folders, usize::MAX, [&walker_rig()]).unwrap()
}

fn put(store: &Store, text: &str) {
    let named = |definitions: &_| Ok(NamedScene::read(text, Format::Toml, definitions).unwrap());
    store
        .put_scene::<super::super::StoreError>(Some((text, Format::Toml)), named)
        .unwrap();
}

fn record(store: &Store) -> Option<Vec<u8>> {
    store.record_of("yard", &store.scenes().get("yard").unwrap().snapshot())
}

/// The record of the yard.
fn note(store: &Store) -> Vec<u8> {
    record(store).unwrap()
}

#[test]
fn objects_are_restored_with_their_places_and_holders() {
    let folder = TempFolder::new("kept-scenes");
    let store = load(&folder);
    store.put_definition(definition(), CUP, Format::Toml).unwrap();
    put(&store, YARD);
    let (one, other) = (Holder::new("one"), Holder::new("other"));
    let cell = store.scenes().get("yard").unwrap();
    cell.update(|scene| {
        let body = scene.instance("mine").unwrap().body.clone();
        scene.add("new", "cup", body.clone(), place(3.0, 1.0, 0.0))?;
        scene.add("left", "cup", body, place(5.0, 1.0, 0.0))?;
        scene.move_to("mine", place(7.0, 1.0, 0.0))?;
        scene.hold("mine", &one)?;
        scene.reserve("left", &other)?;
        scene.remove("gone")
    })
    .unwrap();
    let record = note(&store);
    drop(store);

    let store = load(&folder);
    store.restore_scene("yard", &record).unwrap();
    store.free_all_but(|session| session == "one");
    let scene = store.scenes().get("yard").unwrap().snapshot();
    let at = |id: &str| scene.instance(id).map(|it| (it.transform, it.state.clone()));
    assert_eq!(at("mine"), Some((place(7.0, 1.0, 0.0), State::Held(one))));
    assert_eq!(at("new"), Some((place(3.0, 1.0, 0.0), State::Free)));
    assert_eq!(at("left"), Some((place(5.0, 1.0, 0.0), State::Free)));
    assert_eq!(at("gone"), None);

    // A file that somebody has changed is right, and the record is not.
    put(&store, &YARD.replace("1.0, 2.0]", "1.0, 4.0]"));
    let error = store.restore_scene("yard", &record).unwrap_err();
    assert_eq!(error, "the scene's file has changed since the record was written");
    assert!(store.restore_scene("nowhere", &record).is_err());
    assert!(store.restore_scene("yard", &record[..5]).is_err());
    assert!(
        store
            .restore_scene("yard", &[9, 0, 0])
            .unwrap_err()
            .contains("format 9")
    );
}

#[test]
fn a_scene_without_a_file_has_no_record() {
    let store = Store::load(Folders::default(), usize::MAX, [&walker_rig()]).unwrap();
    store.put_definition(definition(), CUP, Format::Toml).unwrap();
    put(&store, YARD);
    assert_eq!(record(&store), None);
}
