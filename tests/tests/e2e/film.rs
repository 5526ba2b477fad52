//! `troupe drive` and `troupe film` along paths through a scene, with characters that use objects.

use serde_json::Value;
use troupe_proto::v1;

use crate::cli::{Folder, failed, printed, text, troupe};
use crate::server::shared;

const OBJECTS: [&str; 5] = ["cup", "greeter", "seat", "shrine", "sign"];

/// The path of a TOML file in `examples/`, without its ending.
fn example(name: &str) -> String {
    format!("{}/../examples/{name}.toml", env!("CARGO_MANIFEST_DIR"))
}

/// Puts the courtyard of the examples onto the server. Scene and definitions get the prefix `test`,
/// so that tests do not share them. Returns the name of the scene, or `None` if the pack is not
/// `human`, which the examples need.
async fn courtyard(test: &str) -> Option<String> {
    let (client, pack) = shared().client().await;
    if pack.name() != "human" {
        println!("the examples are for the default pack");
        return None;
    }
    let renamed = |text: String, field: &str, name: &str| {
        text.replace(
            &format!("{field} = \"{name}\""),
            &format!("{field} = \"{test}-{name}\""),
        )
    };
    let document = |text| v1::Document {
        format: v1::DocumentFormat::Toml.into(),
        text,
    };
    let mut scene = std::fs::read_to_string(example("scenes/courtyard")).unwrap();
    for name in OBJECTS {
        let object = std::fs::read_to_string(example(&format!("objects/{name}"))).unwrap();
        let object = renamed(object, "\nname", name);
        client.put_object(&pack, document(object)).await.unwrap();
        scene = renamed(scene, "definition", name);
    }
    let scene = renamed(scene, "\nname", "courtyard");
    client.put_scene_document(document(scene)).await.unwrap();
    Some(format!("{test}-courtyard"))
}

/// Drives along a path of the examples and returns the events, each with its name.
async fn events(path: &str, scene: &str) -> Vec<(String, Value)> {
    let path = example(&format!("paths/{path}"));
    let output = troupe(["drive", "--json", "--path", &path, "--scene", scene]).await;
    let summary: Value = serde_json::from_str(&printed(&output)).unwrap();
    let events = summary["events"].as_array().unwrap().iter();
    let named = events.map(|event| {
        let kind = event["event"].as_object().unwrap().keys().next().unwrap();
        (kind.clone(), event.clone())
    });
    named.collect()
}

fn names(events: &[(String, Value)]) -> Vec<&str> {
    events.iter().map(|(name, _)| name.as_str()).collect()
}

fn time_s(event: &(String, Value)) -> f64 {
    event.1["time_s"].as_f64().unwrap()
}

#[tokio::test]
async fn a_bow_has_the_same_events_each_time() {
    let Some(scene) = courtyard("bow").await else {
        return;
    };
    let bow = events("bow", &scene).await;
    assert_eq!(names(&bow)[..3], ["started", "entered", "reached"]);
    assert_eq!(names(&bow).last(), Some(&"done"));
    assert!(bow.is_sorted_by_key(time_s), "{bow:?}");
    assert_eq!(bow, events("bow", &scene).await);
}

#[tokio::test]
async fn a_character_sits_as_long_as_the_path_says() {
    let Some(scene) = courtyard("sit").await else {
        return;
    };
    let sit = events("sit", &scene).await;
    let of_set = |name: &str, set: &str| {
        let found = sit
            .iter()
            .find(|(kind, event)| kind == name && event["event"][kind]["set"] == set);
        time_s(found.unwrap_or_else(|| panic!("no {name} {set} in {sit:?}")))
    };
    let held_s = of_set("entered", "rise") - of_set("reached", "sit");
    assert!((2.0..2.5).contains(&held_s), "{held_s}");
    assert_eq!(names(&sit).last(), Some(&"done"));
}

#[tokio::test]
async fn a_cup_is_carried_and_filmed() {
    let Some(scene) = courtyard("film").await else {
        return;
    };
    let folder = Folder::new("film-cup");
    let (path, out) = (example("paths/cup"), folder.file("cup.png"));
    let film = |from, to| {
        let file = out.to_str().unwrap();
        let arguments = ["film", "--path", &path, "--scene", &scene, "--out", file];
        troupe(
            [
                &arguments[..],
                &["--from", from, "--to", to, "--poses", "8", "--width", "800"],
            ]
            .concat(),
        )
    };
    let events = printed(&film("2", "6").await);
    let at = |what: &str| {
        events
            .find(what)
            .unwrap_or_else(|| panic!("no `{what}` in:\n{events}"))
    };
    let order = [
        "started cup-2",
        "attached cup-2",
        "released cup-2",
        "done with cup-2",
    ]
    .map(at);
    assert!(order.is_sorted(), "{events}");
    let png = std::fs::read(&out).unwrap();
    assert!(png.starts_with(b"\x89PNG") && png.len() > 20_000, "{}", png.len());

    // The cup is on the table again, at another place.
    let (client, _) = shared().client().await;
    let now = client
        .scene(&scene, troupe_motion::conventions::Convention::Native)
        .await
        .unwrap();
    let cup = now.objects.iter().find(|object| object.id == "cup-2").unwrap();
    let place = cup.position.unwrap();
    assert_eq!(cup.state(), v1::ObjectState::Free);
    assert!((place.y - 0.85).abs() < 1e-3 && place.z > 0.0, "{place:?}");
}

#[tokio::test]
async fn missing_objects_scenes_and_frames_are_errors() {
    let Some(scene) = courtyard("wrong").await else {
        return;
    };
    let folder = Folder::new("film-wrong");
    let file = folder.file("path.toml");
    std::fs::write(&file, "[[command]]\ntime_s = 0\ninteract = 'throne'\n").unwrap();
    let (file, out) = (file.to_str().unwrap(), folder.file("out.png"));
    let film = |more: &[&str]| {
        let arguments = ["film", "--path", file, "--out", out.to_str().unwrap()];
        let arguments = arguments.iter().chain(more).map(|&a| a.to_owned());
        troupe(arguments.collect::<Vec<_>>())
    };
    failed(&film(&["--scene", &scene]).await, 4, &["throne"]);
    failed(&film(&["--scene", "no-such-scene"]).await, 4, &["no-such-scene"]);
    failed(&film(&[]).await, 4, &["scene"]);
    std::fs::write(file, "seconds = 1\n[[command]]\ntime_s = 0\nspeed = 1\n").unwrap();
    failed(&film(&["--from", "2"]).await, 2, &["--from must be before --to"]);
    let written = film(&["--from", "0", "--scene", &scene]).await;
    assert_eq!(printed(&written), "", "{}", text(&written.stderr));
}
