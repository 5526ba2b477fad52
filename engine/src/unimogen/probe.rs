//! Made-up tasks for the first run of a network, its accuracy check, and benchmarks.

use troupe_motion::model::PathTask;

use crate::made_up::{neutral_key, path};
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
        sways: true,
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
