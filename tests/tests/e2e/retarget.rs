//! A clip's motion on another character: `troupe retarget`, without a server, and `--onto`.

use std::path::Path;
use std::process::Output;

use serde_json::Value;
use troupe_motion::bvh::{self, BvhOptions};
use troupe_motion::clip::Clip;
use troupe_motion::glb::write_glb;

use crate::cli::{Folder, failed, gap_arguments, printed, text, troupe as troupe_shared, troupe_at, with};
use crate::motion::walk;
use crate::server::shared;

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

/// The example as a character's file, its numbers taken to be of this unit.
async fn hero_in(folder: &Folder, unit: &str) -> String {
    let path = folder
        .file(&format!("hero-{unit}.glb"))
        .to_str()
        .unwrap()
        .to_owned();
    let made = troupe(&["clip", "convert", &example(), &path, "--unit", unit]).await;
    assert!(made.status.success(), "{}", text(&made.stderr));
    path
}

#[tokio::test]
async fn a_character_moves_in_the_unit_of_its_file() {
    let folder = Folder::new("retarget-unit");
    let mut made = Vec::new();
    // The example is in centimetres: in metres, the character has a hundred times its size.
    for unit in ["cm", "m"] {
        let hero = hero_in(&folder, unit).await;
        let out = folder.file("out.glb").to_str().unwrap().to_owned();
        let answer = troupe(&["retarget", &example(), "--to", &hero, "--out", &out]).await;
        assert!(answer.status.success(), "{}", text(&answer.stderr));
        let read = folder.file("out.bvh");
        let walk = format!("{out}#walk");
        let answer = troupe(&["clip", "convert", &walk, read.to_str().unwrap()]).await;
        assert!(answer.status.success(), "{}", text(&answer.stderr));
        let file = bvh::parse(&std::fs::read_to_string(&read).unwrap()).unwrap();
        made.push(file.to_clip(&BvhOptions::default()).unwrap());
    }
    for frame in [0, 60, 119] {
        let [metres, hundred] = [0, 1].map(|nth: usize| made[nth].root_positions[frame]);
        assert!(metres.distance(hundred) < 2e-3, "{frame}: {metres} {hundred}");
    }
}

#[tokio::test]
async fn a_unit_that_a_character_leaves_open_is_given() {
    let folder = Folder::new("retarget-open");
    // 48 m tall, or 48 cm.
    let hero = hero_in(&folder, "ft").await;
    let parts = ["clip", "info", &hero, "--parts"];
    failed(&troupe(&parts).await, 2, &["--unit cm or --unit m decides"]);
    let given: Vec<&str> = parts.iter().copied().chain(["--unit", "cm"]).collect();
    assert!(printed(&troupe(&given).await).contains("[left_leg]"));
    let (clip, out) = (example(), folder.file("out.glb").to_str().unwrap().to_owned());
    let retarget = ["retarget", &clip, "--to", &hero, "--out", &out];
    failed(
        &troupe(&retarget).await,
        2,
        &["--to-unit cm or --to-unit m decides"],
    );
}

#[tokio::test]
async fn an_animation_gives_its_name_to_what_is_made_of_it() {
    let folder = Folder::new("retarget-name");
    let (hero, out) = (hero(&folder).await, folder.file("out.glb"));
    let (clip, out) = (format!("{hero}#motion"), out.to_str().unwrap().to_owned());
    let answer = troupe(&["retarget", &clip, "--to", &hero, "--out", &out]).await;
    assert!(answer.status.success(), "{}", text(&answer.stderr));
    // The character has an animation of that name.
    let made = troupe(&["clip", "info", &format!("{out}#motion_2")]).await;
    assert!(made.status.success(), "{}", text(&made.stderr));
}

#[tokio::test]
async fn a_character_without_animation_is_converted_at_rest() {
    let folder = Folder::new("convert-rest");
    let (statue, out) = (folder.file("statue.gltf"), folder.file("rest.glb"));
    let text_of = r#"{ "asset": { "version": "2.0" }, "skins": [{ "joints": [0, 1] }], "nodes": [
        { "name": "Hips", "translation": [0.0, 0.9, 0.0], "children": [1] },
        { "name": "Leg", "translation": [0.0, -0.4, 0.0] }] }"#;
    std::fs::write(&statue, text_of).unwrap();
    let (statue, out) = (statue.to_str().unwrap(), out.to_str().unwrap());
    let answer = troupe(&["clip", "convert", statue, out]).await;
    let notes = text(&answer.stderr);
    assert!(
        answer.status.success() && notes.contains("its rest pose becomes one frame"),
        "{notes}"
    );
    let report = printed(&troupe(&["clip", "info", out, "--json"]).await);
    let report: Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report[0]["frames"], 1);
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
    assert!(
        why.contains("feet are under the ground in ") && why.contains(" of 120 frames, most at "),
        "{why}"
    );
    assert!(!out.exists());
    assert!(run(&["--force"]).await.status.success() && out.exists());
}

/// The body of the shared server's pack in half its size, as a character's file.
async fn half(folder: &Folder) -> (Clip, String) {
    let clip = walk(&shared().pack().await);
    let mut skeleton = (*clip.skeleton).clone();
    skeleton.joints.iter_mut().for_each(|joint| joint.offset_m *= 0.5);
    let roots = clip.root_positions.iter().map(|root| *root * 0.5).collect();
    let hero = Clip::new(skeleton.into(), clip.fps, roots, clip.rotations.clone()).unwrap();
    let path = folder.file("half.glb");
    std::fs::write(&path, write_glb(&hero).unwrap()).unwrap();
    (clip, path.to_str().unwrap().to_owned())
}

#[tokio::test]
async fn a_character_gets_generated_motion_in_its_size() {
    let folder = Folder::new("onto");
    let (clip, hero) = half(&folder).await;
    let source = folder.write_clip("walk.bvh", &clip);
    let roots = folder.file("roots.toml");
    // In the character's size.
    let place = 0.5 * clip.root_positions[80];
    std::fs::write(
        &roots,
        format!("[[root]]\nframe = 80\nat = [{}, {}]", place.x, place.z),
    )
    .unwrap();
    let out = folder.file("out.bvh");
    let more = ["--onto", &hero, "--roots", roots.to_str().unwrap()];
    let answer = troupe_shared(with(gap_arguments(&source, 60, 95, &out), &more)).await;
    assert!(answer.status.success(), "{}", text(&answer.stderr));
    assert!(text(&answer.stderr).contains("what is kept"));
    let file = bvh::parse(&std::fs::read_to_string(&out).unwrap()).unwrap();
    let made = file.to_clip(&BvhOptions::default()).unwrap();
    assert_eq!(made.frames(), clip.frames());
    for frame in [0, 80, 299] {
        let [half, whole] = [&made, &clip].map(|clip| clip.root_positions[frame]);
        let apart_m = (half - 0.5 * whole).with_y(0.0).length();
        assert!(apart_m < 0.03, "{frame}: {half} {whole}");
    }
    // A character's own file keeps what it has.
    let dressed = folder.file("out.glb");
    let answer = troupe_shared(with(gap_arguments(&source, 60, 95, &dressed), &["--onto", &hero])).await;
    assert!(answer.status.success(), "{}", text(&answer.stderr));
    let animation = format!("{}#inbetween", dressed.display());
    let report = printed(&troupe(&["clip", "info", &animation, "--json"]).await);
    let report: Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report[0]["frames"], 300);
}

#[tokio::test]
async fn a_character_that_does_not_go_with_the_pack_is_refused() {
    let folder = Folder::new("onto-bar");
    let (clip, hero) = half(&folder).await;
    let source = folder.write_clip("walk.bvh", &clip);
    let (parts, out) = (folder.file("half.toml"), folder.file("out.glb"));
    let shown = printed(&troupe(&["clip", "info", &hero, "--parts"]).await);
    let swapped = shown
        .replace("_L\"", "_X\"")
        .replace("_R\"", "_L\"")
        .replace("_X\"", "_R\"");
    std::fs::write(&parts, swapped).unwrap();
    let more = ["--onto", &hero, "--onto-parts", parts.to_str().unwrap()];
    let arguments = || with(gap_arguments(&source, 60, 95, &out), &more);
    failed(
        &troupe_shared(arguments()).await,
        2,
        &[
            "half.glb",
            "the difference of a line across the body at Foot_R",
            "--force",
        ],
    );
    assert!(!out.exists());
    assert!(
        troupe_shared(with(arguments(), &["--force"]))
            .await
            .status
            .success()
            && out.exists()
    );
}
