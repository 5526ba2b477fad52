//! A live plan asks the networks for what a single request with the same keyframes would.

use troupe_character::Path;
use troupe_character::live::CharacterOptions;
use troupe_character::live::request::{self, Context};
use troupe_character::primitives::{PlanTargets, TargetKey};
use troupe_character::testing::toy_rig;
use troupe_motion::rotation::{to_wxyz, yaw};
use troupe_motion::{GlobalRoot, LocalRoot, Quat, Vec3};
use troupe_proto::v1;

use super::{RequestLimits, prepare};

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
    let (rig, context, targets) = (toy_rig(), context(), targets());
    let (item, shape) = request::build(&rig, &OPTIONS, 3, context.clone(), targets.clone());
    let item = item.keyframes().unwrap();
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
        skeleton: String::new(),
    };
    let limits = RequestLimits { max_characters: 1 };
    let (single, plan) = prepare(&Path::root(), &request, &rig, limits).unwrap();
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
        let numbers = |key: &troupe_motion::model::KeyTensors| -> Vec<f32> {
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
