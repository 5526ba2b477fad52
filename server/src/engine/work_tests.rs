use super::*;
use crate::engine::Rows;

const DIMS: Dims = Dims {
    joints: 1,
    contacts: 1,
    heads: 2,
    codes: 5,
    min_tokens: 3,
    max_tokens: 16,
    frames_per_token: 4,
    context_frames: 4,
    max_targets: 4,
};

fn key(mark: f32) -> KeyTensors {
    KeyTensors {
        local_root: None,
        global_root: Some([mark; 5]),
        pose: Some(vec![mark; 9].into()),
    }
}

fn item(targets: usize, frames: Option<usize>) -> WorkItem {
    WorkItem {
        context: (0..4).map(|frame| key(1.0 + frame as f32)).collect(),
        targets: (0..targets).map(|target| key(11.0 + target as f32)).collect(),
        frames,
        allowed_counts: vec![true; DIMS.counts()],
        seed: 0,
        temperature: 0.0,
        pose_steps: 1,
    }
}

fn root_slots(item: &WorkItem) -> Vec<f32> {
    let mut input = RootInput::new(&DIMS, 2);
    input.key_global_root.fill_row(1, 99.0);
    item.fill_root_input(&DIMS, 1, &mut input);
    assert_eq!(input.key_global_root.row(0), [0.0; 40]);
    let marks: Vec<f32> = input
        .key_global_root
        .row(1)
        .chunks(5)
        .map(|slot| slot[0])
        .collect();
    let has: Vec<f32> = marks.iter().map(|&mark| f32::from(mark != 0.0)).collect();
    assert_eq!(input.has_global_root.row(1), has);
    assert_eq!(input.has_pose.row(1), has);
    assert_eq!(input.has_local_root.row(1), [0.0; 8]);
    marks
}

#[test]
fn targets_fill_the_last_slots() {
    assert_eq!(
        root_slots(&item(4, None)),
        [1.0, 2.0, 3.0, 4.0, 11.0, 12.0, 13.0, 14.0]
    );
    assert_eq!(
        root_slots(&item(1, None)),
        [1.0, 2.0, 3.0, 4.0, 0.0, 0.0, 0.0, 11.0]
    );
    assert_eq!(
        root_slots(&item(2, Some(64))),
        [1.0, 2.0, 3.0, 4.0, 0.0, 0.0, 11.0, 12.0]
    );
}

#[test]
fn a_frame_count_between_tokens_moves_targets_and_drops_what_has_no_slot() {
    // 13 frames take 4 tokens (16 frames): frame 12 is the first of the last four.
    assert_eq!(
        root_slots(&item(4, Some(13))),
        [1.0, 2.0, 3.0, 4.0, 14.0, 0.0, 0.0, 0.0]
    );
    assert_eq!(
        root_slots(&item(2, Some(14))),
        [1.0, 2.0, 3.0, 4.0, 11.0, 12.0, 0.0, 0.0]
    );
    assert_eq!(
        root_slots(&item(4, Some(15))),
        [1.0, 2.0, 3.0, 4.0, 12.0, 13.0, 14.0, 0.0]
    );
}

#[test]
fn poses_are_scattered_to_their_frames() {
    let root = RootOutput {
        global_root: Rows::new(1, 320),
        ..RootOutput::new(&DIMS, 1)
    };
    let mut input = TokenInput::new(&DIMS, 1);
    item(2, Some(14)).fill_token_input(&DIMS, 0, 4, &root, &mut input);
    let marked: Vec<(usize, f32)> = input
        .frame_pose
        .row(0)
        .chunks(9)
        .map(|frame| frame[8])
        .enumerate()
        .filter(|frame| frame.1 != 0.0)
        .collect();
    assert_eq!(
        marked,
        [(0, 1.0), (1, 2.0), (2, 3.0), (3, 4.0), (12, 11.0), (13, 12.0)]
    );
    assert_eq!(input.frame_mask.row(0).iter().sum::<f32>(), 6.0);
    assert_eq!(input.tokens.row(0)[..8], [5; 8]);
    assert_eq!(input.tokens.row(0)[8..], [0; 24]);
    assert_eq!(input.num_tokens.row(0), [4]);
}
