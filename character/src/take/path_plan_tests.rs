use std::f32::consts::TAU;

use troupe_motion::path::PathPoint;

use super::*;

const FPS: f32 = 30.0;

/// Whether a path through these places at a speed counts as recorded, and whether its points show
/// steps.
fn drawn_is_recorded(places: &[[f32; 2]], mps: f32) -> [bool; 2] {
    let times = GroundPath::times_at(places, mps);
    let point = |(&place, time_s): (&[f32; 2], f32)| PathPoint {
        time_s,
        place,
        heading: None,
    };
    let path = GroundPath::new(places.iter().zip(times).map(point).collect()).unwrap();
    let frames = path.frames(0.0, FPS, (path.end_s() * FPS) as usize);
    [
        path.shows_steps() && is_recorded(&frames, FPS),
        path.shows_steps(),
    ]
}

/// Whether a way along +Z with a point in each frame counts as recorded.
fn each_frame_is_recorded(at: impl Fn(f32) -> f32) -> bool {
    let point = |frame: usize| PathPoint {
        time_s: frame as f32 / FPS,
        place: [0.0, at(frame as f32 / FPS)],
        heading: Some(0.0),
    };
    let path = GroundPath::new((0..120).map(point).collect()).unwrap();
    assert!(path.shows_steps());
    is_recorded(&path.frames(0.0, FPS, 119), FPS)
}

#[test]
fn paths_of_a_few_points_are_not_taken_for_recorded_roots() {
    let circle: Vec<[f32; 2]> = (0..=8)
        .map(|nth| (nth as f32 / 8.0 * TAU).sin_cos())
        .map(|(sin, cos)| [2.0 * sin, 2.0 * cos])
        .collect();
    let square = [[0.0, 0.0], [0.0, 3.0], [3.0, 3.0], [3.0, 0.0], [0.0, 0.0]];
    for (name, places) in [
        ("line", &[[0.0, 0.0], [0.0, 4.0]][..]),
        ("circle", &circle),
        ("square", &square),
    ] {
        for mps in [0.4, 1.2, 2.5] {
            assert_eq!(drawn_is_recorded(places, mps), [false; 2], "{name} at {mps} m/s");
        }
    }
}

#[test]
fn smooth_ways_of_many_points_are_not_taken_for_recorded_roots() {
    assert!(!each_frame_is_recorded(|t| 1.2 * t), "even");
    assert!(!each_frame_is_recorded(|t| 1.2 * t.min(2.0)), "one that stops");
    assert!(!each_frame_is_recorded(|_| 0.0), "one that stands");
    assert!(!each_frame_is_recorded(|t| 4.0 * smoothstep(t / 4.0)), "eased");
    let slow_and_fast = |t: f32| 1.2 * t + 0.17 * (TAU * t / 3.0).sin();
    assert!(!each_frame_is_recorded(slow_and_fast), "slow and fast");
    assert!(!is_recorded(&[], FPS));
}

#[test]
fn roots_that_hurry_with_each_step_are_recorded() {
    let person = |t: f32| 1.2 * t + 0.025 * (TAU * 1.8 * t).sin();
    let robot = |t: f32| 0.5 * t + 0.004 * (TAU * 1.3 * t).sin();
    let runner = |t: f32| 2.5 * t + 0.007 * (TAU * 2.7 * t).sin();
    assert!(each_frame_is_recorded(person) && each_frame_is_recorded(robot));
    assert!(each_frame_is_recorded(runner));
}
