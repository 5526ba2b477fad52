use std::sync::Arc;

use troupe_motion::fk::{joint_transform, world_transforms};
use troupe_motion::model::{Body, BodyParts, PathTask};
use troupe_motion::path::{GroundPath, PathPoint};
use troupe_motion::rotation::{six_d, yaw};
use troupe_motion::{GlobalRoot, Quat, Vec3};

use super::super::PathRequest;
use super::*;
use crate::Path;
use crate::keyframe::Checked;
use crate::live::behaviour::testing::{doll, doll_rig};

const FEET: [usize; 2] = [12, 15];
const FPS: f32 = 30.0;
const SPEED_MPS: f32 = 1.2;
/// Hips of the made motion, metres.
const HIPS_M: f32 = 0.88;

fn body() -> Arc<Body> {
    let parts = BodyParts {
        name: "doll".to_owned(),
        skeleton: (*doll()).clone(),
        neutral: vec![Quat::IDENTITY; doll().joint_count()],
        sides: vec![0; doll().joint_count()],
        height_m: Some(HIPS_M),
        size_m: Some(HIPS_M),
        words: Vec::new(),
    };
    Arc::new(Body::new(parts, FPS, &doll_rig().dims).unwrap())
}

/// Pose of a walk with short steps, whose feet glide, in a frame of the motion.
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

fn plan(past: Vec<Checked>, targets: Vec<Checked>, frames: usize) -> PathPlan {
    let seconds = frames as f32 / FPS;
    let point = |time_s: f32| PathPoint {
        time_s,
        place: [0.0, SPEED_MPS * time_s],
        heading: Some(0.0),
    };
    let request = PathRequest {
        body: body(),
        points: GroundPath::new(vec![point(0.0), point(seconds)]).unwrap(),
        shows_steps: false,
        seconds,
        past,
        targets,
        style: Vec::new(),
        steps: 1,
        guidance: 1.0,
        seed: 0,
    };
    PathPlan::new(&Path::root(), request).unwrap()
}

/// What the network makes of a task that begins in a frame of the motion.
fn answer(task: &PathTask, from: usize) -> Motion {
    let body = body();
    let mut motion = Motion::default();
    for (index, &[x, z, heading]) in task.path.iter().enumerate() {
        let root = GlobalRoot::new(Vec3::new(x, HIPS_M, z), heading);
        motion.root.extend(root.to_array());
        let mut local = pose((from + index) as f32);
        local[0] = yaw(heading);
        let (mut places, mut world) = (vec![Vec3::ZERO; local.len()], local.clone());
        world_transforms(&body.rig.skeleton, root.position, &local, &mut places, &mut world);
        motion.rotations.extend(world.into_iter().flat_map(six_d));
        motion.contacts.extend(vec![0.0; body.rig.dims.contacts]);
    }
    motion
}

/// The network's frames, those that leave part by part, and how many each part has.
fn made(mut plan: PathPlan, mut bare: PathPlan) -> (Track, Track, Vec<usize>) {
    let (mut raw, mut whole, mut parts) = (Track::default(), Track::default(), Vec::new());
    let (mut steady, lead) = (Steady::default(), plan.newest().len());
    while let Some((task, frame)) = bare.next_task() {
        plan.next_task().unwrap();
        let motion = answer(&task, lead + raw.len() - task.context.len());
        let (fresh, _) = bare.receive(&motion, &frame);
        let fresh = Track::of_motion(&fresh, &frame, &bare.body.rig);
        raw.extend(&fresh, 0, fresh.len());
        let (part, _) = steady.receive(&mut plan, &motion, &frame);
        parts.push(part.len());
        whole.extend(&part, 0, part.len());
    }
    (raw, whole, parts)
}

fn feet(track: &Track, frame: usize) -> [Vec3; 2] {
    FEET.map(|foot| joint_transform(&doll(), track.roots[frame], track.pose(frame), foot).0)
}

/// Mean way of the slower foot, mm a frame.
fn slower_mm(track: &Track) -> f32 {
    let step = |frame: usize| {
        let [a, b] = [feet(track, frame), feet(track, frame + 1)];
        let ways = [0, 1].map(|foot| (b[foot] - a[foot]).with_y(0.0).length());
        ways[0].min(ways[1])
    };
    let steps = (0..track.len() - 1).map(step);
    1000.0 * steps.sum::<f32>() / (track.len() - 1) as f32
}

/// Largest acceleration of a foot, mm a frame².
fn bends_mm(track: &Track) -> f32 {
    let bend = |frame: usize| {
        let at = [frame - 1, frame, frame + 1].map(|frame| feet(track, frame));
        let bends = [0, 1].map(|foot| (at[2][foot] - at[1][foot] * 2.0 + at[0][foot]).length());
        bends[0].max(bends[1])
    };
    1000.0 * (1..track.len() - 1).map(bend).fold(0.0, f32::max)
}

#[test]
fn feet_stand_across_windows_and_frames_leave_before_the_end() {
    let (raw, whole, parts) = made(plan(vec![], vec![], 200), plan(vec![], vec![], 200));
    assert!(parts.len() > 3, "{parts:?}");
    assert!(
        parts[0] > 0 && parts[0] + AHEAD == doll_rig().dims.max_frames(),
        "{parts:?}"
    );
    assert_eq!(whole.len(), raw.len());
    let (was, is) = (slower_mm(&raw), slower_mm(&whole));
    assert!(was > 10.0 && is < 1.5, "{was} {is} mm a frame");
    for (a, b) in raw.roots.iter().zip(&whole.roots) {
        let off = (*a - *b).with_y(0.0).length();
        assert!(off < 1e-4, "the root keeps its way: {off} m");
    }
    // What leaves in parts is as smooth as in one piece.
    let mut piece = raw.clone();
    plant(&body().rig, piece.columns(), 0..raw.len(), None);
    let (parts_mm, piece_mm) = (bends_mm(&whole), bends_mm(&piece));
    assert!(parts_mm < 1.5 * piece_mm, "{parts_mm} {piece_mm} mm a frame²");
    let standing = whole.contacts.iter().filter(|&&bits| bits != 0).count();
    assert!(
        standing * 20 >= whole.len() * 19,
        "a foot stands: {standing} of {} frames",
        whole.len()
    );
}

#[test]
fn past_and_targets_are_met_exactly() {
    let key = |frame: f32| {
        let root = GlobalRoot::new(Vec3::new(0.0, HIPS_M, SPEED_MPS * frame / FPS), 0.0);
        Checked::of(Some(root), None, None, Some(pose(frame)))
    };
    let past = || (0..4).map(|frame| key(frame as f32)).collect::<Vec<_>>();
    let frames = 80;
    let targets = || vec![key(4.0 + frames as f32 - 1.0)];
    let (raw, whole, _) = made(plan(past(), targets(), frames), plan(past(), targets(), frames));
    let last = raw.len() - 1;
    assert_eq!(whole.part(last, 1).rotations, raw.part(last, 1).rotations);
    assert_eq!(whole.roots[last], raw.roots[last]);
    // The first frame goes on from the past.
    let first = feet(&whole, 0)[0].distance(feet(&raw, 0)[0]);
    assert!(first < 0.06, "{first} m");
    assert!(slower_mm(&whole) < 4.0, "{}", slower_mm(&whole));
}
