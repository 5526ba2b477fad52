//! Styles end to end: `troupe style` makes them from clips, lists and shows them, and characters
//! walk in them.

use serde_json::Value;
use troupe_client::SessionOptions;
use troupe_motion::Vec3;
use troupe_motion::clip::Clip;
use troupe_motion::gait::{StandOptions, find_stand};
use troupe_proto::v1;

use crate::cli::{Folder, failed, printed, text, troupe};
use crate::server::shared;
use crate::walk::Walk;

/// A straight walk of five seconds, with two steps a second.
async fn walk(speed_mps: f32) -> Clip {
    let walk = Walk {
        frames: 150,
        speed_mps,
        heading: 0.8,
        ..Walk::default()
    };
    walk.on(shared().pack().await.skeleton())
}

/// Runs `troupe style` with these arguments.
async fn style(arguments: &[&str]) -> std::process::Output {
    troupe(["style"].iter().chain(arguments)).await
}

#[tokio::test]
async fn a_style_from_a_clip_can_be_walked_in() {
    let folder = Folder::new("style-add");
    let (slow, fast) = (
        folder.write_clip("slow.bvh", &walk(0.9).await),
        folder.write_clip("fast.bvh", &walk(1.8).await),
    );
    let out = folder.file("sine.json");
    let [slow, fast, json] = [&slow, &fast, &out].map(|p| p.to_str().unwrap());
    let output = style(&[
        "add", "--name", "sine", "--clip", slow, "--from", "10", "--clip", fast, "--gait", "run", "--out",
        json,
    ])
    .await;
    assert_eq!(printed(&output), "");
    let notes = text(&output.stderr);
    assert!(
        notes.contains("12 key poses rebuilt") && notes.contains("default speed 0.90"),
        "{notes}"
    );

    // The file and the server have the same style.
    let file: v1::Style = serde_json::from_str(&std::fs::read_to_string(&out).unwrap()).unwrap();
    let shown = printed(&style(&["show", "sine", "--json"]).await);
    let shown: v1::Style = serde_json::from_str(&shown).unwrap();
    assert_eq!(shown.gaits.len(), 2);
    assert!(!shown.built_in);
    for (a, b) in file.gaits.iter().zip(&shown.gaits) {
        assert_eq!(
            (&a.name, a.period_frames, a.keys.len()),
            (&b.name, b.period_frames, b.keys.len())
        );
    }

    // The measured speed and period are those of the sines: a stride a second.
    let gait = &file.gaits[0];
    assert!(
        (gait.forward - 0.9).abs() < 0.02 && gait.left.abs() < 0.02,
        "{gait:?}"
    );
    assert_eq!(gait.period_frames, 30.0);
    let mean = |of: fn(&v1::GaitKey) -> f32| gait.keys.iter().map(of).sum::<f32>() / 12.0;
    assert!((mean(|k| k.forward) - gait.forward).abs() < 1e-3);

    let listed = printed(&style(&["list"]).await);
    let line = listed.lines().find(|line| line.contains("sine")).unwrap();
    assert!(
        line.contains("walk") && line.contains("run") && line.contains("added"),
        "{line}"
    );

    let (client, pack) = shared().client().await;
    let options = SessionOptions::new().style("sine");
    let mut character = client.session(&pack, &options).await.unwrap();
    character.walk(Vec3::Z * 0.9);
    let before = character.step(60).await.unwrap().last().unwrap().root;
    let after = character.step(60).await.unwrap().last().unwrap().root;
    let speed = (after - before).with_y(0.0).length() / 2.0;
    // People do not walk like this: a pack of people walks it slower than commanded, but by less
    // than a quarter.
    assert!((speed - 0.9).abs() < 0.22, "{speed} m/s");
    character.close().await.unwrap();
}

#[tokio::test]
async fn a_style_may_only_stand() {
    let folder = Folder::new("style-static");
    let walk = walk(1.2).await;
    // A frame of the walk, repeated.
    let held = |frame: usize| {
        let mut still = walk.slice(0..60).unwrap();
        for f in 0..still.frames() {
            still.root_positions[f] = walk.root_positions[frame];
            still
                .rotations_at_mut(f)
                .copy_from_slice(walk.rotations_at(frame));
        }
        still
    };
    let stands = |clip: &Clip| find_stand(clip, &StandOptions::default()).is_ok();
    let still = (0..30).map(held).find(stands).unwrap();
    let clip = folder.write_clip("still.bvh", &still);
    let clip = clip.to_str().unwrap();
    printed(&style(&["add", "--name", "statue", "--clip", clip, "--static"]).await);
    let shown: Value = serde_json::from_str(&printed(&style(&["show", "statue", "--json"]).await)).unwrap();
    assert_eq!(shown["is_static"], true);
    assert_eq!(shown["gaits"][0]["name"], "idle");
    assert_eq!(shown["gaits"][0]["keys"].as_array().unwrap().len(), 1);
    let shown = printed(&style(&["show", "statue"]).await);
    assert!(shown.contains("stands still"), "{shown}");
}

#[tokio::test]
async fn clips_that_cannot_become_a_style_are_errors() {
    let folder = Folder::new("style-refused");
    let walk = walk(1.2).await;
    let clip = folder.write_clip("walk.bvh", &walk);
    let short = folder.write_clip("short.bvh", &walk.slice(0..40).unwrap());
    let [clip, short] = [&clip, &short].map(|p| p.to_str().unwrap());
    let add = |more: &[&str]| {
        let arguments: Vec<String> = ["style", "add"]
            .iter()
            .chain(more)
            .map(|&a| a.to_owned())
            .collect();
        async move { troupe(arguments).await }
    };
    failed(
        &add(&["--name", "a", "--clip", short]).await,
        2,
        &["short.bvh", "no gait `walk`", "left strikes are too few"],
    );
    failed(
        &add(&["--name", "a", "--clip", clip, "--gait", "idle"]).await,
        2,
        &["walk.bvh", "no gait `idle`", "no frame stands"],
    );
    failed(
        &add(&["--name", "a", "--clip", clip, "--from", "100", "--to", "150"]).await,
        2,
        &["frames 100 to 150 are not in it; it has 0 to 149"],
    );
    failed(
        &add(&["--name", "a", "--clip", clip, "--clip", clip]).await,
        2,
        &["two clips make the gait `walk`"],
    );
    failed(&add(&["--name", "normal", "--clip", clip]).await, 4, &["normal"]);
    failed(&add(&["--name", "a b", "--clip", clip]).await, 4, &["name"]);
    failed(&style(&["show", "missing"]).await, 4, &["missing"]);
}

#[tokio::test]
async fn the_pack_has_its_styles() {
    let (client, pack) = shared().client().await;
    let styles = client.styles(&pack).await.unwrap();
    if styles.styles.iter().all(|s| !s.built_in) {
        println!("the pack has no styles");
        return;
    }
    for wanted in ["normal", "idle", "walk", "run"] {
        assert!(
            styles.styles.iter().any(|s| s.name == wanted),
            "no style {wanted}"
        );
    }
    assert_eq!(styles.default_style, "normal");
    for style in styles.styles.iter().filter(|s| s.built_in) {
        let gaits = format!("{}: {:?}", style.name, style.gaits);
        assert!(style.gaits.iter().any(|g| g.name == "idle"), "{gaits}");
        for gait in style.gaits.iter().filter(|g| g.period_frames > 0.0) {
            assert!((12.0..=75.0).contains(&gait.period_frames), "{gaits}");
            assert!(gait.left.hypot(gait.forward) > 0.2, "{gaits}");
        }
    }
}
