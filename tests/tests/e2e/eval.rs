//! Measurements of `troupe-eval` that ask a running server.

use std::ffi::OsStr;
use std::process::Output;

use serde_json::Value;

use crate::cli::{Folder, failed, printed, run};
use crate::server::shared;
use crate::walk::Walk;

/// Runs `troupe-eval` with the shared server's address in its environment.
async fn measure<S: AsRef<OsStr>>(arguments: impl IntoIterator<Item = S>) -> Output {
    let program = env!("CARGO_BIN_EXE_troupe-eval-under-test");
    run(program, shared().url(), arguments).await
}

#[tokio::test]
async fn gaps_measures_every_gap_and_lists_skipped_clips() {
    let folder = Folder::new("eval-gaps");
    let pack = shared().pack().await;
    let straight = Walk {
        frames: 120,
        ..Walk::default()
    }
    .on(pack.skeleton());
    let curve = Walk {
        frames: 120,
        turn_rps: -0.8,
        heading: 1.0,
        ..Walk::default()
    }
    .on(pack.skeleton());
    folder.write_clip("straight.bvh", &straight);
    folder.write_clip("curve.bvh", &curve);
    folder.write_clip("short.bvh", &straight.slice(0..15).unwrap());
    std::fs::write(folder.file("broken.bvh"), "HIERARCHY").unwrap();
    std::fs::write(
        folder.file("split.txt"),
        "straight\ncurve.bvh\nshort\nbroken\nmissing\n",
    )
    .unwrap();

    let path = |name: &str| folder.file(name).to_str().unwrap().to_owned();
    let arguments = [
        "gaps",
        "--data",
        &path(""),
        "--split",
        &path("split.txt"),
        "--gaps",
        "15,45",
    ];
    let options = ["--stride", "20", "--seeds", "3", "--diversity-windows", "4"];
    let json = ["--json", &path("eval.json")];
    let said = printed(&measure(arguments.iter().chain(&options).chain(&json)).await);
    for part in [
        "Gap of 15 frames, 12 windows of 2 clips; diversity of 4, 3 takes each",
        "Gap of 45 frames, 8 windows",
        "ground truth",
        "linear/slerp",
        "FID, MMD and latent diversity are not measured: no evaluator was given",
        "Skipped clips: 3",
    ] {
        assert!(said.contains(part), "`{part}` is not in:\n{said}");
    }

    let json: Value = serde_json::from_str(&std::fs::read_to_string(path("eval.json")).unwrap()).unwrap();
    let gap = &json["gaps"][0];
    assert_eq!((&gap["gap_frames"], &gap["windows"]), (&15.into(), &12.into()));
    assert_eq!(gap["ground_truth"]["l2p_m"], 0.0);
    assert_eq!(gap["ground_truth"]["reaching_success"], 1.0);
    assert_eq!(gap["interpolation"]["target_keyframe_error_m"], 0.0);
    for figure in [
        "l2p_m",
        "l2q",
        "npss",
        "foot_skate_m_per_frame",
        "joint_jitter_mps2",
        "root_jitter_mps2",
    ] {
        assert!(gap["pack"][figure].as_f64().unwrap() > 0.0, "{figure}: {gap}");
    }
    let metrics = &gap["metrics"];
    for (method, figure) in [
        ("interpolation", "l2p_m"),
        ("pack", "npss"),
        ("pack", "joint_diversity_m"),
    ] {
        let of = |end: &str| metrics[method][figure][end].as_f64().unwrap();
        assert!(
            of("low") > 0.0 && of("low") <= of("mean") && of("mean") <= of("high"),
            "{figure}: {metrics}"
        );
    }
    let (mean, alone) = (&metrics["pack"]["npss"]["mean"], &gap["pack"]["npss"]);
    assert!(
        (mean.as_f64().unwrap() - alone.as_f64().unwrap()).abs() < 1e-9,
        "{mean} {alone}"
    );
    assert_eq!(metrics["ground_truth"]["reached"]["mean"], 1.0);
    assert_eq!(metrics["interpolation"]["joint_diversity_m"]["mean"], 0.0);
    assert_eq!(metrics["pack"]["fid"], Value::Null);
    let skipped = json["skipped"].as_array().unwrap();
    let reason = |name: &str| {
        skipped
            .iter()
            .find(|s| s["clip"] == name)
            .map(|s| s["reason"].to_string())
    };
    assert!(reason("short").unwrap().contains("15 frames"));
    assert!(reason("broken").is_some() && reason("missing").is_some());

    // A second run prints the same.
    let again = arguments.iter().chain(&options).chain(&["-q"]);
    assert_eq!(printed(&measure(again).await), said);
}

#[tokio::test]
async fn gaps_without_usable_clips_fails() {
    let folder = Folder::new("eval-none");
    let path = folder.file("");
    let path = path.to_str().unwrap();
    failed(
        &measure(["gaps", "--data", path]).await,
        2,
        &["no clip can be used"],
    );
    failed(
        &measure(["gaps", "--data", path, "--gaps", "60"]).await,
        2,
        &["--gaps: 60", "7 to 59"],
    );
    failed(&measure(["gaps", "--data", "/nowhere"]).await, 2, &["/nowhere"]);
}

#[tokio::test]
async fn live_characters_are_measured() {
    let folder = Folder::new("eval-live");
    let json = folder.file("live.json");
    let arguments = ["live", "--styles", "normal", "--json", json.to_str().unwrap()];
    let said = printed(&measure(arguments).await);
    assert!(said.contains("holds:    steady speed within 15 %"), "{said}");
    assert!(said.contains("not measured: foot skate"), "{said}");
    let report: Value = serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
    let gaits = report["gaits"].as_array().unwrap();
    let walk = gaits.iter().find(|g| g["gait"] == "walk").unwrap();
    assert!(walk["steady_error"].as_f64().unwrap().abs() < 0.15, "{walk}");
    assert_eq!(report["turns"].as_array().unwrap().len(), 4);
    assert_eq!(report["underruns"], 0);
    // A second run measures the same.
    let again = folder.file("again.json");
    let arguments = ["live", "--styles", "normal", "--json", again.to_str().unwrap()];
    printed(&measure(arguments).await);
    let again: Value = serde_json::from_str(&std::fs::read_to_string(&again).unwrap()).unwrap();
    assert_eq!(report["gaits"], again["gaits"]);

    failed(
        &measure(["live", "--styles", "missing"]).await,
        2,
        &["no style `missing`", "normal"],
    );
    failed(&measure(["live", "--data", "."]).await, 2, &["--list"]);
}

#[tokio::test]
async fn characters_that_wander_are_measured() {
    let folder = Folder::new("eval-wander");
    let file = |name: &str| folder.file(name).to_str().unwrap().to_owned();
    let few = [
        "wander",
        "--styles",
        "normal",
        "--characters",
        "2",
        "--seconds",
        "5",
    ];
    let said = printed(
        &measure(
            few.iter()
                .chain(&["--replan", "4,9", "--json", &file("live.json")]),
        )
        .await,
    );
    assert!(
        said.contains("every 4 frames") && said.contains("not measured: foot skate"),
        "{said}"
    );
    let json: Value = serde_json::from_str(&std::fs::read_to_string(file("live.json")).unwrap()).unwrap();
    let [often, seldom] = [0, 1].map(|nth| &json["runs"][nth]);
    let plans = |run: &Value| run["plans_per_second"].as_f64().unwrap();
    assert!(plans(often) > 1.5 * plans(seldom), "{json}");
    let jitter = &seldom["figures"][1];
    assert_eq!(jitter["name"], "joint_jitter_mps2");
    assert!(jitter["live"]["low"].as_f64().unwrap() > 0.0, "{json}");

    // Compared with the figures of gaps, of this pack and of another.
    let around = |mean: f64| serde_json::json!({"mean": mean, "low": 0.9 * mean, "high": 1.1 * mean});
    let against = |hash: &Value| {
        serde_json::json!({"content_hash": hash, "gaps": [{"metrics": {"pack": {
            "foot_skate_m_per_frame": around(1e3), "joint_jitter_mps2": around(1e-3), "root_jitter_mps2": around(1.0),
        }}}]})
    };
    std::fs::write(file("gaps.json"), against(&json["content_hash"]).to_string()).unwrap();
    std::fs::write(file("other.json"), against(&"sha256:0".into()).to_string()).unwrap();
    let said = printed(&measure(few.iter().chain(&["--against", &file("gaps.json")])).await);
    assert!(
        said.contains("holds:        foot skate at most 1.5 times"),
        "{said}"
    );
    assert!(
        said.contains("missed:       joint jitter at most 1.5 times"),
        "{said}"
    );
    let other = measure(few.iter().chain(&["--against", &file("other.json")])).await;
    failed(&other, 2, &["other.json", "another pack"]);
    let often = measure(few.iter().chain(&["--replan", "2"])).await;
    failed(&often, 4, &["replan_interval_frames", "3 to 30"]);
}
