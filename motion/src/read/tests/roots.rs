//! Which joint of a rig is the root.

use super::kinds::{person, plain};
use super::people::Dialect;
use crate::bvh::{BvhFile, BvhJoint, Channel, write};
use crate::fk::WorldMotion;
use crate::read::{OptionName, Options, Source, Topic, read};
use crate::{Clip, Vec3};

const MOVES: [Channel; 3] = [Channel::Xposition, Channel::Yposition, Channel::Zposition];
const TURNS: [Channel; 3] = [Channel::Zrotation, Channel::Xrotation, Channel::Yrotation];

/// A person who walks in place and whose hips move by some metres.
fn in_place(by_m: f32) -> Clip {
    let mut clip = person().walk(60, 30.0, &[0.3, 0.8, 0.1, 0.6, 0.9, 0.2, 0.45]);
    for (frame, root) in clip.root_positions.iter_mut().enumerate() {
        *root = Vec3::new(0.0, 0.8 + 0.5 * by_m * (0.3 * frame as f32).sin(), 0.0);
    }
    clip
}

/// A BVH of a body below a root that does not move, with a joint beside the body.
fn below_a_still_root(clip: &Clip) -> Vec<u8> {
    let file = Dialect::plain().file(clip);
    let joint = |name: &str, parent, channels: &[Channel]| BvhJoint {
        name: name.to_owned(),
        parent,
        channels: channels.to_vec(),
        ..file.joints()[1].clone()
    };
    let mut joints = vec![joint("Reference", None, &[&MOVES[..], &TURNS].concat())];
    joints.extend(file.joints().iter().map(|of| BvhJoint {
        parent: Some(of.parent.map_or(0, |parent| parent + 1)),
        ..of.clone()
    }));
    joints.push(joint("Prop", Some(0), &TURNS));
    let rows = (0..file.frames()).flat_map(|frame| [&[0.0; 6], file.row(frame), &[0.0; 3]].concat());
    let values = rows.collect();
    write(&BvhFile::new(joints, file.frame_time_s(), values).unwrap()).into_bytes()
}

#[test]
fn the_joint_that_carries_the_body_is_the_root_however_little_it_moves() {
    for by_m in [0.0, 0.004, 0.02, 0.2] {
        let truth = in_place(by_m);
        let named = below_a_still_root(&truth);
        // Without its words, the body is found by what hangs on it.
        let nameless = String::from_utf8(named.clone()).unwrap();
        let nameless = nameless.replace("Foot_", "Thing_").into_bytes();
        for bytes in [named, nameless] {
            let found = plain("walk.bvh", &bytes);
            let names = found.clip.skeleton.joints.iter();
            assert!(names.clone().all(|joint| joint.name != "Prop"));
            assert_eq!(
                (&*found.clip.skeleton.joints[0].name, names.len()),
                ("Hips", truth.skeleton.joint_count())
            );
            let notes = found.report.repairs.iter();
            assert_eq!(
                notes.map(|note| note.topic).collect::<Vec<_>>(),
                [Topic::Bystanders]
            );
            let (a, b) = (
                WorldMotion::from_clip(&truth),
                WorldMotion::from_clip(&found.clip),
            );
            let mut off_m = 0.0_f32;
            for (nth, joint) in truth.skeleton.joints.iter().enumerate() {
                let other = found.clip.skeleton.joint_index(&joint.name);
                // Feet have other names in one of the files.
                let Some(other) = other else { continue };
                for frame in 0..truth.frames() {
                    let distance_m = a.positions_at(frame)[nth].distance(b.positions_at(frame)[other]);
                    off_m = off_m.max(distance_m);
                }
            }
            assert!(off_m < 5e-4, "{by_m}: {off_m} m");
        }
    }
}

#[test]
fn a_joint_with_most_others_that_slides_too_far_may_be_named_as_the_root() {
    let parents = [
        None,
        Some(0),
        Some(1),
        Some(2),
        Some(3),
        Some(4),
        Some(5),
        Some(6),
    ];
    let arm = [Some(0), Some(8), Some(9), Some(10), Some(11)];
    let joints: Vec<BvhJoint> = (parents.into_iter().chain(arm).enumerate())
        .map(|(nth, parent)| BvhJoint {
            name: format!("Bone{nth}"),
            parent,
            offset: glam::DVec3::new(0.0, 10.0, 0.0),
            channels: match nth {
                0 | 1 => [MOVES, TURNS].concat(),
                _ => TURNS.to_vec(),
            },
            end_sites: Vec::new(),
        })
        .collect();
    let row = |frame: usize| {
        let mut row = vec![0.0; 12 + 3 * 11];
        (row[3], row[7]) = (frame as f64, 10.0 + 20.0 * frame as f64);
        row
    };
    let file = BvhFile::new(joints, 1.0 / 30.0, (0..20).flat_map(row).collect()).unwrap();
    let text = write(&file);
    let source = Source::new("limbs.bvh", text.as_bytes());
    let error = read(&source, &Options::default()).unwrap_err();
    assert!(
        error.to_string().contains("--root Bone1 reads what hangs on it"),
        "{error}"
    );
    assert_eq!(error.options()[0].option, OptionName::Root);
    let options = Options {
        root: Some("Bone1".to_owned()),
        ..Options::default()
    };
    assert_eq!(read(&source, &options).unwrap().report.joints, 7);
}
