//! The bodies on which the motions of a certificate are made: one on two legs and one on four.

use std::sync::Arc;

use glam::{Quat, Vec3};

use super::figure::Figure;
use crate::anatomy::{Limb, Parts};
use crate::skeleton::{Joint, Skeleton};

/// Name, index of the parent, and offset from it in metres.
type Row = (&'static str, Option<usize>, [f32; 3]);

/// A person of 1.7 m: limbs hang at rest, so the rest pose is neutral.
const PERSON: [Row; 21] = [
    ("hips", None, [0.0, 0.93, 0.0]),
    ("spine", Some(0), [0.0, 0.12, 0.0]),
    ("chest", Some(1), [0.0, 0.16, 0.0]),
    ("neck", Some(2), [0.0, 0.22, 0.0]),
    ("head", Some(3), [0.0, 0.1, 0.0]),
    ("left_hip", Some(0), [0.09, -0.03, 0.0]),
    ("left_knee", Some(5), [0.0, -0.41, 0.0]),
    ("left_ankle", Some(6), [0.0, -0.4, 0.0]),
    ("left_toe", Some(7), [0.0, -0.07, 0.14]),
    ("right_hip", Some(0), [-0.09, -0.03, 0.0]),
    ("right_knee", Some(9), [0.0, -0.41, 0.0]),
    ("right_ankle", Some(10), [0.0, -0.4, 0.0]),
    ("right_toe", Some(11), [0.0, -0.07, 0.14]),
    ("left_collar", Some(2), [0.03, 0.18, 0.0]),
    ("left_shoulder", Some(13), [0.13, 0.0, 0.0]),
    ("left_elbow", Some(14), [0.0, -0.28, 0.0]),
    ("left_wrist", Some(15), [0.0, -0.25, 0.0]),
    ("right_collar", Some(2), [-0.03, 0.18, 0.0]),
    ("right_shoulder", Some(17), [-0.13, 0.0, 0.0]),
    ("right_elbow", Some(18), [0.0, -0.28, 0.0]),
    ("right_wrist", Some(19), [0.0, -0.25, 0.0]),
];

/// An animal of 1 m at the withers.
const ANIMAL: [Row; 22] = [
    ("hips", None, [0.0, 1.0, 0.0]),
    ("spine", Some(0), [0.0, 0.02, 0.35]),
    ("chest", Some(1), [0.0, 0.02, 0.35]),
    ("neck", Some(2), [0.0, 0.15, 0.2]),
    ("head", Some(3), [0.0, 0.2, 0.2]),
    ("left_hip", Some(0), [0.12, -0.05, 0.0]),
    ("left_stifle", Some(5), [0.0, -0.42, 0.06]),
    ("left_hock", Some(6), [0.0, -0.45, -0.06]),
    ("left_hind_toe", Some(7), [0.0, -0.06, 0.06]),
    ("right_hip", Some(0), [-0.12, -0.05, 0.0]),
    ("right_stifle", Some(9), [0.0, -0.42, 0.06]),
    ("right_hock", Some(10), [0.0, -0.45, -0.06]),
    ("right_hind_toe", Some(11), [0.0, -0.06, 0.06]),
    ("left_shoulder", Some(2), [0.12, -0.07, 0.05]),
    ("left_elbow", Some(13), [0.0, -0.42, -0.06]),
    ("left_wrist", Some(14), [0.0, -0.47, 0.06]),
    ("left_fore_toe", Some(15), [0.0, -0.06, 0.06]),
    ("right_shoulder", Some(2), [-0.12, -0.07, 0.05]),
    ("right_elbow", Some(17), [0.0, -0.42, -0.06]),
    ("right_wrist", Some(18), [0.0, -0.47, 0.06]),
    ("right_fore_toe", Some(19), [0.0, -0.06, 0.06]),
    ("tail", Some(0), [0.0, 0.0, -0.1]),
];

/// The doll that stands on as many legs as a body.
pub(super) fn doll(on_fours: bool) -> Figure {
    let rows: &[Row] = match on_fours {
        true => &ANIMAL,
        false => &PERSON,
    };
    let mut places: Vec<Vec3> = Vec::with_capacity(rows.len());
    let mut joints = Vec::with_capacity(rows.len());
    for &(name, parent, offset) in rows {
        let offset_m = Vec3::from(offset);
        places.push(parent.map_or(offset_m, |parent: usize| places[parent] + offset_m));
        joints.push(Joint {
            name: name.to_owned(),
            parent,
            offset_m,
        });
    }
    let limb = |girdle: &[usize], top: usize, has_toe: bool| Limb {
        girdle: girdle.to_vec(),
        top,
        upper: vec![top],
        lower: vec![top + 1],
        end: top + 2,
        toe: has_toe.then_some(top + 3),
    };
    let arms = match on_fours {
        true => [limb(&[], 13, true), limb(&[], 17, true)],
        false => [limb(&[13], 14, false), limb(&[17], 18, false)],
    };
    let parts = Parts {
        trunk: vec![0, 1, 2],
        neck: vec![3, 4],
        legs: [limb(&[], 5, true), limb(&[], 9, true)],
        arms: Some(arms),
        tail: Vec::new(),
        on_fours,
    };
    let skeleton = Skeleton {
        joints,
        left_axis: Vec3::X,
        ground_y_m: 0.0,
        contacts: None,
        robot: None,
    };
    Figure {
        neutral: vec![Quat::IDENTITY; places.len()],
        leg_m: places[parts.legs[0].top].y - places[parts.legs[0].end].y,
        skeleton: Arc::new(skeleton),
        parts,
        places,
    }
}
