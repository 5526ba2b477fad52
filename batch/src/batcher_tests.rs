use std::ops::Range;
use std::sync::{Mutex, mpsc as blocking};
use std::time::Instant;

use super::*;
use crate::order::OwnerId;
use troupe_base::telemetry::Telemetry;
use troupe_base::turns::ClientId;
use troupe_engine::pack::Stage;
use troupe_engine::{DecoderOutput, Pipeline, PoseOutput, RootInput, RootOutput, Stages, TokenInput};
use troupe_motion::model::{Dims, KeyTensors, KeyframeTask, Motion, PromptTask};

pub(super) const DIMS: Dims = Dims {
    joints: 1,
    contacts: 1,
    heads: 1,
    codes: 2,
    min_tokens: 3,
    max_tokens: 3,
    frames_per_token: 4,
    context_frames: 1,
    max_targets: 1,
    root_choices: 0,
};

/// Stages that wait for a permit before each batch, note batch sizes, and mark rows by their seed.
/// They do not wait once all givers of permits are gone.
pub(super) struct Gate {
    pub(super) permits: blocking::Receiver<()>,
    pub(super) sizes: Arc<Mutex<Vec<usize>>>,
    pub(super) trouble: Trouble,
}

#[derive(Clone, Copy, PartialEq)]
pub(super) enum Trouble {
    None,
    /// The decoder fails.
    Fail,
    /// The first batch panics.
    PanicOnce,
    /// The thread ends: nothing catches the second panic, that of the payload's drop.
    Die,
    /// The root stage gives the row of mark 13 a trajectory that is not finite.
    BadRow,
}

struct PanicsOnDrop;

impl Drop for PanicsOnDrop {
    fn drop(&mut self) {
        panic!("ordered to die");
    }
}

impl Stages for Gate {
    fn root(&mut self, rows: usize, input: &RootInput, output: &mut RootOutput) -> Result<(), EngineError> {
        let _ = self.permits.recv();
        match self.trouble {
            Trouble::PanicOnce => {
                self.trouble = Trouble::None;
                panic!("on purpose");
            }
            Trouble::Die => std::panic::panic_any(PanicsOnDrop),
            _ => {}
        }
        // Padding rows have no context.
        let real = (0..rows).filter(|&row| input.has_global_root.row(row)[0] == 1.0);
        self.sizes.lock().unwrap().push(real.count());
        for row in 0..rows {
            let mark = input.key_global_root.row(row)[0];
            let is_bad = self.trouble == Trouble::BadRow && mark == 13.0;
            output.num_tokens.fill_row(row, 3);
            output
                .global_root
                .fill_row(row, if is_bad { f32::NAN } else { mark });
        }
        Ok(())
    }

    fn pose(&mut self, _: usize, _: &TokenInput, _: &mut PoseOutput) -> Result<(), EngineError> {
        Ok(())
    }

    fn decoder(&mut self, _: usize, _: &TokenInput, _: &mut DecoderOutput) -> Result<(), EngineError> {
        match self.trouble {
            Trouble::Fail => Err(EngineError::Run {
                stage: Stage::Decoder,
                reason: "on purpose".into(),
            }),
            _ => Ok(()),
        }
    }
}

/// A batcher of which each worker waits for permits.
pub(super) struct Setup {
    pub(super) batcher: Batcher,
    pub(super) permits: Vec<blocking::Sender<()>>,
    sizes: Vec<Arc<Mutex<Vec<usize>>>>,
    telemetry: Telemetry,
}

/// Limits without any measured time.
pub(super) fn limits(workers: usize) -> Limits {
    Limits {
        workers,
        max_batch: 4,
        max_batch_time: Duration::ZERO,
        calls_batch_time: Duration::ZERO,
        max_queued: 100,
        max_wait: Duration::ZERO,
        ..Limits::default()
    }
}

/// As many workers as there are troubles, all of them idle.
pub(super) async fn setup<const WORKERS: usize>(limits: Limits, troubles: [Trouble; WORKERS]) -> Setup {
    let telemetry = Telemetry::new().unwrap();
    let (mut gates, mut permits, mut sizes) = (Vec::new(), Vec::new(), Vec::new());
    for trouble in troubles {
        let (permit, gate) = blocking::channel();
        let seen = Arc::new(Mutex::new(Vec::new()));
        permits.push(permit);
        sizes.push(seen.clone());
        gates.push(Some(Gate {
            permits: gate,
            sizes: seen,
            trouble,
        }));
    }
    let gates = Mutex::new(gates);
    let max_batch = limits.max_batch;
    let factory: GeneratorFactory = Arc::new(move |worker| {
        let gate = gates.lock().unwrap()[worker].take().unwrap();
        let pipeline = Pipeline::new(DIMS, Box::new(gate), max_batch);
        Ok(pipeline.into_generator(max_batch))
    });
    // Without a spin: a worker that is at the end of one takes what another is woken for, and tests
    // say who gets what.
    let spin = Duration::ZERO;
    let metrics = PackMetrics::new(&telemetry, "test", "1");
    let batcher = Batcher::start("test", limits, spin, metrics, factory)
        .await
        .unwrap();
    all_idle(&batcher).await;
    Setup {
        batcher,
        permits,
        sizes,
        telemetry,
    }
}

/// Asks every millisecond whether it has come so far.
pub(super) async fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    for _ in 0..5000 {
        if is_so() {
            return;
        }
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
    panic!("never saw {what}");
}

/// Waits until all workers have reported and none has work.
pub(super) async fn all_idle(batcher: &Batcher) {
    until("idle workers", || {
        let state = batcher.shared().state();
        let mut workers = 0..batcher.workers();
        !workers.any(|worker| state.scheduler().is_busy(worker))
    })
    .await;
}

impl Setup {
    pub(super) fn enqueue(&self, marks: Range<usize>) -> Answer {
        self.batcher.enqueue(tasks(marks), soon()).unwrap()
    }

    pub(super) async fn submit(&self, marks: Range<usize>) -> Result<Served, SubmitError> {
        self.batcher.submit(tasks(marks), soon()).await
    }

    /// A plan of owner 1.
    pub(super) fn plan(&self, mark: usize) -> Answer {
        let order = Order::live(OwnerId(1), Instant::now() + Duration::from_millis(100));
        self.batcher.enqueue(tasks(mark..mark + 1), order).unwrap()
    }

    /// Lets a worker run a batch.
    pub(super) fn permit(&self, worker: usize) {
        self.permits[worker].send(()).unwrap();
    }

    pub(super) fn sizes(&self, worker: usize) -> Vec<usize> {
        self.sizes[worker].lock().unwrap().clone()
    }

    /// Requests that wait.
    pub(super) fn pending(&self) -> usize {
        self.batcher.shared().state().scheduler().pending_requests()
    }

    /// Waits until workers have taken so many batches; they may not have finished the last.
    pub(super) async fn dispatched(&self, batches: usize) {
        let line = format!("troupe_batch_size_count{{model=\"test\",version=\"1\"}} {batches}\n");
        until(&line, || self.telemetry.render().contains(&line)).await;
    }

    pub(super) fn shows(&self, line: &str) {
        let text = self.telemetry.render();
        assert!(text.contains(line), "{line} is missing in\n{text}");
    }
}

pub(super) fn tasks(marks: Range<usize>) -> Vec<Task> {
    let key = |mark: usize| KeyTensors {
        global_root: Some([mark as f32; 5]),
        ..KeyTensors::default()
    };
    let task = |mark| KeyframeTask {
        context: vec![key(mark)],
        targets: vec![key(mark)],
        frames: None,
        allowed_counts: vec![true],
        seed: 0,
        temperature: 0.0,
        pose_steps: 1,
        root_guide: None,
        root_override: None,
        gap_poses: Vec::new(),
    };
    marks.map(|mark| task(mark).into()).collect()
}

pub(super) fn soon() -> Order {
    Order::request(Instant::now())
}

pub(super) fn marks(served: Served) -> Vec<f32> {
    let mark = |motion: Motion| motion.trace.unwrap().root_r_g3[0];
    served.into_motions().map(mark).collect()
}

pub(super) fn has_stopped(error: &SubmitError) -> bool {
    matches!(error, SubmitError::Engine(EngineError::Stopped))
}

#[tokio::test]
async fn waiting_requests_share_a_batch_and_large_ones_are_joined() {
    let setup = setup(limits(1), [Trouble::None]).await;
    let first = setup.enqueue(0..1);
    setup.dispatched(1).await;
    let (large, small) = (setup.enqueue(10..16), setup.enqueue(20..21));
    assert_eq!(setup.pending(), 2);
    for _ in 0..3 {
        setup.permit(0);
    }
    assert_eq!(marks(first.await.unwrap()), [0.0]);
    let large = large.await.unwrap();
    assert_eq!(large.batch_size, 4);
    assert_eq!(marks(large), [10.0, 11.0, 12.0, 13.0, 14.0, 15.0]);
    let small = small.await.unwrap();
    assert_eq!((small.batch_size, marks(small)), (3, vec![20.0]));
    assert_eq!(setup.sizes(0), [1, 4, 3]);
    setup.shows("troupe_dispatch_total{model=\"test\",version=\"1\",reason=\"full\"} 1");
    assert!(setup.submit(0..0).await.unwrap().outputs.is_empty());
}

#[tokio::test]
async fn a_full_queue_refuses_at_once_with_a_hint() {
    let limits = Limits {
        max_queued: 5,
        ..limits(1)
    };
    let setup = setup(limits, [Trouble::None]).await;
    let first = setup.enqueue(0..1);
    setup.dispatched(1).await;
    let second = setup.enqueue(1..5);
    let refused = setup.submit(5..7).await.unwrap_err();
    let SubmitError::QueueFull {
        pending_characters: 4,
        retry_after,
    } = refused
    else {
        panic!("{refused:?}");
    };
    assert!(retry_after >= Duration::from_millis(10));
    setup.permit(0);
    setup.permit(0);
    assert!(first.await.is_ok() && second.await.is_ok());
    setup.shows("reason=\"queue_full\"} 1");
}

#[tokio::test]
async fn requests_wait_in_the_order_in_which_they_were_enqueued() {
    let setup = setup(limits(1), [Trouble::None]).await;
    let first = setup.enqueue(0..1);
    setup.dispatched(1).await;
    let answers: Vec<Answer> = (1..6).map(|mark| setup.enqueue(mark..mark + 1)).collect();
    let mut answers = answers.into_iter();
    // One that is dropped gives up its place.
    drop(answers.next());
    assert_eq!(setup.pending(), 4);
    setup.permit(0);
    setup.permit(0);
    first.await.unwrap();
    for (answer, mark) in answers.zip([2.0, 3.0, 4.0, 5.0]) {
        assert_eq!(marks(answer.await.unwrap()), [mark]);
    }
    assert_eq!(setup.sizes(0), [1, 4]);
}

#[tokio::test]
async fn work_of_a_caller_that_left_is_not_run() {
    let setup = setup(limits(1), [Trouble::None]).await;
    let first = setup.enqueue(0..1);
    setup.dispatched(1).await;
    let batcher = setup.batcher.clone();
    let leaver = tokio::spawn(async move { batcher.submit(tasks(1..4), soon()).await });
    until("the leaver", || setup.pending() == 1).await;
    leaver.abort();
    assert!(leaver.await.unwrap_err().is_cancelled());
    assert_eq!(setup.pending(), 0);
    let last = setup.enqueue(7..8);
    setup.permit(0);
    setup.permit(0);
    first.await.unwrap();
    assert_eq!(marks(last.await.unwrap()), [7.0]);
    assert_eq!(setup.sizes(0), [1, 1]);
    setup.shows("reason=\"client_gone\"} 1");
}

#[tokio::test]
async fn a_failing_batch_fails_its_requests_whole_and_the_next_one_runs() {
    let setup = setup(limits(1), [Trouble::Fail]).await;
    setup.permit(0);
    let failed = setup.submit(0..6).await.unwrap_err().to_string();
    assert!(failed.contains("decoder stage failed: on purpose"), "{failed}");
    // What was left of it has not run.
    setup.permit(0);
    let again = setup.submit(0..1).await.unwrap_err().to_string();
    assert!(again.contains("on purpose"), "{again}");
    assert_eq!(setup.sizes(0), [4, 1]);
    assert!(setup.batcher.is_running());
}

#[tokio::test]
async fn a_bad_row_fails_its_own_request_only() {
    let setup = setup(limits(1), [Trouble::BadRow]).await;
    let first = setup.enqueue(0..1);
    setup.dispatched(1).await;
    // Both share the second batch; what is left of the bad request after it is not run.
    let (good, bad) = (setup.enqueue(20..22), setup.enqueue(13..19));
    for _ in 0..3 {
        setup.permit(0);
    }
    assert_eq!(marks(first.await.unwrap()), [0.0]);
    assert_eq!(marks(good.await.unwrap()), [20.0, 21.0]);
    let error = bad.await.unwrap_err().to_string();
    assert!(error.contains("trajectory that is not finite"), "{error}");
    assert_eq!(marks(setup.submit(5..6).await.unwrap()), [5.0]);
    assert_eq!(setup.sizes(0), [1, 4, 1]);
}

#[tokio::test]
async fn a_task_that_the_family_does_not_know_fails_alone() {
    let setup = setup(limits(1), [Trouble::None]).await;
    let first = setup.enqueue(0..1);
    setup.dispatched(1).await;
    let prompt = Task::Prompt(PromptTask::default());
    let (prompt, good) = (
        setup.batcher.enqueue(vec![prompt], soon()).unwrap(),
        setup.enqueue(5..6),
    );
    setup.permit(0);
    setup.permit(0);
    first.await.unwrap();
    let error = prompt.await.unwrap_err();
    assert!(
        matches!(error, SubmitError::Engine(EngineError::WrongTask)),
        "{error:?}"
    );
    assert_eq!(marks(good.await.unwrap()), [5.0]);
}

#[tokio::test]
async fn a_panic_fails_its_batch_and_service_goes_on() {
    let setup = setup(limits(1), [Trouble::PanicOnce]).await;
    setup.permit(0);
    setup.permit(0);
    let error = setup.submit(0..1).await.unwrap_err();
    assert_eq!(error.to_string(), "the engine panicked: on purpose");
    assert_eq!(marks(setup.submit(3..4).await.unwrap()), [3.0]);
    assert!(setup.batcher.is_running());
}

#[tokio::test]
async fn a_dead_engine_is_reported_not_waited_for() {
    let setup = setup(limits(1), [Trouble::Die]).await;
    let running = setup.enqueue(0..1);
    setup.dispatched(1).await;
    let waiting = setup.enqueue(1..2);
    setup.permit(0);
    for stranded in [running, waiting] {
        let error = stranded.await.unwrap_err();
        assert!(has_stopped(&error), "{error:?}");
    }
    let error = setup.submit(0..1).await.unwrap_err();
    assert!(has_stopped(&error), "{error:?}");
    assert!(!setup.batcher.is_running());
}

#[tokio::test]
async fn an_engine_that_does_not_start_gives_the_reason() {
    let telemetry = Telemetry::new().unwrap();
    let factory: GeneratorFactory = Arc::new(|_| Err(EngineError::Library("not here".into())));
    let metrics = PackMetrics::new(&telemetry, "test", "1");
    let started = Batcher::start("test", Limits::default(), Duration::ZERO, metrics, factory).await;
    let error = started.unwrap_err().to_string();
    assert!(
        error.contains("not here") && error.contains("make runtime"),
        "{error}"
    );
}

#[tokio::test]
async fn a_stop_waits_for_the_running_step_and_fails_the_rest() {
    let setup = setup(limits(1), [Trouble::None]).await;
    let running = setup.enqueue(0..4);
    setup.dispatched(1).await;
    let waiting = setup.enqueue(4..12);
    setup.batcher.stop();
    for answer in [running, waiting] {
        assert!(has_stopped(&answer.await.unwrap_err()));
    }
    let refused = setup.batcher.enqueue(tasks(0..1), soon()).unwrap_err();
    assert!(has_stopped(&refused), "{refused}");
    assert!(
        !setup.batcher.join(Instant::now() + Duration::from_millis(20)),
        "a step still runs"
    );
    setup.permit(0);
    assert!(setup.batcher.join(Instant::now() + Duration::from_secs(10)));
    assert_eq!(setup.sizes(0), [4], "no step began after the stop");
    assert!(setup.batcher.join(Instant::now()), "all have ended");
}

#[tokio::test]
async fn calls_of_many_passes_delay_those_of_their_client() {
    let setup = setup(limits(1), [Trouble::None]).await;
    let _running = setup.enqueue(0..1);
    setup.dispatched(1).await;
    let of = |own| {
        soon().of(ClientId {
            group: own,
            own,
            share: 1,
        })
    };
    let many_passes = |task: Task| match task {
        Task::Keyframes(task) => Task::Keyframes(KeyframeTask {
            pose_steps: 10,
            ..task
        }),
        other => other,
    };
    let dear = tasks(10..18).into_iter().map(many_passes).collect();
    let dear = setup.batcher.enqueue(dear, of(1)).unwrap();
    let cheap = setup.batcher.enqueue(tasks(20..28), of(2)).unwrap();
    // After what runs, three batches: four cheap characters go for each dear one. If all counted
    // the same, the cheap ones would need a fourth.
    for _ in 0..4 {
        setup.permit(0);
    }
    let cheap = tokio::time::timeout(Duration::from_secs(5), cheap).await;
    assert!(cheap.is_ok_and(|answer| answer.is_ok()));
    setup.dispatched(5).await;
    assert_eq!(setup.sizes(0), [1, 4, 4, 4]);
    setup.permit(0);
    dear.await.unwrap();
}

#[tokio::test]
async fn a_call_that_makes_room_for_another_client_is_answered_and_counted() {
    let limits = Limits {
        max_queued: 4,
        ..limits(1)
    };
    let setup = setup(limits, [Trouble::None]).await;
    let _running = setup.enqueue(0..1);
    setup.dispatched(1).await;
    let of = |own| {
        soon().of(ClientId {
            group: own,
            own,
            share: 1,
        })
    };
    let large = setup.batcher.enqueue(tasks(10..14), of(1)).unwrap();
    let small = setup.batcher.enqueue(tasks(20..21), of(2)).unwrap();
    let Err(SubmitError::QueueFull { retry_after, .. }) = large.await else {
        panic!("it stays");
    };
    assert!(retry_after > Duration::ZERO);
    setup.shows(r#"troupe_rejections_total{model="test",version="1",reason="pushed_out"} 1"#);
    for _ in 0..2 {
        setup.permit(0);
    }
    assert_eq!(marks(small.await.unwrap()), [20.0]);
}
