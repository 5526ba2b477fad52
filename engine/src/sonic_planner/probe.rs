//! Made-up tasks for the first run of the graph, its accuracy check, and benchmarks.

use troupe_motion::model::PathTask;

use crate::made_up::{neutral_key, path};
use crate::pack::Pack;

/// Speeds of the paths, taken in turns, m/s.
const SPEEDS_MPS: [f32; 4] = [0.8, 0.0, 1.5, 0.3];
/// Turn rates of the paths, taken in turns, radians a second.
const TURNS_RAD_PER_S: [f32; 3] = [0.0, 0.6, -0.9];

/// A task of `frames` frames, rounded up to whole tokens; another one for each `index`. The modes
/// follow in the pack's order. Every task starts from four frames of the neutral pose. None if the
/// pack belongs to another family.
pub fn probe_task(pack: &Pack, index: usize, frames: usize) -> Option<PathTask> {
    pack.manifest.sonic_planner.as_ref()?;
    let (body, dims) = (pack.bodies.first()?, &pack.rig.dims);
    let frames = frames
        .next_multiple_of(dims.frames_per_token)
        .clamp(dims.min_frames(), dims.max_frames());
    let speed = SPEEDS_MPS[index % SPEEDS_MPS.len()];
    let turn = TURNS_RAD_PER_S[index % TURNS_RAD_PER_S.len()];
    let path = path(frames, speed, turn, pack.manifest.fps);
    let mode = index.checked_rem(pack.words.len())?;
    Some(PathTask {
        sways: false,
        body: body.clone(),
        context: (path[..dims.context_frames].iter())
            .map(|&point| neutral_key(body, point))
            .collect(),
        targets: Vec::new(),
        style: (0..pack.words.len())
            .map(|word| if word == mode { 1.0 } else { 0.0 })
            .collect(),
        steps: 1,
        guidance: 1.0,
        seed: index as u64,
        path,
    })
}
