//! Writes generated hierarchies and reads them back.

use std::collections::HashMap;

use glam::{DQuat, DVec3};
use proptest::prelude::*;

use super::SMALL;
use crate::bvh::{BvhBuildError, BvhFile, BvhJoint, Channel, MAX_DEPTH, parse, write};

/// Any subset of the channels in any order.
fn channels() -> impl Strategy<Value = Vec<Channel>> {
    (Just(Channel::ALL.to_vec()).prop_shuffle(), 0..=6usize).prop_map(|(mut all, count)| {
        all.truncate(count);
        all
    })
}

fn vector() -> impl Strategy<Value = DVec3> {
    [-300.0..300.0f64, -300.0..300.0f64, -300.0..300.0f64].prop_map(DVec3::from)
}

/// Whole quarter turns (gimbal lock), and other angles.
fn value() -> impl Strategy<Value = f64> {
    prop_oneof![
        (-4..=4i32).prop_map(|q| f64::from(q) * 90.0),
        -720.0..720.0f64,
        -1e-5..1e-5f64,
        Just(-0.0)
    ]
}

/// Files with any hierarchy, whose only order is that parents come before children, with odd names.
fn files() -> impl Strategy<Value = BvhFile> {
    let joint = (
        any::<prop::sample::Index>(),
        vector(),
        channels(),
        prop::collection::vec(vector(), 0..3),
    );
    let joints = prop::collection::vec((joint, "[a-zA-Z:_.}é][ -z]{0,8}[a-z}]"), 1..12);
    (joints, 0usize..4, 1e-4..1.0f64).prop_flat_map(|(parts, frames, frame_time_s)| {
        let joints: Vec<_> = parts
            .into_iter()
            .enumerate()
            .map(|(i, ((parent, offset, mut channels, end_sites), name))| {
                if i == 0 && channels.is_empty() {
                    channels.push(Channel::Yrotation);
                }
                let parent = (i > 0).then(|| parent.index(i));
                // The number makes names differ.
                let name = format!("{}{i}", name.replace('{', "("));
                BvhJoint {
                    name,
                    parent,
                    offset,
                    channels,
                    end_sites,
                }
            })
            .collect();
        let total = frames * joints.iter().map(|j| j.channels.len()).sum::<usize>();
        prop::collection::vec(value(), total)
            .prop_map(move |values| BvhFile::new(joints.clone(), frame_time_s, values).unwrap())
    })
}

/// Parent's name, channels and per-frame values of each joint, by name.
type ByName<'a> = HashMap<&'a str, (Option<&'a str>, &'a BvhJoint, Vec<Vec<f64>>)>;

fn by_name(file: &BvhFile) -> ByName<'_> {
    let mut start = 0;
    let mut out = ByName::new();
    for joint in file.joints() {
        let columns = start..start + joint.channels.len();
        start = columns.end;
        let values = (0..file.frames())
            .map(|f| file.row(f)[columns.clone()].to_vec())
            .collect();
        let parent = joint.parent.map(|p| file.joints()[p].name.as_str());
        assert!(out.insert(&joint.name, (parent, joint, values)).is_none());
    }
    out
}

/// The rotation of a joint from its channels, computed with matrices instead of the code under
/// test.
fn rotation(channels: &[Channel], values: &[f64]) -> DQuat {
    let mut m = glam::DMat3::IDENTITY;
    for (channel, value) in channels.iter().zip(values) {
        let angle = value.to_radians();
        m *= match channel {
            Channel::Xrotation => glam::DMat3::from_rotation_x(angle),
            Channel::Yrotation => glam::DMat3::from_rotation_y(angle),
            Channel::Zrotation => glam::DMat3::from_rotation_z(angle),
            _ => glam::DMat3::IDENTITY,
        };
    }
    DQuat::from_mat3(&m)
}

proptest! {
    #[test]
    fn written_files_read_back(file in files()) {
        let text = write(&file);
        let back = parse(&text).map_err(|e| TestCaseError::fail(format!("{e}\n{text}")))?;
        prop_assert_eq!(back.frames(), file.frames());
        prop_assert_eq!(back.frame_time_s(), file.frame_time_s());
        let (want, got) = (by_name(&file), by_name(&back));
        prop_assert_eq!(want.len(), got.len());
        for (name, (parent, joint, values)) in want {
            let (got_parent, got_joint, got_values) = &got[name];
            prop_assert_eq!(parent, *got_parent);
            prop_assert_eq!(&joint.channels, &got_joint.channels);
            prop_assert!(joint.offset.abs_diff_eq(got_joint.offset, 1e-6));
            prop_assert_eq!(joint.end_sites.len(), got_joint.end_sites.len());
            for (a, b) in joint.end_sites.iter().zip(&got_joint.end_sites) {
                prop_assert!(a.abs_diff_eq(*b, 1e-6));
            }
            for (a, b) in values.iter().flatten().zip(got_values.iter().flatten()) {
                prop_assert!((a - b).abs() <= 1e-6, "{} came back as {}", a, b);
            }
            for (a, b) in values.iter().zip(got_values) {
                let (a, b) = (rotation(&joint.channels, a), rotation(&joint.channels, b));
                prop_assert!(a.dot(b).abs() > 1.0 - 1e-9);
            }
        }
        // Once in depth-first order and rounded, nothing changes any more.
        prop_assert_eq!(parse(&write(&back)).unwrap(), back);
    }
}

#[test]
fn the_small_file_is_written_as_expected() {
    let text = write(&parse(SMALL).unwrap());
    assert!(
        text.contains(
            "\tJOINT Chest\n\t{\n\t\tOFFSET 0 10 0\n\t\tCHANNELS 3 Zrotation Xrotation Yrotation\n"
        )
    );
    assert!(text.contains("\t\tEnd Site\n\t\t{\n\t\t\tOFFSET 0 5 0\n\t\t}\n"));
    assert!(
        text.ends_with("MOTION\nFrames: 2\nFrame Time: 0.0333333\n1 2 3 90 0 0 0 0 0\n4 5 6 0 0 0 0 90 0\n")
    );
}

#[test]
fn parts_that_do_not_fit_are_refused() {
    let joint = |name: &str, parent| BvhJoint {
        name: name.to_owned(),
        parent,
        offset: DVec3::ZERO,
        channels: vec![Channel::Xrotation],
        end_sites: Vec::new(),
    };
    let build = |joints: Vec<BvhJoint>, values: Vec<f64>| BvhFile::new(joints, 0.1, values).map(|_| ());
    let one = || vec![joint("a", None)];
    assert_eq!(build(one(), vec![1.0]), Ok(()));
    assert_eq!(build(vec![], vec![]), Err(BvhBuildError::JointCount(0)));
    for name in ["", " a", "a\nb", "a{b", "\u{3000}a"] {
        assert_eq!(
            build(vec![joint(name, None)], vec![]),
            Err(BvhBuildError::Name(0, name.to_owned()))
        );
    }
    assert_eq!(
        build(vec![joint("a", Some(0))], vec![]),
        Err(BvhBuildError::Parent("a".to_owned()))
    );
    let chain = (0..=MAX_DEPTH)
        .map(|i| joint(&format!("j{i}"), i.checked_sub(1)))
        .collect();
    assert_eq!(
        build(chain, vec![]),
        Err(BvhBuildError::Depth(format!("j{MAX_DEPTH}")))
    );
    let twice = BvhJoint {
        channels: vec![Channel::Xrotation; 2],
        ..joint("a", None)
    };
    assert_eq!(
        build(vec![twice], vec![]),
        Err(BvhBuildError::Channels("a".to_owned()))
    );
    let none = BvhJoint {
        channels: vec![],
        ..joint("a", None)
    };
    assert_eq!(build(vec![none], vec![]), Err(BvhBuildError::NoChannels));
    assert_eq!(
        build(one(), vec![f64::NAN]),
        Err(BvhBuildError::NotFinite("a motion value"))
    );
    let two = vec![joint("a", None), joint("b", Some(0))];
    assert_eq!(
        build(two, vec![1.0]),
        Err(BvhBuildError::Values {
            values: 1,
            channels: 2
        })
    );
    assert_eq!(
        BvhFile::new(one(), 0.0, vec![]),
        Err(BvhBuildError::FrameTime(0.0))
    );
}
