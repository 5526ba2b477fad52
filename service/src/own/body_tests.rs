use troupe_character::testing::{PERSON_HIPS_M, figure_of, joints_of, person, rig_of};
use troupe_motion::ContactParams;
use troupe_motion::retarget::Figure;

use super::*;

/// A person with contacts at these joints, with or without toes.
fn body(contacts: &[&str], has_toes: bool) -> Figure {
    let mut rows = person();
    rows.retain(|(name, ..)| has_toes || !name.ends_with("_toe"));
    let joints = joints_of(&rows, 1.0);
    let index = |name: &&str| joints.iter().position(|joint| joint.name == **name).unwrap();
    let found: Vec<usize> = contacts.iter().map(index).collect();
    let params = ContactParams {
        max_height_m: vec![0.1; found.len()],
        max_speed_mps: 0.3,
        clearance_m: vec![0.05; found.len()],
        joints: found,
    };
    figure_of(joints, Some(params), PERSON_HIPS_M)
}

fn joint(figure: &Figure, name: &str) -> u32 {
    let joints = &figure.skeleton().joints;
    joints.iter().position(|joint| joint.name == name).unwrap() as u32
}

fn figure(joint: Option<u32>) -> Option<v1::FeasibilityFigure> {
    Some(v1::FeasibilityFigure {
        value: 1.0,
        limit: 2.0,
        frame: 3,
        joint,
    })
}

#[test]
fn contacts_and_joints_are_those_of_the_body() {
    let pack = body(&["left_foot", "left_toe", "right_foot", "right_toe"], true);
    // Ankles alone, in another order.
    let own = body(&["right_foot", "left_foot"], false);
    let worn = Worn::between("own", &own, pack.clone()).unwrap();
    let of = OfBody::new(&worn, &rig_of("own", (**own.skeleton()).clone()));
    let mut frames = v1::Frames {
        frame_count: 2,
        contacts: vec![0.1, 0.9, 0.0, 0.0, 0.0, 0.0, 1.0, 0.2],
        ..v1::Frames::default()
    };
    of.touch(&mut frames);
    assert_eq!(frames.contacts, [0.0, 0.9, 1.0, 0.0]);

    let mut found = v1::Feasibility {
        joint_speed: figure(Some(joint(&pack, "right_forearm"))),
        bend: figure(Some(joint(&pack, "left_toe"))),
        root_speed: figure(None),
        ..v1::Feasibility::default()
    };
    of.name_joints(&mut found);
    assert_ne!(joint(&pack, "right_forearm"), joint(&own, "right_forearm"));
    let joint_of = |figure: Option<v1::FeasibilityFigure>| figure.unwrap().joint;
    assert_eq!(joint_of(found.joint_speed), Some(joint(&own, "right_forearm")));
    assert_eq!(joint_of(found.bend), None, "the body has no toes");
    assert_eq!(joint_of(found.root_speed), None);
}
