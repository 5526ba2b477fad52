use std::ops::Range;
use std::sync::Arc;

use troupe_motion::fk::joint_transform;
use troupe_motion::model::Rig;
use troupe_motion::retarget::Figure;
use troupe_motion::rotation::yaw;
use troupe_motion::{ContactParams, Vec3};

use super::super::finish::{Made, finish};
use super::super::testing::{knot, take};
use super::super::{Clock, Effector, Ground, PoseKey, Take};
use super::*;
use crate::testing::{self, PERSON_HIPS_M, Row};

/// Frames of each motion.
const FRAMES: usize = 60;

/// The person in a size. With `twists`, forearms and upper arms have a joint along them.
fn person(size: f32, twists: bool, contacts: &[&str]) -> Figure {
    let mut rows: Vec<Row> = Vec::new();
    for (name, parent, offset) in testing::person() {
        if twists && parent.contains("arm") {
            let twist = format!("{parent}_twist");
            rows.push((twist.clone(), parent, 0.5 * offset));
            rows.push((name, twist, 0.5 * offset));
        } else {
            rows.push((name, parent, offset));
        }
    }
    let joints = testing::joints_of(&rows, size);
    let index = |name: &&str| joints.iter().position(|joint| joint.name == *name).unwrap();
    let contacts = ContactParams {
        joints: contacts.iter().map(index).collect(),
        max_height_m: vec![0.2; contacts.len()],
        max_speed_mps: 0.4,
        clearance_m: contacts
            .iter()
            .map(|name| if name.contains("toe") { 0.02 } else { 0.09 })
            .collect(),
    };
    let contacts = Some(contacts).filter(|contacts| !contacts.joints.is_empty());
    testing::figure_of(joints, contacts, PERSON_HIPS_M * size)
}

/// A take of a person, and what it meets on another one.
fn onto(own: &Figure, wanted: Wanted) -> Take {
    let model = person(1.0, false, &["right_foot", "left_foot", "left_toe"]);
    let mut take = take(FRAMES);
    let rig = (*take.subject.rig).clone();
    take.subject.rig = Arc::new(Rig::new("person", 30.0, rig.dims, (**model.skeleton()).clone()));
    take.onto = Some(Onto::new(Retargeter::new(model, own.clone()).unwrap(), wanted));
    take
}

/// A motion that slides ahead by 5 cm a frame, in some frames in contact with right foot and left
/// toe.
fn slides(take: &Take, stands: Range<usize>) -> Track {
    let joints = take.subject.rig.skeleton.joint_count();
    let mut track = Track::default();
    for frame in 0..FRAMES {
        let root = Vec3::new(0.0, 0.93, 0.05 * frame as f32);
        track.push(
            root,
            &vec![Quat::IDENTITY; joints],
            if stands.contains(&frame) { 0b101 } else { 0 },
        );
    }
    track
}

fn made(own: &Figure, wanted: Wanted, change: impl FnOnce(&mut Take)) -> Made {
    let mut take = onto(own, wanted);
    take.hold_feet = false;
    change(&mut take);
    let track = slides(&take, 20..27);
    finish(&take, track, Vec::new(), Vec::new())
}

fn place(made: &Made, own: &Figure, frame: usize, joint: &str) -> Vec3 {
    let joint = own.skeleton().joint_index(joint).unwrap();
    joint_transform(
        own.skeleton(),
        made.track.roots[frame],
        made.track.pose(frame),
        joint,
    )
    .0
}

#[test]
fn motion_is_carried_over_in_the_other_bodys_size() {
    for twists in [false, true] {
        let own = person(2.0, twists, &[]);
        let made = made(&own, Wanted::default(), |_| {});
        let last = made.track.roots[FRAMES - 1];
        assert!(last.distance(2.0 * Vec3::new(0.0, 0.93, 2.95)) < 1e-3, "{last}");
        // The model's right foot and left toe: bits of the other body's legs, left first.
        assert_eq!(made.track.contacts[20..28], [6, 6, 6, 6, 6, 6, 6, 0], "{twists}");
        assert!(made.notes.is_empty(), "{:?}", made.notes);
    }
}

#[test]
fn constraints_are_met_on_the_other_body() {
    let own = person(1.6, true, &[]);
    let skeleton = own.skeleton().clone();
    let (hand, head) = (
        skeleton.joint_index("left_hand").unwrap(),
        skeleton.joint_index("head").unwrap(),
    );
    let (mut whole, mut part) = (
        vec![Some(Quat::IDENTITY); skeleton.joint_count()],
        vec![None; skeleton.joint_count()],
    );
    whole[0] = Some(yaw(0.3));
    part[head] = Some(Quat::from_rotation_y(0.4));
    let wanted = Wanted {
        path: vec![knot(0.0, 1.0, 0.5), knot(59.0, 1.2, 5.0)],
        keys: vec![
            PoseKey {
                frame: 20,
                rotations: whole.clone(),
                root: Some(Vec3::new(1.1, 1.45, 2.0)),
            },
            PoseKey {
                frame: 40,
                rotations: part,
                root: None,
            },
        ],
        effectors: vec![Effector {
            frame: 50,
            joint: hand,
            point: Vec3::new(1.5, 2.2, 4.6),
            rotation: Some(Quat::from_rotation_x(0.2)),
        }],
        ground: Ground(vec![Vec3::Y * 0.5]),
    };
    let made = made(&own, wanted, |_| {});
    let root = |frame: usize| made.track.roots[frame];
    assert!((root(0) - Vec3::new(1.0, root(0).y, 0.5)).length() < 1e-3);
    assert!((root(59) - Vec3::new(1.2, root(59).y, 5.0)).length() < 1e-3);
    assert!(
        root(20).distance(Vec3::new(1.1, 1.95, 2.0)) < 1e-3,
        "over the ground: {}",
        root(20)
    );
    for (found, given) in made.track.pose(20).iter().zip(&whole) {
        assert!(found.angle_between(given.unwrap()) < 1e-3);
    }
    assert!(made.track.pose(40)[head].angle_between(Quat::from_rotation_y(0.4)) < 1e-3);
    let reached = place(&made, &own, 50, "left_hand");
    assert!(reached.distance(Vec3::new(1.5, 2.2, 4.6)) < 5e-3, "{reached}");
    assert!(made.notes.is_empty(), "{:?}", made.notes);
}

#[test]
fn a_point_that_is_missed_gets_a_note() {
    let own = person(1.0, true, &[]);
    let effector = Effector {
        frame: 30,
        joint: own.skeleton().joint_index("right_hand").unwrap(),
        point: Vec3::new(0.0, 4.0, 1.5),
        rotation: None,
    };
    let wanted = Wanted {
        effectors: vec![effector],
        ..Wanted::default()
    };
    let made = made(&own, wanted, |_| {});
    assert_eq!(made.notes[0].code, "effector_missed");
}

#[test]
fn standing_feet_are_held_on_the_other_body() {
    let own = person(0.5, false, &[]);
    let slid_m = |hold: bool| {
        let made = made(&own, Wanted::default(), |take| take.hold_feet = hold);
        let feet = [20, 26].map(|frame| place(&made, &own, frame, "left_toe"));
        feet[0].distance(feet[1])
    };
    assert!(
        slid_m(false) > 0.14 && slid_m(true) < 0.01,
        "{} {}",
        slid_m(false),
        slid_m(true)
    );
}

#[test]
fn an_answer_may_have_another_rate_and_close_a_loop() {
    let own = person(1.3, false, &[]);
    let made = made(&own, Wanted::default(), |take| {
        take.is_loop = true;
        take.clock = Clock {
            native_fps: 30.0,
            fps: 60.0,
            frames: 119,
        };
    });
    assert_eq!(made.track.len(), 119);
    let (first, last) = (made.track.pose(0), made.track.pose(118));
    assert!(first.iter().zip(last).all(|(a, b)| a.angle_between(*b) < 1e-3));
}
