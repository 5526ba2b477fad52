//! Feet that stand flat, and toes that stay out of the ground.

use std::sync::Arc;

use glam::{Quat, Vec3};

use super::dolls::doll;
use super::motions::{ON_TWO, clip};
use super::tests::{HIPS_M, figure, person};
use super::*;
use crate::anatomy::PartsDoc;
use crate::clip::Clip;
use crate::read::RestPose;
use crate::skeleton::{ContactParams, Joint, Skeleton};

/// Mixamo's names, with ends of toes or without.
fn hero(has_ends: bool) -> Figure {
    let mut skeleton = (*person(0, 1.0, 3, RestPose::T).skeleton()).clone();
    for side in ["Left", "Right"].into_iter().filter(|_| has_ends) {
        skeleton.joints.push(Joint {
            name: format!("mixamorig:{side}Toe_End"),
            parent: skeleton.joint_index(&format!("mixamorig:{side}ToeBase")),
            offset_m: Vec3::new(0.0, -0.01, 0.09),
        });
    }
    figure(&Arc::new(skeleton), 1.0)
}

#[test]
fn toes_bend_rather_than_go_into_the_ground() {
    // The doll rolls over its toes, which are the ends of stiff feet.
    let source = doll(false);
    let walk = clip(&source, &ON_TWO[1]).unwrap();
    for (has_ends, joint) in [(true, "Toe_End"), (false, "ToeBase")] {
        let target = hero(has_ends);
        let mut retargeter = Retargeter::new(source.clone(), target.clone()).unwrap();
        let (made, figures) = retarget(&mut retargeter, &walk).unwrap();
        assert!(figures.under_m < 0.005, "{figures:?}");
        let mut stiff = made.clone();
        for frame in 0..stiff.frames() {
            for leg in &target.parts.legs {
                stiff.rotations_at_mut(frame)[leg.toe.unwrap()] = Quat::IDENTITY;
            }
        }
        let figures = Figures::of([&source, &target], [&walk, &stiff], (0.0, None));
        assert!(figures.under_m > 0.015, "{figures:?}");
        assert!(figures.joints.under.ends_with(joint), "{figures:?}");
    }
}

#[test]
fn toes_that_lie_on_their_backs_are_not_bent() {
    let target = hero(true);
    let toes = feet::Toes::of(&target, &target.parts.legs[0]).unwrap();
    let bend = |pitch: f32| {
        let bent = toes.bent(0.15, Quat::from_rotation_x(pitch), Quat::IDENTITY);
        bent.to_scaled_axis().length()
    };
    assert!(bend(0.0) == 0.0 && bend(3.0) == 0.0);
    assert!(bend(1.5) > 1.0);
    // Nothing jumps between.
    let steps: Vec<f32> = (0..300).map(|step| bend(0.01 * step as f32)).collect();
    let jump = |pair: &[f32]| (pair[1] - pair[0]).abs();
    let most = steps.windows(2).map(jump).fold(0.0, f32::max);
    assert!(
        most < 0.06,
        "{most} {:?}",
        steps.windows(2).position(|pair| jump(pair) == most)
    );
}

#[test]
fn feet_are_as_level_as_contacts_say() {
    let mut skeleton = (*person(0, 1.0, 3, RestPose::T).skeleton()).clone();
    let joint = |name: &str| skeleton.joint_index(&format!("mixamorig:{name}")).unwrap();
    let feet = ["Left", "Right"].map(|side| ["Foot", "ToeBase"].map(|part| joint(&format!("{side}{part}"))));
    skeleton.contacts = Some(ContactParams {
        joints: feet.concat(),
        max_height_m: vec![0.15; 4],
        max_speed_mps: 0.4,
        clearance_m: [[0.08, 0.02]; 2].concat(),
    });
    // Feet that hang in the mean pose of a motion.
    let mut rest = vec![Quat::IDENTITY; skeleton.joint_count()];
    feet.iter()
        .for_each(|foot| rest[foot[0]] = Quat::from_rotation_x(-0.3));
    let with = |skeleton: &Skeleton| {
        let skeleton = Arc::new(skeleton.clone());
        Figure::new(skeleton, &rest, Some(HIPS_M), &PartsDoc::default()).unwrap()
    };
    let rise = |figure: &Figure| feet.map(|[ankle, toe]| figure.between(toe, ankle).y);
    assert!(rise(&with(&skeleton)).iter().all(|m| (m - 0.06).abs() < 1e-4));
    skeleton.contacts = None;
    assert!(rise(&with(&skeleton)).iter().all(|m| *m < 0.03));
}

#[test]
fn toes_are_straight_where_the_clips_stand_flat() {
    let source = doll(false);
    let walk = clip(&source, &ON_TWO[1]).unwrap();
    // Toes hang while their feet are in the air.
    let mut hanging: Clip = walk.clone();
    let world = crate::fk::WorldMotion::from_clip(&walk);
    for frame in 0..walk.frames() {
        for leg in &source.parts.legs {
            let is_up = world.positions_at(frame)[leg.end].y > source.places[leg.end].y + 0.03;
            let pitch = if is_up { 0.8 } else { 0.0 };
            hanging.rotations_at_mut(frame)[leg.toe.unwrap()] = Quat::from_rotation_x(pitch);
        }
    }
    let found = Figure::of_clip(&hanging, None, &PartsDoc::default()).unwrap();
    for leg in &found.parts.legs {
        let turn = found.neutral[leg.toe.unwrap()].to_scaled_axis();
        assert!(turn.x.abs() < 0.05, "{turn}");
    }
}
