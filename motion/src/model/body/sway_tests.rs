use std::sync::Arc;

use proptest::prelude::*;

use super::*;
use crate::model::{Body, Dims, InlineJoint, InlineSkeleton};
use crate::testing::biped;

const FPS: f32 = 30.0;
const RATE_HZ: f32 = 0.9;
const DIMS: Dims = Dims {
    joints: 0,
    contacts: 0,
    heads: 0,
    codes: 0,
    min_tokens: 5,
    max_tokens: 17,
    frames_per_token: 4,
    context_frames: 4,
    max_targets: 4,
    root_choices: 0,
};
/// Toes of the biped.
const FEET: [usize; 2] = [4, 7];

fn words() -> Vec<String> {
    ["walk", "run"].map(str::to_owned).to_vec()
}

/// The sway of `walk` is 3 cm to the side, 2 cm ahead and 0.1 rad; that of any other word a tenth
/// of it.
fn doc() -> SwayDoc {
    let gait = |word: Option<&str>, size: f32| GaitDoc {
        word: word.map(str::to_owned),
        speeds_mps: vec![0.6, 1.2],
        rates_hz: vec![RATE_HZ; 2],
        left_m: vec![[0.0, 0.03 * size, 0.0, 0.0]; 2],
        ahead_m: vec![[0.0, 0.0, 0.0, 0.02 * size]; 2],
        heading_rad: vec![[0.1 * size, 0.0, 0.0, 0.0]; 2],
        stride_m: vec![[0.5, 0.0, 0.0, 0.0]; 2],
    };
    SwayDoc {
        feet: FEET.map(|foot| biped().joints[foot].name.clone()),
        gaits: vec![gait(None, 0.1), gait(Some("walk"), 1.0)],
    }
}

fn sway() -> Sway {
    Sway::new(doc(), &biped(), &words()).unwrap()
}

fn body() -> Arc<Body> {
    let skeleton = biped();
    let name = |joint: usize| skeleton.joints[joint].name.clone();
    let joints = skeleton.joints.iter().map(|joint| InlineJoint {
        name: joint.name.clone(),
        parent: joint.parent.map(name).unwrap_or_default(),
        offset_m: joint.offset_m,
    });
    let skeleton = InlineSkeleton {
        joints: joints.collect(),
        ..InlineSkeleton::default()
    };
    Arc::new(skeleton.body("mine", FPS, &DIMS, &mut Vec::new()).unwrap())
}

fn task(path: Vec<[f32; 3]>) -> PathTask {
    PathTask {
        body: body(),
        context: Vec::new(),
        targets: Vec::new(),
        path: path.into(),
        sways: true,
        style: vec![1.0, 0.0],
        steps: 4,
        guidance: 1.0,
        seed: 0,
    }
}

/// Along +Z at a speed.
fn line(mps: f32) -> Vec<[f32; 3]> {
    (0..68)
        .map(|frame| [0.0, mps / FPS * frame as f32, 0.0])
        .collect()
}

/// A frame at a place whose feet are so far apart, the left one ahead.
fn key([x, z, heading]: [f32; 3], stride_m: f32) -> KeyTensors {
    let mut pose = vec![0.0; 8 * FEATURES_PER_JOINT];
    for (foot, share) in FEET.into_iter().zip([0.5, -0.5]) {
        pose[foot * FEATURES_PER_JOINT + 2] = share * stride_m;
    }
    KeyTensors {
        local_root: None,
        global_root: Some([x, 0.9, z, heading.cos(), heading.sin()]),
        pose: Some(pose.into()),
    }
}

fn angle(frames: f32) -> f32 {
    TAU * RATE_HZ * frames / FPS
}

#[test]
fn a_drawn_line_sways_once_a_stride_and_hurries_once_a_step() {
    let base = line(1.0);
    let path = sway().path(&task(base.clone()), FPS, 0.5);
    for (frame, (is, was)) in path.iter().zip(&base).enumerate() {
        let phase = 0.5 + angle(frame as f32);
        let want = [0.03 * phase.sin(), 0.02 * (2.0 * phase).sin(), 0.1 * phase.cos()];
        for n in 0..3 {
            assert!((is[n] - was[n] - want[n]).abs() < 1e-4, "frame {frame}: {is:?}");
        }
    }
}

#[test]
fn the_side_is_that_of_the_way() {
    // Along -X the left is +Z.
    let way = |frame: usize| [-(frame as f32) / FPS, 0.0, -TAU / 4.0];
    let base: Vec<[f32; 3]> = (0..68).map(way).collect();
    let path = sway().path(&task(base.clone()), FPS, TAU / 4.0);
    assert!((path[0][1] + 0.03).abs() < 1e-4 || (path[0][1] - 0.03).abs() < 1e-4);
    // Facing +Z the left is +X: turned by -90 degrees it is +Z.
    assert!(path[0][1] > 0.0, "{:?}", path[0]);
}

#[test]
fn slow_bodies_sway_less_and_standing_ones_not() {
    let far = |mps: f32| {
        let path = sway().path(&task(line(mps)), FPS, 0.0);
        path.iter().fold(0.0_f32, |most, point| most.max(point[0].abs()))
    };
    assert!((far(0.6) - 0.03).abs() < 1e-3 && (far(0.3) - 0.015).abs() < 1e-3);
    assert_eq!(far(0.0), 0.0);
}

#[test]
fn bodies_that_go_aside_do_not_sway() {
    let mut base = line(1.0);
    base.iter_mut().for_each(|point| point[2] = 1.2);
    assert_eq!(sway().path(&task(base.clone()), FPS, 0.3)[..], base[..]);
}

#[test]
fn a_style_has_the_gaits_of_its_words() {
    let far = |style: [f32; 2]| {
        let task = PathTask {
            style: style.to_vec(),
            ..task(line(1.0))
        };
        let path = sway().path(&task, FPS, 0.0);
        path.iter().fold(0.0_f32, |most, point| most.max(point[0].abs()))
    };
    // `run` has no gait here, so it counts as any word.
    let any = 0.003;
    assert!((far([0.3, 0.0]) - 0.03).abs() < 1e-3);
    assert!((far([0.0, 1.0]) - any).abs() < 1e-3 && (far([0.0, 0.0]) - any).abs() < 1e-3);
}

#[test]
fn it_goes_on_in_step_with_the_feet_of_the_past_from_their_root() {
    for nth in 0..8 {
        let now = nth as f32 * TAU / 8.0;
        let base = line(1.0);
        let mut task = task(base.clone());
        // The past is 2 cm to the left of where it should be.
        task.context = (0..4)
            .map(|frame| {
                let phase = now + angle(frame as f32 - 3.0);
                let [x, z, _] = base[frame];
                key([x + 0.02, z, 0.0], 0.5 * phase.cos())
            })
            .collect();
        let path = sway().path(&task, FPS, 1.0);
        assert_eq!(path[3][..2], [0.02, base[3][1]], "the root of the past");
        for frame in 20..68 {
            let phase = now + angle(frame as f32 - 3.0);
            let off = path[frame][0] - 0.03 * phase.sin();
            assert!(off.abs() < 2e-3, "phase {nth}, frame {frame}: {off}");
        }
        let steps = path.windows(2).map(|pair| (pair[1][0] - pair[0][0]).abs());
        assert!(steps.fold(0.0, f32::max) < 0.012, "no jump");
    }
}

#[test]
fn given_frames_at_the_end_stay_where_they_are() {
    let base = line(1.0);
    let mut task = task(base.clone());
    task.targets = base[64..].iter().map(|&point| key(point, 0.1)).collect();
    let path = sway().path(&task, FPS, 0.7);
    assert_eq!(path[64..], base[64..]);
    assert!((path[63][0]).abs() < 1e-3 && path[30][0].abs() > 1e-3);
}

#[test]
fn a_short_way_from_a_past_to_targets_begins_without_a_jump() {
    let base = line(1.0)[..20].to_vec();
    let mut task = task(base.clone());
    task.context = base[..4]
        .iter()
        .map(|&[x, z, _]| key([x + 0.03, z, 0.0], 0.5))
        .collect();
    task.targets = base[16..].iter().map(|&point| key(point, 0.1)).collect();
    let path = sway().path(&task, FPS, 0.0);
    assert_eq!(path[16..], base[16..]);
    assert!((path[4][0] - path[3][0]).abs() < 0.008, "{:?}", &path[3..5]);
}

#[test]
fn headings_near_half_a_turn_lead_over_the_short_way() {
    let mut base = line(-1.0);
    base.iter_mut().for_each(|point| point[2] = 3.1);
    let mut task = task(base.clone());
    task.context = base[..4]
        .iter()
        .map(|&[x, z, _]| key([x, z, -3.1], 0.5))
        .collect();
    let path = sway().path(&task, FPS, 0.0);
    let turns = path[3..]
        .windows(2)
        .map(|pair| wrap_angle(pair[1][2] - pair[0][2]).abs());
    assert!(turns.fold(0.0, f32::max) < 0.05);
}

#[test]
fn gaits_are_mixed_by_the_weights_of_a_style() {
    let mut doc = doc();
    let run = GaitDoc {
        word: Some("run".to_owned()),
        left_m: vec![[0.0, 0.01, 0.0, 0.0]; 2],
        ..doc.gaits[1].clone()
    };
    doc.gaits.push(run);
    let sway = Sway::new(doc, &biped(), &words()).unwrap();
    let task = PathTask {
        style: vec![0.25, 0.25],
        ..task(line(1.0))
    };
    assert!((sway.path(&task, FPS, TAU / 4.0)[0][0] - 0.02).abs() < 1e-4);
}

#[test]
fn beyond_its_clips_a_body_strides_faster_and_sways_no_more() {
    let path = sway().path(&task(line(2.4)), FPS, TAU / 4.0);
    let stride = (FPS / RATE_HZ / 2.0_f32.sqrt()).round() as usize;
    assert!((path[0][0] - 0.03).abs() < 1e-4 && (path[stride][0] - 0.03).abs() < 1e-3);
}

#[test]
fn another_body_of_two_legs_sways_by_its_size() {
    let mut like = Arc::unwrap_or_clone(body());
    like.sway = Some(Arc::new(sway()));
    let mut other = Arc::unwrap_or_clone(body());
    (other.size_m, other.sway) = (4.0 * like.size_m, None);
    other.sway_like(&like);
    let large = other.sway.unwrap();
    assert_eq!(large.feet, FEET);
    let path = large.path(&task(line(2.0)), FPS, TAU / 4.0);
    assert!((path[0][0] - 0.12).abs() < 1e-4, "{:?}", path[0]);
    // Half as many strides a second.
    let half = (1.0 / RATE_HZ * FPS).round() as usize;
    assert!((path[half][0] + 0.12).abs() < 1e-3, "{:?}", path[half]);
    // Both feet on one side.
    other.sides = vec![1; 8].into();
    other.sway = None;
    other.sway_like(&like);
    assert_eq!(other.sway, None);
}

#[test]
fn wrong_tables_are_refused_by_field() {
    let refused = |change: &dyn Fn(&mut SwayDoc)| {
        let mut doc = doc();
        change(&mut doc);
        Sway::new(doc, &biped(), &words()).unwrap_err().to_string()
    };
    type Change<'a> = &'a dyn Fn(&mut SwayDoc);
    let cases: [(Change<'_>, &str); 9] = [
        (
            &|doc| doc.feet[1] = "Tail".to_owned(),
            "sway.feet is Tail; allowed: names of joints",
        ),
        (
            &|doc| doc.gaits[1].word = Some("fly".to_owned()),
            "sway.gaits[1].word is fly; allowed: words of the pack",
        ),
        (
            &|doc| doc.gaits[0].rates_hz.clear(),
            "sway.gaits[0].speeds_mps is 2 long; allowed: one or more, as many as in each other list",
        ),
        (
            &|doc| doc.gaits[0].speeds_mps = vec![1.0, 0.5],
            "sway.gaits[0].speeds_mps is [1.0, 0.5]; allowed: rising, more than 0",
        ),
        (
            &|doc| doc.gaits[0].left_m[1][2] = f32::NAN,
            "sway.gaits[0].numbers is NaN; allowed: -100 to 100",
        ),
        (
            &|doc| doc.gaits[0].word = Some("run".to_owned()),
            "sway.gaits is 0 without a word; allowed: one",
        ),
        (
            &|doc| doc.gaits[1].word = None,
            "sway.gaits is 2 without a word; allowed: one",
        ),
        (
            &|doc| doc.feet[0] = doc.feet[1].clone(),
            "sway.feet is one joint; allowed: two joints",
        ),
        (
            &|doc| doc.gaits[1].rates_hz[0] = 0.0,
            "sway.gaits[1].rates_hz is 0; allowed: more than 0",
        ),
    ];
    for (change, message) in cases {
        assert_eq!(refused(change), message);
    }
}

proptest! {
    /// However a path goes, it is followed within the sway and the past's offset.
    #[test]
    fn any_path_stays_near(steps in prop::collection::vec((-0.1_f32..0.1, -0.1_f32..0.1, -0.3_f32..0.3), 68), start in 0.0_f32..TAU) {
        let mut at = [0.0_f32; 3];
        let base: Vec<[f32; 3]> = steps.iter().map(|&(x, z, turn)| {
            at = [at[0] + x, at[1] + z, at[2] + turn];
            at
        }).collect();
        let path = sway().path(&task(base.clone()), FPS, start);
        for (is, was) in path.iter().zip(&base) {
            let off = (is[0] - was[0]).hypot(is[1] - was[1]);
            prop_assert!(off < 0.04 && (is[2] - was[2]).abs() < 0.11);
        }
    }
}
