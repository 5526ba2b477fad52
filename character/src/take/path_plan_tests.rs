use std::f32::consts::TAU;

use troupe_motion::path::PathPoint;

use super::*;

const FPS: f32 = 30.0;

/// Whether a path through these places at a speed counts as recorded.
fn drawn_is_recorded(places: &[[f32; 2]], mps: f32) -> bool {
    let times = GroundPath::times_at(places, mps);
    let point = |(&place, time_s): (&[f32; 2], f32)| PathPoint {
        time_s,
        place,
        heading: None,
    };
    let path = GroundPath::new(places.iter().zip(times).map(point).collect()).unwrap();
    let frames = path.frames(0.0, FPS, (path.end_s() * FPS) as usize);
    is_recorded(&path, &frames, FPS)
}

/// Whether a path with a point in each frame counts as recorded.
fn each_frame_is_recorded(at: impl Fn(f32) -> f32) -> bool {
    let point = |frame: usize| PathPoint {
        time_s: frame as f32 / FPS,
        place: [0.0, at(frame as f32 / FPS)],
        heading: Some(0.0),
    };
    let path = GroundPath::new((0..90).map(point).collect()).unwrap();
    is_recorded(&path, &path.frames(0.0, FPS, 89), FPS)
}

#[test]
fn drawn_paths_are_not_taken_for_recorded_roots() {
    let circle: Vec<[f32; 2]> = (0..=8)
        .map(|nth| (nth as f32 / 8.0 * TAU).sin_cos())
        .map(|(sin, cos)| [2.0 * sin, 2.0 * cos])
        .collect();
    let eight: Vec<[f32; 2]> = (0..=12)
        .map(|nth| nth as f32 / 12.0 * TAU)
        .map(|t| [1.5 * (2.0 * t).sin(), 2.5 * t.sin()])
        .collect();
    let square = [[0.0, 0.0], [0.0, 3.0], [3.0, 3.0], [3.0, 0.0], [0.0, 0.0]];
    for (name, places) in [
        ("line", &[[0.0, 0.0], [0.0, 4.0]][..]),
        ("circle", &circle),
        ("eight", &eight),
        ("square", &square),
        ("corner", &square[..3]),
    ] {
        for mps in [0.4, 1.2, 2.5] {
            assert!(!drawn_is_recorded(places, mps), "{name} at {mps} m/s");
        }
    }
    // Many points at an even speed, one who stops on the way, and one who stands.
    assert!(!each_frame_is_recorded(|t| 1.2 * t));
    assert!(!each_frame_is_recorded(|t| 1.2 * t.min(1.4)) && !each_frame_is_recorded(|_| 0.0));
}

#[test]
fn roots_that_hurry_with_each_step_are_recorded() {
    let person = |t: f32| 1.2 * t + 0.025 * (TAU * 1.8 * t).sin();
    let robot = |t: f32| 0.6 * t + 0.005 * (TAU * 1.5 * t).sin();
    assert!(each_frame_is_recorded(person) && each_frame_is_recorded(robot));
}
