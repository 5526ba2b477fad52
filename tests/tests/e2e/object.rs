//! `troupe object new`: the server accepts the definitions that it makes.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use troupe_character::document::Format;
use troupe_character::object::{Definition, Definitions, Hold, Motion, Origin, load_file};
use troupe_character::scene::NamedScene;
use troupe_engine::pack::Pack;

use crate::cli::{Folder, failed, printed, text, troupe};
use crate::server::pack_folder;

fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

/// Arguments of `troupe object new` with the walk of the examples as its clip.
fn arguments(more: &str) -> Vec<String> {
    let walk = repository("examples/walk.bvh");
    let arguments = ["object", "new", "--from", walk.to_str().unwrap()].map(str::to_owned);
    let more = more.split_whitespace().map(str::to_owned);
    arguments.into_iter().chain(more).collect()
}

/// Runs `troupe object new` with the pack's folder and the address of no server.
fn offline(more: &str) -> Output {
    let folder = pack_folder().unwrap();
    Command::new(env!("CARGO_BIN_EXE_troupe-under-test"))
        .args(arguments(more))
        .arg("--pack-folder")
        .arg(folder)
        .env("TROUPE_SERVER", "http://127.0.0.1:1")
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

fn pack() -> Pack {
    Pack::load(&pack_folder().unwrap()).unwrap()
}

#[test]
fn a_definition_from_a_clip_is_valid() {
    let made = printed(&offline(
        "--frames 30,52,80,100 --name post --hold 80 --soft 52=10 --distance 0.8 --shared",
    ));
    let post = Definition::from_toml(&made, &pack().rig).unwrap();
    assert_eq!((post.name.as_str(), post.sets.len()), ("post", 4));
    assert_eq!(
        (
            post.variants[0].entry.as_slice(),
            post.variants[0].exit.as_slice()
        ),
        (&[0, 1, 2][..], &[3][..])
    );
    let frames: Vec<_> = post.sets.iter().map(|set| set.frames).collect();
    assert_eq!(frames, [None, Some(22), Some(28), Some(20)]);
    assert_eq!(
        (post.sets[1].drop_frames, post.sets[2].hold),
        (10, Hold::UntilEnded)
    );
    let key = &post.sets[0].keyframes[0];
    assert!(key.pivot && key.rotations.is_some());
    assert!((key.place_m.unwrap()[1] - 0.8).abs() < 1e-3);
}

#[test]
fn a_definition_of_a_thing_for_the_hand_is_valid() {
    let folder = Folder::new("object-new");
    let file = folder.file("cup.toml");
    let out = file.to_str().unwrap();
    let cup = "--frames 30,52,80 --hand Hand_R --hold 52 --release 80";
    let output = offline(&format!("{cup} --name cup --variant whole --out {out}"));
    assert_eq!(printed(&output), "");
    assert!(
        text(&output.stderr).contains("3 sets written to"),
        "{}",
        text(&output.stderr)
    );
    // A second run replaces the file only with --force.
    let again = format!("{cup} --name cup --out {out}");
    failed(&offline(&again), 2, &["is there already", "--force"]);
    let output = offline(&format!("{again} --variant whole --force"));
    assert_eq!(printed(&output), "");
    let output = offline(&format!(
        "{cup} --points Hand_R --variant hand --weight 2 --into {out}"
    ));
    assert!(
        text(&output.stderr).contains("3 sets added to"),
        "{}",
        text(&output.stderr)
    );
    let cup = load_file(&file, &pack().rig).unwrap();
    assert_eq!((cup.sets.len(), cup.variants.len(), cup.sockets.len()), (6, 2, 1));
    let reach = &cup.sets[3];
    assert!(reach.keyframes[0].rotations.is_none() && reach.keyframes[0].points.len() == 1);
    assert_eq!(
        (reach.origin, cup.sets[4].origin),
        (Origin::Object, Origin::Character)
    );
    // Comments in the file name its source.
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(
        text.contains("# cup, made from walk.bvh, frames 30, 52, 80, for pack "),
        "{text}"
    );
    assert!(text.contains("# Variant hand, made from walk.bvh"), "{text}");
}

#[test]
fn a_definition_of_a_seat_is_valid() {
    let made = printed(&offline(
        "--frames 0,2,4 --sets turn,sit,rise --name stool --pivot false --seat 2=0.45 --hold 2 --from-stand",
    ));
    let stool = Definition::from_toml(&made, &pack().rig).unwrap();
    let [turn, sit, rise] = &stool.sets[..] else {
        panic!("{made}")
    };
    assert!(turn.from_stand && turn.motion.is_none());
    assert_eq!(
        (sit.motion, rise.motion),
        (Some(Motion::Stance), Some(Motion::Stance))
    );
    assert!((sit.keyframes[0].height_m.unwrap() - 0.55).abs() < 1e-4);
    assert_eq!(stool.approaches.len(), 1);
    // The character turns in front of the stool, with its back to it, and sits on its middle.
    let [x, z] = turn.keyframes[0].place_m.unwrap();
    assert!(x.abs() < 0.05 && (0.3..0.6).contains(&z), "{x} {z}");
    assert!(turn.keyframes[0].heading.unwrap().abs() < 0.1);
    assert_eq!(sit.keyframes[0].place_m, Some([0.0, 0.0]));
}

/// The first steps of the tutorial in docs/objects.md, with the walk of the examples as the clip.
#[test]
fn the_tutorial_makes_an_object_in_a_scene() {
    let docs = std::fs::read_to_string(repository("docs/objects.md")).unwrap();
    let folder = Folder::new("tutorial");
    let file = folder.file("wayside.toml");
    for command in ["new --from bow.bvh", "new --from curt-bow.bvh"] {
        let (_, rest) = docs.split_once(command).unwrap();
        let (line, _) = rest.split_once(" --pack-folder").unwrap();
        let line = line
            .replace('\\', " ")
            .replace("wayside.toml", file.to_str().unwrap());
        printed(&offline(&line));
    }
    let wayside = load_file(&file, &pack().rig).unwrap();
    assert_eq!(
        (wayside.name.as_str(), wayside.variants.len(), wayside.body.shared),
        ("wayside", 2, true)
    );
    let (_, rest) = docs.split_once("```toml\n").unwrap();
    let (garden, _) = rest.split_once("```").unwrap();
    let definitions = Definitions::new([wayside]).unwrap().snapshot();
    let garden = NamedScene::read(garden, Format::Toml, &*definitions).unwrap();
    assert_eq!((garden.name.as_str(), garden.scene.len()), ("garden", 1));
}

#[tokio::test]
async fn the_pack_may_come_from_a_server() {
    let more = "--frames 30,52 --name post";
    let made = printed(&troupe(arguments(more)).await);
    assert_eq!(made, printed(&offline(more)));
}

#[test]
fn wrong_arguments_give_exit_code_2() {
    failed(
        &offline("--frames 30,119,120 --name post"),
        2,
        &["walk.bvh", "--frames: 120 is not in the clip; allowed: 0 to 119"],
    );
    failed(
        &offline("--frames 30 --name post --hand Paw"),
        2,
        &["the pack has no joint \"Paw\"", "Hand_R"],
    );
    failed(
        &offline("--frames 30 --name post --hold 31"),
        2,
        &["--hold: frame 31 is none of --frames"],
    );
    failed(
        &offline("--frames 30 --variant x --into no/such.toml"),
        2,
        &["no/such.toml"],
    );
}
