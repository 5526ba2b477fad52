//! Gaits: measured here and by other code.

use troupe_motion::Clip;
use troupe_motion::gait::{ClosedCycle, CycleOptions, StandOptions, Way, find_cycles, find_stand};

use crate::{data_folder, read};

/// The clip of this name, if it is present.
fn clip(name: &str) -> Option<Clip> {
    let path = data_folder().join(format!("{name}.bvh"));
    let clip = read(&path);
    if clip.is_none() {
        println!("{} is not at hand", path.display());
    }
    clip
}

#[test]
fn speeds_and_periods_agree_with_others() {
    // Name, forward and left speed (m/s), period (frames), root height (m); from smoothed root
    // speeds and foot distances.
    let known = [
        ("dataset-1_walk_normal_001", 1.25, -0.07, 32.0, 0.90),
        ("dataset-1_walk_sad_001", 0.55, -0.01, 50.0, 0.92),
        ("dataset-1_walk-back_active_001", -1.06, -0.03, 35.0, 0.89),
        ("dataset-1_walk-left_tired_001", 0.81, 0.58, 34.0, 0.90),
        ("dataset-1_run_angry_001", 2.80, -0.13, 19.0, 0.89),
        ("dataset-1_dash_chimpira_001", 3.95, 0.26, 18.0, 0.84),
        ("dataset-2_run_masculine_022", 2.74, 0.04, 25.0, 0.88),
        ("dataset-2_walk_elderly_008", 0.78, 0.04, 31.0, 0.89),
    ];
    for (name, forward, left, period, height) in known {
        let Some(clip) = clip(name) else { return };
        let found = find_cycles(&clip, &CycleOptions::default()).unwrap()[0];
        let what = format!("{name}: {found:?}");
        assert!(
            (found.forward_mps - forward).abs() < 0.08 * forward.abs().max(1.0),
            "{what}"
        );
        assert!((found.left_mps - left).abs() < 0.1, "{what}");
        assert!((found.frames as f32 - period).abs() <= 2.0, "{what}");
        assert!(
            (found.height_m - height).abs() < 0.02 && found.closure_m < 0.06,
            "{what}"
        );
        let closed = ClosedCycle::new(&clip, &found);
        assert!((closed.height_m() - found.height_m).abs() < 0.005, "{what}");
    }
}

#[test]
fn a_turn_in_a_walk_is_found() {
    for (name, side) in [
        ("dataset-2_walk-turn-left_normal_003", 1.0),
        ("dataset-2_walk-turn-right_youthful_016", -1.0),
    ] {
        let Some(clip) = clip(name) else { return };
        let options = CycleOptions {
            way: Way::Turning,
            ..CycleOptions::default()
        };
        let found = find_cycles(&clip, &options).unwrap()[0];
        assert!(found.turn_rps * side > 0.8, "{name}: {found:?}");
        assert!((0.8..1.4).contains(&found.forward_mps), "{name}: {found:?}");
    }
}

#[test]
fn a_waving_person_stands_before_or_after() {
    let Some(clip) = clip("dataset-2_raise-up-right-hand_normal_065") else {
        return;
    };
    let stand = find_stand(&clip, &StandOptions::default()).unwrap();
    assert!(
        stand.speed_mps < 0.3 && (0.9..0.95).contains(&stand.height_m),
        "{stand:?}"
    );
}

#[test]
fn a_short_clip_has_no_cycle() {
    let Some(clip) = clip("dataset-1_walk_normal_002") else {
        return;
    };
    let what = find_cycles(&clip, &CycleOptions::default())
        .unwrap_err()
        .to_string();
    assert!(what.contains("left strikes are too few"), "{what}");
}
