//! The same motion comes back out of every dialect.

use glam::{DQuat, Quat};
use proptest::prelude::*;

use super::people::{Dialect, Person};
use crate::bvh::EulerOrder;
use crate::clip::Clip;
use crate::fk::WorldMotion;
use crate::glb::write_glb;
use crate::read::units::UNITS;
use crate::read::{Options, RestPose, Source, Understood, Up, read};
use crate::rotation::angle_between;

const MAX_ERROR_M: f32 = 0.0005;
const MAX_ERROR_DEG: f32 = 0.1;

fn person() -> impl Strategy<Value = Person> {
    let rest = prop_oneof![Just(RestPose::T), Just(RestPose::A), Just(RestPose::Standing)];
    (0..4_usize, 0.85_f32..1.15, 1..=4_usize, rest).prop_map(|(words, size, spine, rest)| Person {
        words,
        size,
        spine,
        rest,
    })
}

fn dialect() -> impl Strategy<Value = Dialect> {
    let order = prop_oneof![
        Just(EulerOrder::XYZ),
        Just(EulerOrder::XZY),
        Just(EulerOrder::YXZ),
        Just(EulerOrder::YZX),
        Just(EulerOrder::ZXY),
        Just(EulerOrder::ZYX)
    ];
    let unit = prop::sample::select(&UNITS[..]).prop_map(|unit| unit.metres);
    let up = prop::sample::select(&Up::ALL[..]);
    let line_end = prop_oneof![Just("\n"), Just("\r\n")];
    (order, unit, up, 0..3_usize, line_end).prop_map(|(order, unit_m, up, encoding, line_end)| Dialect {
        order,
        unit_m,
        up,
        encoding,
        line_end,
        ..Dialect::plain()
    })
}

fn numbers() -> impl Strategy<Value = Vec<f32>> {
    proptest::collection::vec(0.0_f32..1.0, 24)
}

fn rate() -> impl Strategy<Value = f32> {
    prop_oneof![
        Just(24.0_f32),
        Just(25.0),
        Just(30.0),
        Just(50.0),
        Just(60.0),
        Just(100.0),
        Just(120.0)
    ]
}

fn read_file(name: &str, bytes: &[u8]) -> Understood {
    read(&Source::new(name, bytes), &Options::default()).unwrap_or_else(|e| panic!("{e}"))
}

/// Largest distance in metres and angle in degrees between two clips of the same joints. `frame` is
/// the turn of a joint's own axes.
fn errors(truth: &Clip, read: &Clip, frame: impl Fn(usize) -> DQuat) -> (f32, f32) {
    assert_eq!((read.frames(), read.fps), (truth.frames(), truth.fps));
    let place = |name: &str| read.skeleton.joint_index(name).unwrap();
    let order: Vec<usize> = truth
        .skeleton
        .joints
        .iter()
        .map(|joint| place(&joint.name))
        .collect();
    let (a, b) = (WorldMotion::from_clip(truth), WorldMotion::from_clip(read));
    let mut worst = (0.0_f32, 0.0_f32);
    for at in 0..truth.frames() {
        for (joint, &other) in order.iter().enumerate() {
            let distance = a.positions_at(at)[joint].distance(b.positions_at(at)[other]);
            let wanted: Quat = a.rotations_at(at)[joint] * frame(joint).as_quat();
            let angle = angle_between(wanted, b.rotations_at(at)[other]).to_degrees();
            worst = (worst.0.max(distance), worst.1.max(angle));
        }
    }
    worst
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn bvh_comes_back(person in person(), dialect in dialect(), fps in rate(), numbers in numbers()) {
        let truth = person.walk(40, fps, &numbers);
        let found = read_file("walk.bvh", &dialect.bytes(&truth));
        let report = &found.report;
        prop_assert_eq!(report.up.value, dialect.up, "{}", report.up.evidence);
        prop_assert_eq!(report.unit_m.value, dialect.unit_m, "{}", report.unit_m.evidence);
        prop_assert_eq!(report.fps.value, fps);
        prop_assert_eq!(report.rest_pose.value, person.rest, "{}", report.rest_pose.evidence);
        let (distance_m, angle_deg) = errors(&truth, &found.clip, |_| DQuat::IDENTITY);
        prop_assert!(distance_m < MAX_ERROR_M && angle_deg < MAX_ERROR_DEG, "{} m, {}°", distance_m, angle_deg);
        prop_assert!(found.clip.skeleton.left_axis.abs_diff_eq(glam::Vec3::X, 1e-3));
    }

    #[test]
    fn bones_with_axes_of_their_own_come_back(
        person in person(),
        dialect in dialect(),
        turns in proptest::collection::vec(crate::rotation::tests::any_quat(), 7),
        numbers in numbers(),
    ) {
        // The world alone turns: bones keep their own axes.
        let dialect = Dialect {
            frames: turns.into_iter().map(|turn| turn.as_dquat().normalize()).collect(),
            turns_bones: false,
            ..dialect
        };
        let truth = person.walk(40, 30.0, &numbers);
        let bytes = dialect.bytes(&truth);
        let options = Options { up: Some(dialect.up), ..Options::default() };
        let found = read(&Source::new("walk.bvh", &bytes), &options).unwrap();
        prop_assert_eq!(found.report.unit_m.value, dialect.unit_m);
        let (distance_m, _) = errors(&truth, &found.clip, |joint| dialect.frame(joint));
        prop_assert!(distance_m < MAX_ERROR_M, "{} m", distance_m);
        if found.report.rest_pose.value == RestPose::None {
            let (_, angle_deg) = errors(&truth, &found.clip, |joint| dialect.frame(joint));
            prop_assert!(angle_deg < MAX_ERROR_DEG, "{}°", angle_deg);
        }
    }

    #[test]
    fn glb_comes_back(person in person(), fps in rate(), numbers in numbers()) {
        let truth = person.walk(40, fps, &numbers);
        let found = read_file("walk.glb", &write_glb(&truth).unwrap());
        prop_assert_eq!(found.report.fps.value, fps);
        prop_assert_eq!(found.report.oddities.len(), 0, "{:?}", found.report.oddities);
        let (distance_m, angle_deg) = errors(&truth, &found.clip, |_| DQuat::IDENTITY);
        prop_assert!(distance_m < MAX_ERROR_M && angle_deg < MAX_ERROR_DEG, "{} m, {}°", distance_m, angle_deg);
    }

    #[test]
    fn a_skeleton_of_the_same_bones_takes_the_motion(person in person(), dialect in dialect(), numbers in numbers()) {
        let truth = person.walk(40, 30.0, &numbers);
        let options = Options { skeleton: Some(truth.skeleton.clone()), ..Options::default() };
        let bytes = dialect.bytes(&truth);
        let found = read(&Source::new("walk.bvh", &bytes), &options).unwrap();
        let (distance_m, angle_deg) = errors(&truth, &found.clip, |_| DQuat::IDENTITY);
        prop_assert!(distance_m < MAX_ERROR_M && angle_deg < MAX_ERROR_DEG, "{} m, {}°", distance_m, angle_deg);
    }

    #[test]
    fn another_rate_keeps_the_bones_lengths(person in person(), fps in rate(), to in rate(), numbers in numbers()) {
        let truth = person.walk(40, fps, &numbers);
        let options = Options { resample_fps: Some(to), ..Options::default() };
        let bytes = Dialect::plain().bytes(&truth);
        let found = read(&Source::new("walk.bvh", &bytes), &options).unwrap();
        prop_assert_eq!(found.clip.fps, to);
        let world = WorldMotion::from_clip(&found.clip);
        for frame in 0..world.frames() {
            let places = world.positions_at(frame);
            for (joint, of) in found.clip.skeleton.joints.iter().enumerate().skip(1) {
                let length = places[joint].distance(places[of.parent.unwrap()]);
                prop_assert!((length - of.offset_m.length()).abs() < 1e-4);
            }
        }
    }
}
