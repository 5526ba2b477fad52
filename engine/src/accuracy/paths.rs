//! The check of families whose bodies move along paths: compares whole motions of both engines,
//! with all steps of a sampler.
//!
//! Engines start from the same noise or seed. A difference in one step continues into the next, as
//! it does for callers.

use troupe_motion::model::{Body, GLOBAL_ROOT, Motion, PathTask, SIX_D};
use troupe_motion::root::wrap_angle;
use troupe_motion::rotation::from_six_ds;
use troupe_motion::{Quat, Vec3};

use super::{Accuracy, CONTACT, Kind, Sums, finite_or_huge, global_roots};
use crate::EngineError;
use crate::pack::Pack;
use crate::sonic_planner::{self, Planner, SonicPlanner};
use crate::unimogen::{Denoiser, LIVE_FRAMES, UniMoGen, probe_task};

/// Number of tasks for each body.
const ROUNDS: usize = 2;

/// Compares two networks of a UniMoGen pack on tasks of all its bodies, with the longest windows
/// and short ones. Lengths are those of bodies scaled to a size of 1 m.
///
/// # Errors
/// [`EngineError`] if either fails.
pub fn compare_paths(
    pack: &Pack,
    reference: Box<dyn Denoiser>,
    candidate: Box<dyn Denoiser>,
) -> Result<Accuracy, EngineError> {
    let dims = pack.rig.dims;
    let short = LIVE_FRAMES.clamp(dims.min_frames(), dims.max_frames());
    let bodies = pack.bodies.len();
    let frames = |index| if index < bodies { dims.max_frames() } else { short };
    let tasks: Vec<PathTask> = (0..ROUNDS * bodies)
        .filter_map(|index| probe_task(pack, index, frames(index)))
        .collect();
    let motions = |denoiser| UniMoGen::new(pack, denoiser, tasks.len())?.run(&tasks);
    Ok(compare_motions(
        &tasks,
        &motions(reference)?,
        &motions(candidate)?,
    ))
}

/// Compares two engines for the graph of a pack with NVIDIA's planner: a task of each mode, the
/// longest plans and those of live characters in turns.
///
/// # Errors
/// [`EngineError`] if either fails.
pub fn compare_planners(
    pack: &Pack,
    reference: Box<dyn Planner>,
    candidate: Box<dyn Planner>,
) -> Result<Accuracy, EngineError> {
    let frames = |index: usize| match index.is_multiple_of(2) {
        true => sonic_planner::LIVE_FRAMES,
        false => pack.rig.dims.max_frames(),
    };
    let tasks: Vec<PathTask> = (0..pack.words.len())
        .filter_map(|index| sonic_planner::probe_task(pack, index, frames(index)))
        .collect();
    let motions = |planner| SonicPlanner::new(pack, planner, tasks.len())?.run(&tasks);
    Ok(compare_motions(
        &tasks,
        &motions(reference)?,
        &motions(candidate)?,
    ))
}

fn compare_motions(tasks: &[PathTask], expected: &[Motion], found: &[Motion]) -> Accuracy {
    let mut sums = Sums::default();
    for ((task, a), b) in tasks.iter().zip(expected).zip(found) {
        sums.add_motions(&task.body, a, b);
    }
    Accuracy {
        kind: Kind::Paths,
        characters: tasks.len(),
        ..sums.accuracy()
    }
}

impl Sums {
    fn add_motions(&mut self, body: &Body, a: &Motion, b: &Motion) {
        for (a, b) in global_roots(&a.root).zip(global_roots(&b.root)) {
            self.root.add(a.position.distance(b.position) / body.size_m);
            let turn = finite_or_huge(wrap_angle(a.heading - b.heading).abs());
            self.root_max_rad = self.root_max_rad.max(turn);
        }
        for (a, b) in positions(body, a).iter().zip(positions(body, b)) {
            self.joints.add(a.distance(b) / body.size_m);
        }
        for (a, b) in a.contacts.iter().zip(&b.contacts) {
            self.contacts.add((*a >= CONTACT) != (*b >= CONTACT));
        }
    }
}

/// World positions of all joints in all frames, metres.
fn positions(body: &Body, motion: &Motion) -> Vec<Vec3> {
    let joints = body.joints();
    let mut rotations = vec![Quat::IDENTITY; joints];
    let mut positions: Vec<Vec3> = Vec::with_capacity(motion.frames() * joints);
    let frames = (motion.root.chunks_exact(GLOBAL_ROOT)).zip(motion.rotations.chunks_exact(joints * SIX_D));
    for (root, six_d) in frames {
        from_six_ds(six_d, &mut rotations);
        let first = positions.len();
        for joint in &body.rig.skeleton.joints {
            let place = match joint.parent {
                Some(parent) => positions[first + parent] + rotations[parent] * joint.offset_m,
                None => Vec3::new(root[0], root[1], root[2]),
            };
            positions.push(place);
        }
    }
    positions
}
