//! Finds left and right by the joints' names.

use std::collections::HashMap;

use glam::{Quat, Vec3};

use crate::anatomy::{Name, Side};
use crate::skeleton::Joint;

/// Least distance of a left joint from its counterpart, metres.
const MIN_WIDTH_M: f32 = 1e-3;
/// Cosine of 10°: an axis this near to +X is +X.
const MIN_ALONG_X: f32 = 0.985;
/// Most frames that [`mean_axis`] looks at.
const LOOKED_AT: usize = 64;

/// The direction from right to left between the two children of the root whose names differ only in
/// left and right; none without such a pair.
pub(super) fn left_axis_of(joints: &[Joint]) -> Option<Vec3> {
    let children = || joints.iter().filter(|j| j.parent == Some(0));
    for left in children() {
        let Some(mirrored) = mirrored_name(&left.name) else {
            continue;
        };
        let axis = children()
            .find(|right| right.name == mirrored)
            .and_then(|right| (left.offset_m - right.offset_m).try_normalize());
        if axis.is_some() {
            return axis;
        }
    }
    None
}

/// The mean direction from right to left, in the root's frame of reference. It is that between two
/// joints whose names differ only in left and right: of those that are apart, the nearest to the
/// root. CMU's hips are in one place, so the next joints show it.
pub(super) fn left_axis_in(joints: &[Joint], rotations: &[Quat]) -> Option<Vec3> {
    let pairs = (0..joints.len()).filter_map(|left| {
        let mirrored = mirrored_name(&joints[left].name)?;
        let right = joints.iter().position(|joint| joint.name == mirrored)?;
        Some((left, right))
    });
    mean_axis(joints, rotations, pairs.collect())
}

/// As [`left_axis_in`], by names of any program: `Bip01 L Thigh`, `CC_Base_L_Thigh`, `LThigh`.
pub(super) fn left_axis_by_words(joints: &[Joint], rotations: &[Quat]) -> Option<Vec3> {
    let mut rights = HashMap::new();
    let mut lefts = Vec::new();
    for (joint, of) in joints.iter().enumerate() {
        let name = Name::of(&of.name);
        if name.is_helper() {
            continue;
        }
        // Words leave out numbers, which tell the joints of fingers apart.
        let numbers: String = of.name.chars().filter(char::is_ascii_digit).collect();
        match name.side {
            Some(Side::Left) => lefts.push((joint, (name.words, numbers))),
            Some(Side::Right) => {
                rights.entry((name.words, numbers)).or_insert(joint);
            }
            None => {}
        }
    }
    let pairs = lefts
        .iter()
        .filter_map(|(left, key)| Some((*left, *rights.get(key)?)));
    mean_axis(joints, rotations, pairs.collect())
}

/// The mean direction from the right to the left joint of the pair that is nearest to the root, of
/// those that are apart.
fn mean_axis(joints: &[Joint], rotations: &[Quat], mut pairs: Vec<(usize, usize)>) -> Option<Vec3> {
    let depth = |joint: usize| std::iter::successors(joints[joint].parent, |&j| joints[j].parent).count();
    pairs.sort_by_key(|&(left, right)| depth(left).max(depth(right)));
    let frames = rotations.len() / joints.len().max(1);
    let step = frames.div_ceil(LOOKED_AT).max(1);
    let mut places = vec![Vec3::ZERO; joints.len()];
    let mut turns = vec![Quat::IDENTITY; joints.len()];
    let mut sums = vec![Vec3::ZERO; pairs.len()];
    for pose in rotations.chunks_exact(joints.len()).step_by(step) {
        for (nth, joint) in joints.iter().enumerate().skip(1) {
            let parent = joint.parent.unwrap_or(0);
            places[nth] = places[parent] + turns[parent] * joint.offset_m;
            turns[nth] = turns[parent] * pose[nth];
        }
        for (sum, &(left, right)) in sums.iter_mut().zip(&pairs) {
            *sum += places[left] - places[right];
        }
    }
    let least = MIN_WIDTH_M * frames.div_ceil(step) as f32;
    let axis = sums.iter().find(|sum| sum.length() > least)?.try_normalize()?;
    // Without a reason to do otherwise, left is exactly +X.
    Some(if axis.x > MIN_ALONG_X { Vec3::X } else { axis })
}

/// The name of the right-hand counterpart of a left-hand joint: `LeftUpLeg`, `left_hip`,
/// `UpperLeg_L`, `L_Hip`, `thigh.l`.
fn mirrored_name(name: &str) -> Option<String> {
    for (left, right) in [("Left", "Right"), ("left", "right"), ("LEFT", "RIGHT")] {
        if name.contains(left) {
            return Some(name.replacen(left, right, 1));
        }
    }
    for (left, right) in [("L", "R"), ("l", "r")] {
        for mark in ['_', '.', '-', ' '] {
            if let Some(stem) = name.strip_suffix(left).filter(|s| s.ends_with(mark)) {
                return Some(format!("{stem}{right}"));
            }
            if let Some(stem) = name.strip_prefix(left).filter(|s| s.starts_with(mark)) {
                return Some(format!("{right}{stem}"));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joints(children: &[(&str, [f32; 3])]) -> Vec<Joint> {
        let root = Joint {
            name: "Hips".to_owned(),
            parent: None,
            offset_m: Vec3::ZERO,
        };
        let child = |&(name, offset): &(&str, [f32; 3])| Joint {
            name: name.to_owned(),
            parent: Some(0),
            offset_m: Vec3::from(offset),
        };
        std::iter::once(root).chain(children.iter().map(child)).collect()
    }

    #[test]
    fn names_of_many_tools_are_mirrored() {
        for (left, right) in [
            ("LeftUpLeg", "RightUpLeg"),
            ("mixamorig:LeftUpLeg", "mixamorig:RightUpLeg"),
            ("left_hip", "right_hip"),
            ("UpperLeg_L", "UpperLeg_R"),
            ("L_Hip", "R_Hip"),
            ("thigh.l", "thigh.r"),
        ] {
            assert_eq!(mirrored_name(left).as_deref(), Some(right));
        }
        // A single l at an end is part of a word.
        assert_eq!(mirrored_name("Pelvis"), None);
        assert_eq!(mirrored_name("tail"), None);
        assert_eq!(mirrored_name("lumbar"), None);
    }

    #[test]
    fn left_is_from_the_right_hip_to_the_left_one() {
        // Bandai-Namco's hips: the character's left is the pelvis' -Y.
        let hips = joints(&[
            ("UpperLeg_L", [-0.022, -0.065, 0.0]),
            ("Spine", [0.16, 0.0, 0.0]),
            ("UpperLeg_R", [-0.022, 0.065, 0.0]),
        ]);
        assert!(left_axis_of(&hips).unwrap().abs_diff_eq(Vec3::NEG_Y, 1e-6));
    }

    #[test]
    fn without_a_pair_there_is_no_left() {
        assert_eq!(
            left_axis_of(&joints(&[("Spine", [0.0, 1.0, 0.0]), ("Leg_L", [0.1, 0.0, 0.0])])),
            None
        );
        assert_eq!(
            left_axis_of(&joints(&[("Leg_L", [0.1; 3]), ("Leg_R", [0.1; 3])])),
            None,
            "in one place"
        );
    }

    #[test]
    fn hips_without_length_leave_it_to_the_legs() {
        // CMU's: LHipJoint and RHipJoint stand in the pelvis.
        let mut cmu = joints(&[("LHipJoint", [0.0; 3]), ("RHipJoint", [0.0; 3])]);
        for (name, parent, x) in [("LeftUpLeg", 1, -0.1), ("RightUpLeg", 2, 0.1)] {
            cmu.push(Joint {
                name: name.to_owned(),
                parent: Some(parent),
                offset_m: Vec3::new(x, -0.05, 0.0),
            });
        }
        assert_eq!(left_axis_of(&cmu), None);
        let still = [Quat::IDENTITY; 10];
        assert_eq!(left_axis_in(&cmu, &still), Some(Vec3::NEG_X));
        assert_eq!(left_axis_in(&cmu[..3], &still[..6]), None);
    }

    #[test]
    fn names_of_any_program_show_the_left() {
        for (left, right) in [
            ("Bip01 L Thigh", "Bip01 R Thigh"),
            ("J_Bip_L_UpperLeg", "J_Bip_R_UpperLeg"),
            ("CC_Base_L_Thigh", "CC_Base_R_Thigh"),
            ("LThigh", "RThigh"),
            ("lThigh", "rThigh"),
            ("LHipJoint", "RHipJoint"),
        ] {
            let legs = joints(&[(left, [-0.1, 0.0, 0.0]), (right, [0.1, 0.0, 0.0])]);
            let still = [Quat::IDENTITY; 6];
            assert_eq!((left_axis_of(&legs), left_axis_in(&legs, &still)), (None, None));
            assert_eq!(left_axis_by_words(&legs, &still), Some(Vec3::NEG_X), "{left}");
        }
        // Joints of other fingers, and targets of a rig, are no pair.
        for (left, right) in [
            ("Bip01 L Finger1", "Bip01 R Finger11"),
            ("Bip01 L IK", "Bip01 R IK"),
        ] {
            let other = joints(&[(left, [-0.1, 0.0, 0.0]), (right, [0.1, 0.0, 0.0])]);
            assert_eq!(left_axis_by_words(&other, &[Quat::IDENTITY; 3]), None);
        }
    }
}
