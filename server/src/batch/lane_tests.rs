//! Several lanes, and what the order of a request does.

use std::sync::mpsc as blocking;

use super::tests::{DIMS, Gate, Trouble, dispatched, items, marks, pending, soon};
use super::*;
use crate::batch::order::OwnerId;
use crate::telemetry::Telemetry;
use troupe_engine::{DecoderOutput, PoseOutput, RootInput, RootOutput, Stages, TokenInput};

/// Two lanes, each with a gate of its own.
struct Lanes {
    batcher: Batcher,
    permits: Vec<blocking::Sender<()>>,
    sizes: Vec<Arc<Mutex<Vec<usize>>>>,
    telemetry: Telemetry,
}

async fn lanes(limits: Limits, troubles: [Trouble; 2]) -> Lanes {
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
    let factory: EngineFactory = Arc::new(move |lane| {
        let stages = gates.lock().unwrap()[lane].take().unwrap();
        Ok(Pipeline::new(DIMS, Box::new(stages), limits.max_batch))
    });
    let limits = Limits { lanes: 2, ..limits };
    let metrics = telemetry.pack("test", "1");
    let batcher = Batcher::start("test", limits, metrics, factory).await.unwrap();
    Lanes {
        batcher,
        permits,
        sizes,
        telemetry,
    }
}

fn limits() -> Limits {
    Limits {
        max_batch: 4,
        max_queued: 100,
        lane_spin: Duration::from_millis(1),
        ..Limits::default()
    }
}

impl Lanes {
    fn enqueue(&self, marks: std::ops::Range<usize>) -> Answer {
        self.batcher.enqueue(items(marks), soon()).unwrap()
    }

    fn permit(&self, lane: usize) {
        self.permits[lane].send(()).unwrap();
    }

    fn sizes(&self, lane: usize) -> Vec<usize> {
        self.sizes[lane].lock().unwrap().clone()
    }

    /// A request for each lane, so that both are busy: the answers.
    async fn fill(&self) -> Vec<Answer> {
        let mut answers = Vec::new();
        for lane in 0..2 {
            answers.push(self.enqueue(90 + lane..91 + lane));
            dispatched(&self.telemetry, lane + 1).await;
        }
        answers
    }

    fn shows(&self, line: &str) {
        let text = self.telemetry.render();
        assert!(text.contains(line), "{line} is missing in\n{text}");
    }
}

#[tokio::test]
async fn a_request_is_split_over_free_lanes_and_joined_in_order() {
    let lanes = lanes(limits(), [Trouble::None; 2]).await;
    let mut answer = lanes.enqueue(0..6);
    dispatched(&lanes.telemetry, 2).await;
    // The second half is done first.
    lanes.permit(1);
    let early = tokio::time::timeout(Duration::from_millis(50), &mut answer).await;
    assert!(early.is_err(), "half an answer");
    lanes.permit(0);
    let served = answer.await.unwrap();
    assert_eq!(marks(&served), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    assert_eq!((lanes.sizes(0), lanes.sizes(1)), (vec![3], vec![3]));
    assert_eq!(served.batch_size, 3);
    assert!(served.queued <= served.started && served.started + Duration::from_millis(50) <= served.finished);
}

#[tokio::test]
async fn what_a_lane_does_is_on_the_gauge() {
    let lanes = lanes(limits(), [Trouble::None; 2]).await;
    let gauge = lanes.batcher.gauge();
    let started = Instant::now();
    assert_eq!((gauge.lanes(), gauge.busy(started)), (2, Duration::ZERO));
    let answers = lanes.fill().await;
    let waiting = lanes.enqueue(0..3);
    assert_eq!((gauge.waiting(), gauge.served()), (3, 0));
    tokio::time::sleep(Duration::from_millis(20)).await;
    // Two lanes have been at it since they were filled.
    assert!(gauge.busy(Instant::now()) >= Duration::from_millis(40));
    for lane in [0, 1, 0, 1] {
        lanes.permit(lane);
    }
    for answer in answers.into_iter().chain([waiting]) {
        answer.await.unwrap();
    }
    assert_eq!((gauge.waiting(), gauge.served()), (0, 5));
    let now = Instant::now();
    assert!(gauge.busy(now) <= (now - started) * 2);
    assert_eq!(gauge.busy(now), gauge.busy(now + Duration::from_secs(1)));
}

#[tokio::test]
async fn a_lane_that_dies_takes_its_batch_along_and_the_other_serves_on() {
    let lanes = lanes(limits(), [Trouble::Die, Trouble::None]).await;
    let mut answers = lanes.fill().await;
    let waiting = lanes.enqueue(0..6);
    lanes.permit(0);
    let error = answers.remove(0).await.unwrap_err();
    assert!(
        matches!(error, SubmitError::Engine(EngineError::Stopped)),
        "{error:?}"
    );
    for _ in 0..4 {
        lanes.permit(1);
    }
    answers.remove(0).await.unwrap();
    assert_eq!(waiting.await.unwrap().motions.len(), 6);
    assert_eq!(marks(&lanes.enqueue(7..8).await.unwrap()), [7.0]);
    assert!(lanes.batcher.is_running());
    assert_eq!(lanes.batcher.gauge().lanes(), 1);
    lanes.shows("troupe_engine_lanes{model=\"test\",version=\"1\"} 1");
}

#[tokio::test]
async fn a_panic_in_one_lane_fails_its_batch_only() {
    let lanes = lanes(limits(), [Trouble::None, Trouble::PanicOnce]).await;
    let mut answers = lanes.fill().await;
    lanes.permit(1);
    let error = answers.remove(1).await.unwrap_err();
    assert_eq!(error.to_string(), "the engine panicked: told to");
    // The lane that panicked takes the next batch, the other is still busy.
    let next = lanes.enqueue(5..6);
    lanes.permit(1);
    assert_eq!(marks(&next.await.unwrap()), [5.0]);
    lanes.permit(0);
    answers.remove(0).await.unwrap();
    assert_eq!(lanes.batcher.gauge().lanes(), 2);
}

#[tokio::test]
async fn a_newer_plan_of_a_session_answers_for_the_older() {
    let lanes = lanes(limits(), [Trouble::None; 2]).await;
    let busy = lanes.fill().await;
    let plan = |mark: usize| {
        let order = Order::live(OwnerId(1), Instant::now() + Duration::from_millis(100));
        lanes.batcher.enqueue(items(mark..mark + 1), order).unwrap()
    };
    let (older, newer) = (plan(1), plan(2));
    let error = older.await.unwrap_err();
    assert!(matches!(error, SubmitError::Superseded), "{error:?}");
    for lane in [0, 1, 0, 1] {
        lanes.permit(lane);
    }
    assert_eq!(marks(&newer.await.unwrap()), [2.0]);
    for answer in busy {
        answer.await.unwrap();
    }
    lanes.shows("reason=\"superseded\"} 1");
    lanes.shows("troupe_queue_duration_seconds_count{model=\"test\",version=\"1\",class=\"live\"} 1");
}

#[tokio::test]
async fn what_waits_too_long_is_not_run() {
    let lanes = lanes(limits(), [Trouble::None; 2]).await;
    let busy = lanes.fill().await;
    let order = soon().expiring(Instant::now());
    let late = lanes.batcher.enqueue(items(1..2), order).unwrap();
    lanes.permit(0);
    lanes.permit(1);
    let error = late.await.unwrap_err();
    assert!(matches!(error, SubmitError::DeadlinePassed { .. }), "{error:?}");
    for answer in busy {
        answer.await.unwrap();
    }
    assert_eq!((lanes.sizes(0), lanes.sizes(1)), (vec![1], vec![1]));
    lanes.shows("reason=\"expired\"} 1");
}

#[tokio::test]
async fn a_lane_may_wait_for_company() {
    let limits = Limits {
        batch_delay: Duration::from_millis(200),
        preferred_batch: 3,
        ..limits()
    };
    let lanes = lanes(limits, [Trouble::None; 2]).await;
    for lane in [0, 1, 0, 1] {
        lanes.permit(lane);
    }
    // Nobody comes.
    let alone = lanes.enqueue(0..1).await.unwrap();
    assert!((200..2000).contains(&alone.queued.as_millis()), "{alone:?}");
    // Somebody does.
    let answers: Vec<Answer> = (0..3).map(|mark| lanes.enqueue(mark..mark + 1)).collect();
    for answer in answers {
        let served = answer.await.unwrap();
        assert_eq!(served.batch_size, 3);
        assert!(served.queued < Duration::from_millis(200), "{served:?}");
    }
    // The lane may have slept until all of them were there.
    let text = lanes.telemetry.render();
    assert!(!text.contains("reason=\"delayed\"} 0"), "{text}");
}

#[tokio::test]
async fn a_queue_that_is_too_slow_is_known_before_any_work() {
    let limits = Limits {
        max_wait: Duration::from_millis(100),
        ..limits()
    };
    let lanes = lanes(limits, [Trouble::None; 2]).await;
    assert!(lanes.batcher.refuse(1).is_none());
    let busy = lanes.fill().await;
    // By the first guess, 2.5 ms each.
    let waiting = lanes.enqueue(0..50);
    pending(&lanes.telemetry, 1).await;
    let error = lanes.batcher.refuse(1);
    let Some(SubmitError::QueueFull { retry_after, .. }) = error else {
        panic!("{error:?}");
    };
    assert_eq!(retry_after, Duration::from_millis(125));
    lanes.shows("reason=\"queue_slow\"} 1");
    // A plan has a place all the same.
    let order = Order::live(OwnerId(1), Instant::now());
    let plan = lanes.batcher.enqueue(items(1..2), order).unwrap();
    drop((busy, waiting));
    for _ in 0..2 {
        lanes.permit(0);
        lanes.permit(1);
    }
    plan.await.unwrap();
    assert!(lanes.batcher.refuse(1).is_none());
}

/// Notes when its thread lets go of it.
struct Ends(blocking::Sender<usize>, usize);

/// A gate that tells when its thread lets go of it.
struct Ending(
    Gate,
    #[expect(dead_code, reason = "told when it is dropped")] Ends,
);

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

impl Drop for Ends {
    fn drop(&mut self) {
        let _ = self.0.send(self.1);
    }
}

#[tokio::test]
async fn lanes_end_with_the_last_batcher_and_where_one_of_them_does_not_start() {
    for broken in [false, true] {
        let (ends, ended) = blocking::channel();
        let factory: EngineFactory = Arc::new(move |lane| {
            let ends = Ends(ends.clone(), lane);
            if broken && lane == 1 {
                return Err(EngineError::Library("not here".into()));
            }
            let (_, gate) = blocking::channel();
            let gate = Gate {
                permits: gate,
                sizes: Arc::default(),
                trouble: Trouble::None,
            };
            Ok(Pipeline::new(DIMS, Box::new(Ending(gate, ends)), 4))
        });
        let telemetry = Telemetry::new().unwrap();
        let limits = Limits { lanes: 2, ..limits() };
        let started = Batcher::start("test", limits, telemetry.pack("test", "1"), factory).await;
        assert_eq!(started.is_err(), broken);
        let answer = started
            .ok()
            .map(|batcher| batcher.enqueue(items(0..3), soon()).unwrap());
        let mut lanes: Vec<usize> = (0..2)
            .map(|_| ended.recv_timeout(Duration::from_secs(5)).unwrap())
            .collect();
        lanes.sort_unstable();
        assert_eq!(lanes, [0, 1]);
        // What was asked for before is done.
        if let Some(answer) = answer {
            assert_eq!(answer.await.unwrap().motions.len(), 3);
        }
    }
}
