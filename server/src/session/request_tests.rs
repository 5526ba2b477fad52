use std::f32::consts::FRAC_PI_2;

use troupe_motion::LocalRoot;
use troupe_motion::rotation::{to_wxyz, yaw};
use troupe_proto::v1;

use super::*;
use crate::inbetween::prepare_tests::toy_pack;
use crate::inbetween::{RequestLimits, prepare};

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
        r_g1: GlobalRoot::new(Vec3::ZERO, 0.0),
        r_g2: Vec::new(),
        unfinished: false,
        gaits: Vec::new(),
    }
}

fn wire(root: Vec3, heading: f32, rotations: &[Quat]) -> v1::Keyframe {
    v1::Keyframe {
        root: Some(v1::Root {
            position: Some(v1::Vec3 {
                x: root.x,
                y: root.y,
                z: root.z,
            }),
            heading: Some(heading),
        }),
        velocity: None,
        qpos: Vec::new(),
        pose: Some(v1::Pose {
            rotations: rotations.iter().copied().flat_map(to_wxyz).collect(),
            root_height: None,
        }),
    }
}

#[test]
fn a_live_plan_asks_as_a_single_request_would() {
    let (pack, context, targets) = (toy_pack(), context(), targets());
    let (item, shape) = build(&pack, &OPTIONS, 3, context.clone(), targets.clone());
    let keys = context.roots.iter().zip(context.rotations.chunks(2));
    let mut target = wire(Vec3::new(7.0, 0.88, 2.5), 1.0, &pose(1.0, -0.4));
    target.velocity = Some(v1::RootVelocity {
        x: 1.5,
        z: 0.1,
        angular: -0.3,
        height: None,
    });
    let character = v1::Character {
        context: keys
            .enumerate()
            .map(|(frame, (&root, pose))| wire(root, 1.2 + 0.1 * frame as f32, pose))
            .collect(),
        targets: vec![target],
        frame_count: Some(34),
        seed: item.seed,
        temperature: 0.5,
        ..v1::Character::default()
    };
    let request = v1::InBetweenRequest {
        pack: String::new(),
        characters: vec![character],
    };
    let limits = RequestLimits { max_characters: 1 };
    let (single, plan) = prepare(&request, &pack, limits).unwrap();
    assert_eq!(
        (item.frames, &item.allowed_counts),
        (Some(34), &single[0].allowed_counts)
    );
    assert_eq!(item.temperature, 0.5);
    assert!((shape.frame.heading - plan[0].frame.heading).abs() < 1e-5);
    let pairs = [
        (&item.context, &single[0].context),
        (&item.targets, &single[0].targets),
    ];
    for (live, single) in pairs.into_iter().flat_map(|(a, b)| a.iter().zip(b)) {
        let numbers = |key: &crate::engine::KeyTensors| -> Vec<f32> {
            let roots = key
                .local_root
                .unwrap()
                .into_iter()
                .chain(key.global_root.unwrap());
            roots.chain(key.pose.as_ref().unwrap().iter().copied()).collect()
        };
        for (a, b) in numbers(live).iter().zip(numbers(single)) {
            assert!((a - b).abs() < 1e-4, "{live:?} is not {single:?}");
        }
    }
    assert_eq!(
        (shape.context_roots, &shape.context_rotations),
        (context.roots, &context.rotations)
    );
    assert_eq!(shape.targets, targets);
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
    let (item, shape) = build(&toy_pack(), &options, 0, context, targets);
    let guide = item.root_guide.unwrap();
    // The segment stands at (5.3, 2) and looks along the world's X.
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
    let dims = toy_pack().dims;
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
    assert_eq!(
        counts(None, &[1]),
        (3..=16).collect::<Vec<_>>(),
        "never none at all"
    );
}

#[test]
fn a_segment_is_never_longer_than_the_pack_allows() {
    let targets = PlanTargets {
        frames: Some(500),
        ..targets()
    };
    let (item, shape) = build(&toy_pack(), &OPTIONS, 0, context(), targets);
    assert_eq!((item.frames, shape.targets.frames), (Some(64), Some(64)));
}

#[test]
fn every_plan_has_a_seed_of_its_own() {
    let mut seeds: Vec<u64> = (0..50)
        .flat_map(|number| [plan_seed(1, number), plan_seed(2, number)])
        .collect();
    assert_eq!(plan_seed(1, 3), seeds[6], "and always the same");
    seeds.sort_unstable();
    seeds.dedup();
    assert_eq!(seeds.len(), 100);
}
