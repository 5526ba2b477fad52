use std::sync::{Arc, Mutex};

use troupe_motion::model::{KeyTensors, Motion, Output, PathTask, PromptTask, Task};
use troupe_motion::rotation::yaw;
use troupe_motion::{Quat, Vec3};

use super::tests::{assert_near, key, pack};
use super::*;
use crate::EngineError;
use crate::generator::{Generator, JobId, Progress, StepReport};
use crate::pack::Pack;

type Calls = Arc<Mutex<Vec<Seen>>>;
/// The end of a request: its motion, or the error's text.
type Became = (u64, Result<Motion, String>);

/// What was seen of a call.
struct Seen {
    network: usize,
    rows: usize,
    steps: Vec<f32>,
}

/// A denoiser whose clean rows depend on the row's character alone. It records its calls.
struct Echo(Calls);

impl Denoiser for Echo {
    fn denoise(&mut self, call: &Call, clean: &mut [f32]) -> Result<(), EngineError> {
        self.0.lock().unwrap().push(Seen {
            network: call.network,
            rows: call.row_count(),
            steps: call.step.clone(),
        });
        let row = call.frames * ROW_CHANNELS;
        for (index, (clean, x)) in clean
            .chunks_exact_mut(row)
            .zip(call.x.chunks_exact(row))
            .enumerate()
        {
            let owner = call.owner[index] as usize;
            let style: f32 = call.style[owner * call.words..][..call.words].iter().sum();
            for (clean, x) in clean.iter_mut().zip(x) {
                *clean = 0.5 * x + 0.01 * style + 0.001 * call.step[owner];
            }
        }
        Ok(())
    }
}

fn echo(max_jobs: usize) -> (UniMoGen, Calls) {
    let calls = Calls::default();
    let generator = UniMoGen::new(&pack(), Box::new(Echo(calls.clone())), max_jobs).unwrap();
    (generator.with_call_rows(1000), calls)
}

fn task(pack: &Pack, body: &str, frames: usize, seed: u64) -> PathTask {
    PathTask {
        sways: false,
        body: pack.body(body).unwrap().clone(),
        context: Vec::new(),
        targets: Vec::new(),
        path: (0..frames).map(|frame| [0.0, 0.04 * frame as f32, 0.0]).collect(),
        style: vec![0.0, 1.0, 0.0],
        steps: 4,
        guidance: 1.0,
        seed,
    }
}

fn id(request: u64) -> JobId {
    JobId {
        request,
        character: 0,
    }
}

/// Takes one step. Returns its report, and the requests that ended.
fn step(generator: &mut UniMoGen) -> (StepReport, Vec<Became>) {
    let mut became = Vec::new();
    let report = generator.step(&mut |id, progress| {
        became.push((
            id.request,
            match progress {
                Progress::Done(Output::Motion(motion)) => Ok(motion),
                Progress::Failed(error) => Err(error.to_string()),
                other => panic!("{other:?}"),
            },
        ));
    });
    (report.unwrap(), became)
}

fn alone(task: PathTask) -> Motion {
    let (mut generator, _) = echo(1);
    generator.admit(id(0), task.into());
    loop {
        if let Some((_, motion)) = step(&mut generator).1.pop() {
            return motion.unwrap();
        }
    }
}

#[test]
fn jobs_join_and_leave_between_calls_each_at_its_own_diffusion_step() {
    let pack = pack();
    let (mut generator, calls) = echo(3);
    let guided = PathTask {
        guidance: 2.5,
        steps: 2,
        ..task(&pack, "toy", 20, 2)
    };
    generator.admit(id(1), task(&pack, "turned", 20, 1).into());
    assert_eq!(step(&mut generator).1, []);
    generator.admit(id(2), guided.clone().into());
    assert_eq!((generator.free(), generator.is_idle()), (1, false));
    assert_eq!(step(&mut generator).1, []);
    let (report, became) = step(&mut generator);
    assert_eq!((report.jobs, report.networks[0].0), (2, "denoiser"));
    assert_eq!(became, [(2, Ok(alone(guided)))]);
    assert_eq!(
        step(&mut generator).1,
        [(1, Ok(alone(task(&pack, "turned", 20, 1))))]
    );
    assert!(generator.is_idle());
    let calls = calls.lock().unwrap();
    let wanted = [
        (9, vec![49.0]),
        // A second copy without style follows.
        (9 + 15 + 15, vec![36.0, 49.0, 49.0]),
        (9 + 15 + 15, vec![24.0, 24.0, 24.0]),
        (9, vec![11.0]),
    ];
    let seen: Vec<_> = calls.iter().map(|call| (call.rows, call.steps.clone())).collect();
    assert_eq!(seen, wanted);
}

#[test]
fn guidance_moves_away_from_the_answer_without_style() {
    let pack = pack();
    let once = |guidance, style| {
        let (mut generator, _) = echo(1);
        let task = PathTask {
            steps: 1,
            guidance,
            style,
            ..task(&pack, "turned", 20, 5)
        };
        generator.admit(id(0), task.into());
        step(&mut generator).1.pop().unwrap().1.unwrap()
    };
    let (none, styled) = (vec![0.0; 3], vec![0.0, 1.0, 0.0]);
    let plain = once(1.0, none.clone());
    assert_eq!(once(3.0, none), plain);
    assert_eq!(once(0.0, styled.clone()), plain);
    assert_ne!(once(3.0, styled.clone()), plain);
    assert_near(&once(3.0, styled).root, &once(1.0, vec![0.0, 3.0, 0.0]).root);
}

#[test]
fn the_oldest_job_goes_first_with_jobs_of_equal_length_that_fit() {
    let pack = pack();
    let (generator, calls) = echo(9);
    let mut generator = generator.with_call_rows(9 + 15);
    for (request, body, frames) in [
        (1, "turned", 20),
        (2, "turned", 24),
        (3, "toy", 20),
        (4, "turned", 20),
        (5, "turned", 24),
    ] {
        let task = PathTask {
            steps: 1,
            ..task(&pack, body, frames, request)
        };
        generator.admit(id(request), task.into());
    }
    let mut order: Vec<Vec<u64>> = Vec::new();
    while !generator.is_idle() {
        order.push(
            step(&mut generator)
                .1
                .iter()
                .map(|(request, _)| *request)
                .collect(),
        );
    }
    assert_eq!(order, [vec![1, 3], vec![2, 5], vec![4]]);
    let rows: Vec<usize> = calls.lock().unwrap().iter().map(|call| call.rows).collect();
    assert_eq!(rows, [24, 18, 9]);
    // A job that is larger than a call has a call of its own.
    let mut generator = echo(2).0.with_call_rows(1);
    generator.admit(id(1), task(&pack, "toy", 20, 1).into());
    generator.admit(id(2), task(&pack, "toy", 20, 2).into());
    assert_eq!(step(&mut generator).0.jobs, 1);
}

#[test]
fn a_call_has_jobs_of_one_network() {
    let mut pack = pack();
    pack.manifest.unimogen.as_mut().unwrap().kinds.robots = vec!["toy".to_owned()];
    let calls = Calls::default();
    let generator = UniMoGen::new(&pack, Box::new(Echo(calls.clone())), 9).unwrap();
    let mut generator = generator.with_call_rows(1000);
    for (request, network) in [(1, 0), (2, 1), (3, 0), (4, 2)] {
        let mut task = PathTask {
            steps: 1,
            ..task(&pack, "turned", 20, request)
        };
        Arc::make_mut(&mut task.body).network = network;
        generator.admit(id(request), task.into());
    }
    let mut ended = || -> Vec<u64> {
        step(&mut generator)
            .1
            .iter()
            .map(|(request, _)| *request)
            .collect()
    };
    // The fourth is of a pack with more networks.
    assert_eq!([ended(), ended()], [vec![4, 1, 3], vec![2]]);
    let networks: Vec<usize> = calls.lock().unwrap().iter().map(|call| call.network).collect();
    assert_eq!(networks, [0, 1]);
}

#[test]
fn given_frames_stay_as_they_are() {
    let pack = pack();
    let body = pack.body("toy").unwrap();
    let rotations: Vec<Quat> = body.neutral.iter().map(|&neutral| yaw(0.3) * neutral).collect();
    let at = |z: f32| key(body, Vec3::new(0.0, 0.8, z), &rotations);
    let task = PathTask {
        context: (0..4).map(|frame| at(0.04 * frame as f32)).collect(),
        targets: vec![at(0.04 * 19.0)],
        ..task(&pack, "toy", 20, 1)
    };
    let motion = alone(task);
    for frame in [0, 1, 2, 3, 19] {
        assert_near(&motion.root[frame * 5..][..3], &[0.0, 0.8, 0.04 * frame as f32]);
    }
    assert!(
        (motion.root[10 * 5 + 1] - 0.8).abs() > 0.01,
        "the other frames come from the network"
    );
}

#[test]
fn tasks_out_of_range_fail_alone_with_a_reason() {
    let pack = pack();
    let good = task(&pack, "turned", 20, 1);
    type Change = fn(&mut PathTask);
    let cases: [(Change, &str); 9] = [
        (
            |t| t.path = t.path[..16].into(),
            "path is 16; allowed: 20 to 68 frames, a multiple of 4",
        ),
        (|t| t.path = vec![[0.0; 3]; 22].into(), "path is 22"),
        (|t| t.path[3][1] = f32::NAN, "path is not finite"),
        (
            |t| t.context = vec![KeyTensors::default(); 3],
            "context is 3; allowed: 0 or 4",
        ),
        (
            |t| t.targets = vec![KeyTensors::default(); 5],
            "targets is 5; allowed: 0 to 4",
        ),
        (
            |t| {
                t.targets = vec![KeyTensors {
                    pose: Some([0.0; 9].into()),
                    ..KeyTensors::default()
                }]
            },
            "pose is 9; allowed: 72",
        ),
        (|t| t.style = vec![1.0], "style is 1; allowed: 3 finite weights"),
        (|t| t.steps = 51, "steps is 51; allowed: 1 to 50"),
        (
            |t| t.guidance = f32::INFINITY,
            "guidance is inf; allowed: a finite number",
        ),
    ];
    let (mut generator, _) = echo(32);
    generator.admit(id(100), good.clone().into());
    generator.admit(id(101), Task::Prompt(PromptTask::default()));
    for (request, (change, _)) in cases.iter().enumerate() {
        let mut task = good.clone();
        change(&mut task);
        generator.admit(id(request as u64), task.into());
    }
    let (report, became) = step(&mut generator);
    assert_eq!((report.jobs, became.len()), (1, 1 + cases.len()));
    assert_eq!(became[0], (101, Err(EngineError::WrongTask.to_string())));
    for ((request, became), (_, said)) in became[1..].iter().zip(cases) {
        let error = became.as_ref().unwrap_err();
        assert!(error.contains(said), "{request}: {error}");
    }
    generator.cancel(id(100));
    assert!(generator.is_idle());
}

/// Gives NaN to characters with a style of that weight.
struct Broken;

impl Denoiser for Broken {
    fn denoise(&mut self, call: &Call, clean: &mut [f32]) -> Result<(), EngineError> {
        let row = call.frames * ROW_CHANNELS;
        for (clean, owner) in clean.chunks_exact_mut(row).zip(&call.owner) {
            let weight = call.style[*owner as usize * call.words];
            clean.fill(if weight > 0.5 { f32::NAN } else { 0.0 });
        }
        Ok(())
    }
}

#[test]
fn a_job_whose_answer_is_not_finite_fails_alone() {
    let pack = pack();
    let mut generator = UniMoGen::new(&pack, Box::new(Broken), 2).unwrap();
    let bad = PathTask {
        style: vec![1.0, 0.0, 0.0],
        ..task(&pack, "turned", 20, 1)
    };
    generator.admit(id(1), bad.into());
    generator.admit(id(2), task(&pack, "turned", 20, 1).into());
    let (_, became) = step(&mut generator);
    assert_eq!(
        became,
        [(1, Err("denoiser.onnx: values that are not finite".to_owned()))]
    );
    assert!(!generator.is_idle());
}

#[test]
fn seeds_differ_in_the_phase_in_which_a_gait_begins() {
    let phases: Vec<f32> = (0..32).map(job::start_phase).collect();
    assert!(
        phases
            .iter()
            .all(|phase| (0.0..=std::f32::consts::TAU).contains(phase))
    );
    for quarter in 0..4 {
        let begin = quarter as f32 * std::f32::consts::FRAC_PI_2;
        let within = begin..begin + std::f32::consts::FRAC_PI_2;
        assert!(phases.iter().any(|phase| within.contains(phase)), "{within:?}");
    }
}
