//! Which pairs of bodies get a certificate.

use std::sync::Arc;

use glam::{Quat, Vec3};

use super::dolls::doll;
use super::motions::{ON_FOUR, clip};
use super::tests::{HIPS_M, example, figure, g1, person};
use super::*;
use crate::anatomy::{PartsDoc, places};
use crate::clip::Clip;
use crate::fk::local_from_world_rotations;
use crate::read::RestPose;
use crate::rotation::from_wxyz;
use crate::skeleton::{Joint, Skeleton};

fn certificate(source: &Figure, target: &Figure) -> Certificate {
    Certificate::of(&Retargeter::new(source.clone(), target.clone()).unwrap())
}

/// A person whose parts a document corrects.
fn corrected(correct: impl Fn(&mut PartsDoc)) -> Figure {
    let skeleton = person(0, 1.0, 3, RestPose::T).skeleton();
    let found = figure(&skeleton, 1.0);
    let mut doc = PartsDoc::of(found.parts(), &skeleton);
    correct(&mut doc);
    let rest = vec![Quat::IDENTITY; skeleton.joint_count()];
    Figure::new(skeleton, &rest, Some(HIPS_M), &doc).unwrap()
}

#[test]
fn people_of_many_shapes_and_robots_go_together() {
    let (_, source) = example();
    for (words, size, spine, rest) in [
        (0, 1.0, 3, RestPose::T),
        (1, 0.5, 1, RestPose::A),
        (2, 1.6, 4, RestPose::Standing),
    ] {
        let target = figure(&person(words, size, spine, rest).skeleton(), size);
        for pair in [[&source, &target], [&target, &source]] {
            let certificate = certificate(pair[0], pair[1]);
            assert_eq!(certificate.faults(), [""; 0], "{words}");
            assert!(certificate.passes() && certificate.trials.len() == 10);
        }
    }
    let robot = Figure::of_robot(g1(), &PartsDoc::default()).unwrap();
    for pair in [[&source, &robot], [&robot, &source]] {
        assert_eq!(certificate(pair[0], pair[1]).faults(), [""; 0]);
    }
    // An H1's trunk is one joint's place.
    let mut waist = robot;
    assert!(waist.parts.trunk.len() > 1);
    for &joint in &waist.parts.trunk.clone() {
        waist.places[joint] = waist.places[0];
    }
    assert_eq!(build::faults(&waist), [""; 0]);
}

#[test]
fn lengths_that_no_body_has_are_refused_with_the_joint() {
    let (_, source) = example();
    let stretched = |part: &str, to_m: f32| {
        let mut skeleton = (*person(0, 1.0, 3, RestPose::T).skeleton()).clone();
        let is_it = |joint: &Joint| joint.name.ends_with(part);
        for joint in skeleton.joints.iter_mut().filter(|joint| is_it(joint)) {
            joint.offset_m *= to_m / joint.offset_m.length();
        }
        figure(&Arc::new(skeleton), 1.0)
    };
    for (part, to_m, said) in [
        ("Spine1", 99.0, "build: the trunk is 99."),
        ("Head", 5.0, "build: the neck is 5."),
        ("LeftForeArm", 18.0, "build: an arm is 18."),
        ("UpLeg", 6.0, "build: the way to a hip is 6."),
    ] {
        let certificate = certificate(&source, &stretched(part, to_m));
        let faults = certificate.faults();
        let named = format!("{part}; allowed: ");
        assert!(
            faults[0].starts_with(said)
                && faults[0].contains(&named)
                && faults[0].contains("m of it to mixamorig:"),
            "{part}: {faults:#?}"
        );
        assert!(!certificate.passes());
    }
    // Cartoons are no fault: a long trunk on short legs, and arms down to the ground.
    for (part, to_m) in [("Spine1", 3.0), ("LeftForeArm", 2.0), ("Head", 1.0)] {
        let build = certificate(&source, &stretched(part, to_m)).build;
        assert_eq!(build, [""; 0]);
    }
}

#[test]
fn animals_go_together() {
    let [of, mut larger] = [true, true].map(doll);
    assert_eq!(certificate(&of, &of).faults(), [""; 0]);
    let mut skeleton = (*larger.skeleton).clone();
    for joint in &mut skeleton.joints {
        joint.offset_m *= 1.7;
    }
    larger.skeleton = Arc::new(skeleton);
    larger.places.iter_mut().for_each(|place| *place *= 1.7);
    larger.leg_m *= 1.7;
    let certificate = certificate(&of, &larger);
    assert_eq!(certificate.faults(), [""; 0]);
    assert_eq!(certificate.trials.len(), 4);
}

/// A body of the repository's pack of many bodies.
fn animal(name: &str) -> Figure {
    #[derive(serde::Deserialize)]
    struct Tables {
        height_m: f32,
        neutral: Neutral,
        skeleton: Skeleton,
    }
    #[derive(serde::Deserialize)]
    struct Neutral {
        rotations: Vec<[f32; 4]>,
    }
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../models/unimogen/bodies");
    let text = std::fs::read_to_string(format!("{folder}/{name}.toml")).unwrap();
    let tables: Tables = toml::from_str(&text).unwrap();
    let world = tables.neutral.rotations.into_iter().map(from_wxyz);
    let world: Vec<Quat> = world.collect();
    let mut rest = world.clone();
    local_from_world_rotations(&tables.skeleton, &world, &mut rest);
    let skeleton = Arc::new(tables.skeleton);
    Figure::new(skeleton, &rest, Some(tables.height_m), &PartsDoc::default()).unwrap()
}

#[test]
fn a_horse_goes_onto_a_fox() {
    // A horse's legs are almost straight, and its fore legs have a joint more.
    let [horse, fox] = ["horse", "fox"].map(animal);
    assert_eq!(certificate(&horse, &fox).faults(), [""; 0]);
}

#[test]
fn legs_of_animals_that_turn_otherwise_are_seen() {
    let fox = animal("fox");
    let walk = clip(&doll(true), &ON_FOUR[1]).unwrap();
    let mut dresser = Retargeter::new(doll(true), fox.clone()).unwrap();
    let (walk, _) = retarget(&mut dresser, &walk).unwrap();
    let figures = |made: &Clip| Figures::of([&fox, &fox], [&walk, made], (0.0, None));
    assert!(figures(&walk).worst_deg < 0.1);
    // A knee, and a whole leg.
    let leg = &fox.parts.legs[0];
    for joint in [leg.lower[0], leg.top] {
        let mut other = walk.clone();
        for frame in 0..other.frames() {
            let rotation = &mut other.rotations_at_mut(frame)[joint];
            *rotation *= Quat::from_rotation_x(0.5);
        }
        let worst = figures(&other);
        assert!(worst.worst_deg > 20.0, "{worst:?}");
        assert!(worst.joints.bone.starts_with("Back_Leg"), "{worst:?}");
    }
}

#[test]
fn a_leg_that_a_joint_along_its_bone_makes_longer_does_not_lower_the_body() {
    let mut animal = doll(true);
    let mut skeleton = (*animal.skeleton).clone();
    // Fore legs are bent by a joint along the upper bone, and are straight in the pose.
    for (top, limb) in [13, 17].into_iter().zip(animal.parts.arms.iter_mut().flatten()) {
        skeleton.joints[top + 1].offset_m = Vec3::new(0.0, -0.3, 0.3);
        skeleton.joints[top + 2].offset_m = Vec3::new(0.0, -0.3, -0.3);
        (limb.upper, limb.lower) = (vec![top, top + 1], vec![top + 2]);
        (limb.end, limb.toe) = (top + 3, None);
    }
    let still = vec![Quat::IDENTITY; skeleton.joint_count()];
    animal.places = places(&skeleton, &still);
    let lowest = animal
        .places
        .iter()
        .map(|place| place.y)
        .fold(f32::INFINITY, f32::min);
    animal.places.iter_mut().for_each(|place| place.y -= lowest);
    animal.skeleton = Arc::new(skeleton);
    let mut pose = still.clone();
    for top in [13, 17] {
        pose[top] = Quat::from_rotation_x(std::f32::consts::FRAC_PI_4);
        pose[top + 1] = Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2);
        pose[top + 2] = Quat::from_rotation_x(std::f32::consts::FRAC_PI_4);
    }
    // Its fore feet are on the ground.
    let root = animal.places[0] + Vec3::Y * (0.6 * 2.0_f32.sqrt() - 0.6);
    let mut out = still;
    let mut retargeter = Retargeter::new(animal.clone(), animal).unwrap();
    let made = retargeter.pose(root, &pose, &mut out);
    assert!(made.y > root.y - 0.01, "{made} {root}");
}

#[test]
fn arms_on_the_wrong_side_are_refused_with_the_shoulder() {
    let (_, source) = example();
    let target = corrected(|doc| std::mem::swap(&mut doc.left_arm, &mut doc.right_arm));
    for (pair, joint) in [
        ([&source, &target], "mixamorig:RightArm"),
        ([&target, &source], "UpperArm_L"),
    ] {
        let faults = certificate(pair[0], pair[1]).faults();
        let wanted = format!("walk: the difference of a line across the body at {joint} is");
        assert!(
            faults.iter().any(|fault| fault.starts_with(&wanted)),
            "{faults:#?}"
        );
    }
}

#[test]
fn legs_of_the_other_side_are_refused_with_the_foot() {
    let (_, source) = example();
    let target = corrected(|doc| std::mem::swap(&mut doc.left_leg, &mut doc.right_leg));
    let faults = certificate(&source, &target).faults();
    let wanted = "the difference of a line across the body at mixamorig:RightFoot is";
    assert!(faults.iter().any(|fault| fault.contains(wanted)), "{faults:#?}");
}

#[test]
fn a_leg_without_a_shin_is_refused_with_a_number() {
    let (_, source) = example();
    let mut skeleton = (*person(0, 1.0, 3, RestPose::T).skeleton()).clone();
    let ankle = skeleton.joint_index("mixamorig:RightFoot").unwrap();
    skeleton.joints[ankle].offset_m = Vec3::ZERO;
    let target = figure(&Arc::new(skeleton), 1.0);
    let faults = certificate(&source, &target).faults();
    let wanted = "distance of feet from their places at mixamorig:RightFoot is ";
    assert!(faults.iter().any(|fault| fault.contains(wanted)), "{faults:#?}");
    let finite = |fault: &String| !fault.contains("inf") && !fault.contains("NaN");
    assert!(faults.iter().all(finite), "{faults:#?}");
}

#[test]
fn what_is_allowed_grows_and_shrinks_with_the_legs() {
    let faults = |leg_m: f32, under_m: f32| {
        let figures = Figures {
            under_m,
            leg_m,
            ..Figures::default()
        };
        figures.faults().len()
    };
    assert_eq!([faults(0.8, 0.019), faults(0.8, 0.021)], [0, 1]);
    assert_eq!([faults(8.0, 0.15), faults(8.0, 0.17)], [0, 1]);
    assert_eq!([faults(0.05, 0.0019), faults(0.05, 0.0021)], [0, 1]);
    let (_, source) = example();
    for size in [0.06, 1.0, 18.0] {
        let target = figure(&person(0, size, 3, RestPose::T).skeleton(), size);
        assert_eq!(certificate(&source, &target).faults(), [""; 0], "{size}");
    }
}

#[test]
fn a_certificate_is_always_the_same() {
    let (clip, source) = example();
    let target = figure(&person(0, 0.8, 3, RestPose::T).skeleton(), 0.8);
    let mut retargeter = Retargeter::new(source, target).unwrap();
    let first = Certificate::of(&retargeter);
    retarget(&mut retargeter, &clip).unwrap();
    assert_eq!(Certificate::of(&retargeter), first);
}
