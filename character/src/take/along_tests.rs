use troupe_motion::model::{Output, Task};
use troupe_motion::path::PathPoint;
use troupe_motion::rotation::yaw;

use super::super::testing::made;
use super::super::{Making, Track};
use super::*;
use crate::style::testing::{walker_rig, walker_style};

fn point(time_s: f32, x: f32, z: f32) -> PathPoint {
    PathPoint {
        time_s,
        place: [x, z],
        heading: None,
    }
}

/// Four metres ahead at 1 m/s.
fn ahead() -> WalkRequest {
    WalkRequest {
        rig: Arc::new(walker_rig()),
        style: Arc::new(walker_style()),
        points: GroundPath::new(vec![point(0.0, 0.0, 0.0), point(4.0, 0.0, 4.0)]).unwrap(),
        seconds: 4.0,
        past: Vec::new(),
        keyframes: Vec::new(),
        targets: Vec::new(),
        seed: 3,
        temperature: 0.0,
        hold_feet: true,
    }
}

/// A pose with bent legs at a place.
fn key(x: f32, z: f32) -> Checked {
    let mut rotations = vec![Quat::IDENTITY; walker_rig().dims.joints];
    rotations[0] = yaw(0.1);
    rotations[2] = Quat::from_rotation_x(0.3);
    let root = GlobalRoot::new(Vec3::new(x, 0.9, z), 0.1);
    Checked::of(Some(root), None, None, Some(rotations))
}

/// All frames of a walk, and how many frames each part has.
fn walked(path: &WalkPath) -> (Track, Vec<usize>) {
    let mut making = Making::new(&path.take, 0);
    let (mut whole, mut parts) = (Track::default(), Vec::new());
    while let Some(task) = making.next_task().unwrap() {
        let Task::Keyframes(task) = task else {
            panic!("{task:?}")
        };
        let motion = made(&task, &path.take.subject.rig);
        making.receive(&Output::Motion(motion)).unwrap();
        let part = making.part();
        parts.push(part.len());
        whole.extend(&part, 0, part.len());
    }
    (whole, parts)
}

#[test]
fn a_path_is_walked_part_by_part() {
    let path = ahead().plan(&Path::root()).unwrap();
    assert_eq!((path.way.len(), path.too_fast), (121, None));
    let (track, parts) = walked(&path);
    // 36 frames are made in front of the first one, for it to be in its stride.
    assert_eq!(parts, [0, 13, 24, 24, 24, 24, 12]);
    for (frame, root) in track.roots.iter().enumerate() {
        let off = root.x.hypot(root.z - frame as f32 / 30.0);
        assert!(off < 0.12, "{off} m off in frame {frame}");
    }
}

#[test]
fn keyframes_and_targets_are_met_in_the_parts_that_have_them() {
    let request = WalkRequest {
        keyframes: vec![(2.0, key(0.2, 2.0))],
        targets: vec![key(0.1, 4.0), key(0.1, 4.03)],
        ..ahead()
    };
    let (track, _) = walked(&request.plan(&Path::root()).unwrap());
    for (frame, wanted) in [(60, key(0.2, 2.0)), (119, key(0.1, 4.0)), (120, key(0.1, 4.03))] {
        let root = wanted.root.unwrap();
        assert!(track.roots[frame].distance(root.position) < 1e-3, "frame {frame}");
        let pose = wanted.pose.unwrap().rotations;
        let off = track
            .pose(frame)
            .iter()
            .zip(&pose)
            .map(|(a, b)| a.angle_between(*b));
        assert!(off.fold(0.0, f32::max) < 2e-3, "frame {frame}");
    }
    let steps = track.roots.windows(2).map(|pair| pair[0].distance(pair[1]));
    assert!(steps.fold(0.0, f32::max) < 0.15, "nothing jumps");
}

#[test]
fn a_walk_goes_on_from_its_past() {
    let past: Vec<Checked> = (0..4)
        .map(|frame| key(0.0, -0.1 + 0.033 * frame as f32))
        .collect();
    let path = WalkRequest { past, ..ahead() }.plan(&Path::root()).unwrap();
    let (track, parts) = walked(&path);
    // Time 0 is the last frame of the past.
    assert_eq!((parts.iter().sum::<usize>(), path.way.len()), (120, 121));
    assert!(
        track.roots[0].distance(Vec3::new(0.0, 0.9, 0.03)) < 0.05,
        "{}",
        track.roots[0]
    );
    assert!((track.roots[119].z - 4.0).abs() < 0.12);
}

#[test]
fn a_path_of_one_point_is_stood_on() {
    let points = GroundPath::new(vec![point(0.0, 1.0, 2.0)]).unwrap();
    let path = WalkRequest {
        points,
        seconds: 1.5,
        ..ahead()
    };
    let (track, _) = walked(&path.plan(&Path::root()).unwrap());
    assert_eq!(track.len(), 46);
    let off = track.roots.iter().map(|root| (root.x - 1.0).hypot(root.z - 2.0));
    assert!(off.fold(0.0, f32::max) < 0.05);
}

#[test]
fn a_path_may_be_too_fast_for_its_style() {
    let points = GroundPath::new(vec![point(0.0, 0.0, 0.0), point(4.0, 0.0, 24.0)]).unwrap();
    let path = WalkRequest { points, ..ahead() }.plan(&Path::root()).unwrap();
    let fast = path.too_fast.unwrap();
    assert!((fast.path_mps - 6.0).abs() < 0.1, "{fast:?}");
    assert!(
        (2.5..3.5).contains(&fast.style_mps),
        "the style runs at 3 m/s: {fast:?}"
    );
}

#[test]
fn knots_may_be_too_fast_for_a_style_of_a_smaller_body() {
    let knot = |frame: f32, z: f32| Knot {
        frame,
        place: [0.0, z],
        heading: None,
    };
    let behind = |knots: &[Knot], scale: f32| falls_behind(&walker_style(), knots, 30.0, scale);
    // 1 m/s, then 6 m/s.
    let knots = [knot(0.0, 0.0), knot(45.5, 1.5), knot(120.0, 16.4)];
    assert!(!behind(&knots[..2], 1.0) && behind(&knots, 1.0));
    assert!(!behind(&knots, 6.0), "a giant's steps are as long as that");
    assert!(
        !behind(&knots[..1], 1.0) && !behind(&[], 1.0),
        "no path is too fast"
    );
}
