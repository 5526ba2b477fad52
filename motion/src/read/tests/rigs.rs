//! Rigs that are made for animators: feet that steer legs, poles, IK.

use glam::DVec3;

use super::people::Person;
use crate::bvh::{BvhFile, BvhJoint, Channel, EulerOrder, write};
use crate::fk::WorldMotion;
use crate::read::{Options, RestPose, Source, Topic, read};

const MOVES: [Channel; 3] = [Channel::Xposition, Channel::Yposition, Channel::Zposition];
const TURNS: [Channel; 3] = [Channel::Zrotation, Channel::Xrotation, Channel::Yrotation];

/// A person whose feet hang on the rig's root and stand at the ends of the legs, as an animator
/// moves them, and poles that steer the knees. `off_m` is how far a foot leaves its leg.
fn rig(off_m: f64) -> (crate::Clip, Vec<u8>) {
    let person = Person {
        words: 2,
        size: 1.0,
        spine: 2,
        rest: RestPose::T,
    };
    let truth = person.walk(60, 30.0, &[0.3, 0.8, 0.1, 0.6, 0.9, 0.2, 0.45]);
    let world = WorldMotion::from_clip(&truth);
    let of = &truth.skeleton.joints;
    let is_foot = |name: &str| name.starts_with("Foot");
    let is_toe = |name: &str| name.starts_with("Toes");
    let joint = |name: &str, parent, offset: DVec3, channels: &[Channel]| BvhJoint {
        name: name.to_owned(),
        parent,
        offset,
        channels: channels.to_vec(),
        end_sites: Vec::new(),
    };
    let six = [MOVES, TURNS].concat();
    // The rig's root, the body on it with ends where the feet were, then the feet and the poles.
    let mut joints = vec![joint("Bone", None, DVec3::ZERO, &six)];
    let mut place = vec![0; of.len()];
    let body: Vec<usize> = (0..of.len()).filter(|&nth| !is_toe(&of[nth].name)).collect();
    for &nth in &body {
        let parent = of[nth].parent.map_or(0, |parent| place[parent]);
        place[nth] = joints.len();
        let name = of[nth].name.replace("Foot", "LowerLeg_end");
        let channels = if nth == 0 { &six[..] } else { &TURNS };
        joints.push(joint(
            &name,
            Some(parent),
            100.0 * of[nth].offset_m.as_dvec3(),
            channels,
        ));
    }
    let feet: Vec<usize> = (0..of.len()).filter(|&nth| is_foot(&of[nth].name)).collect();
    for &foot in &feet {
        let mut at = foot;
        let mut rest = DVec3::ZERO;
        while let Some(parent) = of[at].parent {
            rest += 100.0 * of[at].offset_m.as_dvec3();
            at = parent;
        }
        joints.push(joint(&of[foot].name, Some(0), rest, &six));
        let toe = foot + 1;
        joints.push(joint(
            &of[toe].name,
            Some(joints.len() - 1),
            100.0 * of[toe].offset_m.as_dvec3(),
            &TURNS,
        ));
        joints.push(joint(&format!("Pole_{foot}"), Some(0), DVec3::Z, &six));
    }
    let order = EulerOrder::ZXY;
    let angles = |q: glam::Quat| order.angles(q.as_dquat()).map(f64::to_degrees);
    let mut values = Vec::new();
    for frame in 0..truth.frames() {
        values.extend([0.0; 6]);
        for &nth in &body {
            if nth == 0 {
                values.extend((100.0 * truth.root_positions[frame].as_dvec3()).to_array());
            }
            values.extend(angles(truth.rotations_at(frame)[nth]));
        }
        for &foot in &feet {
            let swing = 100.0 * off_m * (frame as f64 / 9.0).sin();
            let at = 100.0 * world.positions_at(frame)[foot].as_dvec3();
            values.extend((at + DVec3::new(0.0, swing, 0.0)).to_array());
            values.extend(angles(world.rotations_at(frame)[foot]));
            values.extend(angles(truth.rotations_at(frame)[foot + 1]));
            values.extend([10.0, 20.0, frame as f64, 0.0, 0.0, 0.0]);
        }
    }
    let file = BvhFile::new(joints, 1.0 / 30.0, values).unwrap();
    (truth, write(&file).into_bytes())
}

#[test]
fn feet_that_steer_legs_are_hung_on_them() {
    let (truth, bytes) = rig(0.0);
    let found = read(&Source::new("rig.bvh", &bytes), &Options::default()).unwrap();
    let topics: Vec<Topic> = found.report.repairs.iter().map(|note| note.topic).collect();
    assert_eq!(topics[0], Topic::Rig, "{:?}", found.report.repairs);
    assert!(found.report.repairs[0].text.contains("Foot_L on LowerLeg_end_L"));
    // The body with an end on each leg; neither the rig's root nor the poles.
    assert_eq!(found.report.joints, truth.skeleton.joint_count() + 2);
    let (a, b) = (
        WorldMotion::from_clip(&truth),
        WorldMotion::from_clip(&found.clip),
    );
    for (nth, joint) in truth.skeleton.joints.iter().enumerate() {
        let other = found.clip.skeleton.joint_index(&joint.name);
        let Some(other) = other else {
            panic!("{} is lost", joint.name)
        };
        for frame in 0..truth.frames() {
            let distance = a.positions_at(frame)[nth].distance(b.positions_at(frame)[other]);
            assert!(distance < 5e-4, "{}: {distance} m", joint.name);
        }
    }
}

/// A still body of joints with parents and offsets in centimetres.
fn still(joints: &[(&str, Option<usize>, [f64; 3])]) -> Vec<u8> {
    let made = joints.iter().map(|&(name, parent, offset)| BvhJoint {
        name: name.to_owned(),
        parent,
        offset: DVec3::from_array(offset),
        channels: match parent {
            None => [MOVES, TURNS].concat(),
            Some(_) => TURNS.to_vec(),
        },
        end_sites: Vec::new(),
    });
    let values = vec![0.0; 3 * (3 + 3 * joints.len())];
    write(&BvhFile::new(made.collect(), 1.0 / 30.0, values).unwrap()).into_bytes()
}

#[test]
fn joints_that_would_hang_on_each_other_stay() {
    let body = [("Hips", None, [0.0; 3]), ("Spine", Some(0), [0.0, 150.0, 0.0])];
    let hand = |nth: usize| {
        [
            ("LeftHand", Some(0), [10.0, 0.0, 0.0]),
            ("LeftA", Some(nth), [0.1, 0.0, 0.0]),
        ]
    };
    let foot = |nth: usize| {
        [
            ("LeftFoot", Some(0), [10.5, 0.0, 0.0]),
            ("LeftB", Some(nth), [0.1, 0.0, 0.0]),
        ]
    };
    for joints in [
        [body, hand(2), foot(4)].concat(),
        [&body[..1], &hand(1), &foot(3), &body[1..]].concat(),
    ] {
        let found = read(&Source::new("ring.bvh", &still(&joints)), &Options::default()).unwrap();
        assert_eq!(found.report.joints, joints.len());
        assert!(
            found.report.repairs.iter().all(|note| note.topic != Topic::Rig),
            "{:?}",
            found.report.repairs
        );
    }
}

#[test]
fn notes_list_a_few_joints_and_count_the_others() {
    let names: Vec<String> = (0..40).map(|nth| format!("Bone{nth}")).collect();
    let joint = |nth: usize, name: &str| BvhJoint {
        name: name.to_owned(),
        parent: nth.checked_sub(1).map(|_| 0),
        offset: DVec3::Y,
        channels: [MOVES, TURNS].concat(),
        end_sites: Vec::new(),
    };
    let joints = names.iter().enumerate().map(|(nth, name)| joint(nth, name));
    let values = (0..10).flat_map(|frame| {
        let mut row = vec![0.0; 6 * 40];
        row.chunks_mut(6).skip(1).for_each(|of| of[0] = f64::from(frame));
        row
    });
    let file = BvhFile::new(joints.collect(), 1.0 / 30.0, values.collect()).unwrap();
    let found = read(
        &Source::new("star.bvh", write(&file).as_bytes()),
        &Options::default(),
    );
    let repairs = found.unwrap().report.repairs;
    let note = repairs.iter().find(|note| note.topic == Topic::Bystanders);
    let text = &note.unwrap().text;
    assert!(text.ends_with(" and 31 more") && text.len() < 300, "{text}");
}

#[test]
fn a_foot_that_leaves_its_leg_is_named_and_one_that_walks_away_refused() {
    let (_, bytes) = rig(0.08);
    let found = read(&Source::new("rig.bvh", &bytes), &Options::default()).unwrap();
    let odd = &found.report.oddities[0];
    assert!(
        odd.topic == Topic::Sliding && odd.text.contains("Foot_L by 0."),
        "{odd:?}"
    );
    let (_, bytes) = rig(1.5);
    let error = read(&Source::new("rig.bvh", &bytes), &Options::default()).unwrap_err();
    assert!(error.to_string().contains("--max-slide"), "{error}");
}
