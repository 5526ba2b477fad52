use std::path::{Path, PathBuf};

use super::*;

fn fixture() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/sonic_planner")
}

#[test]
fn a_pack_of_the_planner_has_one_robot_whose_words_are_modes() {
    let pack = Pack::load(&fixture()).unwrap();
    assert_eq!(pack.files(), ["planner.onnx"]);
    assert_eq!((pack.words.len(), pack.words[0].as_str()), (27, "idle"));
    let names: Vec<&str> = pack.bodies.iter().map(|body| body.name.as_str()).collect();
    assert_eq!(names, ["g1"]);
    let body = pack.body("").unwrap();
    assert_eq!(body.words, pack.words);
    assert!(body.rig.by_path.is_some() && pack.sampler().is_none() && pack.language().is_none());
    assert_eq!((body.rig.dims.min_frames(), body.rig.dims.max_frames()), (24, 64));
    let able: Vec<&str> = (pack.manifest.capabilities.list())
        .map(|able| able.name())
        .collect();
    assert_eq!(able, ["live"]);
}

#[test]
fn every_mistake_in_the_table_of_modes_is_named() {
    let text = std::fs::read_to_string(fixture().join(MANIFEST_FILE)).unwrap();
    for (from, to, said) in [
        (
            "live = true",
            "live = true\npath = true",
            "capabilities is path; allowed: live alone",
        ),
        (
            "min_tokens = 6",
            "min_tokens = 5",
            "min_tokens is 5; allowed: 6 to 6",
        ),
        (
            "max_tokens = 16",
            "max_tokens = 17",
            "max_tokens is 17; allowed: 16 to 16",
        ),
        (
            "frames_per_token = 4",
            "frames_per_token = 8",
            "frames_per_token is 8; allowed: 4 to 4",
        ),
        (
            "context_frames = 4",
            "context_frames = 5",
            "context_frames is 5; allowed: 4 to 4",
        ),
        (
            "context_frames = 4",
            "context_frames = 4\nmax_targets = 4",
            "max_targets is 4; allowed: 0 to 0",
        ),
        (
            "body = \"g1\"",
            "body = \"../g1\"",
            "sonic_planner.body is ../g1; allowed: names of 1 to 64",
        ),
        (
            "\"idle\", \"slow-walk\"",
            "\"idle\", \"idle\"",
            "sonic_planner.modes is idle; allowed: each name once",
        ),
        (
            "\"idle\", \"slow-walk\"",
            "\"idle\", \"Slow\"",
            "sonic_planner.modes is Slow; allowed: names of",
        ),
        (
            "default_mode = \"walk\"",
            "default_mode = \"fly\"",
            "sonic_planner.default_mode is fly",
        ),
        (
            "walks = [\"slow-walk\"",
            "walks = [\"fly\"",
            "sonic_planner.walks is fly",
        ),
        (
            "family = \"sonic_planner\"",
            "family = \"unimogen\"",
            "max_targets is 0",
        ),
        (
            "[sonic_planner]",
            "[planner]",
            "sonic_planner is missing; allowed: the table [sonic_planner]",
        ),
        (
            "specific_target = false",
            "specific_target = false\nspring = 1",
            "unknown field `spring`",
        ),
    ] {
        assert!(text.contains(from), "{from}");
        let changed = text.replacen(from, to, 1);
        let checked = Manifest::parse(&changed).and_then(|manifest| manifest.check());
        let error = checked.unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
}

#[test]
fn a_body_with_other_hinges_is_refused() {
    let folder = std::env::temp_dir().join(format!("troupe-hinges-{}", std::process::id()));
    std::fs::create_dir_all(folder.join("bodies")).unwrap();
    for file in [MANIFEST_FILE, PLANNER_FILE] {
        std::fs::copy(fixture().join(file), folder.join(file)).unwrap();
    }
    let text = std::fs::read_to_string(fixture().join("bodies/g1.toml")).unwrap();
    let last = text.rfind("[[robot.hinges]]").unwrap();
    std::fs::write(folder.join("bodies/g1.toml"), &text[..last]).unwrap();
    let error = Pack::load(&folder).unwrap_err().to_string();
    std::fs::remove_dir_all(&folder).unwrap();
    let said = "sonic_planner.body is a body with 28 hinges; allowed: a robot with 29";
    assert!(error.contains(said), "{error}");
}
