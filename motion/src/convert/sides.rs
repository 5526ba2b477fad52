//! Finds left and right by the joints' names.

use glam::Vec3;

use crate::skeleton::Joint;

/// The direction from right to left between the two children of the root whose names differ only in
/// left and right; +X without such a pair.
pub(super) fn left_axis_of(joints: &[Joint]) -> Vec3 {
    let children = || joints.iter().filter(|j| j.parent == Some(0));
    for left in children() {
        let Some(mirrored) = mirrored_name(&left.name) else {
            continue;
        };
        let axis = children()
            .find(|right| right.name == mirrored)
            .and_then(|right| (left.offset_m - right.offset_m).try_normalize());
        if let Some(axis) = axis {
            return axis;
        }
    }
    Vec3::X
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
        assert!(left_axis_of(&hips).abs_diff_eq(Vec3::NEG_Y, 1e-6));
    }

    #[test]
    fn without_a_pair_left_is_x() {
        assert_eq!(
            left_axis_of(&joints(&[("Spine", [0.0, 1.0, 0.0]), ("Leg_L", [0.1, 0.0, 0.0])])),
            Vec3::X
        );
        assert_eq!(
            left_axis_of(&joints(&[("Leg_L", [0.1; 3]), ("Leg_R", [0.1; 3])])),
            Vec3::X,
            "in one place"
        );
    }
}
