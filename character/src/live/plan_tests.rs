use std::f32::consts::FRAC_PI_2;

use troupe_motion::rotation::{angle_between, six_d};

use super::*;
use crate::primitives::{Guide, PlanTargets};
use crate::testing::toy_rig;

/// Ten metres from the origin, facing the world's +X.
const FRAME: SegmentFrame = SegmentFrame {
    origin: Vec3::new(10.0, 0.0, 0.0),
    heading: FRAC_PI_2,
};

/// Walks along the segment's +Z at 0.1 m a frame, 5 cm to its left and 3 cm too low, with heading
/// 0.2 rad and foot 0.3 rad.
fn raw() -> Motion {
    let root = |frame: usize| [0.05, 0.87, 0.1 * (frame as f32 - 3.0), 0.2f32.cos(), 0.2f32.sin()];
    let pose = |_| {
        let pelvis = yaw(0.2);
        let foot = pelvis * Quat::from_rotation_x(0.3);
        six_d(pelvis).into_iter().chain(six_d(foot))
    };
    Motion {
        root: (0..28).flat_map(root).collect(),
        rotations: (0..28).flat_map(pose).collect(),
        contacts: (0..28).map(|frame| if frame < 10 { 0.6 } else { 0.4 }).collect(),
        trace: Some(Box::new(troupe_motion::model::Trace {
            num_tokens: 7,
            count_probs: vec![0.0; 14],
            root_r_g3: (0..28).flat_map(root).collect(),
            tokens: vec![1; 14],
        })),
    }
}

/// The context walks along the world's +X at 0.1 m a frame, facing that way, with a straight foot.
fn shape(frames: Option<usize>) -> LiveShape {
    LiveShape {
        frame: FRAME,
        context_roots: std::array::from_fn(|frame| Vec3::new(9.7 + 0.1 * frame as f32, 0.9, 0.0)),
        context_rotations: [yaw(FRAC_PI_2), Quat::IDENTITY].repeat(4),
        targets: PlanTargets {
            targets: Vec::new(),
            gap_poses: Vec::new(),
            frames,
            allowed_token_counts: Vec::new(),
            guide: None,
            follow: None,
            r_g1: GlobalRoot::new(Vec3::ZERO, 0.0),
            r_g2: Vec::new(),
            path: None,
            unfinished: false,
            gaits: Vec::new(),
        },
    }
}

#[test]
fn the_plan_goes_on_from_its_context() {
    let shape = shape(Some(26));
    let plan = finish_live(&raw(), &shape, &toy_rig()).unwrap();
    assert_eq!(
        (plan.roots.len(), plan.rotations.len(), plan.contacts.len()),
        (26, 52, 26)
    );
    assert_eq!(plan.roots[..4], shape.context_roots);
    assert_eq!(plan.rotations[..8], shape.context_rotations);
    for frame in 4..26 {
        // The path moves as a whole; heights return to the networks' own.
        let lacking = if frame < 11 {
            0.9 - plan.roots[frame].y
        } else {
            0.03
        };
        assert!((0.0..0.0301).contains(&lacking));
        let want = Vec3::new(10.0 + 0.1 * (frame as f32 - 3.0), 0.9 - lacking, 0.0);
        assert!(
            plan.roots[frame].abs_diff_eq(want, 1e-5),
            "{:?} is not {want:?}",
            plan.roots[frame]
        );
        // Headings turn as a whole; the foot returns to the networks' own.
        assert!(angle_between(plan.rotations[frame * 2], yaw(FRAC_PI_2)) < 1e-4);
        let foot = angle_between(plan.rotations[frame * 2 + 1], Quat::IDENTITY);
        let t = ((frame - 3) as f32 / 8.0).min(1.0);
        assert!((foot - 0.3 * t * t * (3.0 - 2.0 * t)).abs() < 1e-4);
    }
    assert_eq!(plan.contacts[..10], [1; 10]);
    assert_eq!(plan.contacts[10..], [0; 16]);
}

#[test]
fn the_trace_shows_the_networks_own_motion() {
    let plan = finish_live(&raw(), &shape(None), &toy_rig()).unwrap();
    assert_eq!(plan.roots.len(), 28, "every frame that was made");
    let trace = plan.trace;
    assert_eq!(
        (trace.r_g3.len(), trace.tokens.len(), trace.count_probs.len()),
        (28, 14, 14)
    );
    assert_eq!(trace.r_g3, trace.r_g4);
    // Left of the segment is -Z of the world here.
    assert!(
        trace.r_g4[13]
            .position
            .abs_diff_eq(Vec3::new(11.0, 0.87, -0.05), 1e-5)
    );
    assert!((trace.r_g4[13].heading - FRAC_PI_2 - 0.2).abs() < 1e-5);
}

#[test]
fn a_plan_cannot_have_more_frames_than_were_made() {
    let plan = finish_live(&raw(), &shape(Some(60)), &toy_rig()).unwrap();
    assert_eq!(plan.roots.len(), 28);
}

#[test]
fn numbers_that_are_not_finite_are_refused() {
    let mut raw = raw();
    raw.root[77] = f32::NAN;
    assert_eq!(finish_live(&raw, &shape(None), &toy_rig()), Err(NonFinite));
}

#[test]
fn a_followed_gait_brings_its_own_contacts() {
    let mut shape = shape(Some(26));
    let path = |frame: usize| GlobalRoot::new(Vec3::new(10.0, 0.83, 0.05 * frame as f32), 0.0);
    shape.targets.guide = Some(Guide {
        path: (0..26).map(path).collect(),
        position_ratio: 0.0,
        height_ratio: 1.0,
        heading_ratio: 1.0,
    });
    shape.targets.follow = Some(Follow {
        rotations: [yaw(FRAC_PI_2), Quat::from_rotation_x(0.4)].repeat(26),
        weights: (0..26).map(|frame| if frame < 15 { 0.0 } else { 1.0 }).collect(),
    });
    let usual = LiveShape {
        targets: PlanTargets {
            follow: None,
            ..shape.targets.clone()
        },
        ..shape.clone()
    };
    let rig = toy_rig();
    let (plan, usual) = (
        finish_live(&raw(), &shape, &rig).unwrap(),
        finish_live(&raw(), &usual, &rig).unwrap(),
    );
    assert_eq!(plan.roots[..15], usual.roots[..15]);
    assert_eq!(plan.contacts[..15], usual.contacts[..15]);
    assert!(
        usual.contacts[16..].iter().all(|&bits| bits == 0),
        "the networks see the foot up"
    );
    for frame in 15..26 {
        assert!(plan.roots[frame].abs_diff_eq(path(frame).position, 1e-5));
        assert!(angle_between(plan.rotations[frame * 2 + 1], Quat::from_rotation_x(0.4)) < 1e-3);
    }
    // The foot is 3 cm over the ground and moves at 1.5 m/s: no contact either.
    assert!(plan.contacts[16..].iter().all(|&bits| bits == 0));
}
