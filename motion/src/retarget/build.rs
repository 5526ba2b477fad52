//! Whether the lengths of a body are such as a body can have.

use std::ops::RangeInclusive;

use super::figure::Figure;
use crate::anatomy::Limb;

/// Lengths of the parts of a body by the length of its legs. People have a trunk of 0.6, a neck of
/// 0.2 and arms of 0.7; a cartoon's legs are a sixth as long. Lizards and giraffes are on four.
const TRUNK: RangeInclusive<f32> = 0.05..=10.0;
const NECK: RangeInclusive<f32> = 0.0..=4.0;
const ARM: RangeInclusive<f32> = 0.03..=8.0;
/// From the trunk to where a limb begins, and along a foot.
const BESIDE: RangeInclusive<f32> = 0.0..=4.0;

/// What of a body's build no body has: each as a sentence with the joint, the length and what is
/// allowed. Empty if all is well.
pub(super) fn faults(figure: &Figure) -> Vec<String> {
    // A robot's description has true lengths: an H1's trunk begins and ends at its waist.
    if figure.skeleton.robot.is_some() {
        return Vec::new();
    }
    let parts = &figure.parts;
    let mut faults = Vec::new();
    let mut check = |what: &str, chain: &[usize], allowed: &RangeInclusive<f32>| {
        let bones = chain
            .windows(2)
            .map(|pair| (pair[1], figure.between(pair[0], pair[1]).length()));
        let length_m: f32 = bones.clone().map(|(_, bone_m)| bone_m).sum();
        let [low_m, high_m] = [allowed.start(), allowed.end()].map(|share| share * figure.leg_m);
        if (low_m..=high_m).contains(&length_m) {
            return;
        }
        let longest = bones.max_by(|a, b| a.1.total_cmp(&b.1));
        let at = longest.map_or(String::new(), |(joint, bone_m)| {
            let name = &figure.skeleton.joints[joint].name;
            format!(", {bone_m:.2} m of it to {name}")
        });
        faults.push(format!(
            "build: {what} is {length_m:.2} m long{at}; allowed: {low_m:.2} to {high_m:.2} m with legs of {:.2} m",
            figure.leg_m
        ));
    };
    let chest = parts.trunk[parts.trunk.len() - 1];
    if parts.trunk.len() > 1 {
        check("the trunk", &parts.trunk, &TRUNK);
    }
    let neck: Vec<usize> = std::iter::once(chest).chain(parts.neck.iter().copied()).collect();
    check("the neck", &neck, &NECK);
    let mut limb = |limb: &Limb, trunk: usize, [beside, what]: [&str; 2], is_leg: bool| {
        check(beside, &[trunk, limb.top], &BESIDE);
        match is_leg {
            // Other lengths are by those of the legs.
            true => check(what, &[&[limb.end][..], limb.toe.as_slice()].concat(), &BESIDE),
            false => check(what, &limb.chain(), &ARM),
        }
    };
    for leg in &parts.legs {
        limb(leg, parts.trunk[0], ["the way to a hip", "a foot"], true);
    }
    for arm in parts.arms.iter().flatten() {
        let names = match parts.on_fours {
            true => ["the way to a shoulder", "a fore leg"],
            false => ["the way to a shoulder", "an arm"],
        };
        limb(arm, chest, names, false);
    }
    faults
}
