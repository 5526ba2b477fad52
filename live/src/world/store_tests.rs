use std::sync::Arc;

use troupe_motion::Vec3;

use super::store::{Folders, LoadError, Store, StoreError};
use troupe_character::document::Format;
use troupe_character::object::testing::{CUP, definition};
use troupe_character::object::{Definition, DefinitionsError};
use troupe_character::scene::testing::place;
use troupe_character::scene::{Holder, NamedScene, Scene, State, TableError};
use troupe_character::style::StyleTable;
use troupe_character::style::testing::{TempFolder, walker_rig, walker_style};
use troupe_motion::model::Rig;

const YARD: &str = r#"
format = 1
name = "yard"
ground_m = 1.0

[[objects]]
id = "mine"
definition = "cup"
position_m = [0.0, 1.0, 2.0]
"#;

fn folders(folder: &TempFolder) -> Folders {
    Folders {
        scenes: Some(folder.path().join("scenes")),
        objects: Some(folder.path().join("objects")),
        skeletons: Some(folder.path().join("skeletons")),
    }
}

fn load(folder: &TempFolder) -> Result<Store, LoadError> {
    Store::load(folders(folder), usize::MAX, [&walker_rig(), &other_rig()])
}

/// A rig of the same skeleton under another name.
fn other_rig() -> Rig {
    Rig {
        name: "others".into(),
        ..walker_rig()
    }
}

fn put_yard(store: &Store, text: &str) -> Result<String, String> {
    let put: Result<_, StoreError> = store.put_scene(Some((text, Format::Toml)), |definitions| {
        Ok(NamedScene::read(text, Format::Toml, definitions).unwrap())
    });
    put.map_err(|error| error.to_string())
}

fn put_cup(store: &Store) -> troupe_character::object::Uploaded {
    store.put_definition(definition(), CUP, Format::Toml).unwrap()
}

fn ids(scene: &Scene) -> Vec<String> {
    let mut ids: Vec<String> = scene
        .instances()
        .map(|instance| instance.id.to_string())
        .collect();
    ids.sort();
    ids
}

#[test]
fn uploads_survive_a_restart_until_they_are_deleted() {
    let folder = TempFolder::new("store-kept");
    let store = load(&folder).unwrap();
    assert!(store.scenes().names().is_empty());
    put_cup(&store);
    assert_eq!(put_yard(&store, YARD), Ok("yard".to_owned()));
    // One that was made otherwise is written as it is.
    let mut made = Scene::new(0.5).unwrap();
    made.add("its", "cup", definition().body, place(1.0, 2.0, 3.0))
        .unwrap();
    let put: Result<_, StoreError> = store.put_scene(None, |_| {
        Ok(NamedScene {
            name: "hall".to_owned(),
            scene: made,
        })
    });
    put.unwrap();

    let again = load(&folder).unwrap();
    assert_eq!(again.scenes().names(), ["hall", "yard"]);
    let text = std::fs::read_to_string(folder.path().join("scenes/yard.toml")).unwrap();
    assert_eq!(text, YARD, "as it was written");
    assert!(folder.path().join("objects/walkers/cup.toml").is_file());
    let hall = again.scenes().get("hall").unwrap().snapshot();
    assert_eq!(
        (
            hall.ground_y_m(),
            hall.instance("its").unwrap().transform.position
        ),
        (0.5, Vec3::new(1.0, 2.0, 3.0))
    );

    again.delete_scene("hall").unwrap();
    again.delete_scene("yard").unwrap();
    again.delete_definition("cup").unwrap();
    let empty = load(&folder).unwrap();
    assert!(empty.scenes().names().is_empty() && empty.definitions().get("cup").is_err());
}

#[test]
fn a_scene_is_replaced_under_those_who_are_in_it() {
    let store = Store::load(Folders::default(), usize::MAX, []).unwrap();
    put_cup(&store);
    put_yard(&store, YARD).unwrap();
    let resident = store.scenes().enter("yard").unwrap();
    let by = Holder::new("a");
    resident
        .cell()
        .update(|scene| scene.reserve("mine", &by))
        .unwrap();
    let new = YARD.replace("ground_m = 1.0", "ground_m = 2.0")
        + "\n[[objects]]\nid = \"new\"\ndefinition = \"cup\"\nposition_m = [5, 0, 0]\n";
    put_yard(&store, &new).unwrap();
    let scene = resident.cell().snapshot();
    assert_eq!(
        (scene.ground_y_m(), ids(&scene)),
        (2.0, vec!["mine".to_owned(), "new".to_owned()])
    );
    assert_eq!(scene.instance("mine").unwrap().state, State::Reserved(by));
    let in_use = store.delete_scene("yard").unwrap_err();
    assert!(
        matches!(in_use, StoreError::Scenes(TableError::InUse { sessions: 1, .. })),
        "{in_use}"
    );
    drop(resident);
    store.delete_scene("yard").unwrap();
}

#[test]
fn scenes_share_a_memory_that_has_an_end() {
    let yard = {
        let store = Store::load(Folders::default(), usize::MAX, []).unwrap();
        put_cup(&store);
        put_yard(&store, YARD).unwrap();
        store.scenes().get("yard").unwrap().snapshot().bytes()
    };
    let cup = cup_bytes();
    let store = Store::load(Folders::default(), cup + 2 * yard, []).unwrap();
    put_cup(&store);
    let named = |name: &str| YARD.replace("name = \"yard\"", &format!("name = \"{name}\""));
    for name in ["yard", "b", "yard"] {
        assert_eq!(put_yard(&store, &named(name)), Ok(name.to_owned()));
    }
    let error = put_yard(&store, &named("c")).unwrap_err();
    assert!(error.contains("max_scene_memory_mib"), "{error}");
    assert_eq!(store.scenes().names().len(), 2);
    store.delete_scene("b").unwrap();
    assert_eq!(put_yard(&store, &named("c")), Ok("c".to_owned()));
}

/// What the cup takes of the memory of uploads.
fn cup_bytes() -> usize {
    let store = Store::load(Folders::default(), usize::MAX, []).unwrap();
    put_cup(&store);
    let cups = store.definitions().snapshot();
    cups.iter().map(|listed| listed.definition.bytes()).sum()
}

#[test]
fn definitions_and_styles_share_the_memory_of_scenes() {
    const ALL: usize = 1 << 20;
    let cup = cup_bytes();
    let store = Store::load(Folders::default(), ALL, []).unwrap();
    put_cup(&store);
    put_cup(&store);
    let beside = store.beside(Folders::default(), []).unwrap();
    let check = |bytes| beside.memory().check(bytes, 0).map_err(|error| error.taken);
    assert_eq!(check(ALL - cup), Ok(()));
    assert_eq!(check(ALL - cup + 1), Err(cup));
    store.delete_definition("cup").unwrap();
    assert_eq!(check(ALL), Ok(()));

    let folder = TempFolder::new("store-styles");
    let styles = Arc::new(StyleTable::load(&walker_rig(), folder.path(), None).unwrap());
    store.memory().count(&styles);
    let style = styles.put(walker_style()).unwrap().bytes();
    assert_eq!(check(ALL - style), Ok(()));
    assert_eq!(check(ALL - style + 1), Err(style));
    drop(styles);
    assert_eq!(check(ALL), Ok(()));
}

#[test]
fn a_definition_that_a_kept_scene_names_stays() {
    let folder = TempFolder::new("store-in-use");
    let store = load(&folder).unwrap();
    put_cup(&store);
    put_yard(&store, YARD).unwrap();
    let in_use = |store: &Store| match store.delete_definition("cup") {
        Err(StoreError::Definitions(DefinitionsError::InUse { scenes, .. })) => scenes,
        other => panic!("{other:?}"),
    };
    assert_eq!(in_use(&store), ["yard"]);
    // Its object is gone now, but would be back after a restart.
    let yard = store.scenes().get("yard").unwrap();
    yard.update(|scene| scene.remove("mine")).unwrap();
    assert_eq!(in_use(&store), ["yard"]);
    let empty = YARD.split("[[objects]]").next().unwrap();
    put_yard(&store, empty).unwrap();
    store.delete_definition("cup").unwrap();
    load(&folder).unwrap();
}

#[test]
fn a_definition_may_change_its_pack() {
    let folder = TempFolder::new("store-packs");
    let store = load(&folder).unwrap();
    put_cup(&store);
    let moved = Definition::from_toml(CUP, &other_rig()).unwrap();
    assert!(
        store
            .put_definition(moved, CUP, Format::Toml)
            .unwrap()
            .replaced
            .is_some()
    );
    let again = load(&folder).unwrap();
    assert_eq!(again.definitions().get("cup").unwrap().definition.pack, "others");

    std::fs::create_dir_all(folder.path().join("objects/walkers")).unwrap();
    std::fs::write(folder.path().join("objects/walkers/cup.toml"), CUP).unwrap();
    let again = load(&folder).unwrap();
    assert_eq!(again.definitions().get("cup").unwrap().definition.pack, "walkers");
}

#[test]
fn files_that_cannot_be_used_are_left_out() {
    let folder = TempFolder::new("store-bad");
    let scenes = folder.path().join("scenes");
    std::fs::create_dir_all(&scenes).unwrap();
    std::fs::write(scenes.join("yard.toml"), YARD).unwrap();
    let objects = folder.path().join("objects/walkers");
    std::fs::create_dir_all(&objects).unwrap();
    std::fs::write(objects.join("mug.toml"), "no definition").unwrap();
    let empty = "format = 1\nname = \"field\"\nground_m = 0.0\n";
    std::fs::write(scenes.join("field.toml"), empty).unwrap();
    // The yard has an object without a definition.
    let store = load(&folder).unwrap();
    assert_eq!(store.scenes().names(), ["field"]);
    assert_eq!(store.definitions().snapshot().iter().len(), 0);
}

#[test]
fn an_upload_that_cannot_be_written_is_not_added() {
    let folder = TempFolder::new("store-blocked");
    let store = load(&folder).unwrap();
    put_cup(&store);
    // A file where the folder should be.
    std::fs::write(folder.path().join("scenes"), "in the way").unwrap();
    let error = put_yard(&store, YARD).unwrap_err();
    assert!(
        error.starts_with("scene \"yard\" cannot be written to its folder"),
        "{error}"
    );
    assert!(store.scenes().get("yard").is_err());
    store.delete_definition("cup").unwrap();
}
