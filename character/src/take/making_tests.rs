use troupe_motion::model::Motion;
use troupe_motion::rotation::{six_d, yaw};
use troupe_motion::{Quat, Vec3};

use super::super::testing::{knot, run, take};
use super::super::{Knot, PoseKey, Severity};
use super::*;

fn place(made: &Made, frame: usize) -> [f32; 2] {
    let root = made.track.roots[frame];
    [root.x, root.z]
}

fn near(a: [f32; 2], b: [f32; 2], most_m: f32) -> bool {
    (a[0] - b[0]).hypot(a[1] - b[1]) <= most_m
}

#[test]
fn a_path_is_met_at_its_knots_however_long_it_is() {
    for frames in [2, 24, 100, 400] {
        let mut take = take(frames);
        let last = (frames - 1) as f32;
        take.wanted.path = vec![knot(0.0, 1.0, 2.0), knot(last, 1.0, 2.0 + last * 0.04)];
        let (made, windows) = run(&Arc::new(take), 0);
        assert_eq!(made.track.len(), frames);
        // A motion that starts in motion is made from 36 frames before; a window has 24.
        assert_eq!(windows, (36 + frames).div_ceil(24), "{frames} frames");
        assert!(near(place(&made, 0), [1.0, 2.0], 1e-3));
        let end = place(&made, frames - 1);
        assert!(near(end, [1.0, 2.0 + last * 0.04], 1e-3), "{end:?}");
    }
}

#[test]
fn a_pose_on_the_way_is_met_and_the_motion_continues_from_it() {
    let mut take = take(120);
    take.wanted.path = vec![knot(0.0, 0.0, 0.0), knot(119.0, 0.0, 4.0)];
    let mut rotations = vec![Quat::IDENTITY; take.subject.rig.dims.joints];
    rotations[0] = yaw(0.4);
    rotations[1] = Quat::from_rotation_x(0.6);
    take.wanted.keys = vec![PoseKey {
        frame: 60,
        rotations: rotations.iter().copied().map(Some).collect(),
        root: Some(Vec3::new(0.3, 0.8, 2.0)),
    }];
    let (made, _) = run(&Arc::new(take), 0);
    assert!(made.track.roots[60].distance(Vec3::new(0.3, 0.8, 2.0)) < 1e-3);
    for (found, wanted) in made.track.pose(60).iter().zip(&rotations) {
        assert!(found.angle_between(*wanted) < 1e-3);
    }
    let steps = made.track.roots.windows(2).map(|pair| pair[0].distance(pair[1]));
    assert!(steps.fold(0.0, f32::max) < 0.15, "nothing jumps");
    assert!(made.boundaries.contains(&61), "a window ends with the pose");
}

#[test]
fn the_way_of_words_is_bent_to_its_place() {
    let mut take = take(90);
    take.segments[0].prompt = Prompt::Words("someone walks".to_owned());
    let ahead = Knot {
        heading: Some(0.0),
        ..knot(0.0, 0.0, 0.0)
    };
    take.wanted.path = vec![ahead, knot(89.0, 2.0, 2.0)];
    let rig = take.subject.rig.clone();
    let mut making = Making::new(&Arc::new(take), 0);
    while let Some(task) = making.next_task().unwrap() {
        let Task::Prompt(task) = task else {
            panic!("{task:?}")
        };
        // It walks straight on, whatever the path.
        let mut motion = Motion::default();
        for frame in 0..task.frames.unwrap() {
            motion.root.extend([0.0, 1.0, 0.035 * frame as f32, 1.0, 0.0]);
            let pose = (0..rig.dims.joints).flat_map(|_| six_d(Quat::IDENTITY));
            motion.rotations.extend(pose);
            motion.contacts.extend(vec![0.0; rig.dims.contacts]);
        }
        making.receive(&Output::Motion(motion)).unwrap();
    }
    let made = making.finish().unwrap();
    assert!(near(place(&made, 89), [2.0, 2.0], 1e-3), "{:?}", place(&made, 89));
    // A quarter of a circle leads there, and the body turns with its way.
    let heading = made.track.root(89, &rig.skeleton).heading;
    assert!((heading - std::f32::consts::FRAC_PI_2).abs() < 0.05, "{heading}");
    let middle = made.track.root(45, &rig.skeleton);
    assert!((middle.heading - 0.8).abs() < 0.2 && middle.position.x < middle.position.z);
}

#[test]
fn a_loop_ends_in_its_first_pose() {
    let mut take = take(90);
    take.is_loop = true;
    take.wanted.path = vec![knot(0.0, 0.0, 0.0), knot(89.0, 0.0, 3.0)];
    let (made, _) = run(&Arc::new(take), 0);
    let (first, last) = (made.track.pose(0), made.track.pose(89));
    assert!(first.iter().zip(last).all(|(a, b)| a.angle_between(*b) < 1e-3));
    assert!((made.track.roots[0].y - made.track.roots[89].y).abs() < 1e-3);
    assert!(near(place(&made, 89), [0.0, 3.0], 1e-2));
}

#[test]
fn samples_differ_and_repeat_exactly() {
    let take = Arc::new(take(60));
    let [first, again, other] = [0, 0, 1].map(|sample| run(&take, sample).0);
    assert_eq!(first.track, again.track);
    assert_ne!(first.track, other.track);
    let note = &first.notes[0];
    assert_eq!((note.code, note.severity), ("path_drawn", Severity::Info));
    assert!(other.notes.is_empty(), "a note appears once for all samples");
}

#[test]
fn answers_of_another_kind_add_no_frames() {
    let take = Arc::new(take(30));
    let mut making = Making::new(&take, 0);
    making.next_task().unwrap().unwrap();
    assert!(making.receive(&Output::Audio(Vec::new())).is_err());
    assert!(making.finish().is_err(), "frames are missing");
}
