use std::f32::consts::FRAC_PI_2;

use troupe_motion::LocalRoot;
use troupe_motion::rotation::yaw;

use super::*;
use crate::testing::toy_rig;

const OPTIONS: CharacterOptions = CharacterOptions {
    seed: 7,
    look_ahead_frames: 4,
    replan_interval_frames: None,
    root_ratio: None,
    temperature: 0.5,
};

fn pose(heading: f32, bend: f32) -> Vec<Quat> {
    vec![yaw(heading), Quat::from_rotation_x(bend)]
}

fn context() -> Context {
    Context {
        roots: std::array::from_fn(|frame| Vec3::new(5.0 + 0.1 * frame as f32, 0.9, 2.0)),
        rotations: (0..4)
            .flat_map(|frame| pose(1.2 + 0.1 * frame as f32, 0.2))
            .collect(),
    }
}

fn targets() -> PlanTargets {
    PlanTargets {
        targets: vec![TargetKey {
            root: Some(GlobalRoot::new(Vec3::new(7.0, 0.88, 2.5), 1.0)),
            velocity: Some(LocalRoot {
                vx: 1.5,
                vz: 0.1,
                omega: -0.3,
                height: 0.88,
            }),
            rotations: Some(pose(1.0, -0.4)),
            height_m: None,
        }],
        gap_poses: Vec::new(),
        frames: Some(34),
        allowed_token_counts: Vec::new(),
        guide: None,
        follow: None,
        r_g1: GlobalRoot::new(Vec3::ZERO, 0.0),
        r_g2: Vec::new(),
        path: None,
        unfinished: false,
        gaits: Vec::new(),
    }
}

#[test]
fn guides_and_poses_in_the_gap_go_to_the_segment_frame() {
    let mut context = context();
    for pose in context.rotations.chunks_mut(2) {
        pose[0] = yaw(FRAC_PI_2);
    }
    let path = vec![GlobalRoot::new(Vec3::new(6.3, 0.8, 2.0), FRAC_PI_2 + 0.1); 34];
    let targets = PlanTargets {
        guide: Some(Guide {
            path,
            position_ratio: 0.0,
            height_ratio: 0.7,
            heading_ratio: 1.0,
        }),
        gap_poses: vec![primitives::GapPose {
            frame: 14,
            rotations: pose(FRAC_PI_2, 0.0),
            height_m: 0.9,
        }],
        ..targets()
    };
    let options = CharacterOptions {
        root_ratio: Some(0.4),
        ..OPTIONS
    };
    let (item, shape) = build(&toy_rig(), &options, 0, context, targets);
    let item = item.keyframes().unwrap();
    let guide = item.root_guide.as_ref().unwrap();
    // The segment's origin is at (5.3, 2), and it looks along the world's X.
    for (got, want) in guide.path[20].iter().zip([0.0, 0.8, 1.0, 0.1]) {
        assert!((got - want).abs() < 1e-5, "{:?}", guide.path[20]);
    }
    assert_eq!(
        (guide.position_ratio, guide.height_ratio, guide.heading_ratio),
        (0.4, 0.7, 1.0)
    );
    assert_eq!(shape.targets.guide.unwrap().position_ratio, 0.4);
    let gap = &item.gap_poses[0];
    assert_eq!((item.gap_poses.len(), gap.frame), (1, 14));
    let want = [0.0, 0.9, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    for (got, want) in gap.pose.iter().zip(want) {
        assert!((got - want).abs() < 1e-5, "{:?}", gap.pose);
    }
}

#[test]
fn token_counts_are_those_that_the_primitive_allows() {
    let dims = toy_rig().dims;
    let counts = |frames, allowed: &[u32]| -> Vec<usize> {
        let targets = PlanTargets {
            frames,
            allowed_token_counts: allowed.to_vec(),
            ..targets()
        };
        let allowed = allowed_counts(&dims, &targets);
        (3..=16).zip(allowed).filter(|c| c.1).map(|c| c.0).collect()
    };
    assert_eq!(counts(Some(34), &[3]), [9]);
    assert_eq!(counts(None, &[7, 9, 400]), [7, 9]);
    assert_eq!(counts(None, &[]), (3..=16).collect::<Vec<_>>());
    assert_eq!(counts(None, &[1]), (3..=16).collect::<Vec<_>>(), "at least one");
}

#[test]
fn a_segment_is_never_longer_than_the_pack_allows() {
    let targets = PlanTargets {
        frames: Some(500),
        ..targets()
    };
    let (item, shape) = build(&toy_rig(), &OPTIONS, 0, context(), targets);
    assert_eq!((item.frames(), shape.targets.frames), (Some(64), Some(64)));
}

#[test]
fn every_plan_has_its_own_seed() {
    let mut seeds: Vec<u64> = (0..50)
        .flat_map(|number| [plan_seed(1, number), plan_seed(2, number)])
        .collect();
    assert_eq!(plan_seed(1, 3), seeds[6], "always the same one");
    seeds.sort_unstable();
    seeds.dedup();
    assert_eq!(seeds.len(), 100);
}
