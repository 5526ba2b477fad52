use std::sync::{Arc, Mutex};

use super::*;
use troupe_motion::model::{KeyTensors, RootGuide, RootKey, RootOverride};

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
    root_choices: 0,
};

/// Stage, rows and token count of a call; the count is 0 for the root stage, which has none.
type Call = (Stage, usize, usize);

/// Stages whose outputs name the row that the input came from.
#[derive(Default)]
struct Echo {
    calls: Arc<Mutex<Vec<Call>>>,
    /// The noise of every row that the root stage saw.
    root_noise: Arc<Mutex<Vec<Vec<f32>>>>,
    break_stage: Option<Stage>,
    count: Option<i64>,
    one_length: bool,
    any_batch: bool,
}

impl Echo {
    fn call(&self, stage: Stage, rows: usize, length: usize) {
        self.calls.lock().unwrap().push((stage, rows, length));
    }
}

/// x of the root in the last frame of the segment.
fn last_x(input: &TokenInput, row: usize) -> f32 {
    let frames = input.num_tokens.row(row)[0] as usize * DIMS.frames_per_token;
    input.global_root.row(row)[(frames - 1) * GLOBAL_ROOT]
}

impl Stages for Echo {
    fn any_length(&self) -> bool {
        !self.one_length
    }

    fn any_batch(&self) -> bool {
        self.any_batch
    }

    fn root(&mut self, rows: usize, input: &RootInput, output: &mut RootOutput) -> Result<(), EngineError> {
        self.call(Stage::Root, rows, 0);
        for row in 0..rows {
            let noise = input.root_noise.row(row).to_vec();
            self.root_noise.lock().unwrap().push(noise);
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
        self.call(Stage::Pose, rows, input.length());
        assert_eq!(output.logits.row(0).len(), input.length() * 10);
        for row in 0..rows {
            let code = last_x(input, row) as usize % DIMS.codes;
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
        self.call(Stage::Decoder, rows, input.length());
        if self.break_stage == Some(Stage::Decoder) {
            return Err(EngineError::Run {
                stage: Stage::Decoder,
                reason: "broken".into(),
            });
        }
        // An engine that runs a batch in calls of fixed sizes also reads the rows behind the batch.
        for row in 0..rows.next_multiple_of(ROOM_MULTIPLE) {
            let tokens = input.tokens.row(row);
            assert!(
                tokens.iter().all(|&token| token < DIMS.codes as i64),
                "masked token left in row {row}"
            );
        }
        for row in 0..rows {
            output.rotations.fill_row(row, last_x(input, row));
            output
                .global_root
                .row_mut(row)
                .copy_from_slice(input.global_root.row(row));
            output.contacts.fill_row(row, input.length() as f32);
        }
        Ok(())
    }
}

/// A task with a root that stays at `mark`. It takes `mark` tokens more than the fewest.
fn item(mark: f32, pose_steps: u32) -> KeyframeTask {
    item_of(mark, DIMS.min_tokens + mark as usize, pose_steps)
}

fn item_of(mark: f32, tokens: usize, pose_steps: u32) -> KeyframeTask {
    let key = KeyTensors {
        global_root: Some([mark; 5]),
        ..KeyTensors::default()
    };
    KeyframeTask {
        context: vec![key.clone(); 4],
        targets: vec![key],
        frames: None,
        allowed_counts: (DIMS.min_tokens..=DIMS.max_tokens)
            .map(|count| count == tokens)
            .collect(),
        seed: 1,
        temperature: 0.0,
        pose_steps,
        root_guide: None,
        root_override: None,
        gap_poses: Vec::new(),
    }
}

/// The motions of a batch; no row may fail.
fn run(pipeline: &mut Pipeline, items: &[KeyframeTask]) -> Vec<Motion> {
    let (answers, _) = pipeline.run(items).unwrap();
    answers.into_iter().map(Result::unwrap).collect()
}

fn pipeline(echo: Echo) -> Pipeline {
    Pipeline::new(DIMS, Box::new(echo), 8)
}

#[test]
fn lengths_are_few_and_long() {
    assert_eq!(lengths(&DIMS, true), [9, 12, 16]);
    assert_eq!(lengths(&DIMS, false), [16]);
    let dims = Dims {
        min_tokens: 3,
        max_tokens: 3,
        ..DIMS
    };
    assert_eq!(lengths(&dims, true), [3]);
    let dims = Dims {
        min_tokens: 15,
        ..DIMS
    };
    assert_eq!(lengths(&dims, true), [16]);
}

#[test]
fn warm_up_runs_every_stage_in_every_shape() {
    for one_length in [false, true] {
        let echo = Echo {
            one_length,
            ..Echo::default()
        };
        let calls = echo.calls.clone();
        let mut pipeline = pipeline(echo);
        assert_eq!(pipeline.trial(), None);
        pipeline.warm_up().unwrap();
        assert_eq!(pipeline.trial().unwrap().rows, 8);
        let mut expected = Vec::new();
        for rows in [8, 6, 4, 2, 1] {
            expected.push((Stage::Root, rows, 0));
            for length in lengths(&DIMS, !one_length).into_iter().rev() {
                expected.extend([(Stage::Pose, rows, length), (Stage::Decoder, rows, length)]);
            }
        }
        // One more run, which is timed.
        let longest = DIMS.max_tokens;
        expected.extend([
            (Stage::Root, 8, 0),
            (Stage::Pose, 8, longest),
            (Stage::Decoder, 8, longest),
        ]);
        assert_eq!(*calls.lock().unwrap(), expected);
    }
}

#[test]
fn answers_come_in_the_order_of_the_items_for_all_lengths_and_passes() {
    for one_length in [false, true] {
        let echo = Echo {
            one_length,
            ..Echo::default()
        };
        let items: Vec<KeyframeTask> = [(4.0, 1), (2.0, 3), (13.0, 1), (4.0, 2), (1.0, 1)]
            .map(|(mark, steps)| item(mark, steps))
            .into();
        let (motions, _) = pipeline(echo).run(&items).unwrap();
        for (motion, mark) in motions.into_iter().zip([4.0, 2.0, 13.0, 4.0, 1.0]) {
            let motion = motion.unwrap();
            let trace = motion.trace.as_deref().unwrap();
            assert_eq!(trace.num_tokens, DIMS.min_tokens + mark as usize);
            let frames = trace.num_tokens * 4;
            assert_eq!(trace.root_r_g3, vec![mark; frames * 5]);
            assert_eq!(motion.rotations, vec![mark; frames * 2 * 6]);
            assert_eq!(trace.tokens, vec![mark as u32 % 5; trace.num_tokens * 2]);
            assert_eq!(motion.root, trace.root_r_g3);
            assert_eq!(motion.contacts.len(), frames);
        }
    }
}

#[test]
fn rows_run_in_groups_of_one_length_with_their_own_number_of_passes() {
    let echo = Echo::default();
    let calls = echo.calls.clone();
    // Eleven and twelve tokens have the same length; eight have a shorter one.
    let items = [(8, 1), (12, 1), (11, 3), (12, 2), (8, 1), (12, 1), (12, 1)];
    let items = items.map(|(tokens, steps)| item_of(1.0, tokens, steps));
    let (_, times) = pipeline(echo).run(&items).unwrap();
    assert_eq!(times.bucket, 8);
    let expected = [
        (Stage::Root, 8, 0),
        (Stage::Pose, 2, 9),
        (Stage::Decoder, 2, 9),
        (Stage::Pose, 6, 12),
        (Stage::Pose, 2, 12),
        (Stage::Pose, 1, 12),
        (Stage::Decoder, 6, 12),
    ];
    assert_eq!(*calls.lock().unwrap(), expected);
}

#[test]
fn values_of_a_failed_batch_reach_no_later_call() {
    let mut pipeline = pipeline(Echo {
        any_batch: true,
        ..Echo::default()
    });
    for row in 0..8 {
        pipeline.token_input.tokens.fill_row(row, DIMS.codes as i64);
    }
    // The engine asserts this for the rows that it may read.
    pipeline.run(&vec![item_of(1.0, 10, 1); 3]).unwrap();
}

#[test]
fn an_engine_that_takes_any_batch_gets_no_padding() {
    let echo = Echo {
        any_batch: true,
        ..Echo::default()
    };
    let calls = echo.calls.clone();
    let mut pipeline = pipeline(echo);
    pipeline.warm_up().unwrap();
    let sizes: Vec<usize> = calls.lock().unwrap().drain(..).map(|call| call.1).collect();
    assert!(
        sizes.iter().all(|&rows| rows == 8 || rows == 1) && sizes[0] == 8,
        "{sizes:?}"
    );
    let (_, times) = pipeline.run(&vec![item_of(1.0, 10, 1); 7]).unwrap();
    assert_eq!(times.bucket, 7);
    let expected = [Stage::Root, Stage::Pose, Stage::Decoder];
    let calls = calls.lock().unwrap();
    assert_eq!(
        calls.iter().map(|call| (call.0, call.1)).collect::<Vec<_>>(),
        expected.map(|stage| (stage, 7))
    );
}

#[test]
fn a_character_alone_and_in_a_batch_is_the_same() {
    let mut pipeline = pipeline(Echo::default());
    let items: Vec<KeyframeTask> = [
        (1.0, 3),
        (2.0, 16),
        (3.0, 9),
        (4.0, 11),
        (5.0, 12),
        (6.0, 9),
        (7.0, 15),
    ]
    .into_iter()
    .map(|(mark, tokens)| item_of(mark, tokens, 1 + mark as u32 % 3))
    .collect();
    let together = run(&mut pipeline, &items);
    for (item, together) in items.iter().zip(together) {
        // The toy decoder writes the call's token count into the contacts.
        assert_eq!(run(&mut pipeline, std::slice::from_ref(item)), [together]);
    }
}

#[test]
fn the_stages_behind_the_root_see_the_guided_trajectory() {
    let mut guided = item(3.0, 1);
    guided.root_guide = Some(RootGuide {
        path: vec![[4.0, 9.0, 3.0, 0.0]; 24].into(),
        position_ratio: 1.0,
        height_ratio: 0.0,
        heading_ratio: 1.0,
    });
    let motions = run(&mut pipeline(Echo::default()), &[guided, item(3.0, 1)]);
    for (motion, x) in motions.into_iter().zip([4.0, 3.0]) {
        let trace = motion.trace.as_deref().unwrap();
        assert_eq!(trace.root_r_g3, [3.0; 24 * 5]);
        assert_eq!(trace.tokens, [x as u32; 12]);
        for (frame, root) in motion.root.chunks(5).enumerate() {
            assert_eq!(root[..3], [if frame < 4 { 3.0 } else { x }, 3.0, 3.0]);
        }
    }
}

#[test]
fn the_decoder_alone_sees_an_overridden_root() {
    let mut bent = item(3.0, 2);
    let key = RootKey {
        frame: 10,
        ground: Some([4.0, 1.0]),
        ..RootKey::default()
    };
    bent.root_override = Some(RootOverride::new([key], DIMS.context_frames - 1));
    let items = [item(3.0, 1), bent.clone(), item(3.0, 2)];
    let motions = run(&mut pipeline(Echo::default()), &items);
    assert_eq!(run(&mut pipeline(Echo::default()), &[bent]), motions[1..2]);
    for motion in &motions {
        let trace = motion.trace.as_deref().unwrap();
        assert_eq!(trace.root_r_g3, [3.0; 24 * 5]);
        assert_eq!(trace.tokens, [3; 12], "tokens of the predicted root");
    }
    // The toy decoder writes the end of its root into the rotations, and answers the roots of its
    // input.
    assert_eq!(motions[0].rotations, [3.0; 24 * 12]);
    assert_eq!(motions[1].rotations, [4.0; 24 * 12]);
    let root = |frame: usize| &motions[1].root[frame * 5..][..3];
    assert_eq!(root(3), [3.0; 3]);
    assert_eq!(
        (root(10), root(23)),
        ([4.0, 3.0, 1.0].as_slice(), [4.0, 3.0, 1.0].as_slice())
    );
    assert!(root(7)[0] > 3.5 && root(7)[0] < 4.0);
}

#[test]
fn the_root_stage_gets_noise_that_follows_seed_and_temperature() {
    let dims = Dims {
        root_choices: 6,
        ..DIMS
    };
    let noise_of = |items: &[KeyframeTask]| {
        let echo = Echo::default();
        let noise = echo.root_noise.clone();
        let mut pipeline = Pipeline::new(dims, Box::new(echo), 8);
        // Values that were in these rows before must not remain.
        pipeline.run(&vec![drawn(9, 2.0); 8]).unwrap();
        noise.lock().unwrap().clear();
        pipeline.run(items).unwrap();
        noise.lock().unwrap().clone()
    };
    let together = noise_of(&[
        drawn(1, 1.0),
        drawn(2, 1.0),
        drawn(1, 0.0),
        drawn(1, 0.5),
        drawn(1, 1.0),
    ]);
    assert_eq!(together.len(), 6, "a row of padding");
    let [one, two, likeliest, half, again, padding] = &together[..] else {
        unreachable!()
    };
    assert!(one.iter().all(|&value| value != 0.0) && one != two);
    assert_eq!((one.len(), one), (6, again));
    assert_eq!((likeliest, padding), (&vec![0.0; 6], &vec![0.0; 6]));
    assert_eq!(*half, one.iter().map(|value| 0.5 * value).collect::<Vec<_>>());
    assert_eq!(
        noise_of(&[drawn(2, 1.0)]),
        std::slice::from_ref(two),
        "alone and in a batch"
    );
}

#[test]
fn a_root_stage_without_choices_gets_no_noise() {
    let echo = Echo::default();
    let noise = echo.root_noise.clone();
    pipeline(echo).run(&[drawn(1, 1.0)]).unwrap();
    assert_eq!(*noise.lock().unwrap(), [Vec::<f32>::new()]);
}

fn drawn(seed: u64, temperature: f32) -> KeyframeTask {
    KeyframeTask {
        seed,
        temperature,
        ..item(1.0, 1)
    }
}

#[test]
fn invalid_outputs_fail_their_own_row_only() {
    // The engine spoils row 0: the first item in the root stage, and the item with the most passes
    // behind it.
    let items = [(1.0, 1), (2.0, 3), (3.0, 2)].map(|(mark, steps)| item_of(mark, 5, steps));
    let good = run(&mut pipeline(Echo::default()), &items);
    for (stage, bad, says) in [
        (Stage::Root, 0, "trajectory that is not finite"),
        (Stage::Pose, 1, "logits that are not finite"),
    ] {
        let mut pipeline = pipeline(Echo {
            break_stage: Some(stage),
            ..Echo::default()
        });
        let (answers, _) = pipeline.run(&items).unwrap();
        let error = answers[bad].as_ref().unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
        for row in (0..3).filter(|&row| row != bad) {
            let motion = answers[row].as_ref().unwrap();
            assert_eq!(motion.rotations, good[row].rotations, "{stage:?}");
            assert_eq!(motion.trace, good[row].trace, "{stage:?}");
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

#[test]
fn a_pack_whose_networks_give_values_that_are_not_finite_fails_warm_up() {
    for (stage, name) in [(Stage::Root, "root"), (Stage::Pose, "pose")] {
        let error = pipeline(Echo {
            break_stage: Some(stage),
            ..Echo::default()
        })
        .warm_up()
        .unwrap_err()
        .to_string();
        assert!(error.contains(name) && error.contains("not finite"), "{error}");
    }
}
