use std::f32::consts::FRAC_PI_2;

use troupe_character::testing::{self, PERSON_HIPS_M};
use troupe_motion::retarget::Figure;

use super::*;

/// The person in a size. `root` is a joint before the hips, with the hips' offset from it.
fn person(size: f32, root: Option<[f32; 3]>) -> Figure {
    let mut rows = testing::person();
    let mut height_m = PERSON_HIPS_M;
    if let Some(offset) = root {
        rows[0] = ("hips".to_owned(), "root".to_owned(), Vec3::from(offset));
        rows.insert(0, ("root".to_owned(), String::new(), Vec3::ZERO));
        height_m -= offset[1];
    }
    testing::figure_of(testing::joints_of(&rows, size), None, size * height_m)
}

/// A caller of twice the size, whose root is on the ground and 0.5 m behind its hips.
fn worn() -> Worn {
    let own = person(2.0, Some([0.0, 0.93, 0.25]));
    Worn::between("own", &own, person(1.0, None)).unwrap()
}

fn still(worn: &Worn) -> Vec<Quat> {
    vec![Quat::IDENTITY; worn.skeleton().joint_count()]
}

fn near(a: Vec3, b: Vec3) -> bool {
    a.distance(b) < 1e-3
}

#[test]
fn a_path_of_the_callers_root_guides_the_models() {
    let worn = worn();
    let knot = |frame: f32, place: [f32; 2], heading| Knot {
        frame,
        place,
        heading,
    };
    let wanted = Wanted {
        path: vec![
            knot(0.0, [0.0, 0.0], None),
            knot(30.0, [0.0, 2.0], None),
            knot(60.0, [0.0, 4.0], Some(FRAC_PI_2)),
            knot(90.0, [0.0, 4.0], None),
        ],
        ..Wanted::default()
    };
    let (guide, onto) = onto(&worn, wanted.clone(), &still(&worn));
    let places: Vec<[f32; 2]> = guide.path.iter().map(|knot| knot.place).collect();
    // The hips are 0.25 m of the model ahead of the root. The last knot keeps the heading before.
    for (found, expected) in places
        .iter()
        .zip([[0.0, 0.25], [0.0, 1.25], [0.25, 2.0], [0.25, 2.0]])
    {
        let off = (found[0] - expected[0]).hypot(found[1] - expected[1]);
        assert!(off < 1e-3, "{places:?}");
    }
    assert_eq!(guide.path[2].heading, Some(FRAC_PI_2));
    assert_eq!(onto.wanted, wanted, "the caller's body meets what was asked for");
}

#[test]
fn poses_with_all_main_joints_are_whole_for_the_model() {
    let worn = worn();
    let own = worn.skeleton().clone();
    let mut rotations = vec![Some(Quat::IDENTITY); own.joint_count()];
    let shin = own.joint_index("left_shin").unwrap();
    rotations[shin] = Some(Quat::from_rotation_x(0.8));
    let toe = own.joint_index("left_toe").unwrap();
    rotations[toe] = None;
    let key = PoseKey {
        frame: 7,
        rotations: rotations.clone(),
        root: Some(Vec3::new(1.0, 0.0, 3.0)),
    };
    let made = pose(&worn, &key, &still(&worn));
    let model = worn.onto().figures()[0].skeleton().clone();
    assert!(
        near(made.root.unwrap(), Vec3::new(0.5, 0.93, 1.75)),
        "{:?}",
        made.root
    );
    let bent = made.whole().unwrap()[model.joint_index("left_shin").unwrap()];
    assert!(bent.angle_between(Quat::from_rotation_x(0.8)) < 0.02);
    // Without a hand it is a part of a pose: only place and heading guide the model.
    rotations[own.joint_index("left_hand").unwrap()] = None;
    rotations[0] = Some(Quat::from_rotation_y(FRAC_PI_2));
    let made = pose(&worn, &PoseKey { rotations, ..key }, &still(&worn));
    assert!(made.rotations[1..].iter().all(Option::is_none));
    assert!(heading_of(made.rotations[0].unwrap(), model.left_axis) - FRAC_PI_2 < 1e-3);
    assert!(
        near(made.root.unwrap(), Vec3::new(0.75, 0.93, 1.5)),
        "{:?}",
        made.root
    );
}

#[test]
fn effectors_are_of_a_foot_the_root_or_in_front() {
    let worn = worn();
    let model = worn.onto().figures()[0].skeleton().clone();
    for (joint, of_model) in [
        ("root", "hips"),
        ("left_toe", "left_foot"),
        ("right_foot", "right_foot"),
        ("left_hand", "head"),
        ("head", "head"),
    ] {
        let given = Effector {
            frame: 3,
            joint: worn.skeleton().joint_index(joint).unwrap(),
            point: Vec3::new(2.0, 1.0, 4.0),
            rotation: None,
        };
        let made = effector(&worn, &given);
        assert_eq!(model.joints[made.joint].name, of_model, "{joint}");
        assert!(made.point.with_y(0.0).distance(Vec3::new(1.0, 0.0, 2.0)) < 1e-3);
    }
}
