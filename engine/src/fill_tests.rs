use std::f32::consts::PI;

use troupe_motion::model::{GapPose, RootGuide};
use troupe_motion::root::wrap_angle;

use super::*;

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
    root_choices: 0,
};

fn key(mark: f32) -> KeyTensors {
    KeyTensors {
        local_root: None,
        global_root: Some([mark; 5]),
        pose: Some(vec![mark; 9].into()),
    }
}

fn item(targets: usize, frames: Option<usize>) -> KeyframeTask {
    KeyframeTask {
        context: (0..4).map(|frame| key(1.0 + frame as f32)).collect(),
        targets: (0..targets).map(|target| key(11.0 + target as f32)).collect(),
        frames,
        allowed_counts: vec![true; DIMS.counts()],
        seed: 0,
        temperature: 0.0,
        pose_steps: 1,
        root_guide: None,
        root_override: None,
        gap_poses: Vec::new(),
    }
}

fn root_slots(item: &KeyframeTask) -> Vec<f32> {
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
    // 13 frames take 4 tokens (16 frames), so frame 12 is the first of the last four.
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
    let mut input = TokenInput::new(&DIMS, 1);
    item(2, Some(14)).fill_token_input(&DIMS, 0, 4, &[0.0; 320], &mut input);
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

/// A trajectory of `frames` frames along +X at 1 m/s, with the given heading, bobbing.
fn trajectory(frames: usize, heading: f32) -> Vec<f32> {
    (0..frames)
        .flat_map(|frame| {
            let t = frame as f32 / 30.0;
            [t, 0.9 + 0.1 * t, 0.5, heading.cos(), heading.sin()]
        })
        .collect()
}

/// The root that the pose stage gets, one a frame: x, y, z, heading. The path is at height 2.
fn guided(path: &[[f32; 3]], ratio: f32, heading: f32) -> Vec<[f32; 4]> {
    guided_by(path, [ratio, 0.0, ratio], heading)
}

/// The same, with separate ratios for place, height and heading.
fn guided_by(path: &[[f32; 3]], ratios: [f32; 3], heading: f32) -> Vec<[f32; 4]> {
    let mut item = item(1, None);
    item.root_guide = Some(RootGuide {
        path: path.iter().map(|&[x, z, heading]| [x, 2.0, z, heading]).collect(),
        position_ratio: ratios[0],
        height_ratio: ratios[1],
        heading_ratio: ratios[2],
    });
    let mut input = TokenInput::new(&DIMS, 1);
    input.set_length(&DIMS, 5);
    item.fill_token_input(&DIMS, 0, 4, &trajectory(64, heading), &mut input);
    let roots = input.global_root.row(0);
    assert_eq!(roots[16 * 5..], [0.0, 0.0, 0.0, 1.0, 0.0].repeat(4));
    let frames = roots.chunks(5).take(16);
    frames
        .map(|root| [root[0], root[1], root[2], root[4].atan2(root[3])])
        .collect()
}

fn assert_near(a: [f32; 4], b: [f32; 4]) {
    let near = (0..3).all(|axis| (a[axis] - b[axis]).abs() < 1e-5) && wrap_angle(a[3] - b[3]).abs() < 1e-5;
    assert!(near, "{a:?} is not {b:?}");
}

#[test]
fn a_guide_of_ratio_zero_changes_no_bit() {
    let path = [[7.0, -3.0, 2.0]; 16];
    assert_eq!(guided(&path, 0.0, 0.4), guided(&[], 1.0, 0.4));
}

#[test]
fn a_guide_of_ratio_one_takes_place_and_heading_after_the_context() {
    let path: Vec<[f32; 3]> = (0..16).map(|frame| [0.1 * frame as f32, 2.0, -0.2]).collect();
    let (free, guided) = (guided(&[], 1.0, 0.4), guided(&path, 1.0, 0.4));
    assert_eq!(free[..4], guided[..4]);
    for frame in 4..16 {
        let [x, z, heading] = path[frame];
        assert_near(guided[frame], [x, free[frame][1], z, heading]);
    }
}

#[test]
fn a_guide_turns_over_the_shorter_arc_and_may_overshoot() {
    let path = [[0.0, 0.0, -PI + 0.3]; 16];
    let halfway = guided(&path, 0.5, PI - 0.1);
    assert_near(halfway[9], [0.5 * 0.3, 0.93, 0.25, PI + 0.1]);
    let beyond = guided(&path, 1.2, PI - 0.1);
    assert_near(beyond[9], [-0.2 * 0.3, 0.93, -0.1, PI + 0.38]);
    // Whole turns do not count.
    let wound = guided(&[[0.0, 0.0, 5.0 * PI + 0.3]; 16], 0.5, PI - 0.1);
    assert_near(wound[9], halfway[9]);
}

#[test]
fn frames_beyond_the_guide_keep_its_last_shift() {
    let path: Vec<[f32; 3]> = (0..8).map(|frame| [frame as f32 / 30.0, 1.5, 0.9]).collect();
    for (frame, root) in guided(&path, 0.5, 0.4).into_iter().enumerate().skip(4) {
        let t = frame as f32 / 30.0;
        assert_near(root, [t, 0.9 + 0.1 * t, 1.0, 0.65]);
    }
    // A guide with only context frames moves nothing.
    assert_eq!(guided(&path[..4], 1.0, 0.4), guided(&[], 1.0, 0.4));
}

#[test]
fn poses_in_the_gap_are_scattered_too() {
    let mut input = TokenInput::new(&DIMS, 1);
    let gap = |frame, mark: f32| GapPose {
        frame,
        pose: vec![mark; 9].into(),
    };
    let item = KeyframeTask {
        gap_poses: vec![gap(3, 21.0), gap(7, 22.0), gap(14, 23.0), gap(900, 24.0)],
        ..item(1, Some(14))
    };
    assert_eq!(root_slots(&item), [1.0, 2.0, 3.0, 4.0, 0.0, 11.0, 0.0, 0.0]);
    input.set_length(&DIMS, 4);
    item.fill_token_input(&DIMS, 0, 4, &trajectory(64, 0.0), &mut input);
    let at = |frame: usize| (input.frame_pose.row(0)[frame * 9], input.frame_mask.row(0)[frame]);
    assert_eq!(at(7), (22.0, 1.0));
    assert_eq!((at(3).0, at(13).0), (4.0, 11.0), "context and targets replace it");
    assert_eq!(at(14), (0.0, 0.0), "after the segment");
    assert_eq!(input.frame_mask.row(0).iter().sum::<f32>(), 6.0);
}

#[test]
fn a_guide_has_separate_ratios_for_place_height_and_heading() {
    let path: Vec<[f32; 3]> = (0..16).map(|frame| [frame as f32, 4.0, 0.5]).collect();
    let by = |ratios| guided_by(&path, ratios, 0.4);
    let (places, headings) = (by([0.5, 0.0, 0.0]), by([0.0, 0.0, 1.0]));
    let t = 6.0 / 30.0;
    let heights = by([0.0, 0.5, 0.0]);
    assert_near(heights[6], [t, 0.5 * (2.9 + 0.1 * t), 0.5, 0.4]);
    assert_near(places[6], [0.5 * (6.0 + t), 0.9 + 0.1 * t, 2.25, 0.4]);
    assert_near(headings[6], [t, 0.9 + 0.1 * t, 0.5, 0.5]);
}
