use std::path::Path;
use std::sync::Arc;

use super::*;
use crate::style::StyleTable;
use crate::style::testing::{walker, walker_style};

/// The default pack's skeleton and styles.
fn pack() -> (Arc<Skeleton>, StyleTable) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/human");
    let rig = troupe_engine::pack::Pack::load(&folder).unwrap().rig;
    (
        Arc::clone(&rig.skeleton),
        StyleTable::load(&rig, &folder, None).unwrap(),
    )
}

#[test]
fn every_walking_style_of_the_default_pack_goes_in_every_direction() {
    let (_, styles) = pack();
    for style in styles.list().iter().filter(|style| !style.is_static) {
        for (name, degrees) in WAYS {
            let way = degrees.to_radians();
            let goes = |gait: &&Gait| {
                !gait.stands() && wrap_angle(gait.left_mps.atan2(gait.forward_mps) - way).abs() < NEAR
            };
            let gait = style.gaits.iter().find(goes);
            assert!(gait.is_some(), "{} cannot go {name}", style.name);
            let walk = walk(style).unwrap();
            let share = gait.unwrap().speed_mps() / walk.speed_mps();
            assert!(
                !gait.unwrap().built || share > 0.8 || gait.unwrap().speed_mps() > 1.2,
                "{}: {share}",
                style.name
            );
        }
        let message = style.to_proto();
        assert!(
            message.gaits.iter().all(|gait| !gait.name.starts_with("step-")),
            "{}",
            style.name
        );
    }
}

#[test]
fn feet_stand_still_and_hips_face_ahead() {
    let (skeleton, styles) = pack();
    let mut built = 0;
    for style in styles.list() {
        for gait in style.gaits.iter().filter(|gait| gait.built) {
            built += 1;
            let key_s = gait.period_frames / FPS / gait.keys.len() as f32;
            let velocity = Vec3::new(gait.left_mps, 0.0, gait.forward_mps);
            let at = |key: usize| {
                let key = &gait.keys[key % gait.keys.len()];
                assert!(
                    heading_of(key.rotations[0], skeleton.left_axis).abs() < 0.02,
                    "{}",
                    style.name
                );
                places(&skeleton, key.height_m, &key.rotations).0
            };
            let legs = legs(&skeleton);
            let mut stood = 0;
            for key in 0..gait.keys.len() {
                let (here, there) = (at(key), at(key + 1));
                let apart = (here[legs[0].foot] - here[legs[1].foot]).with_y(0.0).length();
                assert!(apart > CLOSED_M - 0.02, "{} {} {apart}", style.name, gait.name);
                for leg in &legs {
                    let [hip, knee, ankle] = [leg.upper, leg.lower, leg.foot].map(|joint| here[joint]);
                    assert!(
                        knee.z > 0.5 * (hip.z + ankle.z) - 0.01,
                        "{} {}: knees bend ahead",
                        style.name,
                        gait.name
                    );
                    let phase =
                        key as f32 / KEYS as f32 - if leads(leg, &legs, gait, &here) { 0.0 } else { 0.5 };
                    if phase.rem_euclid(1.0) + 1.0 / (KEYS as f32) < STANDING {
                        let slid = there[leg.foot] - here[leg.foot] + velocity * key_s;
                        assert!(
                            slid.length() < 5e-3,
                            "{} {} key {key}: {slid}",
                            style.name,
                            gait.name
                        );
                        stood += 1;
                    }
                }
            }
            assert!(stood > KEYS / 2, "{stood}");
        }
    }
    assert!(built > 60, "{built} gaits");
}

/// Whether a leg is on the side of travel.
fn leads(leg: &Leg, legs: &[Leg], gait: &Gait, places: &[Vec3]) -> bool {
    let other = legs.iter().find(|other| other.foot != leg.foot).unwrap();
    let left = places[leg.upper].x > places[other.upper].x;
    left == (gait.left_mps > -1e-4)
}

#[test]
fn nothing_is_built_for_a_style_with_side_gaits_or_without_knees() {
    assert!(build(&walker_style(), &walker()).is_empty(), "no knees");
    let (skeleton, styles) = pack();
    let mut style = Style::clone(&styles.get("normal").unwrap());
    assert!(build(&style, &skeleton).is_empty(), "it has all of them");
    style.gaits.retain(|gait| !gait.built);
    assert!(build(&style, &skeleton).len() >= 4);
    let mut aside = style.gait("walk").unwrap().clone();
    aside.name = "shuffle".to_owned();
    (aside.left_mps, aside.forward_mps) = (1.0, 0.1);
    style.gaits.push(aside);
    let names: Vec<_> = build(&style, &skeleton)
        .into_iter()
        .map(|gait| gait.name)
        .collect();
    assert!(
        !names.contains(&"step-left".to_owned()) && names.contains(&"step-right".to_owned()),
        "{names:?}"
    );
}

#[test]
fn a_swing_goes_the_whole_way_and_comes_to_rest() {
    let step = |share: f32| swing(share + 1e-3) - swing(share);
    assert!(swing(0.0).abs() < 1e-6 && (swing(1.0) - 1.0).abs() < 1e-6 && (swing(0.5) - 0.5).abs() < 1e-5);
    assert!(step(0.0) < 1e-5 && step(0.999) < 1e-5);
    for share in 0..999 {
        let share = share as f32 * 1e-3;
        assert!(step(share) >= 0.0);
        // The acceleration is at most 8π / (2 + π), and the velocity has no jump.
        assert!((step(share + 1e-3) - step(share)).abs() < 6.5e-6, "{share}");
    }
}
