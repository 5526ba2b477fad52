//! Which definitions are read, and the errors of those that are not.

use std::path::Path as FilePath;

use super::testing::{CUP, definition};
use super::*;
use crate::style::testing::{TempFolder, walker_rig};

fn json() -> String {
    serde_json::to_string_pretty(&*definition().doc).unwrap()
}

#[test]
fn everything_is_read() {
    let cup = definition();
    assert_eq!(
        (cup.name.as_str(), cup.sets.len(), cup.variants.len()),
        ("cup", 4, 2)
    );
    assert_eq!((cup.body.solid, cup.body.shared), (true, false));
    let slow = &cup.variants[0];
    assert_eq!(
        (slow.entry.as_slice(), slow.exit.as_slice()),
        (&[0, 1][..], &[3][..])
    );
    assert_eq!(
        (cup.variants[1].entry.as_slice(), cup.variants[1].weight),
        (&[2][..], 3.0)
    );
    let reach = cup.set("reach").unwrap();
    assert!(reach.is_hard() && reach.frames.is_none() && reach.hold == Hold::Frames(0));
    let attach = Event {
        at: Moment::Reached,
        action: Action::Attach(0),
    };
    assert_eq!(reach.events, [attach]);
    let key = &reach.keyframes[0];
    assert_eq!((key.pivot, key.from_ground, key.points[0].joint), (true, true, 5));
    assert!((key.heading.unwrap() - std::f32::consts::PI).abs() < 1e-6);
    assert_eq!(key.rotations.as_ref().unwrap().len(), 6);
    let lift = cup.set("lift").unwrap();
    assert_eq!(
        (lift.drop_frames, lift.frames, lift.hold),
        (6, Some(20), Hold::UntilEnded)
    );
    assert_eq!(
        (cup.sets[2].origin, cup.sets[2].keyframes.len()),
        (Origin::Character, 2)
    );
    let put_down = cup.set("put-down").unwrap();
    assert_eq!(
        (put_down.motion, put_down.from_stand),
        (Some(Motion::Stance), true)
    );
    assert_eq!((reach.motion, reach.from_stand), (None, false));
    assert_eq!(cup.socket("foot").unwrap().joint, 5);
    assert!((cup.approaches[0].span.to_degrees() - 140.0).abs() < 1e-3);
}

#[test]
fn a_socket_may_leave_the_turn_as_it_is() {
    let socket = |text: &str| {
        let cup = Definition::from_toml(text, &walker_rig()).unwrap();
        let again = Definition::from_doc((*cup.doc).clone(), &walker_rig()).unwrap();
        assert_eq!(cup.sockets, again.sockets);
        cup.sockets[0].clone()
    };
    let given = socket(CUP);
    assert!(given.rotation.is_some() && !given.swings);
    let line = "rotation = [0.7071068, 0.7071068, 0.0, 0.0]";
    assert!(CUP.contains(line));
    let free = socket(&CUP.replace(line, "swings = true"));
    assert!(free.rotation.is_none() && free.swings && !free.upright);
    assert!(socket(&CUP.replace(line, "upright = true")).upright);
}

#[test]
fn json_and_toml_give_the_same_definition() {
    let (cup, rig) = (definition(), walker_rig());
    let again = Definition::from_json(&json(), &rig).unwrap();
    assert_eq!((again.sets.clone(), &*again.doc), (cup.sets.clone(), &*cup.doc));
    let again = Definition::from_toml(&cup.doc.to_toml().unwrap(), &rig).unwrap();
    assert_eq!((again.variants, &*again.doc), (cup.variants, &*cup.doc));
}

/// A change of the text (from, to), and what its error contains: line, field, what is wrong, what
/// is allowed.
const WRONG: &[(&str, &str, &str)] = &[
    (
        "format = 1",
        "format = 7",
        "line 2, column 10: format: is 7; allowed: 1",
    ),
    (
        "name = \"cup\"",
        "name = \"a cup\"",
        "name: has the character ' '; allowed: 1 to 64 letters",
    ),
    (
        "[0.04, 0.05, 0.04]",
        "[0.04, -0.05, 0.04]",
        "line 8, column 25: shape.box.half_extents_m[1]: is -0.05; allowed: 0.001 to 1000 m",
    ),
    (
        "[0.04, 0.05, 0.04]",
        "[0.04, nan, 0.04]",
        "line 8, column 25: shape.box.half_extents_m[1]: is NaN; allowed: ",
    ),
    (
        "reach_m = 0.8",
        "reach_m = -1",
        "line 11, column 11: trigger.reach_m: is -1; allowed: 0 to 10",
    ),
    (
        "reach_m = 0.8",
        "reach_m = \"far\"",
        "line 11, column 11: trigger.reach_m: invalid type: string \"far\", expected a number",
    ),
    (
        "reach_m = 0.8",
        "reach = 0.8",
        "line 11, column 1: trigger.reach: unknown field `reach`, expected `reach_m` or `shape`",
    ),
    (
        "pivot_m = [0.0, 0.05, 0.0]",
        "pivot_m = [0.0, inf, 0.0]",
        "anchor.pivot_m[1]: is inf; allowed: -20 to 20",
    ),
    (
        "max_slope_deg = 25.0",
        "max_slope_deg = 90.0",
        "release.max_slope_deg: is 90; allowed: 0 to 80",
    ),
    (
        "align = \"upright\"",
        "align = \"sideways\"",
        "release.align: unknown variant `sideways`, expected",
    ),
    (
        "[-70.0, 70.0]",
        "[70.0, -70.0]",
        "line 23, column 18: approaches[0].directions_deg: goes from 70 to -70; allowed: ",
    ),
    (
        "distance_m = 0.9",
        "distance_m = 21.0",
        "approaches[0].distance_m: is 21; allowed: 0 to 20",
    ),
    (
        "joint = \"Foot_R\"\nposition",
        "joint = \"Hand\"\nposition",
        "line 28, column 9: sockets[0].joint: is \"Hand\", which is no joint of the pack; allowed: Hips, Spine, Leg_L",
    ),
    (
        "[0.7071068, 0.7071068, 0.0, 0.0]",
        "[0.7, 0.9, 0.0, 0.0]",
        "sockets[0].rotation: the rotation has length 1.14",
    ),
    (
        "[0.7071068, 0.7071068, 0.0, 0.0]",
        "[nan, 0.7071068, 0.0, 0.0]",
        "sockets[0].rotation: the rotation has length NaN; allowed: unit length",
    ),
    (
        "weight = 3.0",
        "weight = -3.0",
        "line 39, column 10: variants[1].weight: is -3; allowed: 0 to 1000",
    ),
    (
        "entry = \"grab\"",
        "entry = \"grasp\"",
        "line 40, column 9: variants[1].entry: is \"grasp\", which is no set; allowed: reach, lift, grab, put-down",
    ),
    (
        "name = \"quick\"",
        "name = \"slow\"",
        "variants[1].name: is \"slow\", which another of the variants has",
    ),
    (
        "name = \"grab\"\norigin",
        "name = \"lift\"\norigin",
        "sets[2].name: is \"lift\", which another of the sets has",
    ),
    (
        "next = \"lift\"",
        "next = \"fly\"",
        "line 44, column 8: sets[0].next: is \"fly\", which is no set",
    ),
    (
        "next = \"lift\"",
        "next = \"reach\"",
        "line 44, column 8: sets[0].next: goes round: reach -> reach; allowed: a set that does not lead back",
    ),
    (
        "frames = 20",
        "frames = 20\nnext = \"reach\"",
        "sets[1].next: goes round: reach -> lift -> reach",
    ),
    (
        "exit = \"put-down\"",
        "",
        "sets[3].name: is \"put-down\", a set that no variant reaches",
    ),
    (
        "attach = \"foot\" }]\n\n[[sets.key",
        "attach = \"hand\" }]\n\n[[sets.key",
        "sets[0].events[0].attach: is \"hand\", which is no socket; allowed: foot",
    ),
    (
        "description = \"A",
        "shared = true\ndescription = \"A",
        "sets[0].events[0].attach: is \"foot\" for a shared object, which cannot be taken; allowed: no attach, or shared = false",
    ),
    (
        "{ release = true }",
        "{ release = true, attach = \"foot\" }",
        "sets[3].events[0]: has both attach and release",
    ),
    (
        "{ release = true }",
        "{ at = \"end\" }",
        "sets[3].events[0]: does nothing; allowed: exactly one of attach and release",
    ),
    (
        "place_m = [0.0, 0.45]",
        "place_m = [0.0, 45]",
        "line 49, column 17: sets[0].keyframes[0].place_m[1]: is 45; allowed: -20 to 20",
    ),
    (
        "heading_deg = 180.0",
        "heading_deg = nan",
        "line 50, column 15: sets[0].keyframes[0].heading_deg: is NaN; allowed: -360 to 360",
    ),
    (
        "heading_deg = 180.0\n",
        "",
        "sets[0].keyframes[0].heading_deg: is missing; allowed: a number, with a pose",
    ),
    (
        "height_m = 0.8",
        "height_m = -inf",
        "sets[0].keyframes[0].height_m: is -inf; allowed: -20 to 20",
    ),
    (
        "    1.0, 0.0, 0.0, 0.0,  1.0",
        "    1.0",
        "sets[0].keyframes[0].rotations: has 20 numbers; allowed: exactly 24: 4 (w, x, y, z) for each of the pack's 6 joints",
    ),
    (
        "    1.0, 0.0, 0.0, 0.0,  1.0",
        "    1.0, 0.0, 0.0, 0.0,  2.0",
        "line 54, column 26: sets[0].keyframes[0].rotations[4]: the rotation of joint Spine has length 2",
    ),
    (
        "    1.0, 0.0, 0.0, 0.0,  1.0",
        "    0.7071068, 0.0, 0.7071068, 0.0,  1.0",
        "sets[0].keyframes[0].rotations[0]: the pose has a heading of 90.0 degrees",
    ),
    (
        "joint = \"Foot_R\", position_m = [0.0",
        "joint = \"Foot\", position_m = [0.0",
        "sets[0].keyframes[0].points[0].joint: is \"Foot\", which is no joint",
    ),
    (
        "motion = \"stance\"",
        "motion = \"walk\"",
        "line 79, column 10: sets[3].motion: unknown variant `walk`, expected `plan` or `stance`",
    ),
    (
        "from_stand = true",
        "from_stand = 1",
        "sets[3].from_stand: invalid type: integer `1`, expected a boolean",
    ),
    (
        "drop_frames = 6",
        "drop_frames = 21",
        "sets[1].drop_frames: is 21; allowed: 0 to 20",
    ),
    (
        "drop_frames = 6",
        "drop_frames = -1",
        "sets[1].drop_frames: invalid value: integer `-1`, expected a whole number of 0 or more",
    ),
    (
        "frames = 20",
        "frames = 61",
        "sets[1].frames: is 61; allowed: 8 to 60",
    ),
    (
        "hold_frames = 10",
        "hold_frames = 10000",
        "sets[2].hold_frames: is 10000; allowed: 0 to 9000",
    ),
    (
        "hold_until_ended = true",
        "hold_until_ended = true\nhold_frames = 4",
        "sets[1].hold_frames: is 4 for a set that is held until ended",
    ),
    (
        "{ height_m = 0.7 }",
        "{ height_m = 0.7, pivot = true }",
        "sets[2].keyframes[0].pivot: is true in a set whose origin is the character",
    ),
    (
        "{ height_m = 0.7 }",
        "{}",
        "sets[2].keyframes[0]: is empty; allowed: at least one of place_m",
    ),
    (
        "{ height_m = 0.7 }",
        "{}, {}, {}, {}",
        "sets[2].keyframes: has 5 entries; allowed: 1 to 4",
    ),
    ("name = \"cup\"\n", "", "name: is missing"),
    ("[anchor]", "[anchor", "line 13, column"),
    (
        "[[variants]]\nname = \"quick\"",
        "[[varieties]]\nname = \"quick\"",
        "varieties: unknown field `varieties`",
    ),
];

#[test]
fn errors_name_line_field_and_range() {
    for (from, to, want) in WRONG {
        assert!(CUP.contains(from), "{from:?} is not in the text");
        let text = CUP.replacen(from, to, 1);
        let error = Definition::from_toml(&text, &walker_rig()).unwrap_err();
        let said = error.to_string();
        assert!(
            said.contains(want),
            "{from:?} -> {to:?}\nsays {said}\nwant {want}"
        );
        assert!(said.contains("line ") || error.place.is_none(), "{said}");
        assert!(
            error.place.is_some() || error.field == "format",
            "no line in: {said}"
        );
    }
}

#[test]
fn json_errors_name_line_field_and_range() {
    let good = json();
    let line = |needle: &str| good.lines().position(|line| line.contains(needle)).unwrap() + 1;
    for (from, to, want) in [
        (
            "\"reach_m\": 0.8",
            "\"reach_m\": 80",
            format!(
                "line {}, column 16: trigger.reach_m: is 80; allowed: 0 to 10",
                line("reach_m")
            ),
        ),
        (
            "\"reach_m\": 0.8",
            "\"reach_m\": 1e300",
            "trigger.reach_m: is inf; allowed: 0 to 10".to_owned(),
        ),
        (
            "\"reach_m\": 0.8",
            "\"reach_m\": null",
            format!(
                "line {}, column 19: trigger.reach_m: invalid type: null, expected a number",
                line("reach_m")
            ),
        ),
        (
            "\"reach_m\": 0.8",
            "\"reach\": 0.8",
            "trigger.reach: unknown field `reach`".to_owned(),
        ),
        (
            "\"next\": \"lift\"",
            "\"next\": \"reach\"",
            format!("line {}, column 15: sets[0].next: goes round", line("\"next\"")),
        ),
        (
            "\"name\": \"cup\",",
            "\"name\": \"cup\"",
            "expected `,` or `}`".to_owned(),
        ),
    ] {
        assert!(good.contains(from), "{good}");
        let said = Definition::from_json(&good.replacen(from, to, 1), &walker_rig())
            .unwrap_err()
            .to_string();
        assert!(said.contains(&want), "says {said}\nwant {want}");
        assert!(said.matches("line ").count() == 1, "{said}");
    }
    let said = Definition::from_json(&format!("{good} x"), &walker_rig())
        .unwrap_err()
        .to_string();
    assert!(said.contains("trailing characters"), "{said}");
}

#[test]
fn ten_thousand_keyframes_are_an_error() {
    let many = "{ height_m = 0.7 },".repeat(10_000);
    let text = CUP.replacen("{ height_m = 0.7 },", &many, 1);
    let said = Definition::from_toml(&text, &walker_rig())
        .unwrap_err()
        .to_string();
    assert!(
        said.contains("line 74, column 13: sets[2].keyframes: has 10001 entries; allowed: 1 to 4"),
        "{said}"
    );

    let set = |i: usize| format!("[[sets]]\nname = \"more-{i}\"\nkeyframes = [{{ height_m = 0.7 }}]\n");
    let text = (0..10_000).fold(CUP.to_owned(), |text, i| text + &set(i));
    let said = Definition::from_toml(&text, &walker_rig())
        .unwrap_err()
        .to_string();
    assert!(
        said.contains("sets: has 10004 entries; allowed: 1 to 32"),
        "{said}"
    );

    let text = format!("{CUP}#{}", "x".repeat(MAX_BYTES));
    let said = Definition::from_toml(&text, &walker_rig())
        .unwrap_err()
        .to_string();
    assert!(
        said.ends_with("bytes long; allowed: at most 1048576 bytes"),
        "{said}"
    );
}

#[test]
fn weights_that_are_all_zero_are_refused() {
    let text = CUP.replacen("weight = 3.0", "weight = 0", 1).replacen(
        "entry = \"reach\"",
        "entry = \"reach\"\nweight = 0.0",
        1,
    );
    let said = Definition::from_toml(&text, &walker_rig())
        .unwrap_err()
        .to_string();
    assert!(
        said.contains("variants[0].weight: is 0, as that of every variant"),
        "{said}"
    );
}

#[test]
fn files_and_folders() {
    let folder = TempFolder::new("objects");
    let rig = walker_rig();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    assert!(
        load_folder(FilePath::new("no/such/folder"), &rig)
            .unwrap()
            .is_empty()
    );
    write("cup.toml", CUP);
    write("a-mug.json", &json().replacen("\"cup\"", "\"mug\"", 1));
    write("notes.txt", "no object");
    let names: Vec<_> = load_folder(folder.path(), &rig)
        .unwrap()
        .into_iter()
        .map(|one| one.name)
        .collect();
    assert_eq!(names, ["cup", "mug"]);
    write("twice.toml", CUP);
    let said = load_folder(folder.path(), &rig).unwrap_err().to_string();
    assert!(
        said.contains("twice.toml: name: is \"cup\", the same as the object definition of another file"),
        "{said}"
    );
    write("twice.toml", "format = 1\nname = 4");
    let said = load_folder(folder.path(), &rig).unwrap_err().to_string();
    assert!(
        said.contains("twice.toml: line 2, column 8: name: invalid type"),
        "{said}"
    );
    let said = load_file(&folder.path().join("notes.txt"), &rig)
        .unwrap_err()
        .to_string();
    assert!(
        said.contains("notes.txt: is no object definition; allowed: files that end in .toml or .json"),
        "{said}"
    );
    let said = load_file(&folder.path().join("none.toml"), &rig)
        .unwrap_err()
        .to_string();
    assert!(said.contains("none.toml: cannot be read"), "{said}");
}
