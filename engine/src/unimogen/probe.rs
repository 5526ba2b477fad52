//! Made-up tasks for the first run of a network, its accuracy check, and benchmarks.

use troupe_motion::features::{FEATURES_PER_JOINT, pose_features_from_world};
use troupe_motion::model::{Body, KeyTensors, PathTask};
use troupe_motion::rotation::yaw;
use troupe_motion::{Quat, Vec3};

use crate::pack::Pack;

/// Speeds of the paths, taken in turns, body sizes a second.
const SPEEDS_PER_S: [f32; 4] = [0.8, 0.0, 1.5, 0.4];
/// Turn rates of the paths, taken in turns, radians a second.
const TURNS_RAD_PER_S: [f32; 3] = [0.0, 0.6, -0.9];

/// A task of `frames` frames, another one for each `index`. The bodies follow in the pack's order,
/// each with words of its own. Tasks start alternately without context and from four frames of the
/// neutral pose. Every fourth task has guidance. None if the pack has no bodies.
pub fn probe_task(pack: &Pack, index: usize, frames: usize) -> Option<PathTask> {
    let table = pack.manifest.unimogen.as_ref()?;
    let bodies = pack.bodies.len();
    let body = pack.bodies.get(index.checked_rem(bodies)?)?;
    let round = index / bodies;
    let speed = SPEEDS_PER_S[(index + round) % SPEEDS_PER_S.len()] * body.size_m;
    let turn = TURNS_RAD_PER_S[index % TURNS_RAD_PER_S.len()];
    let path = path(frames, speed, turn, pack.manifest.fps);
    let word = body.words.get(index.checked_rem(body.words.len()).unwrap_or(0));
    let is_word = |other: &String| Some(other) == word;
    let past = if round.is_multiple_of(2) {
        pack.rig.dims.context_frames
    } else {
        0
    };
    Some(PathTask {
        body: body.clone(),
        context: path[..past]
            .iter()
            .map(|&point| neutral_key(body, point))
            .collect(),
        targets: Vec::new(),
        style: pack
            .words
            .iter()
            .map(|other| if is_word(other) { 1.0 } else { 0.0 })
            .collect(),
        steps: table.sampler_steps as u32,
        guidance: if index % 4 == 3 { 2.0 } else { 1.0 },
        seed: index as u64,
        path,
    })
}

/// A path of constant speed (m/s) and turn rate (rad/s).
fn path(frames: usize, speed: f32, turn: f32, fps: f32) -> Box<[[f32; 3]]> {
    let mut point = [0.0_f32; 3];
    let points = (0..frames).map(|_| {
        let now = point;
        let (sin, cos) = now[2].sin_cos();
        point = [
            now[0] + speed * sin / fps,
            now[1] + speed * cos / fps,
            now[2] + turn / fps,
        ];
        now
    });
    points.collect()
}

/// A keyframe: the body in its neutral pose at a point of a path.
fn neutral_key(body: &Body, [x, z, heading]: [f32; 3]) -> KeyTensors {
    let root = Vec3::new(x, body.height_m, z);
    let turn = yaw(heading);
    let rotations: Vec<Quat> = body.neutral.iter().map(|&neutral| turn * neutral).collect();
    let mut positions: Vec<Vec3> = Vec::with_capacity(body.joints());
    for (joint, &bone) in body.rig.skeleton.joints.iter().zip(&body.bones_m) {
        positions.push(
            joint
                .parent
                .map_or(root, |parent| positions[parent] + turn * bone),
        );
    }
    let mut pose = vec![0.0; body.joints() * FEATURES_PER_JOINT];
    pose_features_from_world(root, &positions, &rotations, &mut pose);
    let (sin, cos) = heading.sin_cos();
    KeyTensors {
        local_root: None,
        global_root: Some([root.x, root.y, root.z, cos, sin]),
        pose: Some(pose.into()),
    }
}
