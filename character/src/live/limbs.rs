//! Limbs of a plan that has taken over.

use troupe_motion::model::Rig;

use super::buffer::FramesMut;
use crate::post::{clear_arms, part_legs, plant};

/// Has the feet of a plan stand, if they glide, and keeps its legs apart and its forearms off the
/// trunk.
///
/// This works on what is shown, after the cross-fade. A foot that stands in the frame before stays
/// there, and a foot in the air does not come down at once.
pub(super) fn finish_limbs(rig: &Rig, feet_glide: bool, frames: FramesMut<'_>) {
    let FramesMut {
        roots,
        rotations,
        contacts,
        start,
    } = frames;
    if feet_glide {
        let range = start..roots.len();
        plant(rig, (&mut *roots, &mut *rotations, contacts), range, None);
    }
    let (roots, rotations) = (&roots[start..], &mut rotations[start * rig.dims.joints..]);
    part_legs(rig, roots, rotations);
    clear_arms(rig, roots, rotations);
}

#[cfg(test)]
#[path = "limbs_tests.rs"]
mod tests;
