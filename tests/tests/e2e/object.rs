//! Definitions that `troupe object new` makes: the server takes them.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use troupe_server::object::{Definition, Hold, Origin, load_file};
use troupe_server::pack::Pack;

use crate::cli::{Folder, failed, printed, text, troupe};
use crate::server::pack_folder;

fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

/// `troupe object new` from the walk in the examples.
fn arguments(more: &str) -> Vec<String> {
    let walk = repository("examples/walk.bvh");
    let arguments = ["object", "new", "--from", walk.to_str().unwrap()].map(str::to_owned);
    let more = more.split_whitespace().map(str::to_owned);
    arguments.into_iter().chain(more).collect()
}

/// The same with the pack's folder, where no server can be reached.
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
fn a_definition_from_a_clip_is_one_of_the_server() {
    let made = printed(&offline(
        "--frames 30,52,80,100 --name post --hold 80 --soft 52=10 --distance 0.8 --shared",
    ));
    let post = Definition::from_toml(&made, &pack()).unwrap();
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
fn a_thing_for_the_hand_is_one_of_the_server() {
    let folder = Folder::new("object-new");
    let file = folder.file("cup.toml");
    let out = file.to_str().unwrap();
    let cup = "--frames 30,52,80 --hand Hand_R --hold 52 --release 80";
    let told = offline(&format!("{cup} --name cup --variant whole --out {out}"));
    assert_eq!(printed(&told), "");
    assert!(
        text(&told.stderr).contains("3 sets written to"),
        "{}",
        text(&told.stderr)
    );
    let told = offline(&format!(
        "{cup} --points Hand_R --variant hand --weight 2 --into {out}"
    ));
    assert!(
        text(&told.stderr).contains("3 sets added to"),
        "{}",
        text(&told.stderr)
    );
    let cup = load_file(&file, &pack()).unwrap();
    assert_eq!((cup.sets.len(), cup.variants.len(), cup.sockets.len()), (6, 2, 1));
    let reach = &cup.sets[3];
    assert!(reach.keyframes[0].rotations.is_none() && reach.keyframes[0].points.len() == 1);
    assert_eq!(
        (reach.origin, cup.sets[4].origin),
        (Origin::Object, Origin::Character)
    );
    // What a person has to know of it stands beside it.
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(
        text.contains("# cup, made from walk.bvh, frames 30, 52, 80, for pack "),
        "{text}"
    );
    assert!(text.contains("# Variant hand, made from walk.bvh"), "{text}");
}

#[tokio::test]
async fn the_pack_may_come_from_a_server() {
    let more = "--frames 30,52 --name post";
    let made = printed(&troupe(arguments(more)).await);
    assert_eq!(made, printed(&offline(more)));
}

#[test]
fn what_is_wrong_is_told_with_exit_code_2() {
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
