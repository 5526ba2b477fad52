//! Documents: what may be left out, what is refused, and what is written.

use troupe_proto::docs::{ObjectDoc, SceneDoc};

const BENCH: &str = r#"{
    "format": 1,
    "name": "bench",
    "shape": {"box": {"half_extents_m": [0.5, 0.5, 0.5]}},
    "trigger": {"reach_m": 0.5},
    "variants": [{"name": "sit", "weight": 1.0, "entry": "down"}],
    "sets": [{"name": "down", "keyframes": [{"height_m": 0.5}]}]
}"#;

#[test]
fn empty_values_are_not_written() {
    let bench: ObjectDoc = serde_json::from_str(BENCH).unwrap();
    assert!(bench.solid && !bench.shared && bench.release.snap);
    let written = serde_json::to_value(&bench).unwrap();
    assert_eq!(written, serde_json::from_str::<serde_json::Value>(BENCH).unwrap());
    assert_eq!(serde_json::from_value::<ObjectDoc>(written).unwrap(), bench);
    let text = bench.to_toml().unwrap();
    assert!(text.contains("[[sets.keyframes]]\nheight_m = 0.5"), "{text}");
}

#[test]
fn unknown_fields_are_refused() {
    let said = |text: &str| serde_json::from_str::<ObjectDoc>(text).unwrap_err().to_string();
    for (from, to) in [
        ("\"reach_m\"", "\"reach\""),
        ("\"height_m\"", "\"height\""),
        ("\"entry\"", "\"entries\""),
    ] {
        let error = said(&BENCH.replacen(from, to, 1));
        assert!(error.contains("unknown field"), "{error}");
    }
    let error = serde_json::from_str::<SceneDoc>(r#"{"format": 1, "name": "a", "ground": 0}"#)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("unknown field `ground`, expected one of"),
        "{error}"
    );
}
