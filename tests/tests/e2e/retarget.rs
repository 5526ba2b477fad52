//! `troupe retarget`: a clip's motion on another character, without a server.

use std::path::Path;
use std::process::Output;

use serde_json::Value;

use crate::cli::{Folder, failed, printed, text, troupe_at};

async fn troupe(arguments: &[&str]) -> Output {
    troupe_at("http://127.0.0.1:1", arguments).await
}

fn example() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/walk.bvh");
    path.to_str().unwrap().to_owned()
}

/// A character's file with an animation of its own.
async fn hero(folder: &Folder) -> String {
    let path = folder.file("hero.glb").to_str().unwrap().to_owned();
    let made = troupe(&["clip", "convert", &example(), &path]).await;
    assert!(made.status.success(), "{}", text(&made.stderr));
    path
}

#[tokio::test]
async fn a_character_gets_the_motion_of_a_clip() {
    let folder = Folder::new("retarget");
    let (hero, out) = (hero(&folder).await, folder.file("out.glb"));
    let out = out.to_str().unwrap();
    let answer = troupe(&[
        "retarget",
        &example(),
        "--to",
        &hero,
        "--out",
        out,
        "--name",
        "steps",
        "--json",
    ])
    .await;
    let answer: Value = serde_json::from_str(&printed(&answer)).unwrap();
    assert_eq!(answer["faults"], Value::Array(Vec::new()), "{answer}");
    let steps = format!("{out}#steps");
    let report = printed(&troupe(&["clip", "info", &steps, "--json"]).await);
    let report: Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report[0]["frames"], 120);
}

#[tokio::test]
async fn parts_are_shown_and_corrected() {
    let folder = Folder::new("retarget-parts");
    let (hero, out) = (hero(&folder).await, folder.file("out.bvh"));
    let shown = printed(&troupe(&["clip", "info", &hero, "--parts"]).await);
    assert!(
        shown.contains("[left_leg]") && shown.contains("end = \"Foot_L\""),
        "{shown}"
    );
    let parts = folder.file("hero.toml");
    let parts_file = parts.to_str().unwrap();
    let mut arguments = vec!["retarget", "", "--to", &hero, "--out", out.to_str().unwrap()];
    let clip = example();
    arguments[1] = &clip;
    arguments.extend(["--to-parts", parts_file]);
    std::fs::write(&parts, &shown).unwrap();
    assert!(troupe(&arguments).await.status.success());
    std::fs::write(&parts, "neck = [\"Tie\"]").unwrap();
    failed(&troupe(&arguments).await, 2, &["hero.toml", "neck names \"Tie\""]);
}

#[tokio::test]
async fn what_is_beyond_the_bar_is_not_written() {
    let folder = Folder::new("retarget-bar");
    let (hero, out) = (hero(&folder).await, folder.file("out.glb"));
    // Arms where the legs should be.
    let parts = folder.file("hero.toml");
    let shown = printed(&troupe(&["clip", "info", &hero, "--parts"]).await);
    let swapped = shown
        .replace("_L\"", "_X\"")
        .replace("_R\"", "_L\"")
        .replace("_X\"", "_R\"");
    std::fs::write(&parts, swapped).unwrap();
    let clip = example();
    let arguments = |more: &[&'static str]| {
        let mut all: Vec<String> = ["retarget", &clip, "--to", &hero, "--out"]
            .map(str::to_owned)
            .to_vec();
        all.push(out.to_str().unwrap().to_owned());
        all.extend(["--to-parts".to_owned(), parts.to_str().unwrap().to_owned()]);
        all.extend(more.iter().map(|&word| word.to_owned()));
        all
    };
    let run = async |more: &[&'static str]| troupe_at("http://127.0.0.1:1", arguments(more)).await;
    // The figures are printed all the same.
    let refused = run(&[]).await;
    let why = text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(2), "{why}");
    assert!(
        why.contains("depth of feet under the ground") && why.contains("--force"),
        "{why}"
    );
    assert!(!out.exists());
    assert!(run(&["--force"]).await.status.success() && out.exists());
}
