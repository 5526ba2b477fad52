//! Scenes and object definitions end to end: files that the command line puts onto the server, and
//! characters in a scene.

use serde_json::Value;
use troupe_client::{Act, ClientError, SessionOptions};
use troupe_motion::Vec3;
use troupe_motion::conventions::Convention;
use troupe_proto::v1;

use crate::cli::{Folder, failed, printed, text, troupe};
use crate::server::shared;

/// The path of a file in `examples/`.
fn example(name: &str) -> String {
    format!("{}/../examples/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// Runs `troupe` with these arguments.
async fn run(arguments: &[&str]) -> std::process::Output {
    troupe(arguments).await
}

/// A definition without poses, which any pack with a root can use. Its name is that of the test, so
/// that tests do not share it.
fn post(name: &str) -> String {
    format!(
        r#"
format = 1
name = "{name}"
description = "A post to walk to."
shape = {{ box = {{ center_m = [0, 0.5, 0], half_extents_m = [0.05, 0.5, 0.05] }} }}
variants = [{{ name = "touch", entry = "touch" }}]

[[sets]]
name = "touch"
keyframes = [{{ pivot = true, place_m = [0.0, 0.4], heading_deg = 180.0 }}]
"#
    )
}

fn yard(name: &str, definition: &str) -> String {
    format!(
        r#"
format = 1
name = "{name}"
objects = [{{ id = "post", definition = "{definition}", position_m = [0, 0, 3] }}]
"#
    )
}

#[tokio::test]
async fn the_examples_can_be_put_and_read_back() {
    if shared().pack().await.name() != "human" {
        println!("the examples are for the default pack");
        return;
    }
    let objects =
        ["cup", "greeter", "seat", "shrine", "sign"].map(|name| example(&format!("objects/{name}.toml")));
    let files: Vec<&str> = objects.iter().map(String::as_str).collect();
    let checked = run(&[&["object", "check"], &files[..]].concat()).await;
    assert!(
        text(&checked.stderr).contains("`cup` is good for pack"),
        "{}",
        text(&checked.stderr)
    );
    let put = run(&[&["object", "put"], &files[..]].concat()).await;
    assert!(
        text(&put.stderr).contains("`sign` added for pack"),
        "{}",
        text(&put.stderr)
    );
    let put = run(&["scene", "put", &example("scenes/courtyard.toml")]).await;
    let notes = text(&put.stderr);
    assert!(
        notes.contains("scene `courtyard`: 4 colliders, 6 objects"),
        "{notes}"
    );

    let listed = printed(&run(&["object", "list"]).await);
    let line = listed.lines().find(|line| line.contains("sign")).unwrap();
    assert!(line.contains("bow, deep-bow") && line.contains("front"), "{line}");
    let listed = printed(&run(&["scene", "list", "--json"]).await);
    let listed: Value = serde_json::from_str(&listed).unwrap();
    assert!(
        listed
            .as_array()
            .unwrap()
            .iter()
            .any(|scene| scene["name"] == "courtyard")
    );
    let shown = printed(&run(&["scene", "get", "courtyard"]).await);
    assert!(
        shown.contains("cup-1") && shown.contains("2.30 0.85 0.30"),
        "{shown}"
    );
    let shown = printed(&run(&["scene", "get", "courtyard", "--json"]).await);
    let scene: v1::Scene = serde_json::from_str(&shown).unwrap();
    assert_eq!(scene.colliders.len(), 4);

    // The server accepts a definition as it prints it.
    let folder = Folder::new("object-again");
    let again = folder.file("cup.toml");
    std::fs::write(&again, printed(&run(&["object", "get", "cup"]).await)).unwrap();
    let put = run(&["object", "put", again.to_str().unwrap()]).await;
    assert!(
        text(&put.stderr).contains("`cup` replaced"),
        "{}",
        text(&put.stderr)
    );

    failed(&run(&["object", "delete", "cup"]).await, 4, &["courtyard"]);
    printed(&run(&["scene", "delete", "courtyard"]).await);
    printed(&run(&["object", "delete", "cup", "greeter", "seat", "shrine", "sign"]).await);
    failed(
        &run(&["scene", "get", "courtyard"]).await,
        4,
        &["no scene \"courtyard\""],
    );
}

#[tokio::test]
async fn an_error_in_a_file_names_its_line() {
    let folder = Folder::new("scene-wrong");
    let write = |name: &str, text: String| {
        let path = folder.file(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let bad = write(
        "bad.toml",
        post("bad").replace("0.05, 0.5, 0.05", "0.05, -0.5, 0.05"),
    );
    failed(
        &run(&["object", "check", &bad]).await,
        2,
        &[
            "bad.toml: object definition: line 5",
            "shape.box.half_extents_m[1]: is -0.5; allowed: 0.001 to 1000 m",
        ],
    );
    let lost = write("lost.toml", yard("lost", "no-such-thing"));
    failed(
        &run(&["scene", "put", &lost]).await,
        2,
        &["lost.toml: scene: line 4", "objects[0].definition"],
    );
    let other = write("notes.txt", String::new());
    failed(
        &run(&["scene", "put", &other]).await,
        2,
        &["must be .toml or .json"],
    );
}

#[tokio::test]
async fn characters_use_a_scene() {
    let (client, pack) = shared().client().await;
    let toml = |text| v1::Document {
        format: v1::DocumentFormat::Toml.into(),
        text,
    };
    client.put_object(&pack, toml(post("living-post"))).await.unwrap();
    client
        .put_scene_document(toml(yard("living", "living-post")))
        .await
        .unwrap();
    let options = SessionOptions::new().scene("living");
    let mut guard = client.session(&pack, &options).await.unwrap();
    guard.walk(Vec3::Z);
    guard.step(20).await.unwrap();
    assert!(guard.held().is_none());
    let info = guard.info().await.unwrap();
    assert_eq!(info.scene, "living");

    let reach = v1::DetectRequest {
        session_id: guard.id().to_owned(),
        ahead: 5.0,
        ..v1::DetectRequest::default()
    };
    let found = client.detect(reach).await.unwrap();
    let names: Vec<&str> = found
        .objects
        .iter()
        .map(|of| of.variants[0].name.as_str())
        .collect();
    assert_eq!(names, ["touch"]);

    let moved = v1::ObjectMove {
        id: "post".to_owned(),
        position: Some(v1::Vec3 {
            x: 0.0,
            y: 0.0,
            z: -3.0,
        }),
        ..v1::ObjectMove::default()
    };
    let done = client
        .move_objects("living", Convention::Native, vec![moved])
        .await
        .unwrap();
    assert!(done.results[0].problem.is_none());
    assert!(client.delete_scene("living").await.is_err(), "a session is in it");

    let mut nowhere = client.session(&pack, &SessionOptions::new()).await.unwrap();
    let refused = nowhere.act(&Act::interact("post")).step(1).await.unwrap_err();
    assert!(matches!(&refused, ClientError::Session(_)), "{refused}");
    nowhere.close().await.unwrap();
    guard.close().await.unwrap();
    client.delete_scene("living").await.unwrap();
    client.delete_object("living-post").await.unwrap();
    let unknown = client.session(&pack, &options).await.unwrap_err();
    let ClientError::Refused(refusal) = unknown else {
        panic!("{unknown}");
    };
    assert_eq!(refusal.reason.as_deref(), Some("UNKNOWN_SCENE"));
}
