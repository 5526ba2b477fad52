use super::*;
use crate::style::testing::{walker_rig, walker_style};

fn check(change: impl FnOnce(&mut v1::Style)) -> Result<Style, FieldError> {
    let mut style = walker_style().to_proto();
    change(&mut style);
    let request = Path::root();
    Style::from_proto(&request.field("style"), &style, &walker_rig(), false)
}

#[test]
fn a_style_is_unchanged_by_writing_and_checking() {
    let style = walker_style();
    let back = check(|_| {}).unwrap();
    assert_eq!(back.name, style.name);
    for (a, b) in back.gaits.iter().zip(&style.gaits) {
        assert_eq!(
            (&a.name, a.left_mps, a.forward_mps),
            (&b.name, b.left_mps, b.forward_mps)
        );
        assert_eq!((a.turn_rps, a.period_frames), (b.turn_rps, b.period_frames));
        for (a, b) in a.keys.iter().zip(&b.keys) {
            assert_eq!(
                (a.height_m, a.forward_mps, a.turn_rps),
                (b.height_m, b.forward_mps, b.turn_rps)
            );
            assert!(
                a.rotations
                    .iter()
                    .zip(&b.rotations)
                    .all(|(a, b)| a.abs_diff_eq(*b, 1e-6))
            );
        }
    }
}

#[test]
fn lists_have_no_keyframes() {
    let summary = walker_style().to_proto_summary();
    let walk = &summary.gaits[1];
    assert_eq!((walk.keys.len(), walk.key_count), (0, 16));
    assert!((walk.height - 0.95).abs() < 1e-4);
    assert_eq!(walker_style().to_proto().gaits[1].keys.len(), 16);
}

#[test]
fn fields_that_the_server_sets_are_not_read() {
    let style = check(|style| {
        style.built_in = true;
        style.gaits[1].height = 7.0;
        style.gaits[1].key_count = 0;
    })
    .unwrap();
    assert!(!style.built_in);
    assert!(style.gaits[1].height_m() < 1.0);
}

#[test]
fn rotations_are_made_unit() {
    let style = check(|style| style.gaits[0].keys[0].rotations[0] = 1.0005).unwrap();
    assert_eq!(style.gaits[0].keys[0].rotations[0].length(), 1.0);
}

/// Every field out of its range is refused, with its place and what is allowed.
#[test]
fn bad_fields_are_named_with_their_range() {
    type Case = (fn(&mut v1::Style), &'static str, &'static str);
    let cases: [Case; 28] = [
        (|s| s.name.clear(), "style.name", "1 to 64 letters"),
        (|s| s.name = "a".repeat(65), "style.name", "1 to 64 letters"),
        (|s| s.name = "../up".into(), "style.name", "1 to 64 letters"),
        (|s| s.default_speed = -0.1, "style.default_speed", "0 to 10"),
        (|s| s.default_speed = f32::NAN, "style.default_speed", "0 to 10"),
        (
            |s| s.replan_interval_frames = 2,
            "style.replan_interval_frames",
            "3 to 30",
        ),
        (
            |s| s.replan_interval_frames = 31,
            "style.replan_interval_frames",
            "3 to 30",
        ),
        (
            |s| s.allowed_token_counts = vec![9, 17],
            "style.allowed_token_counts[1]",
            "3 to 16",
        ),
        (
            |s| s.allowed_token_counts = vec![2],
            "style.allowed_token_counts[0]",
            "3 to 16",
        ),
        (
            |s| s.allowed_token_counts = vec![9; 15],
            "style.allowed_token_counts",
            "at most 14",
        ),
        (|s| s.root_ratio = 1.3, "style.root_ratio", "0 to 1.2"),
        (|s| s.gaits.clear(), "style.gaits", "1 to 16"),
        (
            |s| s.gaits = (0..17).map(|_| s.gaits[0].clone()).collect(),
            "style.gaits",
            "1 to 16",
        ),
        (
            |s| s.gaits[2].name = "walk".into(),
            "style.gaits[2].name",
            "a name for each gait",
        ),
        (
            |s| s.gaits[2].name.clear(),
            "style.gaits[2].name",
            "1 to 64 letters",
        ),
        (|s| s.gaits[1].left = 10.5, "style.gaits[1].left", "-10 to 10"),
        (
            |s| s.gaits[1].forward = f32::INFINITY,
            "style.gaits[1].forward",
            "-10 to 10",
        ),
        (|s| s.gaits[1].turn = -11.0, "style.gaits[1].turn", "-10 to 10"),
        (
            |s| s.gaits[1].period_frames = -1.0,
            "style.gaits[1].period_frames",
            "0 to 300",
        ),
        (
            |s| s.gaits[1].period_frames = 0.0,
            "style.gaits[1].period_frames",
            "1 to 300",
        ),
        (|s| s.gaits[1].keys.clear(), "style.gaits[1].keys", "1 to 32"),
        (
            |s| s.gaits[1].keys = vec![s.gaits[1].keys[0].clone(); 33],
            "style.gaits[1].keys",
            "1 to 32",
        ),
        (
            |s| s.gaits[1].key_count = 3,
            "style.gaits[1].key_count",
            "16, as many",
        ),
        (
            |s| s.gaits[2].keys[0].left = 51.0,
            "style.gaits[2].keys[0].left",
            "-50 to 50",
        ),
        (
            |s| s.gaits[2].keys[0].height = f32::NAN,
            "style.gaits[2].keys[0].height",
            "-100 to 100",
        ),
        (
            |s| s.gaits[2].keys[0].rotations.truncate(23),
            "style.gaits[2].keys[0].rotations",
            "exactly 24",
        ),
        (
            |s| s.gaits[2].keys[0].rotations[8] = 0.5,
            "style.gaits[2].keys[0].rotations[8]",
            "unit length",
        ),
        (
            |s| s.gaits[2].keys[0].rotations[9] = f32::NAN,
            "style.gaits[2].keys[0].rotations[8]",
            "unit length",
        ),
    ];
    for (change, field, allowed) in cases {
        let error = check(change).unwrap_err();
        assert_eq!(error.field, field, "{error}");
        assert!(error.allowed.contains(allowed), "{error}");
    }
}
