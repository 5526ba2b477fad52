//! Legs of a plan that has taken over.

use troupe_motion::model::Rig;

use super::buffer::FramesMut;
use crate::post::{part_legs, plant};

/// Has the feet of a plan stand, if they glide, and keeps its legs apart.
///
/// This works on what is shown, after the cross-fade. A foot that stands in the frame before stays
/// there, and a foot in the air does not come down at once.
pub(super) fn finish_legs(rig: &Rig, feet_glide: bool, frames: FramesMut<'_>) {
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
    part_legs(rig, &roots[start..], &mut rotations[start * rig.dims.joints..]);
}

#[cfg(test)]
#[path = "legs_tests.rs"]
mod tests;
