//! Retargeting allocates no memory a frame.

#![allow(clippy::unwrap_used, reason = "this is a test, its helpers too")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;

use troupe_motion::anatomy::PartsDoc;
use troupe_motion::retarget::{Figure, Holds, Retargeter};
use troupe_motion::robot::RobotDoc;
use troupe_motion::{Joint, Quat, Skeleton, Vec3};

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

/// The system's allocator, which counts for each thread.
struct Counting;

// Each call goes on to the system's allocator as it came.
#[allow(unsafe_code, reason = "an allocator is unsafe")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|count| count.set(count.get() + 1));
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        unsafe { System.dealloc(memory, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// A person whose arms hang at rest.
fn person(size: f32) -> Figure {
    let mut joints = Vec::new();
    let mut add = |name: String, parent: Option<usize>, offset: [f32; 3]| {
        let offset_m = Vec3::from(offset) * size;
        joints.push(Joint {
            name,
            parent,
            offset_m,
        });
        joints.len() - 1
    };
    let hips = add("Hips".to_owned(), None, [0.0; 3]);
    let chest = add("Chest".to_owned(), Some(hips), [0.0, 0.4, 0.0]);
    add("Head".to_owned(), Some(chest), [0.0, 0.2, 0.0]);
    for (side, x) in [("L", 1.0), ("R", -1.0)] {
        let limbs = [
            (hips, ["UpperLeg", "LowerLeg", "Foot"], [0.1 * x, -0.1, 0.0]),
            (chest, ["UpperArm", "LowerArm", "Hand"], [0.2 * x, 0.1, 0.0]),
        ];
        for (from, names, first) in limbs {
            let mut above = from;
            for (nth, name) in names.into_iter().enumerate() {
                let offset = if nth == 0 { first } else { [0.0, -0.3, 0.0] };
                above = add(format!("{name}_{side}"), Some(above), offset);
            }
        }
    }
    let skeleton = Arc::new(Skeleton::new(joints, Vec3::X, 0.0, None).unwrap());
    let rest = vec![Quat::IDENTITY; skeleton.joint_count()];
    Figure::new(skeleton, &rest, None, &PartsDoc::default()).unwrap()
}

fn g1() -> Figure {
    #[derive(serde::Deserialize)]
    struct Tables {
        skeleton: Skeleton,
        robot: RobotDoc,
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../models/g1/pack.toml");
    let tables: Tables = toml::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let skeleton = tables.skeleton.with_robot(&tables.robot).unwrap();
    Figure::of_robot(Arc::new(skeleton), &PartsDoc::default()).unwrap()
}

#[test]
fn a_frame_allocates_nothing() {
    for target in [person(0.6), g1()] {
        let source = person(1.0);
        let pose = vec![Quat::from_rotation_x(0.1); source.skeleton().joint_count()];
        let mut out = vec![Quat::IDENTITY; target.skeleton().joint_count()];
        let mut retargeter = Retargeter::new(source, target).unwrap();
        let hands = [Some(Vec3::new(0.2, 1.0, 0.3)), None];
        let before = COUNT.with(Cell::get);
        assert!(before > 0, "allocations are counted");
        for frame in 0..3 {
            let root = Vec3::new(0.0, 0.7, 0.02 * frame as f32);
            let holds = Holds { hands, hips: 0.5 };
            retargeter.pose_holding(root, &pose, holds, &mut out);
        }
        assert_eq!(COUNT.with(Cell::get), before);
    }
}
