//! A family that needs several steps for a job: joining, streaming, leaving between steps, and how
//! workers are woken.

use std::sync::{Mutex, mpsc as blocking};
use std::time::Instant;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use troupe_engine::generator::{Generator, JobId, Progress, StepReport};
use troupe_engine::toy::{PART_FRAMES, STEPS, Toy};
use troupe_motion::model::{DescribeTask, KeyTensors, Motion, Output, PromptTask};

use super::tests::{DIMS, all_idle, limits, soon, tasks, until};
use super::*;
use troupe_base::telemetry::Telemetry;

/// A toy that waits for a permit before each step, and notes which requests take part in it. It
/// does not wait once all givers of permits are gone.
struct Stepped {
    toy: Toy,
    permits: blocking::Receiver<()>,
    held: Vec<u64>,
    steps: Arc<Mutex<Vec<Vec<u64>>>>,
    /// Fails from this step on, after it has reported the results of its jobs.
    fails_at: usize,
}

impl Generator for Stepped {
    fn free(&self) -> usize {
        self.toy.free()
    }

    fn is_idle(&self) -> bool {
        self.toy.is_idle()
    }

    fn admit(&mut self, id: JobId, task: Task) {
        self.held.push(id.request);
        self.toy.admit(id, task);
    }

    fn cancel(&mut self, id: JobId) {
        self.held.retain(|&held| held != id.request);
        self.toy.cancel(id);
    }

    fn step(&mut self, out: &mut dyn FnMut(JobId, Progress)) -> Result<StepReport, EngineError> {
        let _ = self.permits.recv();
        let mut steps = self.steps.lock().unwrap();
        steps.push(self.held.clone());
        let held = &mut self.held;
        let report = self.toy.step(&mut |id, progress| {
            if !matches!(progress, Progress::Part(_)) {
                held.retain(|&held| held != id.request);
            }
            out(id, progress);
        })?;
        match steps.len() > self.fails_at {
            true => Err(EngineError::Panicked("on purpose".to_owned())),
            false => Ok(report),
        }
    }

    fn clear(&mut self) {
        self.held.clear();
        self.toy.clear();
    }
}

struct Setup {
    batcher: Batcher,
    permits: Option<blocking::Sender<()>>,
    steps: Arc<Mutex<Vec<Vec<u64>>>>,
    telemetry: Telemetry,
}

/// One worker with so many slots.
async fn setup(slots: usize, fails_at: usize) -> Setup {
    let (permit, permits) = blocking::channel();
    let steps: Arc<Mutex<Vec<Vec<u64>>>> = Arc::default();
    let generator = Stepped {
        toy: Toy::new(DIMS, slots),
        permits,
        held: Vec::new(),
        steps: steps.clone(),
        fails_at,
    };
    let generator = Mutex::new(Some(generator));
    let factory: GeneratorFactory = Arc::new(move |_| {
        let generator = generator.lock().unwrap().take().unwrap();
        Ok(Box::new(generator))
    });
    let telemetry = Telemetry::new().unwrap();
    let metrics = PackMetrics::new(&telemetry, "test", "1");
    let batcher = Batcher::start("test", limits(1), Duration::ZERO, metrics, factory)
        .await
        .unwrap();
    all_idle(&batcher).await;
    Setup {
        batcher,
        permits: Some(permit),
        steps,
        telemetry,
    }
}

impl Setup {
    /// Lets the worker do so many steps, and waits until it has begun the last of them.
    async fn permit(&self, steps: usize) {
        let begun = self.steps.lock().unwrap().len();
        for _ in 0..steps {
            self.permits.as_ref().unwrap().send(()).unwrap();
        }
        until("a step", || self.steps.lock().unwrap().len() == begun + steps).await;
    }

    /// Lets the worker do any number of steps.
    fn permit_all(&mut self) {
        self.permits = None;
    }

    fn enqueue(&self, task: Task) -> Answer {
        self.batcher.enqueue(vec![task], soon()).unwrap()
    }

    fn steps(&self) -> Vec<Vec<u64>> {
        self.steps.lock().unwrap().clone()
    }
}

fn prompt(words: usize, seed: u64) -> Task {
    Task::Prompt(PromptTask {
        text: vec!["walk"; words].join(" "),
        seed,
        ..PromptTask::default()
    })
}

fn describe() -> Task {
    let frame = |z| KeyTensors {
        global_root: Some([0.0, 0.9, z, 1.0, 0.0]),
        ..KeyTensors::default()
    };
    Task::Describe(DescribeTask {
        frames: vec![frame(0.0), frame(1.5)],
        ..DescribeTask::default()
    })
}

fn text(text: &str) -> Output {
    Output::Text(text.to_owned())
}

/// The parts that a task gives alone.
fn parts_alone(task: Task) -> Vec<Output> {
    let mut toy = Toy::new(DIMS, 1);
    let id = JobId {
        request: 0,
        character: 0,
    };
    toy.admit(id, task);
    let mut parts = Vec::new();
    while !toy.is_idle() {
        toy.step(&mut |_, progress| match progress {
            Progress::Part(part) | Progress::Done(part) => parts.push(part),
            Progress::Failed(error) => panic!("{error}"),
        })
        .unwrap();
    }
    parts
}

/// The motion that a task gives alone.
fn alone(task: Task) -> Motion {
    let mut motion = Motion::default();
    for part in parts_alone(task) {
        motion.append(part.into_motion().unwrap());
    }
    motion
}

fn motion(served: Served) -> Motion {
    served.into_motions().next().unwrap()
}

async fn rest(mut stream: AnswerStream) -> Vec<Piece> {
    let mut pieces = Vec::new();
    while let Some(piece) = stream.next().await {
        pieces.push(piece.unwrap());
    }
    pieces
}

#[tokio::test]
async fn a_job_takes_its_steps_and_reports_its_times() {
    let setup = setup(4, usize::MAX).await;
    let keyframes = tasks(3..4).remove(0);
    let answer = setup.enqueue(keyframes.clone());
    until("the worker", || {
        setup.batcher.shared().state().scheduler().is_busy(0)
    })
    .await;
    tokio::time::sleep(Duration::from_millis(10)).await;
    setup.permit(STEPS).await;
    let served = answer.await.unwrap();
    assert_eq!(setup.steps(), vec![vec![0]; STEPS]);
    assert_eq!(served.batch_size, 1);
    assert!(served.queued < Duration::from_millis(1000));
    // It answers with its last step only, which began after the pause.
    assert!(
        served.started >= served.queued + Duration::from_millis(10),
        "{served:?}"
    );
    assert!(served.finished >= served.started && served.work > Duration::ZERO);
    assert_eq!(motion(served), alone(keyframes));
}

#[tokio::test]
async fn jobs_join_between_steps_and_give_what_they_give_alone() {
    let setup = setup(3, usize::MAX).await;
    let mut tasks = vec![prompt(4, 0), tasks(1..2).remove(0), prompt(2, 2), prompt(1, 3)];
    let mut answers = vec![setup.enqueue(tasks[0].clone())];
    until("the worker", || {
        setup.batcher.shared().state().scheduler().is_busy(0)
    })
    .await;
    for task in &tasks[1..] {
        answers.push(setup.enqueue(task.clone()));
        setup.permit(1).await;
    }
    setup.permit(2).await;
    // The last one waits for a slot.
    let steps = [vec![0], vec![0, 1], vec![0, 1, 2], vec![0, 1, 2], vec![3]];
    assert_eq!(setup.steps(), steps);
    for (answer, task) in answers.into_iter().zip(tasks.drain(..)) {
        let served = answer.await.unwrap();
        assert_eq!(motion(served), alone(task));
    }
}

#[tokio::test]
async fn random_jobs_of_many_callers_give_what_they_give_alone() {
    let mut setup = setup(3, usize::MAX).await;
    setup.permit_all();
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut callers = tokio::task::JoinSet::new();
    for seed in 0..200 {
        let task = match rng.random_range(0..4) {
            0 => tasks(seed..seed + 1).remove(0),
            words => prompt(words * 2, seed as u64),
        };
        let order = soon();
        if rng.random_bool(0.5) {
            let stream = setup.batcher.stream(task.clone(), order);
            callers.spawn(async move {
                let pieces = rest(stream.unwrap()).await;
                let parts: Vec<Output> = pieces.into_iter().map(|piece| piece.output).collect();
                assert_eq!(parts, parts_alone(task));
            });
        } else {
            let answer = setup.batcher.enqueue(vec![task.clone()], order);
            callers.spawn(async move { assert_eq!(motion(answer.unwrap().await.unwrap()), alone(task)) });
        }
        if seed % 50 == 0 {
            tokio::task::yield_now().await;
        }
        until("room", || {
            setup.batcher.refuse(&Order::request(Instant::now()), 1).is_none()
        })
        .await;
    }
    while let Some(caller) = callers.join_next().await {
        caller.unwrap();
    }
    assert!(
        setup.steps().iter().any(|step| step.len() == 3),
        "no job joined another"
    );
}

#[tokio::test]
async fn pieces_come_one_by_one_in_order_and_end_with_the_last() {
    let setup = setup(2, usize::MAX).await;
    let mut stream = setup.batcher.stream(prompt(3, 5), soon()).unwrap();
    for (number, output) in parts_alone(prompt(3, 5)).into_iter().enumerate() {
        let early = tokio::time::timeout(Duration::from_millis(5), stream.next()).await;
        assert!(early.is_err(), "a part before its step");
        setup.permit(1).await;
        let piece = stream.next().await.unwrap().unwrap();
        let is_last = number == 2;
        assert_eq!(
            (piece.character, &piece.output, piece.is_last),
            (0, &output, is_last)
        );
        assert_eq!(piece.step.jobs, 1);
        assert!(piece.step.started < piece.step.ended);
        assert_eq!(piece.output.into_motion().unwrap().frames(), PART_FRAMES);
    }
    assert_eq!(stream.next().await.map(Result::unwrap), None);
    assert_eq!(setup.steps().len(), 3);
}

#[tokio::test]
async fn words_are_answered_whole_and_in_pieces() {
    let mut setup = setup(2, usize::MAX).await;
    setup.permit_all();
    let served = setup.enqueue(describe()).await.unwrap();
    assert_eq!(served.outputs, [text("walks 1.5 m")]);
    let pieces = rest(setup.batcher.stream(describe(), soon()).unwrap()).await;
    let pieces: Vec<_> = pieces
        .into_iter()
        .map(|piece| (piece.output, piece.is_last))
        .collect();
    assert_eq!(pieces, [(text("walks "), false), (text("1.5 m"), true)]);
}

#[tokio::test]
async fn dropping_a_stream_frees_its_slot_between_two_steps() {
    let setup = setup(1, usize::MAX).await;
    let mut leaver = setup.batcher.stream(prompt(100, 0), soon()).unwrap();
    setup.permit(1).await;
    assert!(!leaver.next().await.unwrap().unwrap().is_last);
    let next = setup.enqueue(prompt(2, 1));
    drop(leaver);
    // The step that had begun, and those of the next job in its slot.
    setup.permit(3).await;
    assert_eq!(motion(next.await.unwrap()), alone(prompt(2, 1)));
    assert_eq!(setup.steps(), [vec![0], vec![0], vec![1], vec![1]]);
    // The same for an answer that is awaited whole, with no other request behind it.
    let leaver = setup.enqueue(prompt(100, 2));
    setup.permit(1).await;
    drop(leaver);
    setup.permit(1).await;
    all_idle(&setup.batcher).await;
    assert_eq!(setup.steps().len(), 6);
}

#[tokio::test]
async fn a_slow_reader_is_cut_off() {
    let mut setup = setup(1, usize::MAX).await;
    let mut slow = setup
        .batcher
        .stream(prompt(MAX_WAITING_PIECES + 50, 0), soon())
        .unwrap();
    setup.permit_all();
    all_idle(&setup.batcher).await;
    until("a cut", || {
        setup.telemetry.render().contains("reason=\"reader_slow\"} 1")
    })
    .await;
    for _ in 0..MAX_WAITING_PIECES {
        assert!(!slow.next().await.unwrap().unwrap().is_last);
    }
    let error = slow.next().await.unwrap().unwrap_err();
    assert!(matches!(error, SubmitError::ReaderSlow), "{error:?}");
    assert!(slow.next().await.is_none());
    let steps = setup.steps().len();
    assert!(
        (MAX_WAITING_PIECES + 1..MAX_WAITING_PIECES + 3).contains(&steps),
        "{steps}"
    );
    // The worker serves on.
    assert_eq!(
        rest(setup.batcher.stream(prompt(3, 1), soon()).unwrap())
            .await
            .len(),
        3
    );
}

#[tokio::test]
async fn a_job_that_fails_leaves_the_others_alone() {
    let setup = setup(2, usize::MAX).await;
    let fail = Task::Prompt(PromptTask {
        text: "fail".to_owned(),
        ..PromptTask::default()
    });
    let good = setup.enqueue(prompt(2, 0));
    until("the worker", || {
        setup.batcher.shared().state().scheduler().is_busy(0)
    })
    .await;
    let mut bad = setup.batcher.stream(fail, soon()).unwrap();
    setup.permit(2).await;
    let error = bad.next().await.unwrap().unwrap_err();
    assert!(error.to_string().contains("asks for a failure"), "{error}");
    assert!(bad.next().await.is_none());
    assert_eq!(motion(good.await.unwrap()), alone(prompt(2, 0)));
}

#[tokio::test]
async fn a_failed_step_fails_all_its_jobs_even_those_with_a_piece_in_it() {
    let mut setup = setup(2, 1).await;
    let mut streamed = setup.batcher.stream(prompt(9, 0), soon()).unwrap();
    setup.permit(1).await;
    let whole = setup.enqueue(prompt(9, 1));
    assert!(streamed.next().await.unwrap().is_ok());
    setup.permit_all();
    let answers = async {
        let error = loop {
            if let Err(error) = streamed.next().await.expect("no error") {
                break error;
            }
        };
        assert!(error.to_string().contains("on purpose"), "{error}");
        assert!(whole.await.is_err());
    };
    let answers = tokio::time::timeout(Duration::from_secs(5), answers).await;
    answers.expect("a job that the generator has dropped is never answered");
}

#[tokio::test]
async fn no_wake_up_is_lost() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    for (workers, spin_us) in [(1, 0), (1, 100), (2, 0), (2, 100), (3, 0), (3, 100)] {
        let factory: GeneratorFactory = Arc::new(|_| Ok(Box::new(Toy::new(DIMS, 4))));
        let telemetry = Telemetry::new().unwrap();
        let spin = Duration::from_micros(spin_us);
        let metrics = PackMetrics::new(&telemetry, "test", "1");
        let batcher = Batcher::start("test", limits(workers), spin, metrics, factory)
            .await
            .unwrap();
        for round in 0..400 {
            // Around the moment at which a worker ends its spinning and parks.
            let pause = Instant::now() + Duration::from_micros(rng.random_range(0..2 * spin_us + 20));
            while Instant::now() < pause {
                std::hint::spin_loop();
            }
            let task = prompt(rng.random_range(1..3), 0);
            let answer = batcher.submit(vec![task], soon());
            let answer = tokio::time::timeout(Duration::from_secs(10), answer).await;
            assert!(
                answer.is_ok_and(|answer| answer.is_ok()),
                "{workers} workers, {spin_us} us, {round}"
            );
        }
    }
}
