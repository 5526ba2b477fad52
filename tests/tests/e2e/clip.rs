//! `troupe clip`: files of motion are understood, checked and converted, without a server.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::Arc;

use serde_json::Value;
use troupe_motion::bvh::{self, BvhFile, BvhOptions, BvhWriteOptions};
use troupe_motion::clip::Clip;
use troupe_motion::skeleton::Skeleton;

use crate::cli::{Folder, failed, printed, text, troupe_at};
use crate::motion::{difference, walk};
use crate::server::shared;

/// Largest difference of a clip after it was written and read, metres and parts of a quaternion.
const ROUNDING: f32 = 1e-3;
/// Frames of the robot's motion, at 30 a second, and at the 50 of trackers.
const ROBOT_FRAMES: usize = 61;
const TRACKER_FRAMES: usize = 101;

/// Runs `troupe clip` with the address of no server.
async fn clip<S: AsRef<OsStr>>(arguments: impl IntoIterator<Item = S>) -> Output {
    let mut all = vec![OsStr::new("clip").to_owned()];
    all.extend(arguments.into_iter().map(|argument| argument.as_ref().to_owned()));
    troupe_at("http://127.0.0.1:1", all).await
}

/// The reports of `troupe clip info --json`.
async fn info(file: &Path, more: &[&str]) -> Value {
    let mut arguments = vec!["info", file.to_str().unwrap(), "--json"];
    arguments.extend(more);
    serde_json::from_str(&printed(&clip(arguments).await)).unwrap()
}

async fn convert(from: &Path, out: &Path, more: &[&str]) -> Output {
    let mut arguments = vec!["convert", from.to_str().unwrap(), out.to_str().unwrap()];
    arguments.extend(more);
    clip(arguments).await
}

fn read_bvh(path: &Path, skeleton: &Arc<Skeleton>) -> Clip {
    let file = bvh::parse(&std::fs::read_to_string(path).unwrap()).unwrap();
    file.to_clip_on(skeleton, &BvhOptions::default()).unwrap()
}

fn g1_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/g1")
}

/// A G1 with all angles at 0 that glides ahead by a centimetre a frame.
fn write_robot(folder: &Folder) -> PathBuf {
    let path = folder.file("glide.csv");
    let rows = (0..ROBOT_FRAMES).map(|frame| {
        let x = 0.01 * frame as f32;
        format!("{x},0,0.79,0,0,0,1{}\n", ",0".repeat(29))
    });
    std::fs::write(&path, rows.collect::<String>()).unwrap();
    path
}

#[tokio::test]
async fn what_is_understood_of_a_clip_is_printed_with_its_evidence() {
    let folder = Folder::new("clip-info");
    let pack = shared().pack().await;
    let file = folder.write_clip("walk.bvh", &walk(&pack));
    let table = printed(&clip(["info", file.to_str().unwrap()]).await);
    for part in ["BVH", "up axis", "it begins with HIERARCHY", "tall in cm", "300"] {
        assert!(table.contains(part), "`{part}` is not in: {table}");
    }
    let reports = info(&file, &[]).await;
    let report = &reports[0];
    assert_eq!(report["up"]["value"], "y");
    assert_eq!(report["unit_m"]["value"], 0.01);
    assert_eq!(report["frames"], 300);
    assert_eq!(report["fps"]["basis"], "stated");
}

#[tokio::test]
async fn a_refused_file_does_not_hide_the_others() {
    let folder = Folder::new("clip-info-refused");
    let pack = shared().pack().await;
    let good = folder.write_clip("walk.bvh", &walk(&pack));
    let bad = folder.file("motion.pkl");
    std::fs::write(&bad, "nothing").unwrap();
    let output = clip(["info", bad.to_str().unwrap(), good.to_str().unwrap()]).await;
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stdout).contains("BVH"), "{}", text(&output.stdout));
    let errors = text(&output.stderr);
    assert!(
        errors.contains("motion.pkl") && errors.contains("np.savez"),
        "{errors}"
    );
}

#[tokio::test]
async fn a_picture_of_a_clip_is_drawn() {
    let folder = Folder::new("clip-picture");
    let pack = shared().pack().await;
    let file = folder.write_clip("walk.bvh", &walk(&pack));
    let out = folder.file("walk.png");
    let [file, picture] = [&file, &out].map(|path| path.to_str().unwrap());
    printed(&clip(["info", file, "--picture", picture]).await);
    assert_eq!(&std::fs::read(&out).unwrap()[..8], b"\x89PNG\r\n\x1a\n");
    failed(
        &clip(["info", file, file, "--picture", picture]).await,
        2,
        &["--picture draws one file"],
    );
}

#[tokio::test]
async fn a_clip_survives_every_format() {
    let folder = Folder::new("clip-convert");
    let pack = shared().pack().await;
    let first = walk(&pack);
    let mut file = folder.write_clip("walk.bvh", &first);
    for name in ["one.glb", "two.npz", "three.bvh"] {
        let out = folder.file(name);
        let output = convert(&file, &out, &[]).await;
        assert_eq!(printed(&output), "");
        assert!(
            text(&output.stderr).contains("300 frames read"),
            "{name}: {}",
            text(&output.stderr)
        );
        file = out;
    }
    let last = read_bvh(&file, pack.skeleton());
    assert_eq!((last.frames(), last.fps), (first.frames(), first.fps));
    let error = difference(&last, &first);
    assert!(error < ROUNDING, "{error}");
}

#[tokio::test]
async fn a_clip_in_metres_is_read_and_the_repair_is_noted() {
    let folder = Folder::new("clip-metres");
    let pack = shared().pack().await;
    let first = walk(&pack);
    let options = BvhWriteOptions {
        units_per_metre: 1.0,
        ..BvhWriteOptions::default()
    };
    let (metres, out) = (folder.file("metres.bvh"), folder.file("out.bvh"));
    let in_metres = BvhFile::from_clip(&first, &options).unwrap();
    std::fs::write(&metres, bvh::write(&in_metres)).unwrap();
    let output = convert(&metres, &out, &[]).await;
    let notes = text(&output.stderr);
    assert!(notes.contains("lengths are in m, not in cm"), "{notes}");
    let error = difference(&read_bvh(&out, pack.skeleton()), &first);
    assert!(error < ROUNDING, "{error}");

    let quiet = convert(&metres, &out, &["--quiet", "--unit", "m"]).await;
    assert_eq!(printed(&quiet) + &text(&quiet.stderr), "");
}

#[tokio::test]
async fn a_clip_is_made_to_loop() {
    let folder = Folder::new("clip-loop");
    let pack = shared().pack().await;
    let first = walk(&pack);
    let (file, out) = (folder.write_clip("walk.bvh", &first), folder.file("loop.bvh"));
    let output = convert(&file, &out, &["--loop"]).await;
    assert!(
        text(&output.stderr).contains("joints turned by up to"),
        "{}",
        text(&output.stderr)
    );
    let looped = read_bvh(&out, pack.skeleton());
    assert!((225..=300).contains(&looped.frames()));
    let heights = [first, looped].map(|clip| {
        let height = |frame: usize| clip.root_positions[frame].y;
        (height(clip.frames() - 1) - height(0)).abs()
    });
    assert!(heights[1] <= heights[0] + ROUNDING, "{heights:?}");
}

#[tokio::test]
async fn a_check_of_a_folder_fails_for_what_is_refused() {
    let folder = Folder::new("clip-check");
    let pack = shared().pack().await;
    folder.write_clip("walk.bvh", &walk(&pack));
    std::fs::write(folder.file("notes.txt"), "no motion").unwrap();
    let path = folder.file("");
    let path = path.to_str().unwrap();
    let table = printed(&clip(["check", path]).await);
    assert!(
        table.contains("walk.bvh") && !table.contains("notes.txt"),
        "{table}"
    );

    let broken = "HIERARCHY\nROOT Hips\n{\n  OFFSET 0 x 0\n";
    std::fs::write(folder.file("broken.bvh"), broken).unwrap();
    let output = clip(["check", path, "--json"]).await;
    assert_eq!(output.status.code(), Some(1));
    let errors = text(&output.stderr);
    assert!(errors.contains("odd or refused: 1 of 2"), "{errors}");
    let checked: Value = serde_json::from_str(&text(&output.stdout)).unwrap();
    assert_eq!(checked[0]["file"], "broken.bvh");
    assert_eq!(checked[0]["verdict"], "refused");
    assert!(
        checked[0]["error"].as_str().unwrap().contains("line 4"),
        "{checked}"
    );
    assert_eq!(checked[1]["report"]["frames"], 300);

    std::fs::create_dir_all(folder.file("empty")).unwrap();
    let empty = folder.file("empty");
    failed(
        &clip(["check", empty.to_str().unwrap()]).await,
        2,
        &["empty", ".bvh"],
    );
}

#[tokio::test]
async fn a_robots_motion_is_written_for_trackers_and_read_back() {
    let folder = Folder::new("clip-robot");
    let file = write_robot(&folder);
    let g1 = g1_folder();
    let onto = ["--pack-folder", g1.to_str().unwrap()];
    failed(
        &clip(["info", file.to_str().unwrap()]).await,
        2,
        &["--pack or --urdf gives the robot"],
    );

    let npz = folder.file("glide.npz");
    let layout = |name| [&onto[..], &["--layout", name]].concat();
    let output = convert(&file, &npz, &layout("beyondmimic")).await;
    printed(&output);
    let notes = text(&output.stderr);
    assert!(notes.contains("read at 30 frames per second"), "{notes}");
    let sonic = folder.file("glide");
    printed(&convert(&file, &sonic, &layout("sonic")).await);
    assert!(sonic.join("metadata.txt").is_file());

    for (file, format) in [(&npz, "beyond_mimic"), (&sonic.join("joint_pos.csv"), "sonic")] {
        let reports = info(file, &onto).await;
        assert_eq!(reports[0]["format"]["value"], format);
        assert_eq!(reports[0]["fps"]["value"], 50.0);
        assert_eq!(reports[0]["frames"], TRACKER_FRAMES, "{format}");
    }

    let back = folder.file("back.csv");
    printed(&convert(&npz, &back, &onto).await);
    let rows = std::fs::read_to_string(&back).unwrap();
    assert_eq!(rows.lines().count(), ROBOT_FRAMES);
    for (frame, row) in rows.lines().enumerate() {
        let x: f32 = row.split(',').next().unwrap().parse().unwrap();
        assert!((x - 0.01 * frame as f32).abs() < ROUNDING, "{frame}: {row}");
    }
}

#[tokio::test]
async fn what_cannot_be_written_is_said_before_any_work() {
    let folder = Folder::new("clip-wrong");
    let pack = shared().pack().await;
    let file = folder.write_clip("walk.bvh", &walk(&pack));
    for (out, more, wanted) in [
        ("out.fbx", &[] as &[&str], ".bvh or .glb"),
        ("out.csv", &[], "the motion is no robot's"),
        ("out.csv", &["--layout", "beyondmimic"], "must be .npz"),
        ("out.bvh", &["--up", "w"], "x, y, z, -x, -y or -z"),
        ("out.bvh", &["--unit", "yard"], "in, cm, mm"),
    ] {
        let out = folder.file(out);
        failed(&convert(&file, &out, more).await, 2, &[wanted]);
        assert!(!out.exists(), "nothing was written");
    }
}
