//! A tiny model family without networks, for tests. Its motion is easy to predict, and each of its
//! jobs needs several steps.
//!
//! With it, tests prove that scheduler, sessions and API do not depend on a family. Keyframes: a
//! straight walk meets them after [`STEPS`] steps. Paths: the neutral pose follows them. Prompts:
//! each word gives a part of
//! [`PART_FRAMES`] frames, one part a step. Descriptions: one word a step.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use troupe_motion::features::FEATURES_PER_JOINT;
use troupe_motion::model::{
    DescribeTask, Dims, GLOBAL_ROOT, KeyTensors, KeyframeTask, Motion, Output, PathTask, PromptTask, Task,
};
use troupe_motion::rotation::{six_d, yaw};

use crate::EngineError;
use crate::generator::{Generator, JobId, Progress, StepReport};

/// Name of the family in a manifest.
pub const FAMILY: &str = "toy";
/// Steps of a job with keyframes.
pub const STEPS: usize = 3;
/// Frames of the part that one word of a prompt gives.
pub const PART_FRAMES: usize = 4;
/// How far the root moves in one frame of a prompt's motion, metres.
const STRIDE_M: f32 = 0.04;
/// A seed raises or lowers the root by up to this height, metres.
const SWAY_M: f32 = 0.01;
/// 6D rotation of an unrotated joint.
const UPRIGHT: [f32; 6] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// The toy family's generator for one worker.
pub struct Toy {
    dims: Dims,
    slots: usize,
    jobs: Vec<Job>,
}

struct Job {
    id: JobId,
    task: Task,
    /// Steps that the job has taken part in.
    steps: usize,
}

impl Toy {
    /// A generator that holds up to `slots` jobs at a time.
    pub fn new(dims: Dims, slots: usize) -> Self {
        Self {
            dims,
            slots: slots.max(1),
            jobs: Vec::new(),
        }
    }
}

impl Generator for Toy {
    fn free(&self) -> usize {
        self.slots - self.jobs.len()
    }

    fn is_idle(&self) -> bool {
        self.jobs.is_empty()
    }

    fn admit(&mut self, id: JobId, task: Task) {
        self.jobs.push(Job { id, task, steps: 0 });
    }

    fn cancel(&mut self, id: JobId) {
        self.jobs.retain(|job| job.id != id);
    }

    fn step(&mut self, out: &mut dyn FnMut(JobId, Progress)) -> Result<StepReport, EngineError> {
        let jobs = self.jobs.len();
        let dims = self.dims;
        self.jobs.retain_mut(|job| {
            let progress = advance(&dims, &job.task, job.steps);
            job.steps += 1;
            let goes_on = matches!(progress, None | Some(Progress::Part(_)));
            if let Some(progress) = progress {
                out(job.id, progress);
            }
            goes_on
        });
        Ok(StepReport {
            jobs,
            rows: jobs,
            ..StepReport::default()
        })
    }

    fn clear(&mut self) {
        self.jobs.clear();
    }
}

/// The result of a job's step number `step`.
fn advance(dims: &Dims, task: &Task, step: usize) -> Option<Progress> {
    match task {
        Task::Keyframes(task) => {
            (step + 1 == STEPS).then(|| Progress::Done(Output::Motion(walk(dims, task))))
        }
        Task::Path(task) => (step + 1 == STEPS).then(|| Progress::Done(Output::Motion(follow(task)))),
        Task::Prompt(task) => Some(act(dims, task, step)),
        Task::Describe(task) => Some(describe(task, step)),
    }
}

/// A part of a straight walk. The motion has as many parts as the prompt has words. The prompt
/// "fail" fails.
fn act(dims: &Dims, task: &PromptTask, step: usize) -> Progress {
    if task.text == "fail" {
        return Progress::Failed(EngineError::Panicked("the prompt asks for a failure".to_owned()));
    }
    let parts = match task.frames {
        Some(frames) => frames.div_ceil(PART_FRAMES),
        None => task.text.split_whitespace().count(),
    };
    let first = step * PART_FRAMES;
    let last = task.frames.unwrap_or(parts * PART_FRAMES);
    let frames = first..last.min(first + PART_FRAMES);
    let sway = sway(task.seed);
    let height = task.context.last().and_then(height_of).unwrap_or(0.9);
    let roots = frames.map(|frame| [0.0, height + sway, STRIDE_M * (frame + 1) as f32, 1.0, 0.0]);
    let part = motion_of(dims, roots, None);
    match step + 1 < parts {
        true => Progress::Part(Output::Motion(part)),
        false => Progress::Done(Output::Motion(part)),
    }
}

/// First "walks", then the distance.
fn describe(task: &DescribeTask, step: usize) -> Progress {
    let place = |key: Option<&KeyTensors>| key.and_then(|key| key.global_root).unwrap_or_default();
    let ([from_x, _, from_z, ..], [to_x, _, to_z, ..]) =
        (place(task.frames.first()), place(task.frames.last()));
    match step {
        0 => Progress::Part(Output::Text("walks ".to_owned())),
        _ => Progress::Done(Output::Text(format!(
            "{:.1} m",
            (to_x - from_x).hypot(to_z - from_z)
        ))),
    }
}

/// A motion in a straight line from the last context frame to the last target.
fn walk(dims: &Dims, task: &KeyframeTask) -> Motion {
    let shortest = task.allowed_counts.iter().position(|&may| may).unwrap_or(0);
    let frames = task.frames(dims, dims.min_tokens + shortest);
    let root = |key: Option<&KeyTensors>| key.and_then(|key| key.global_root);
    let from = root(task.context.last()).unwrap_or([0.0, 0.9, 0.0, 1.0, 0.0]);
    let to = root(task.targets.last()).unwrap_or(from);
    let gap = frames.saturating_sub(task.context.len()).max(1) as f32;
    let sway = sway(task.seed);
    let roots = (0..frames).map(|frame| {
        let share = ((frame + 1) as f32 - task.context.len() as f32) / gap;
        let share = share.clamp(0.0, 1.0);
        let mut root: [f32; GLOBAL_ROOT] = std::array::from_fn(|n| from[n] + share * (to[n] - from[n]));
        let length = root[3].hypot(root[4]).max(1e-6);
        root[1] += sway * share * (1.0 - share);
        root[3] /= length;
        root[4] /= length;
        root
    });
    let pose = task.context.last().and_then(|key| key.pose.as_deref());
    motion_of(dims, roots, pose)
}

/// A motion along the path in the neutral pose.
fn follow(task: &PathTask) -> Motion {
    let body = &task.body;
    let mut motion = Motion::default();
    for &[x, z, heading] in &task.path {
        let (sin, cos) = heading.sin_cos();
        motion
            .root
            .extend([x, body.height_m + sway(task.seed), z, cos, sin]);
        for &neutral in &body.neutral {
            motion.rotations.extend(six_d(yaw(heading) * neutral));
        }
        motion
            .contacts
            .extend(std::iter::repeat_n(1.0, body.rig.dims.contacts));
    }
    motion
}

/// A motion with a frame at each of those roots, all in one pose.
fn motion_of(dims: &Dims, roots: impl Iterator<Item = [f32; GLOBAL_ROOT]>, pose: Option<&[f32]>) -> Motion {
    let mut motion = Motion::default();
    for root in roots {
        motion.root.extend(root);
        match pose {
            Some(features) => {
                for joint in features.chunks_exact(FEATURES_PER_JOINT) {
                    motion.rotations.extend(&joint[3..]);
                }
            }
            None => (0..dims.joints).for_each(|_| motion.rotations.extend(UPRIGHT)),
        }
        motion.contacts.extend(std::iter::repeat_n(1.0, dims.contacts));
    }
    motion
}

fn height_of(key: &KeyTensors) -> Option<f32> {
    key.global_root.map(|[_, height, ..]| height)
}

fn sway(seed: u64) -> f32 {
    ChaCha8Rng::seed_from_u64(seed).random_range(-SWAY_M..=SWAY_M)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    const DIMS: Dims = Dims {
        joints: 2,
        contacts: 1,
        heads: 1,
        codes: 2,
        min_tokens: 3,
        max_tokens: 16,
        frames_per_token: 4,
        context_frames: 4,
        max_targets: 4,
        root_choices: 0,
    };

    fn id(request: u64) -> JobId {
        JobId {
            request,
            character: 0,
        }
    }

    fn prompt(text: &str, seed: u64) -> Task {
        Task::Prompt(PromptTask {
            text: text.to_owned(),
            seed,
            ..PromptTask::default()
        })
    }

    /// Takes steps until all jobs are done. The result has every job's parts in order.
    fn run(toy: &mut Toy, mut between: impl FnMut(&mut Toy, usize)) -> BTreeMap<u64, Vec<Output>> {
        let mut parts: BTreeMap<u64, Vec<Output>> = BTreeMap::new();
        for step in 0.. {
            between(toy, step);
            if toy.is_idle() {
                break;
            }
            toy.step(&mut |id, progress| match progress {
                Progress::Part(part) | Progress::Done(part) => {
                    parts.entry(id.request).or_default().push(part)
                }
                Progress::Failed(error) => panic!("{error}"),
            })
            .unwrap();
        }
        parts
    }

    #[test]
    fn jobs_that_join_and_leave_between_steps_have_the_same_results_as_alone() {
        let mut alone = BTreeMap::new();
        for (request, text) in [(1, "walk on and on"), (2, "stop here"), (3, "go")] {
            let mut toy = Toy::new(DIMS, 4);
            toy.admit(id(request), prompt(text, request));
            alone.extend(run(&mut toy, |_, _| {}));
        }
        let mut toy = Toy::new(DIMS, 4);
        let together = run(&mut toy, |toy, step| match step {
            0 => toy.admit(id(1), prompt("walk on and on", 1)),
            1 => {
                toy.admit(id(2), prompt("stop here", 2));
                toy.admit(id(9), prompt("cancelled before it ends", 9));
            }
            2 => {
                toy.cancel(id(9));
                toy.admit(id(3), prompt("go", 3));
                assert_eq!(toy.free(), 1);
            }
            _ => {}
        });
        assert_eq!(together[&9].len(), 1, "it had one step");
        assert_eq!(alone.len(), 3);
        for (request, parts) in alone {
            assert_eq!(together[&request], parts, "{request}");
        }
        assert_eq!(toy.free(), 4);
    }

    #[test]
    fn a_motion_is_described_in_words() {
        let frame = |z| KeyTensors {
            global_root: Some([0.0, 0.9, z, 1.0, 0.0]),
            ..KeyTensors::default()
        };
        let mut toy = Toy::new(DIMS, 1);
        toy.admit(
            id(1),
            Task::Describe(DescribeTask {
                frames: vec![frame(0.0), frame(1.5)],
                ..DescribeTask::default()
            }),
        );
        let parts = run(&mut toy, |_, _| {});
        let text = |text: &str| Output::Text(text.to_owned());
        assert_eq!(parts[&1], [text("walks "), text("1.5 m")]);
    }

    #[test]
    fn every_body_follows_paths() {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/unimogen");
        let pack = crate::pack::Pack::load(&folder).unwrap();
        let task = crate::unimogen::probe_task(&pack, 1, 20).unwrap();
        let mut toy = Toy::new(DIMS, 1);
        toy.admit(id(1), Task::Path(task.clone()));
        let Some(Output::Motion(motion)) = run(&mut toy, |_, _| {}).remove(&1).unwrap().pop() else {
            panic!("no motion");
        };
        assert_eq!(
            (motion.frames(), motion.rotations.len()),
            (20, 20 * task.body.joints() * 6)
        );
        let [x, z, heading] = task.path[19];
        let root = &motion.root[19 * GLOBAL_ROOT..];
        assert_eq!((root[0], root[2], root[4]), (x, z, heading.sin()));
    }
}
