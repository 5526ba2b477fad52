use super::*;
use crate::robot::{HingeDoc, RobotDoc};
use crate::testing::biped;

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

fn inline() -> InlineSkeleton {
    let skeleton = biped();
    let name = |joint: usize| skeleton.joints[joint].name.clone();
    let joints = skeleton.joints.iter().map(|joint| InlineJoint {
        name: joint.name.clone(),
        parent: joint.parent.map(name).unwrap_or_default(),
        offset_m: joint.offset_m,
    });
    InlineSkeleton {
        joints: joints.collect(),
        ..InlineSkeleton::default()
    }
}

fn body_of(skeleton: &InlineSkeleton) -> Body {
    skeleton.body("mine", 30.0, &DIMS, &mut Vec::new()).unwrap()
}

#[test]
fn missing_parts_are_derived() {
    let body = body_of(&inline());
    assert_eq!(body.sides[..], [0, 0, 1, 1, 1, -1, -1, -1]);
    let contacts = body.rig.skeleton.contacts.as_ref().unwrap();
    assert_eq!((&contacts.joints[..], body.rig.dims.contacts), (&[4, 7][..], 2));
    assert_eq!(contacts.clearance_m, [0.0, 0.0]);
    assert!((body.height_m - 0.95).abs() < 1e-6 && body.size_m == body.height_m);
    assert_eq!((body.rig.dims.joints, body.row_count()), (8, 9));
    // The left toe: bone, place, contact, end, depth and side.
    let toe = body.description[5];
    let near = |a: f32, b: f32| (a - b).abs() < 1e-6;
    assert!(near(toe[2], 0.12 / 0.95) && near(toe[3], 0.1 / 0.95) && near(toe[4], -1.0));
    assert_eq!((toe[11], toe[12], toe[15], toe[16]), (1.0, 1.0, 3.0 / 8.0, 1.0));
    assert!(
        near(body.description[1][17], (0.1 + 0.9 + 0.13) / 0.95),
        "the root's reach"
    );
}

#[test]
fn rows_read_themselves_their_root_and_their_ancestors() {
    let body = body_of(&inline());
    assert_eq!(body.rows[0][..6], [0, 0, 1, 5, 8, 2], "contacts, then the spine");
    assert_eq!(body.reads[0][..7], [1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0]);
    assert_eq!(body.rows[1][..4], [1, 0, 0, 0]);
    assert_eq!(body.reads[1][..4], [1.0, 1.0, 0.0, 0.0]);
    assert_eq!(body.rows[5][..6], [5, 0, 1, 4, 3, 0]);
    assert_eq!(body.reads[5][..6], [1.0, 1.0, 1.0, 1.0, 1.0, 0.0]);
}

#[test]
fn a_rest_pose_that_heads_elsewhere_is_turned() {
    let turn = Quat::from_rotation_y(1.0);
    let mut turned = inline();
    for joint in &mut turned.joints {
        joint.offset_m = turn * joint.offset_m;
    }
    turned.left_axis = Some(turn * Vec3::X);
    let (found, wanted) = (body_of(&turned), body_of(&inline()));
    let near = |(a, b): (&Vec3, &Vec3)| a.abs_diff_eq(*b, 1e-6);
    assert!(found.bones_m.iter().zip(&wanted.bones_m).all(near));
    assert_eq!(found.sides, wanted.sides);
}

#[test]
fn only_hinges_may_be_at_one_place() {
    let mut skeleton = inline();
    skeleton.joints[1].offset_m = Vec3::ZERO;
    let error = skeleton
        .body("mine", 30.0, &DIMS, &mut Vec::new())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("skeleton.joints[1].offset_m is 0 m long"),
        "{error}"
    );
    skeleton.robot = Some(RobotDoc {
        name: "hinged".to_owned(),
        hinges: vec![HingeDoc {
            joint: "Spine".to_owned(),
            axis: Vec3::Y,
            rest: [1.0, 0.0, 0.0, 0.0],
            lower_rad: -1.0,
            upper_rad: 1.0,
            max_speed_rad_per_s: 9.0,
            max_acceleration_rad_per_s2: None,
        }],
        mimics: Vec::new(),
    });
    let body = body_of(&skeleton);
    let (spine, leg) = (body.description[2], body.description[3]);
    assert_eq!(
        (&spine[6..9], spine[9], spine[10]),
        (&[0.0, 1.0, 0.0][..], 1.0, 0.0)
    );
    assert_eq!((leg[9], leg[10]), (0.0, 1.0), "a joint without hinge is fixed");
}

#[test]
fn every_mistake_is_named() {
    type Change = fn(&mut InlineSkeleton);
    let cases: [(Change, &str); 17] = [
        (|s| s.joints.clear(), "skeleton.joints is 0; allowed: 1 to 256"),
        (
            |s| s.joints[3].parent = "Tail".to_owned(),
            "skeleton.joints[3].parent is \"Tail\"; allowed: the name",
        ),
        (
            |s| s.joints[3].parent.clear(),
            "skeleton.joints[3].parent is empty, which makes it a second root",
        ),
        (
            |s| s.joints[0].parent = "Toes_L".to_owned(),
            "skeleton.joints[0].parent is \"Toes_L\", which closes a cycle",
        ),
        (
            |s| s.joints[2].parent = "Toes_L".to_owned(),
            "skeleton.joints[2].parent is \"Toes_L\", which closes a cycle",
        ),
        (
            |s| s.joints[1].parent = "Spine".to_owned(),
            "which closes a cycle",
        ),
        (
            |s| s.joints[1].parent = "Toes_R".to_owned(),
            "which comes later; allowed: parents before children",
        ),
        (|s| s.joints[1].name = "Hips".to_owned(), "more than one joint"),
        (
            |s| s.joints[1].offset_m.x = f32::NAN,
            "offset of joint \"Spine\" is not finite",
        ),
        (
            |s| s.joints[1].offset_m.x = 1e6,
            "skeleton.joints[1].offset_m is 1000000 m long; allowed: 0.0001 to 100 m",
        ),
        (
            |s| s.contacts = Some(vec!["Paw".to_owned()]),
            "skeleton.contacts[0] is \"Paw\"; allowed: the name of a joint",
        ),
        (
            |s| s.contacts = Some(vec!["Hips".to_owned(); 2]),
            "skeleton.contacts[1] is \"Hips\"; allowed: each joint once",
        ),
        (
            |s| s.neutral = Some(vec![Quat::IDENTITY; 3]),
            "neutral.rotations is 3 long; allowed: 8",
        ),
        (
            |s| s.neutral = Some(vec![Quat::from_xyzw(0.0, 0.0, 0.0, 2.0); 8]),
            "neutral.rotations[0] is 2 long; allowed: unit length",
        ),
        (
            |s| s.sides = Some(vec![2; 8]),
            "neutral.sides[0] is 2; allowed: 1 for left",
        ),
        (
            |s| s.left_axis = Some(Vec3::NAN),
            "left_axis must have unit length",
        ),
        (
            |s| {
                s.neutral = Some(vec![Quat::IDENTITY; 8]);
                s.left_axis = Some(-Vec3::X);
            },
            "skeleton.left_axis is [-1.00, -0.00, -0.00]; allowed: near [1.00, 0.00, 0.00]",
        ),
    ];
    for (change, wanted) in cases {
        let mut skeleton = inline();
        change(&mut skeleton);
        let error = skeleton
            .body("mine", 30.0, &DIMS, &mut Vec::new())
            .unwrap_err()
            .to_string();
        assert!(error.contains(wanted), "{error} lacks {wanted}");
    }
    let small = InlineSkeleton {
        joints: inline().joints[..1].to_vec(),
        ..InlineSkeleton::default()
    };
    let error = small
        .body("mine", 30.0, &DIMS, &mut Vec::new())
        .unwrap_err()
        .to_string();
    assert!(error.contains("size_m is 0; allowed: 0.01 to 100"), "{error}");
}

/// A person with its arms at an angle below the horizontal, turned about the vertical axis.
fn person(arms_down_deg: f32, turn_rad: f32) -> InlineSkeleton {
    let turn = Quat::from_rotation_y(turn_rad);
    let joint = |name: &str, parent: &str, offset_m: Vec3| InlineJoint {
        name: name.to_owned(),
        parent: parent.to_owned(),
        offset_m: turn * offset_m,
    };
    let mut joints = vec![
        joint("Hips", "", Vec3::Y),
        joint("Spine", "Hips", Vec3::Y * 0.3),
        joint("Head", "Spine", Vec3::Y * 0.4),
    ];
    for (side, sign) in [("Left", 1.0), ("Right", -1.0)] {
        let name = |part: &str| format!("{side}{part}");
        let (sin, cos) = arms_down_deg.to_radians().sin_cos();
        let along = Vec3::new(sign * cos, -sin, 0.0);
        for (part, parent, offset_m) in [
            ("UpLeg", "Hips".to_owned(), Vec3::new(0.1 * sign, 0.0, 0.0)),
            ("Leg", name("UpLeg"), Vec3::Y * -0.45),
            ("Foot", name("Leg"), Vec3::Y * -0.45),
            ("Toe", name("Foot"), Vec3::new(0.0, -0.05, 0.15)),
            ("Arm", "Spine".to_owned(), Vec3::new(0.18 * sign, 0.2, 0.0)),
            ("ForeArm", name("Arm"), along * 0.3),
            ("Hand", name("ForeArm"), along * 0.25),
        ] {
            joints.push(joint(&name(part), &parent, offset_m));
        }
    }
    InlineSkeleton {
        joints,
        ..InlineSkeleton::default()
    }
}

fn noted(skeleton: &InlineSkeleton) -> (Body, Vec<String>) {
    let mut notes = Vec::new();
    let body = skeleton.body("mine", 30.0, &DIMS, &mut notes).unwrap();
    (body, notes)
}

#[test]
fn a_person_in_a_t_pose_or_an_a_pose_lets_its_arms_down() {
    for arms_down_deg in [-5.0, 0.0, 20.0, 45.0] {
        for turn_rad in [0.0, 1.0, std::f32::consts::PI] {
            let (body, notes) = noted(&person(arms_down_deg, turn_rad));
            let bone = |name: &str| body.bones_m[body.rig.skeleton.joint_index(name).unwrap()];
            for hanging in ["LeftForeArm", "LeftHand", "RightHand", "LeftLeg", "RightFoot"] {
                let off_deg = bone(hanging).angle_between(Vec3::NEG_Y).to_degrees();
                assert!(off_deg < 0.1, "{hanging}: {off_deg}°");
            }
            assert!(
                bone("LeftUpLeg").abs_diff_eq(Vec3::X * 0.1, 1e-5),
                "heads along +Z"
            );
            assert!(bone("LeftToe").z > 0.1);
            assert!(notes.last().unwrap().contains("limbs are let down"), "{notes:?}");
            assert_eq!(notes.len(), 1 + usize::from(turn_rad > 0.0), "{notes:?}");
        }
    }
}

#[test]
fn a_person_that_stands_is_neutral_as_it_is() {
    let (body, notes) = noted(&person(85.0, 0.0));
    assert!(
        body.neutral.iter().all(|q| *q == Quat::IDENTITY) && notes.is_empty(),
        "{notes:?}"
    );
}

#[test]
fn a_person_in_no_stance_asks_for_its_neutral_pose() {
    let error = |skeleton: &InlineSkeleton| {
        let found = skeleton.body("mine", 30.0, &DIMS, &mut Vec::new());
        found.unwrap_err().to_string()
    };
    let arms_up = error(&person(-60.0, 0.0));
    assert!(
        arms_up.contains("neutral.rotations") && arms_up.contains("arms -60°"),
        "{arms_up}"
    );
    let mut lying = person(0.0, 0.0);
    for joint in &mut lying.joints {
        joint.offset_m = Quat::from_rotation_x(1.57) * joint.offset_m;
    }
    let why = error(&lying);
    assert!(why.contains("is not upright"), "{why}");
    lying.neutral = Some(vec![Quat::from_rotation_x(-1.57); lying.joints.len()]);
    assert!(noted(&lying).1.is_empty(), "what is given is taken");
}

#[test]
fn what_may_be_meant_otherwise_is_noted() {
    let mut unknown = person(0.0, 0.0);
    for (index, joint) in unknown.joints.iter_mut().enumerate() {
        joint.name = format!("bone{index}");
    }
    let names: Vec<String> = person(0.0, 0.0)
        .joints
        .into_iter()
        .map(|joint| joint.name)
        .collect();
    for joint in &mut unknown.joints {
        if let Some(parent) = names.iter().position(|name| *name == joint.parent) {
            joint.parent = format!("bone{parent}");
        }
    }
    let notes = noted(&unknown).1;
    assert!(notes.len() == 1 && notes[0].contains("1.46 m wide"), "{notes:?}");
    let mut large = person(85.0, 0.0);
    large.joints.iter_mut().for_each(|joint| joint.offset_m *= 39.37);
    let notes = noted(&large).1;
    assert!(
        notes.len() == 1 && notes[0].contains("offsets are in metres"),
        "{notes:?}"
    );
}
