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
