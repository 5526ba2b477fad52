//! Answers that are there before their batch ends.

use std::sync::mpsc as blocking;

use super::tests::{DIMS, Gate, Trouble, dispatched, items, marks, pending, soon};
use super::*;
use crate::batch::OwnerId;
use crate::telemetry::Telemetry;
use troupe_engine::pack::Stage;
use troupe_engine::{DecoderOutput, PoseOutput, RootInput, RootOutput, Stages, TokenInput};

const MAX_BATCH: usize = 8;

/// An engine whose decoder takes two rows a call, and waits for a word before each: whether it works.
struct ByTwo(Gate, blocking::Receiver<bool>);

impl Stages for ByTwo {
    fn root(&mut self, rows: usize, input: &RootInput, output: &mut RootOutput) -> Result<(), EngineError> {
        self.0.root(rows, input, output)
    }

    fn pose(&mut self, rows: usize, input: &TokenInput, output: &mut PoseOutput) -> Result<(), EngineError> {
        self.0.pose(rows, input, output)
    }

    fn decoder(&mut self, _: usize, _: &TokenInput, _: &mut DecoderOutput) -> Result<(), EngineError> {
        unreachable!("it is run by calls")
    }

    fn decoder_by_calls(
        &mut self,
        rows: usize,
        _: &TokenInput,
        output: &mut DecoderOutput,
        made: &mut dyn FnMut(std::ops::Range<usize>, &DecoderOutput),
    ) -> Result<(), EngineError> {
        for call in (0..rows).step_by(2) {
            if self.1.recv() != Ok(true) {
                return Err(EngineError::Run {
                    stage: Stage::Decoder,
                    reason: "told to".into(),
                });
            }
            // The last may have a row more than is wanted.
            made(call..call + 2, output);
        }
        Ok(())
    }
}

/// One lane, whose next batch is two callers of one character, the first with `order`, and one of three.
struct Setup {
    batcher: Batcher,
    calls: blocking::Sender<bool>,
    telemetry: Telemetry,
    /// Of the two, and of the one.
    answers: Vec<Answer>,
}

async fn setup(order: Order) -> Setup {
    let telemetry = Telemetry::new().unwrap();
    let (permits, permitted) = blocking::channel();
    let (calls, told) = blocking::channel();
    let gate = Gate {
        permits: permitted,
        sizes: Arc::default(),
        trouble: Trouble::None,
    };
    let stages = Mutex::new(Some(ByTwo(gate, told)));
    let factory: EngineFactory = Arc::new(move |_| {
        let stages = stages.lock().unwrap().take().unwrap();
        Ok(Pipeline::new(DIMS, Box::new(stages), MAX_BATCH))
    });
    let limits = Limits {
        max_batch: MAX_BATCH,
        max_queued: 100,
        live_slice: Duration::ZERO,
        ..Limits::default()
    };
    let batcher = Batcher::start("test", limits, telemetry.pack("test", "1"), factory);
    let batcher = batcher.await.unwrap();
    let enqueue = |(marks, order)| batcher.enqueue(items(marks), order).unwrap();
    let first = enqueue((90..91, soon()));
    dispatched(&telemetry, 1).await;
    let answers = [(0..1, order), (1..2, soon()), (2..5, soon())]
        .map(enqueue)
        .into();
    pending(&telemetry, 3).await;
    permits.send(()).unwrap();
    calls.send(true).unwrap();
    first.await.unwrap();
    dispatched(&telemetry, 2).await;
    // Batches to come wait for their calls alone.
    for _ in 0..10 {
        permits.send(()).unwrap();
    }
    Setup {
        batcher,
        calls,
        telemetry,
        answers,
    }
}

async fn is_there(answer: &mut Answer) -> bool {
    tokio::time::timeout(Duration::from_millis(50), answer)
        .await
        .is_ok()
}

#[tokio::test]
async fn nobody_waits_for_calls_behind_their_own() {
    let Setup {
        calls, mut answers, ..
    } = setup(soon()).await;
    assert!(!is_there(&mut answers[0]).await);
    calls.send(true).unwrap();
    let mut large = answers.pop().unwrap();
    for (mark, answer) in answers.into_iter().enumerate() {
        let served = answer.await.unwrap();
        assert_eq!((marks(&served), served.batch_size), (vec![mark as f32], 5));
    }
    // Of its three characters two are in the second call: it is answered once, whole.
    calls.send(true).unwrap();
    assert!(!is_there(&mut large).await);
    calls.send(true).unwrap();
    let served = large.await.unwrap();
    assert_eq!(marks(&served), [2.0, 3.0, 4.0]);
    assert!(served.finished >= served.started + Duration::from_millis(50));
    assert!(!served.work.is_zero());
}

#[tokio::test]
async fn a_call_that_fails_takes_no_answer_back() {
    let Setup {
        batcher,
        calls,
        answers,
        telemetry,
    } = setup(soon()).await;
    calls.send(true).unwrap();
    calls.send(false).unwrap();
    let mut results = Vec::new();
    for answer in answers {
        results.push(answer.await);
    }
    let error = results.pop().unwrap().unwrap_err();
    assert_eq!(error.to_string(), "the decoder stage failed: told to");
    assert!(results.iter().all(Result::is_ok));
    assert_eq!(batcher.gauge().served(), 3, "one alone, and two of five");
    // The lane goes on.
    let next = batcher.enqueue(items(7..8), soon()).unwrap();
    calls.send(true).unwrap();
    assert_eq!(marks(&next.await.unwrap()), [7.0]);
    dispatched(&telemetry, 3).await;
}

#[tokio::test]
async fn answers_stay_together_while_a_full_batch_waits() {
    let Setup {
        batcher,
        calls,
        mut answers,
        ..
    } = setup(soon()).await;
    let waiting = batcher.enqueue(items(10..10 + MAX_BATCH), soon()).unwrap();
    calls.send(true).unwrap();
    assert!(!is_there(&mut answers[0]).await);
    for _ in 0..6 {
        calls.send(true).unwrap();
    }
    for answer in answers {
        answer.await.unwrap();
    }
    assert_eq!(waiting.await.unwrap().motions.len(), MAX_BATCH);
}

#[tokio::test]
async fn plans_of_live_characters_are_not_held_back() {
    let plan = Order::live(OwnerId(1), Instant::now() + Duration::from_millis(100));
    let Setup {
        batcher,
        calls,
        mut answers,
        ..
    } = setup(plan).await;
    let _waiting = batcher.enqueue(items(10..10 + MAX_BATCH), soon()).unwrap();
    calls.send(true).unwrap();
    let served = tokio::time::timeout(Duration::from_secs(30), answers.remove(0));
    assert_eq!(marks(&served.await.unwrap().unwrap()), [0.0]);
}
