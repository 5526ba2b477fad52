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
    skeleton.body("mine", 30.0, &DIMS).unwrap()
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
    let error = skeleton.body("mine", 30.0, &DIMS).unwrap_err().to_string();
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
    let cases: [(Change, &str); 16] = [
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
    ];
    for (change, wanted) in cases {
        let mut skeleton = inline();
        change(&mut skeleton);
        let error = skeleton.body("mine", 30.0, &DIMS).unwrap_err().to_string();
        assert!(error.contains(wanted), "{error} lacks {wanted}");
    }
    let small = InlineSkeleton {
        joints: inline().joints[..1].to_vec(),
        ..InlineSkeleton::default()
    };
    let error = small.body("mine", 30.0, &DIMS).unwrap_err().to_string();
    assert!(error.contains("size_m is 0; allowed: 0.01 to 100"), "{error}");
}
