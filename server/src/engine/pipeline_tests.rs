use std::sync::{Arc, Mutex};

use super::*;
use crate::engine::KeyTensors;

const DIMS: Dims = Dims {
    joints: 2,
    contacts: 1,
    heads: 2,
    codes: 5,
    min_tokens: 3,
    max_tokens: 16,
    frames_per_token: 4,
    context_frames: 4,
    max_targets: 4,
};

/// Rows in, rows out: each stage writes values that tell which row's input they came from.
#[derive(Default)]
struct Echo {
    calls: Arc<Mutex<Vec<(Stage, usize)>>>,
    break_stage: Option<Stage>,
    count: Option<i64>,
}

impl Echo {
    fn call(&self, stage: Stage, rows: usize) {
        self.calls.lock().unwrap().push((stage, rows));
    }
}

impl Stages for Echo {
    fn root(&mut self, rows: usize, input: &RootInput, output: &mut RootOutput) -> Result<(), EngineError> {
        self.call(Stage::Root, rows);
        for row in 0..rows {
            let first = input
                .allowed_counts
                .row(row)
                .iter()
                .position(|&may| may == 1.0)
                .unwrap();
            output
                .num_tokens
                .fill_row(row, self.count.unwrap_or((first + DIMS.min_tokens) as i64));
            output
                .global_root
                .fill_row(row, input.key_global_root.row(row)[0]);
        }
        if self.break_stage == Some(Stage::Root) {
            output.global_root.fill_row(0, f32::NAN);
        }
        Ok(())
    }

    fn pose(&mut self, rows: usize, input: &TokenInput, output: &mut PoseOutput) -> Result<(), EngineError> {
        self.call(Stage::Pose, rows);
        for row in 0..rows {
            let code = input.global_root.row(row)[0] as usize % DIMS.codes;
            for logits in output.logits.row_mut(row).chunks_mut(DIMS.codes) {
                logits.fill(0.0);
                logits[code] = 1.0;
            }
        }
        if self.break_stage == Some(Stage::Pose) {
            output.logits.fill_row(0, f32::INFINITY);
        }
        Ok(())
    }

    fn decoder(
        &mut self,
        rows: usize,
        input: &TokenInput,
        output: &mut DecoderOutput,
    ) -> Result<(), EngineError> {
        self.call(Stage::Decoder, rows);
        if self.break_stage == Some(Stage::Decoder) {
            return Err(EngineError::Run {
                stage: Stage::Decoder,
                reason: "broken".into(),
            });
        }
        for row in 0..rows {
            assert!(
                input
                    .tokens
                    .row(row)
                    .iter()
                    .all(|&token| token < DIMS.codes as i64),
                "masked token left"
            );
            output.rotations.fill_row(row, input.global_root.row(row)[0]);
        }
        Ok(())
    }
}

fn item(mark: f32, pose_steps: u32) -> WorkItem {
    let key = KeyTensors {
        global_root: Some([mark; 5]),
        ..KeyTensors::default()
    };
    WorkItem {
        context: vec![key.clone(); 4],
        targets: vec![key],
        frames: None,
        allowed_counts: (0..DIMS.counts()).map(|index| index == mark as usize).collect(),
        seed: 1,
        temperature: 0.0,
        pose_steps,
    }
}

/// The motions of a batch in which no row fails.
fn run(pipeline: &mut Pipeline, items: &[WorkItem]) -> Vec<RawMotion> {
    let (answers, _) = pipeline.run(items).unwrap();
    answers.into_iter().map(Result::unwrap).collect()
}

fn pipeline(echo: Echo) -> Pipeline {
    Pipeline::new(DIMS, Box::new(echo), 8)
}

#[test]
fn buckets_are_powers_of_two_and_the_limit() {
    assert_eq!(buckets(64), [1, 2, 4, 8, 16, 32, 64]);
    assert_eq!(buckets(6), [1, 2, 4, 6]);
    assert_eq!(buckets(1), [1]);
}

#[test]
fn warm_up_runs_every_stage_in_every_bucket() {
    let echo = Echo::default();
    let calls = echo.calls.clone();
    pipeline(echo).warm_up().unwrap();
    let expected: Vec<_> = [1, 2, 4, 8]
        .into_iter()
        .flat_map(|rows| Stage::ALL.map(|stage| (stage, rows)))
        .collect();
    assert_eq!(*calls.lock().unwrap(), expected);
}

#[test]
fn answers_come_in_the_order_of_the_items_whatever_their_passes() {
    let echo = Echo::default();
    let calls = echo.calls.clone();
    let items: Vec<WorkItem> = [(1.0, 1), (2.0, 3), (3.0, 1), (4.0, 2), (5.0, 1)]
        .map(|(mark, steps)| item(mark, steps))
        .into();
    let (motions, times) = pipeline(echo).run(&items).unwrap();
    for (index, motion) in motions.into_iter().enumerate() {
        let motion = motion.unwrap();
        let mark = 1.0 + index as f32;
        assert_eq!(motion.num_tokens, DIMS.min_tokens + index + 1);
        let frames = motion.num_tokens * 4;
        assert_eq!(motion.root_r_g3, vec![mark; frames * 5]);
        assert_eq!(motion.rotations, vec![mark; frames * 2 * 6]);
        assert_eq!(motion.tokens, vec![mark as u32 % 5; motion.num_tokens * 2]);
        assert_eq!(
            (motion.root_r_g4.len(), motion.contacts.len()),
            (frames * 5, frames)
        );
    }
    // Five rows take the bucket of 8; later pose passes run only for those who asked for them.
    let pose: Vec<usize> = calls
        .lock()
        .unwrap()
        .iter()
        .filter(|call| call.0 == Stage::Pose)
        .map(|call| call.1)
        .collect();
    assert_eq!((times.bucket, pose), (8, vec![8, 2, 1]));
}

#[test]
fn a_character_alone_and_in_a_batch_is_the_same() {
    let mut pipeline = pipeline(Echo::default());
    let alone = run(&mut pipeline, &[item(3.0, 2)]);
    let items: Vec<WorkItem> = (1..=8)
        .map(|mark| item(mark as f32, 1 + mark as u32 % 3))
        .collect();
    let together = run(&mut pipeline, &items);
    assert_eq!(alone[0].rotations, together[2].rotations);
    assert_eq!(alone[0].tokens, together[2].tokens);
}

#[test]
fn outputs_out_of_the_contract_fail_their_own_row_only() {
    // The second item asks for the most passes, so it is row 0, which the engine spoils.
    let items = [item(1.0, 1), item(2.0, 3), item(3.0, 2)];
    let good = run(&mut pipeline(Echo::default()), &items);
    for (stage, says) in [
        (Stage::Root, "trajectory that is not finite"),
        (Stage::Pose, "logits that are not finite"),
    ] {
        let mut pipeline = pipeline(Echo {
            break_stage: Some(stage),
            ..Echo::default()
        });
        let (answers, _) = pipeline.run(&items).unwrap();
        let error = answers[1].as_ref().unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
        for row in [0, 2] {
            let motion = answers[row].as_ref().unwrap();
            assert_eq!(motion.rotations, good[row].rotations, "{stage:?}");
            assert_eq!(motion.tokens, good[row].tokens, "{stage:?}");
        }
    }
    for count in [0, 3, 17, -1] {
        let mut pipeline = pipeline(Echo {
            count: Some(count),
            ..Echo::default()
        });
        let (answers, _) = pipeline.run(&[item(1.0, 1)]).unwrap();
        let error = answers[0].as_ref().unwrap_err().to_string();
        assert!(error.contains("not allowed"), "{error}");
    }
}

#[test]
fn a_failing_stage_fails_the_batch() {
    let mut pipeline = pipeline(Echo {
        break_stage: Some(Stage::Decoder),
        ..Echo::default()
    });
    let error = pipeline.run(&[item(1.0, 1)]).unwrap_err().to_string();
    assert!(error.contains("broken"), "{error}");
}
