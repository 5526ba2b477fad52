use std::sync::Arc;

use troupe_motion::fk::joint_transform;
use troupe_motion::rotation::six_d;
use troupe_motion::{Quat, Vec3};

use super::*;
use crate::live::behaviour::testing::{doll, doll_rig};

const FEET: [usize; 2] = [12, 15];
/// Hips of the made motion, metres.
const HIPS_M: f32 = 0.88;
/// Way of a frame, metres: 1.2 m/s.
const STEP_M: f32 = 0.04;

fn rig() -> Arc<Rig> {
    doll_rig()
}

/// Pose of a walk with short steps, whose feet glide.
fn pose(frame: f32) -> Vec<Quat> {
    let mut pose = vec![Quat::IDENTITY; doll().joint_count()];
    for (first, phase) in [(10, 0.0), (13, std::f32::consts::PI)] {
        let phase = 0.2 * frame + phase;
        let (swing, lift) = (0.16 * phase.sin(), 0.25 * phase.cos().max(0.0));
        pose[first] = Quat::from_rotation_x(-0.36 - swing - 0.4 * lift);
        pose[first + 1] = Quat::from_rotation_x(0.72 + 1.6 * lift);
        pose[first + 2] = Quat::from_rotation_x(-0.36 + swing - 1.2 * lift);
    }
    pose
}

/// Frames `from..to` of the walk along +Z, as a model gives them.
fn walked(from: usize, to: usize) -> Motion {
    let rig = rig();
    let mut motion = Motion::default();
    for frame in from..to {
        let root = GlobalRoot::new(Vec3::new(0.0, HIPS_M, STEP_M * frame as f32), 0.0);
        motion.root.extend(root.to_array());
        let local = pose(frame as f32);
        let (mut places, mut world) = (vec![Vec3::ZERO; local.len()], local.clone());
        world_transforms(&rig.skeleton, root.position, &local, &mut places, &mut world);
        motion.rotations.extend(world.into_iter().flat_map(six_d));
        // A foot touches the ground while it is not lifted.
        let lifts = [0.0, std::f32::consts::PI].map(|phase| (0.2 * frame as f32 + phase).cos() > 0.0);
        let touches = |joint: &usize| f32::from(!lifts[usize::from(*joint > FEET[0])]);
        let feet = &rig.skeleton.contacts.as_ref().unwrap().joints;
        motion.contacts.extend(feet.iter().map(touches));
    }
    motion
}

/// Frames of the same walk as keyframes, at a root.
fn keys(range: std::ops::Range<usize>, root: impl Fn(usize) -> GlobalRoot) -> Vec<Checked> {
    let key = |frame: usize| Checked::of(Some(root(frame)), None, None, Some(pose(frame as f32)));
    range.map(key).collect()
}

fn on_the_way(frame: usize) -> GlobalRoot {
    GlobalRoot::new(Vec3::new(0.0, HIPS_M, STEP_M * frame as f32), 0.0)
}

/// The frame of reference in which the walk is made.
fn origin() -> SegmentFrame {
    SegmentFrame::from_root(GlobalRoot::new(Vec3::ZERO, 0.0))
}

fn slower_mm(track: &Track) -> f32 {
    let feet = |frame: usize| {
        FEET.map(|foot| joint_transform(&doll(), track.roots[frame], track.pose(frame), foot).0)
    };
    let step = |frame: usize| {
        let [a, b] = [feet(frame), feet(frame + 1)];
        let ways = [0, 1].map(|foot| (b[foot] - a[foot]).with_y(0.0).length());
        ways[0].min(ways[1])
    };
    let steps = (0..track.len() - 1).map(step);
    1000.0 * steps.sum::<f32>() / (track.len() - 1) as f32
}

fn away_m(a: Vec3, b: Vec3) -> f32 {
    (a - b).with_y(0.0).length()
}

#[test]
fn a_walk_ends_at_its_place_on_feet_that_stand() {
    let rig = rig();
    let place = GlobalRoot::new(Vec3::new(1.2, 0.0, 2.6), 0.9);
    let mut ending = Ending::at(place, origin(), &[]);
    // The parts may have any length.
    for (from, to) in [(0, 16), (16, 48), (48, 90)] {
        ending.receive(&walked(from, to), &rig).unwrap();
    }
    let (track, notes) = ending.finish(&rig);
    assert_eq!((track.len(), notes), (90, Vec::new()));
    assert!(
        away_m(track.roots[89], place.position) < 1e-3,
        "{}",
        track.roots[89]
    );
    let heading = track.root(89, &rig.skeleton).heading;
    assert!((heading - 0.9).abs() < 0.01, "{heading}");
    assert!(
        away_m(track.roots[0], Vec3::ZERO) < 1e-4,
        "it begins where it began"
    );
    let slower = slower_mm(&track);
    assert!(slower < 3.0, "{slower} mm a frame");
}

#[test]
fn a_walk_goes_on_from_its_past_without_a_jump() {
    let rig = rig();
    let past = keys(0..16, on_the_way);
    let place = GlobalRoot::new(Vec3::new(-1.0, 0.0, 3.0), 0.0);
    let mut ending = Ending::at(place, origin(), &past);
    ending.receive(&walked(16, 90), &rig).unwrap();
    let (track, _) = ending.finish(&rig);
    assert!(away_m(track.roots[73], place.position) < 1e-3);
    let first = away_m(track.roots[0], on_the_way(15).position);
    assert!((first - STEP_M).abs() < 0.005, "{first} m");
}

#[test]
fn a_place_that_is_too_far_is_met_and_noted() {
    let rig = rig();
    let top = top_speed_mps(&rig).unwrap();
    // Five times the legs of 0.86 m.
    assert!((top - 4.3).abs() < 1e-3, "{top}");
    let mut ending = Ending::at(GlobalRoot::new(Vec3::new(0.0, 0.0, 12.0), 0.0), origin(), &[]);
    ending.receive(&walked(0, 60), &rig).unwrap();
    let (track, notes) = ending.finish(&rig);
    assert!(away_m(track.roots[59], Vec3::Z * 12.0) < 1e-3);
    let note = &notes[0];
    assert!(
        note.contains("4.3 suit the body") && note.contains("seconds"),
        "{note}"
    );
}

#[test]
fn a_gap_takes_the_way_that_is_known() {
    let rig = rig();
    // The captured way has a curve that the model does not know.
    let curve = |frame: usize| {
        let aside = 0.3 * (frame as f32 / 60.0 * std::f32::consts::PI).sin();
        GlobalRoot::new(Vec3::new(aside, HIPS_M, STEP_M * frame as f32), 0.0)
    };
    let (past, targets) = (keys(0..16, on_the_way), keys(60..76, on_the_way));
    let mut ending = Ending::between(origin(), &past, &targets);
    assert!(ending.is_gap());
    ending.follow((16..60).map(curve).collect());
    ending.receive(&walked(16, 60), &rig).unwrap();
    let (track, notes) = ending.finish(&rig);
    assert_eq!((track.len(), notes), (44, Vec::new()));
    for (frame, root) in track.roots.iter().enumerate() {
        assert!(away_m(*root, curve(frame + 16).position) < 1e-4, "frame {frame}");
    }
}

#[test]
fn a_gap_without_a_way_keeps_the_models() {
    let rig = rig();
    let (past, targets) = (keys(0..16, on_the_way), keys(60..76, on_the_way));
    let mut ending = Ending::between(origin(), &past, &targets);
    // A way of another length is none.
    ending.follow(vec![on_the_way(0)]);
    ending.receive(&walked(16, 60), &rig).unwrap();
    let (track, _) = ending.finish(&rig);
    for (frame, root) in track.roots.iter().enumerate() {
        assert!(away_m(*root, on_the_way(frame + 16).position) < 1e-4);
    }
    let held = slower_mm(&track);
    let raw = slower_mm(&Track::of_motion(&walked(16, 60), &origin(), &rig));
    assert!(held < raw, "{held} {raw} mm a frame");
}

#[test]
fn numbers_that_are_not_finite_are_refused() {
    let rig = rig();
    let mut ending = Ending::at(on_the_way(0), origin(), &[]);
    let mut motion = walked(0, 8);
    motion.root[0] = f32::NAN;
    assert!(ending.receive(&motion, &rig).is_err());
}
