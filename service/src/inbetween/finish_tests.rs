use std::f32::consts::FRAC_PI_2;

use troupe_motion::rotation::six_d;

use super::*;
use troupe_character::testing::toy_rig;

/// Walks along the segment's +Z at 0.1 m a frame with an upright pose, and turns by `turn` a frame.
fn raw(tokens: usize, turn: f32) -> Motion {
    let frames = tokens * 4;
    let root = |frame: usize| {
        let heading = turn * frame as f32;
        [0.0, 0.9, 0.1 * (frame as f32 - 3.0), heading.cos(), heading.sin()]
    };
    let pose = |frame: usize| {
        let pelvis = six_d(Quat::from_rotation_y(turn * frame as f32));
        let foot = six_d(Quat::from_rotation_y(turn * frame as f32) * Quat::from_rotation_x(0.2));
        pelvis.into_iter().chain(foot)
    };
    Motion {
        root: (0..frames).flat_map(root).collect(),
        rotations: (0..frames).flat_map(pose).collect(),
        contacts: vec![1.5; frames],
        trace: Some(Box::new(troupe_motion::model::Trace {
            num_tokens: tokens,
            count_probs: vec![0.5; 14],
            root_r_g3: (0..frames).flat_map(root).collect(),
            tokens: vec![1; tokens * 2],
        })),
    }
}

fn plan(frames: Option<usize>, target_roots: Vec<Option<GlobalRoot>>) -> Plan {
    Plan {
        id: "me".into(),
        frame: SegmentFrame {
            origin: Vec3::new(5.0, 0.0, 2.0),
            heading: FRAC_PI_2,
        },
        frames,
        most_frames: 64,
        size: Default::default(),
        strict: false,
        context: Vec::new(),
        targets: target_roots
            .into_iter()
            .map(|root| Given {
                root,
                ..Given::default()
            })
            .collect(),
        root: None,
        hold_feet: true,
        extras: ExtraOutputs {
            intermediates: true,
            positions: true,
            ..ExtraOutputs::default()
        },
    }
}

fn assert_near(actual: &[f32], expected: &[f32]) {
    assert_eq!(actual.len(), expected.len());
    for (a, b) in actual.iter().zip(expected) {
        assert!((a - b).abs() < 1e-4, "{actual:?} is not {expected:?}");
    }
}

#[test]
fn frames_are_in_the_world_and_parent_relative() {
    let result = finish(&raw(3, 0.0), &plan(None, vec![None]), &toy_rig()).unwrap();
    let frames = result.frames.unwrap();
    assert_eq!((result.id.as_str(), frames.frame_count), ("me", 12));
    // The segment's +Z is the world's +X.
    assert_near(&frames.root_positions[..3], &[4.7, 0.9, 2.0]);
    assert_near(&frames.root_positions[33..], &[5.8, 0.9, 2.0]);
    let turned = Quat::from_rotation_y(FRAC_PI_2);
    let foot = Quat::from_rotation_x(0.2);
    let expected = [
        turned.w, turned.x, turned.y, turned.z, foot.w, foot.x, foot.y, foot.z,
    ];
    assert_near(&frames.rotations[88..], &expected);
    assert_near(&frames.positions[..6], &[4.7, 0.9, 2.0, 4.7, 0.1, 2.0]);
    assert_eq!(frames.positions.len(), 12 * 2 * 3);
    assert_eq!(frames.contacts, vec![1.0; 12]);
}

#[test]
fn the_root_is_pinned_to_the_targets() {
    let target = GlobalRoot::new(Vec3::new(0.3, 0.8, 1.5), 0.4);
    let at = |frame: usize| Given {
        root: Some(GlobalRoot::new(
            Vec3::new(0.0, 0.9, 0.1 * (frame as f32 - 3.0)),
            0.0,
        )),
        ..Given::default()
    };
    let plan = Plan {
        context: (0..4).map(at).collect(),
        ..plan(Some(14), vec![None, Some(target)])
    };
    let result = finish(&raw(4, 0.0), &plan, &toy_rig()).unwrap();
    let frames = result.frames.unwrap();
    assert_eq!(frames.frame_count, 14);
    assert_near(&frames.root_positions[39..], &[6.5, 0.8, 1.7]);
    let pelvis = Quat::from_rotation_y(FRAC_PI_2 + 0.4);
    assert_near(
        &frames.rotations[13 * 8..13 * 8 + 4],
        &[pelvis.w, pelvis.x, pelvis.y, pelvis.z],
    );
    // The context is met already and stays.
    assert_near(&frames.root_positions[9..12], &[5.0, 0.9, 2.0]);
    // The intermediates are the model's own, and cover the whole tokens.
    let stages = result.intermediates.unwrap();
    assert_eq!((stages.predicted_frame_count, stages.tokens.len()), (16, 8));
    assert_near(&stages.root_r_g4[13 * 5..14 * 5], &[6.0, 0.9, 2.0, 0.0, 1.0]);
    assert_eq!(stages.root_r_g3, stages.root_r_g4);
}

#[test]
fn given_roots_are_met_in_their_frames() {
    use crate::inbetween::GivenRoot;
    use troupe_motion::model::{RootKey, RootOverride};
    let target = GlobalRoot::new(Vec3::new(0.3, 0.8, 1.5), 0.4);
    let keys = [
        RootKey {
            frame: 8,
            ground: Some([0.25, 0.6]),
            height: None,
            heading: Some(-0.3),
        },
        RootKey::whole(15, target),
    ];
    let over = RootOverride::new(keys, 3);
    let plan = Plan {
        root: Some(GivenRoot {
            over,
            frames: vec![8],
        }),
        ..plan(Some(16), vec![Some(target)])
    };
    let frames = finish(&raw(4, 0.0), &plan, &toy_rig()).unwrap().frames.unwrap();
    // The segment's +Z is the world's +X, and its +X the world's -Z. The height is the network's,
    // on its way to the target's.
    let place = |frame: usize| &frames.root_positions[frame * 3..][..3];
    assert_near(&[place(8)[0], place(8)[2]], &[5.6, 1.75]);
    assert!(place(8)[1] < 0.9 && place(8)[1] > 0.8, "{}", place(8)[1]);
    assert_near(place(15), &[6.5, 0.8, 1.7]);
    for (frame, heading) in [(8, -0.3), (15, 0.4)] {
        let pelvis = Quat::from_rotation_y(FRAC_PI_2 + heading);
        let expected = [pelvis.w, pelvis.x, pelvis.y, pelvis.z];
        assert_near(&frames.rotations[frame * 8..][..4], &expected);
    }
}

#[test]
fn a_height_without_a_root_is_met_where_the_root_is() {
    let targets = vec![
        Given {
            root: Some(GlobalRoot::new(Vec3::new(0.3, 0.8, 0.8), 0.4)),
            height: Some(0.8),
            ..Given::default()
        },
        Given {
            height: Some(0.7),
            ..Given::default()
        },
    ];
    let plan = Plan {
        targets,
        ..plan(None, Vec::new())
    };
    let frames = finish(&raw(3, 0.0), &plan, &toy_rig()).unwrap().frames.unwrap();
    // Segment (0.3, 0.8, 0.8), and the last frame goes on from there: the model makes 0.1 m of way
    // along +Z.
    assert_near(&frames.root_positions[30..33], &[5.8, 0.8, 1.7]);
    assert_near(&frames.root_positions[33..], &[5.9, 0.7, 1.7]);
}

#[test]
fn every_keyframe_is_met_exactly() {
    let pose = |angle| {
        Some(vec![
            Quat::from_rotation_y(angle),
            Quat::from_rotation_x(2.0 * angle),
        ])
    };
    let key = |frame: usize, angle| Given {
        root: Some(GlobalRoot::new(
            Vec3::new(0.01, 0.91, 0.1 * (frame as f32 - 3.0)),
            angle,
        )),
        rotations: pose(angle),
        ..Given::default()
    };
    let plan = Plan {
        context: (0..4).map(|frame| key(frame, 0.05)).collect(),
        targets: vec![key(26, -0.1), key(27, -0.12)],
        ..plan(Some(28), Vec::new())
    };
    let frames = finish(&raw(7, 0.0), &plan, &toy_rig()).unwrap().frames.unwrap();
    let keys = plan.context.iter().zip(0..).chain(plan.targets.iter().zip(26..));
    for (key, frame) in keys {
        let (root, rotations) = (key.root.unwrap(), key.rotations.as_ref().unwrap());
        let at = plan.frame.to_world_position(root.position);
        assert_near(&frames.root_positions[frame * 3..][..3], &at.to_array());
        for (joint, given) in rotations.iter().enumerate() {
            let given = if joint == 0 {
                plan.frame.to_world_rotation(*given)
            } else {
                *given
            };
            let made = &frames.rotations[(frame * 2 + joint) * 4..][..4];
            let made = Quat::from_xyzw(made[1], made[2], made[3], made[0]);
            assert!(made.dot(given).abs() > 1.0 - 1e-5, "frame {frame} joint {joint}");
        }
    }
    // The middle of the gap is the model's own pose.
    let foot = Quat::from_rotation_x(0.2);
    assert_near(
        &frames.rotations[(15 * 2 + 1) * 4..][..4],
        &[foot.w, foot.x, foot.y, foot.z],
    );
}

#[test]
fn quaternions_do_not_change_hemisphere() {
    let frames = finish(&raw(16, 0.3), &plan(None, vec![None]), &toy_rig())
        .unwrap()
        .frames
        .unwrap();
    let pelvis: Vec<&[f32]> = frames.rotations.chunks(8).map(|pose| &pose[..4]).collect();
    for pair in pelvis.windows(2) {
        let dot: f32 = pair[0].iter().zip(pair[1]).map(|(a, b)| a * b).sum();
        assert!(dot > 0.9, "{pair:?}");
    }
}

#[test]
fn only_what_was_asked_for_comes_back() {
    let plan = Plan {
        extras: ExtraOutputs::default(),
        ..plan(None, vec![None])
    };
    let result = finish(&raw(3, 0.0), &plan, &toy_rig()).unwrap();
    assert!(result.intermediates.is_none() && result.frames.unwrap().positions.is_empty());
}

#[test]
fn frames_that_are_not_finite_are_refused() {
    for spoil in [
        |raw: &mut Motion| raw.rotations[7] = f32::NAN,
        |raw: &mut Motion| raw.root[2] = f32::INFINITY,
        |raw: &mut Motion| raw.contacts[0] = f32::NAN,
        |raw: &mut Motion| raw.trace.as_mut().unwrap().count_probs[0] = f32::NAN,
        |raw: &mut Motion| raw.trace.as_mut().unwrap().root_r_g3[1] = f32::NAN,
    ] {
        let mut raw = raw(3, 0.0);
        spoil(&mut raw);
        assert_eq!(finish(&raw, &plan(None, vec![None]), &toy_rig()), Err(NonFinite));
    }
}
