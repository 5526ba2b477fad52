use std::sync::mpsc as blocking;

use super::*;
use crate::telemetry::Telemetry;
use troupe_engine::pack::Stage;
use troupe_engine::{DecoderOutput, PoseOutput, RootInput, RootOutput, Stages, TokenInput};
use troupe_motion::model::Dims;

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
};

/// An engine that waits for a permit before each batch, notes batch sizes, and marks rows by their seed.
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
        panic!("told to die");
    }
}

impl Stages for Gate {
    fn root(&mut self, rows: usize, input: &RootInput, output: &mut RootOutput) -> Result<(), EngineError> {
        let _ = self.permits.recv();
        match self.trouble {
            Trouble::PanicOnce => {
                self.trouble = Trouble::None;
                panic!("told to");
            }
            Trouble::Die => std::panic::panic_any(PanicsOnDrop),
            _ => {}
        }
        // Padding rows have no context.
        let real = (0..rows)
            .filter(|&row| input.has_global_root.row(row)[0] == 1.0)
            .count();
        self.sizes.lock().unwrap().push(real);
        for row in 0..rows {
            output.num_tokens.fill_row(row, 3);
            output
                .global_root
                .fill_row(row, input.key_global_root.row(row)[0]);
            if self.trouble == Trouble::BadRow && input.key_global_root.row(row)[0] == 13.0 {
                output.global_root.fill_row(row, f32::NAN);
            }
        }
        Ok(())
    }

    fn pose(&mut self, _: usize, _: &TokenInput, _: &mut PoseOutput) -> Result<(), EngineError> {
        Ok(())
    }

    fn decoder(&mut self, _: usize, _: &TokenInput, _: &mut DecoderOutput) -> Result<(), EngineError> {
        if self.trouble == Trouble::Fail {
            return Err(EngineError::Run {
                stage: Stage::Decoder,
                reason: "told to".into(),
            });
        }
        Ok(())
    }
}

pub(super) struct Setup {
    batcher: Batcher,
    permits: blocking::Sender<()>,
    sizes: Arc<Mutex<Vec<usize>>>,
    telemetry: Telemetry,
}

async fn setup(max_batch: usize, max_queued: usize, trouble: Trouble) -> Setup {
    let telemetry = Telemetry::new().unwrap();
    let (permits, gate) = blocking::channel();
    let sizes = Arc::new(Mutex::new(Vec::new()));
    let stages = Gate {
        permits: gate,
        sizes: sizes.clone(),
        trouble,
    };
    let stages = Mutex::new(Some(stages));
    let factory: EngineFactory = Arc::new(move |_| {
        let stages = stages.lock().unwrap().take().unwrap();
        Ok(Pipeline::new(DIMS, Box::new(stages), max_batch))
    });
    let limits = Limits {
        max_batch,
        max_queued,
        ..Limits::default()
    };
    let batcher = Batcher::start("test", limits, telemetry.pack("test", "1"), factory)
        .await
        .unwrap();
    Setup {
        batcher,
        permits,
        sizes,
        telemetry,
    }
}

pub(super) fn items(marks: std::ops::Range<usize>) -> Vec<KeyframeTask> {
    let key = |mark: usize| troupe_motion::model::KeyTensors {
        global_root: Some([mark as f32; 5]),
        ..Default::default()
    };
    marks
        .map(|mark| KeyframeTask {
            context: vec![key(mark)],
            targets: vec![key(mark)],
            frames: None,
            allowed_counts: vec![true],
            seed: 0,
            temperature: 0.0,
            pose_steps: 1,
            root_guide: None,
            gap_poses: Vec::new(),
        })
        .collect()
}

pub(super) fn soon() -> Order {
    Order::request(Instant::now())
}

pub(super) fn marks(served: &Served) -> Vec<f32> {
    served
        .motions
        .iter()
        .map(|motion| motion.trace.as_ref().unwrap().root_r_g3[0])
        .collect()
}

/// Waits until the batcher shows `requests` waiting.
pub(super) async fn pending(telemetry: &Telemetry, requests: usize) {
    let line = format!("troupe_pending_requests{{model=\"test\",version=\"1\"}} {requests}\n");
    for _ in 0..2000 {
        if telemetry.render().contains(&line) {
            return;
        }
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
    panic!("never saw {requests} requests waiting:\n{}", telemetry.render());
}

fn submit(
    setup: &Setup,
    marks: std::ops::Range<usize>,
) -> tokio::task::JoinHandle<Result<Served, SubmitError>> {
    let batcher = setup.batcher.clone();
    tokio::spawn(async move { batcher.submit(items(marks), soon()).await })
}

/// Waits until the engine has taken `batches` batches (it may not have finished the last).
pub(super) async fn dispatched(telemetry: &Telemetry, batches: usize) {
    let line = format!("troupe_batch_size_count{{model=\"test\",version=\"1\"}} {batches}\n");
    for _ in 0..2000 {
        if telemetry.render().contains(&line) {
            return;
        }
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
    panic!("never saw {batches} batches:\n{}", telemetry.render());
}

#[tokio::test]
async fn waiting_requests_share_a_batch_and_large_ones_are_joined() {
    let setup = setup(4, 100, Trouble::None).await;
    let first = submit(&setup, 0..1);
    dispatched(&setup.telemetry, 1).await;
    let large = submit(&setup, 10..16);
    pending(&setup.telemetry, 1).await;
    let small = submit(&setup, 20..21);
    pending(&setup.telemetry, 2).await;
    for _ in 0..3 {
        setup.permits.send(()).unwrap();
    }
    assert_eq!(marks(&first.await.unwrap().unwrap()), [0.0]);
    let large = large.await.unwrap().unwrap();
    assert_eq!(marks(&large), [10.0, 11.0, 12.0, 13.0, 14.0, 15.0]);
    assert_eq!(large.batch_size, 4);
    let small = small.await.unwrap().unwrap();
    assert_eq!((marks(&small), small.batch_size), (vec![20.0], 3));
    assert_eq!(*setup.sizes.lock().unwrap(), [1, 4, 3]);
}

#[tokio::test]
async fn a_full_queue_refuses_at_once_with_a_hint() {
    let setup = setup(4, 5, Trouble::None).await;
    let first = submit(&setup, 0..1);
    dispatched(&setup.telemetry, 1).await;
    let second = submit(&setup, 1..5);
    pending(&setup.telemetry, 1).await;
    let refused = setup.batcher.submit(items(5..7), soon()).await.unwrap_err();
    let SubmitError::QueueFull {
        pending_characters: 4,
        retry_after,
    } = refused
    else {
        panic!("{refused:?}");
    };
    assert!(retry_after >= Duration::from_millis(10));
    setup.permits.send(()).unwrap();
    setup.permits.send(()).unwrap();
    assert!(first.await.unwrap().is_ok() && second.await.unwrap().is_ok());
    assert!(setup.telemetry.render().contains("reason=\"queue_full\"} 1"));
}

#[tokio::test]
async fn what_is_enqueued_waits_in_the_order_of_the_calls_and_shares_batches() {
    let setup = setup(4, 5, Trouble::None).await;
    let first = submit(&setup, 0..1);
    dispatched(&setup.telemetry, 1).await;
    let answers: Vec<_> = (1..4)
        .map(|mark| setup.batcher.enqueue(items(mark..mark + 1), soon()).unwrap())
        .collect();
    pending(&setup.telemetry, 3).await;
    // One that is dropped gives up its place, one that does not fit is refused.
    let mut answers = answers.into_iter();
    drop(answers.next());
    let refused = setup.batcher.enqueue(items(10..14), soon()).unwrap_err();
    assert!(
        matches!(
            refused,
            SubmitError::QueueFull {
                pending_characters: 2,
                ..
            }
        ),
        "{refused:?}"
    );
    setup.permits.send(()).unwrap();
    setup.permits.send(()).unwrap();
    first.await.unwrap().unwrap();
    for (answer, mark) in answers.zip([2.0, 3.0]) {
        assert_eq!(marks(&answer.await.unwrap()), [mark]);
    }
    assert_eq!(*setup.sizes.lock().unwrap(), [1, 2]);
}

#[tokio::test]
async fn work_of_a_caller_that_left_is_not_run() {
    let setup = setup(4, 100, Trouble::None).await;
    let first = submit(&setup, 0..1);
    dispatched(&setup.telemetry, 1).await;
    let leaver = submit(&setup, 1..4);
    pending(&setup.telemetry, 1).await;
    leaver.abort();
    assert!(leaver.await.unwrap_err().is_cancelled());
    let last = submit(&setup, 7..8);
    // The leaver was dropped when the last one arrived, so still one waits.
    pending(&setup.telemetry, 1).await;
    setup.permits.send(()).unwrap();
    setup.permits.send(()).unwrap();
    first.await.unwrap().unwrap();
    assert_eq!(marks(&last.await.unwrap().unwrap()), [7.0]);
    assert_eq!(*setup.sizes.lock().unwrap(), [1, 1]);
    assert!(setup.telemetry.render().contains("reason=\"client_gone\"} 1"));
}

#[tokio::test]
async fn a_failing_batch_fails_its_requests_whole_and_the_next_one_runs() {
    let setup = setup(2, 100, Trouble::Fail).await;
    for _ in 0..8 {
        setup.permits.send(()).unwrap();
    }
    let failed = setup.batcher.submit(items(0..3), soon()).await.unwrap_err();
    assert!(
        failed.to_string().contains("decoder stage failed: told to"),
        "{failed}"
    );
    let again = setup.batcher.submit(items(0..1), soon()).await.unwrap_err();
    assert!(again.to_string().contains("told to"));
    assert!(setup.batcher.is_running());
}

#[tokio::test]
async fn a_bad_row_fails_its_own_request_only() {
    let setup = setup(4, 100, Trouble::BadRow).await;
    let first = submit(&setup, 0..1);
    dispatched(&setup.telemetry, 1).await;
    // Both share the second batch; what is left of the bad request after it is not run.
    let good = submit(&setup, 20..22);
    pending(&setup.telemetry, 1).await;
    let bad = submit(&setup, 13..19);
    pending(&setup.telemetry, 2).await;
    for _ in 0..3 {
        setup.permits.send(()).unwrap();
    }
    assert_eq!(marks(&first.await.unwrap().unwrap()), [0.0]);
    assert_eq!(marks(&good.await.unwrap().unwrap()), [20.0, 21.0]);
    let error = bad.await.unwrap().unwrap_err().to_string();
    assert!(error.contains("trajectory that is not finite"), "{error}");
    assert_eq!(
        marks(&setup.batcher.submit(items(5..6), soon()).await.unwrap()),
        [5.0]
    );
    assert_eq!(*setup.sizes.lock().unwrap(), [1, 4, 1]);
}

#[tokio::test]
async fn a_panic_fails_its_batch_and_service_goes_on() {
    let setup = setup(2, 100, Trouble::PanicOnce).await;
    setup.permits.send(()).unwrap();
    setup.permits.send(()).unwrap();
    let error = setup.batcher.submit(items(0..1), soon()).await.unwrap_err();
    assert_eq!(error.to_string(), "the engine panicked: told to");
    assert_eq!(
        marks(&setup.batcher.submit(items(3..4), soon()).await.unwrap()),
        [3.0]
    );
    assert!(setup.batcher.is_running());
}

#[tokio::test]
async fn a_dead_engine_is_reported_not_waited_for() {
    let setup = setup(2, 100, Trouble::Die).await;
    setup.permits.send(()).unwrap();
    let error = setup.batcher.submit(items(0..1), soon()).await.unwrap_err();
    assert!(
        matches!(error, SubmitError::Engine(EngineError::Stopped)),
        "{error:?}"
    );
    let error = setup.batcher.submit(items(0..1), soon()).await.unwrap_err();
    assert!(
        matches!(error, SubmitError::Engine(EngineError::Stopped)),
        "{error:?}"
    );
    assert!(!setup.batcher.is_running());
}

#[tokio::test]
async fn an_engine_that_does_not_start_says_why() {
    let telemetry = Telemetry::new().unwrap();
    let factory: EngineFactory = Arc::new(|_| Err(EngineError::Library("not here".into())));
    let limits = Limits::default();
    let error = Batcher::start("test", limits, telemetry.pack("t", "1"), factory)
        .await
        .unwrap_err();
    assert!(error.to_string().contains("not here") && error.to_string().contains("make runtime"));
}
