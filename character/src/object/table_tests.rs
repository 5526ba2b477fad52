//! Uploading and removing definitions, and what that does to the objects of scenes.

use std::sync::Arc;
use std::time::Duration;

use troupe_motion::Vec3;

use super::testing::{CUP, definition};
use super::*;
use crate::scene::testing::place;
use crate::scene::{BoxTrace, Holder, Scene, SceneCell, SceneTable, State, Transform};
use crate::style::testing::walker_rig;

/// The cup with a trigger that reaches `reach_m` metres.
fn cup(reach_m: f32) -> Definition {
    let text = CUP.replacen("reach_m = 0.8", &format!("reach_m = {reach_m}"), 1);
    Definition::from_toml(&text, &walker_rig()).unwrap()
}

fn named(name: &str) -> Definition {
    Definition {
        name: name.to_owned(),
        ..definition()
    }
}

/// A table with a cup, and a yard with `cups` cups.
fn yard(cups: usize) -> (Definitions, SceneTable, Arc<SceneCell>) {
    let definitions = Definitions::new([definition()]).unwrap();
    let scenes = SceneTable::default();
    let yard = scenes.add("yard", Scene::default()).unwrap();
    for index in 0..cups {
        add(&definitions, &yard, index);
    }
    (definitions, scenes, yard)
}

/// Puts another cup into the scene, beside the others.
fn add(definitions: &Definitions, cell: &SceneCell, index: usize) -> bool {
    definitions.while_unchanged(|list| {
        let Ok(cup) = list.get("cup") else {
            return false;
        };
        let body = Arc::clone(&cup.definition.body);
        let at = place(index as f32 * 10.0, 0.0, 0.0);
        cell.update(|scene| scene.add(&format!("cup-{index}"), "cup", body, at))
            .is_ok()
    })
}

/// Number of objects that a small box finds, `x` metres beside the first one.
fn found(cell: &SceneCell, x: f32) -> usize {
    let trace = BoxTrace::new(place(x, 0.0, 0.0), Vec3::splat(0.01), Vec3::ZERO).unwrap();
    cell.snapshot().detect(&trace).len()
}

#[test]
fn definitions_go_by_name() {
    let table = Definitions::new([named("mug"), definition()]).unwrap();
    let scenes = SceneTable::default();
    let names = |table: &Definitions| -> Vec<String> {
        let list = table.snapshot();
        list.iter().map(|listed| listed.definition.name.clone()).collect()
    };
    assert_eq!(names(&table), ["cup", "mug"]);
    let revisions: Vec<_> = ["cup", "mug"]
        .map(|name| table.get(name).unwrap().revision)
        .into();
    let before = table.snapshot();
    let put = table.upload(named("mug"), &scenes).unwrap();
    assert!(revisions.iter().all(|&revision| put.revision > revision));
    assert_eq!(table.get("mug").unwrap().revision, put.revision);
    assert!(Arc::ptr_eq(
        &put.replaced.unwrap(),
        &before.get("mug").unwrap().definition
    ));
    assert!(Arc::ptr_eq(
        &put.definition,
        &table.get("mug").unwrap().definition
    ));
    let new = table.upload(named("jug"), &scenes).unwrap();
    assert!(new.replaced.is_none() && new.revision > put.revision);
    assert_eq!(
        (names(&table).len(), before.iter().len()),
        (3, 2),
        "a snapshot stays"
    );

    table.remove("jug", &scenes).unwrap();
    let unknown = table.remove("jug", &scenes).unwrap_err();
    assert_eq!(
        unknown.to_string(),
        "there is no object definition \"jug\"; there are: cup, mug"
    );
    assert_eq!(table.get("jug").unwrap_err(), unknown);
    let again = table.upload(named("jug"), &scenes).unwrap();
    assert!(
        again.revision > new.revision,
        "no two uploads have the same revision"
    );
    assert_eq!(table.get("jug").unwrap().definition.pack, walker_rig().name());
}

#[test]
fn the_table_has_a_limit() {
    let all = (0..MAX_DEFINITIONS).map(|index| named(&format!("cup-{index}")));
    let table = Definitions::new(all).unwrap();
    let scenes = SceneTable::default();
    assert_eq!(
        table.upload(named("more"), &scenes).unwrap_err(),
        DefinitionsError::Full
    );
    assert!(
        table.upload(named("cup-7"), &scenes).is_ok(),
        "replacing one needs no room"
    );
    table.remove("cup-7", &scenes).unwrap();
    assert!(table.upload(named("more"), &scenes).is_ok());
    let too_many = (0..=MAX_DEFINITIONS).map(|index| named(&format!("cup-{index}")));
    assert_eq!(Definitions::new(too_many).unwrap_err(), DefinitionsError::Full);
}

#[test]
fn replacing_a_definition_changes_every_scene_but_no_interaction() {
    let (definitions, scenes, yard) = yard(2);
    let hall = scenes.add("hall", Scene::default()).unwrap();
    add(&definitions, &hall, 0);
    let empty = scenes.add("empty", Scene::default()).unwrap();
    let (by, untouched) = (Holder::new("a"), empty.snapshot());
    yard.update(|scene| scene.hold("cup-1", &by)).unwrap();

    let in_use = definitions.get("cup").unwrap().definition;
    let old_scene = yard.snapshot();
    assert_eq!((found(&yard, 2.0), found(&hall, 2.0)), (0, 0));
    let put = definitions.upload(cup(3.0), &scenes).unwrap();
    assert_eq!(put.rebound, 3);
    assert_eq!((found(&yard, 2.0), found(&hall, 2.0)), (1, 1));

    // An interaction goes on with the definition that it has, and with the object.
    assert!(Arc::ptr_eq(&in_use, &put.replaced.unwrap()));
    let (before, after) = (old_scene.instance("cup-1").unwrap(), yard.snapshot());
    let after = after.instance("cup-1").unwrap();
    assert!(Arc::ptr_eq(&before.body, &in_use.body) && Arc::ptr_eq(&after.body, &put.definition.body));
    assert_eq!(after.state, State::Held(by.clone()));
    assert!(after.revision > before.revision);
    // A scene without such objects is unchanged.
    assert!(Arc::ptr_eq(&untouched, &empty.snapshot()));
    // A held object comes back with the new body.
    yard.update(|scene| scene.release("cup-1", &by, place(50.0, 0.0, 0.0)))
        .unwrap();
    assert_eq!(found(&yard, 52.0), 1);
}

#[test]
fn a_definition_with_objects_cannot_be_removed() {
    let (definitions, scenes, yard) = yard(1);
    let hall = scenes.add("hall", Scene::default()).unwrap();
    add(&definitions, &hall, 0);
    let error = definitions.remove("cup", &scenes).unwrap_err();
    assert_eq!(
        error.to_string(),
        "object definition \"cup\" is used in hall, yard; allowed: a definition without objects in scenes"
    );
    hall.update(|scene| scene.remove("cup-0")).unwrap();
    // An object in a hand counts too.
    yard.update(|scene| scene.hold("cup-0", &Holder::new("a")))
        .unwrap();
    let error = definitions.remove("cup", &scenes).unwrap_err();
    assert!(matches!(error, DefinitionsError::InUse { scenes, .. } if scenes == ["yard"]));
    scenes.remove("yard").unwrap();
    assert_eq!(definitions.remove("cup", &scenes).unwrap().name, "cup");
    assert!(definitions.get("cup").is_err());
}

/// An object is added while its definition is replaced or removed by another thread. It ends up
/// with the body in the table, and never without a definition.
#[test]
fn objects_and_definitions_agree_under_concurrent_changes() {
    let (definitions, scenes, yard) = yard(0);
    // Adds a cup while `other` runs; `other` gets 50 ms to interfere.
    let add_beside = |id: &str, other: &(dyn Fn() + Sync)| {
        std::thread::scope(|threads| {
            definitions.while_unchanged(|list| {
                let cup = &list.get("cup").unwrap().definition;
                threads.spawn(other);
                std::thread::sleep(Duration::from_millis(50));
                yard.update(|scene| scene.add(id, "cup", Arc::clone(&cup.body), Transform::IDENTITY))
                    .unwrap();
            });
        });
        let body = yard.snapshot().instance(id).unwrap().body.clone();
        let listed = definitions.get("cup").unwrap();
        assert!(Arc::ptr_eq(&listed.definition.body, &body));
    };
    add_beside("replaced", &|| {
        assert_eq!(definitions.upload(cup(3.0), &scenes).unwrap().rebound, 1);
    });
    assert_eq!(found(&yard, 2.0), 1);
    yard.update(|scene| scene.remove("replaced")).unwrap();
    add_beside("removed", &|| {
        assert!(definitions.remove("cup", &scenes).is_err());
    });
}
