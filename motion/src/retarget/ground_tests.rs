//! Where the ground of a file is, and what lies on it.

use std::sync::Arc;

use glam::{Quat, Vec3};

use super::tests::{HIPS_M, example, figure, person};
use super::*;
use crate::anatomy::PartsDoc;
use crate::clip::Clip;
use crate::read::tests::people::Dialect;
use crate::read::{Options, RestPose, Source, read};
use crate::skeleton::Joint;

const NUMBERS: [f32; 7] = [0.3, 0.8, 0.1, 0.6, 0.9, 0.2, 0.45];

#[test]
fn a_single_frame_says_nothing_of_the_ground() {
    let mut walk = person(2, 1.0, 2, RestPose::T).walk(60, 30.0, &NUMBERS);
    let hips_m = |clip: &Clip| {
        let bytes = Dialect::plain().bytes(clip);
        let found = read(&Source::new("clip.bvh", &bytes), &Options::default()).unwrap();
        assert_eq!(found.clip.frames(), clip.frames());
        found.figure(&PartsDoc::default()).unwrap().root().y
    };
    let wanted = hips_m(&walk);
    assert!((wanted - HIPS_M).abs() < 0.05, "{wanted}");
    // As if it sat, or jumped.
    for by in [-0.4, 1.0] {
        walk.root_positions.iter_mut().for_each(|root| root.y += by);
        let found = hips_m(&walk.slice(20..21).unwrap());
        assert!((found - wanted).abs() < 1e-3, "{by}: {found}, not {wanted}");
        walk.root_positions.iter_mut().for_each(|root| root.y -= by);
    }
}

#[test]
fn an_origin_at_the_hips_is_not_the_ground() {
    let skeleton = person(0, 1.0, 3, RestPose::T).skeleton();
    let rest = vec![Quat::IDENTITY; skeleton.joint_count()];
    let root_m = |height_m| {
        let figure = Figure::resting(Arc::clone(&skeleton), &rest, height_m, &PartsDoc::default());
        figure.unwrap().root().y
    };
    let by_toes = root_m(None);
    assert!((by_toes - HIPS_M).abs() < 0.05, "{by_toes}");
    for height_m in [0.0, HIPS_M + 1.0] {
        assert_eq!(root_m(Some(height_m)), by_toes, "{height_m}");
    }
    // High heels.
    let high = root_m(Some(HIPS_M + 0.08));
    assert!((high - HIPS_M - 0.08).abs() < 1e-3, "{high}");
}

#[test]
fn a_root_on_the_floor_stays_below_the_hips() {
    let (clip, source) = example();
    let mut skeleton = (*person(0, 1.0, 3, RestPose::T).skeleton()).clone();
    for joint in &mut skeleton.joints {
        joint.parent = Some(joint.parent.map_or(0, |parent| parent + 1));
    }
    skeleton.joints[0].offset_m = Vec3::Y * HIPS_M;
    let root = Joint {
        name: "root".to_owned(),
        parent: None,
        offset_m: Vec3::ZERO,
    };
    skeleton.joints.insert(0, root);
    let skeleton = Arc::new(skeleton);
    let rest = vec![Quat::IDENTITY; skeleton.joint_count()];
    let target = Figure::new(skeleton, &rest, Some(0.0), &PartsDoc::default()).unwrap();
    let mut plain = Retargeter::new(
        source.clone(),
        figure(&person(0, 1.0, 3, RestPose::T).skeleton(), 1.0),
    );
    let hips = retarget(plain.as_mut().unwrap(), &clip).unwrap().0;
    let made = retarget(&mut Retargeter::new(source, target).unwrap(), &clip)
        .unwrap()
        .0;
    for frame in 0..clip.frames() {
        let (root, hips) = (made.root_positions[frame], hips.root_positions[frame]);
        assert!(
            (root - hips).with_y(0.0).length() < 0.02,
            "frame {frame}: {root} {hips}"
        );
        let up = made.rotations_at(frame)[0] * Vec3::Y;
        assert!(up.y > 0.9999, "frame {frame}: {up}");
    }
}

#[test]
fn a_body_on_two_legs_and_one_on_four_are_named() {
    let (_, source) = example();
    let animal = dolls::doll(true);
    let error = Retargeter::new(source, animal).unwrap_err().to_string();
    assert!(
        error.starts_with("the motion is of a body on two legs, and the character stands on four"),
        "{error}"
    );
}
