//! Several workers, and what the order of a request does.

use std::sync::mpsc as blocking;
use std::time::Instant;

use super::tests::*;
use super::*;
use troupe_base::telemetry::Telemetry;
use troupe_engine::{DecoderOutput, Pipeline, PoseOutput, RootInput, RootOutput, Stages, TokenInput};

const TWO: [Trouble; 2] = [Trouble::None; 2];

impl Setup {
    /// A request for each of two workers, so that both are busy: the answers.
    async fn fill(&self) -> Vec<Answer> {
        let mut answers = Vec::new();
        for worker in 0..2 {
            answers.push(self.enqueue(90 + worker..91 + worker));
            self.dispatched(worker + 1).await;
        }
        answers
    }
}

#[tokio::test]
async fn a_request_is_split_over_idle_workers_and_joined_in_order() {
    let setup = setup(limits(2), TWO).await;
    let mut answer = setup.enqueue(0..6);
    setup.dispatched(2).await;
    // The second half is done first.
    setup.permit(1);
    let early = tokio::time::timeout(Duration::from_millis(50), &mut answer).await;
    assert!(early.is_err(), "half an answer");
    setup.permit(0);
    let served = answer.await.unwrap();
    assert_eq!((setup.sizes(0), setup.sizes(1)), (vec![3], vec![3]));
    assert_eq!(served.batch_size, 3);
    assert!(served.queued <= served.started && served.started + Duration::from_millis(50) <= served.finished);
    assert!(served.work > Duration::ZERO && served.inference > Duration::ZERO);
    assert_eq!(marks(served), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
}

#[tokio::test]
async fn workers_leave_with_the_last_clone_and_answer_what_was_asked() {
    let setup = setup(limits(1), [Trouble::None]).await;
    let answer = setup.enqueue(0..1);
    setup.dispatched(1).await;
    let (leaving, clone) = (setup.batcher.leaving(), setup.batcher.clone());
    setup.permit(0);
    assert_eq!(marks(answer.await.unwrap()), [0.0]);
    let waiting = setup.enqueue(1..2);
    drop(setup.batcher);
    assert!(leaving.is_held() && !leaving.has_ended());
    drop(clone);
    assert!(!leaving.is_held() && !leaving.has_ended());
    setup.permits[0].send(()).unwrap();
    assert_eq!(marks(waiting.await.unwrap()), [1.0]);
    until("the worker has ended", || leaving.has_ended()).await;
    assert!(leaving.join(Instant::now()));
}

#[tokio::test]
async fn a_step_for_several_characters_counts_once() {
    let setup = setup(limits(1), [Trouble::None]).await;
    let answer = setup.enqueue(0..4);
    setup.dispatched(1).await;
    setup.permit(0);
    let served = answer.await.unwrap();
    assert_eq!(served.batch_size, 4);
    let parts = served.assemble + served.inference + served.scatter;
    assert!(parts <= served.finished - served.started, "{served:?}");
}

#[tokio::test]
async fn a_dying_worker_fails_its_batch_and_the_other_continues() {
    let setup = setup(limits(2), [Trouble::Die, Trouble::None]).await;
    let mut answers = setup.fill().await;
    let waiting = setup.enqueue(0..6);
    setup.permit(0);
    let error = answers.remove(0).await.unwrap_err();
    assert!(has_stopped(&error), "{error:?}");
    for _ in 0..4 {
        setup.permit(1);
    }
    answers.remove(0).await.unwrap();
    assert_eq!(waiting.await.unwrap().outputs.len(), 6);
    assert_eq!(marks(setup.submit(7..8).await.unwrap()), [7.0]);
    assert_eq!(setup.batcher.workers(), 1);
    setup.shows("troupe_engine_workers{model=\"test\",version=\"1\"} 1");
}

#[tokio::test]
async fn the_next_plan_of_an_owner_outlives_the_worker_of_the_one_before() {
    let setup = setup(limits(2), [Trouble::Die, Trouble::None]).await;
    let lost = setup.plan(1);
    setup.dispatched(1).await;
    let next = setup.plan(2);
    setup.permit(0);
    let error = lost.await.unwrap_err();
    assert!(has_stopped(&error), "{error:?}");
    setup.permit(1);
    let next = tokio::time::timeout(Duration::from_secs(5), next).await;
    assert_eq!(
        marks(next.expect("the next plan is never let in").unwrap()),
        [2.0]
    );
}

#[tokio::test]
async fn a_panic_of_one_worker_fails_its_batch_only() {
    let setup = setup(limits(2), [Trouble::None, Trouble::PanicOnce]).await;
    let mut answers = setup.fill().await;
    setup.permit(1);
    let error = answers.remove(1).await.unwrap_err();
    assert_eq!(error.to_string(), "the engine panicked: on purpose");
    // The worker that panicked takes the next batch, the other is still busy.
    let next = setup.enqueue(5..6);
    setup.permit(1);
    assert_eq!(marks(next.await.unwrap()), [5.0]);
    setup.permit(0);
    answers.remove(0).await.unwrap();
    assert_eq!(setup.batcher.workers(), 2);
}

#[tokio::test]
async fn a_newer_plan_of_an_owner_supersedes_the_older() {
    let setup = setup(limits(2), TWO).await;
    let busy = setup.fill().await;
    let (older, newer) = (setup.plan(1), setup.plan(2));
    let error = older.await.unwrap_err();
    assert!(matches!(error, SubmitError::Superseded), "{error:?}");
    for worker in [0, 1, 0, 1] {
        setup.permit(worker);
    }
    assert_eq!(marks(newer.await.unwrap()), [2.0]);
    for answer in busy {
        answer.await.unwrap();
    }
    setup.shows("reason=\"superseded\"} 1");
    setup.shows("troupe_queue_duration_seconds_count{model=\"test\",version=\"1\",class=\"live\"} 1");
}

#[tokio::test]
async fn requests_that_wait_too_long_are_not_run() {
    let setup = setup(limits(2), TWO).await;
    let busy = setup.fill().await;
    let order = soon().expiring(Instant::now());
    let late = setup.batcher.enqueue(tasks(1..2), order).unwrap();
    setup.permit(0);
    setup.permit(1);
    let error = late.await.unwrap_err();
    assert!(matches!(error, SubmitError::DeadlinePassed { .. }), "{error:?}");
    for answer in busy {
        answer.await.unwrap();
    }
    assert_eq!((setup.sizes(0), setup.sizes(1)), (vec![1], vec![1]));
    setup.shows("reason=\"expired\"} 1");
}

#[tokio::test]
async fn a_slow_queue_refuses_before_any_work() {
    let limits = Limits {
        max_wait: Duration::from_millis(100),
        ..limits(2)
    };
    let setup = setup(limits, TWO).await;
    assert!(setup.batcher.refuse(&Order::request(Instant::now()), 1).is_none());
    let busy = setup.fill().await;
    // By the first guess, 2.4 ms each.
    let waiting = setup.enqueue(0..50);
    let error = setup.batcher.refuse(&Order::request(Instant::now()), 1);
    let Some(SubmitError::QueueFull { retry_after, .. }) = error else {
        panic!("{error:?}");
    };
    assert_eq!(retry_after, Duration::from_millis(120));
    setup.shows("reason=\"queue_slow\"} 1");
    // A plan has a place all the same.
    let plan = setup.plan(1);
    drop((busy, waiting));
    for worker in [0, 1, 0, 1] {
        setup.permit(worker);
    }
    plan.await.unwrap();
    assert!(setup.batcher.refuse(&Order::request(Instant::now()), 1).is_none());
}

/// Tells when its thread lets go of it.
struct Ends(blocking::Sender<usize>, usize);

impl Drop for Ends {
    fn drop(&mut self) {
        let _ = self.0.send(self.1);
    }
}

/// A gate that tells when its thread lets go of it.
struct Ending(Gate, #[expect(dead_code, reason = "for its drop")] Ends);

impl Stages for Ending {
    fn root(&mut self, rows: usize, input: &RootInput, output: &mut RootOutput) -> Result<(), EngineError> {
        self.0.root(rows, input, output)
    }

    fn pose(&mut self, rows: usize, input: &TokenInput, output: &mut PoseOutput) -> Result<(), EngineError> {
        self.0.pose(rows, input, output)
    }

    fn decoder(
        &mut self,
        rows: usize,
        input: &TokenInput,
        output: &mut DecoderOutput,
    ) -> Result<(), EngineError> {
        self.0.decoder(rows, input, output)
    }
}

#[tokio::test]
async fn workers_end_with_the_last_batcher_or_if_one_of_them_does_not_start() {
    for (is_broken, spin_ms) in [(false, 0), (false, 5), (true, 0)] {
        let (ends, ended) = blocking::channel();
        let factory: GeneratorFactory = Arc::new(move |worker| {
            let ends = Ends(ends.clone(), worker);
            if is_broken && worker == 1 {
                return Err(EngineError::Library("not here".into()));
            }
            let (_, permits) = blocking::channel();
            let gate = Gate {
                permits,
                sizes: Arc::default(),
                trouble: Trouble::None,
            };
            let pipeline = Pipeline::new(DIMS, Box::new(Ending(gate, ends)), 4);
            Ok(pipeline.into_generator(4))
        });
        let telemetry = Telemetry::new().unwrap();
        let spin = Duration::from_millis(spin_ms);
        let started = Batcher::start(
            "test",
            limits(2),
            spin,
            PackMetrics::new(&telemetry, "test", "1"),
            factory,
        )
        .await;
        assert_eq!(started.is_err(), is_broken);
        let answer = started
            .ok()
            .map(|batcher| batcher.enqueue(tasks(0..9), soon()).unwrap());
        let end = |_| ended.recv_timeout(Duration::from_secs(5)).unwrap();
        let mut workers: Vec<usize> = (0..2).map(end).collect();
        workers.sort_unstable();
        assert_eq!(workers, [0, 1]);
        // What was asked for before is done.
        if let Some(answer) = answer {
            assert_eq!(answer.await.unwrap().outputs.len(), 9);
        }
    }
}
