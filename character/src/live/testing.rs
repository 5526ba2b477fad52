//! Shared by the tests of live characters.

use troupe_motion::{Quat, Vec3};

use super::buffer::{Frames, MotionBuffer};

/// Frames -3 to 0 of a standing character with one joint.
pub(super) fn still_buffer() -> MotionBuffer {
    let frames = Frames {
        roots: &[Vec3::ZERO; 4],
        rotations: &[Quat::IDENTITY; 4],
        contacts: &[0; 4],
    };
    MotionBuffer::new(1, -3, frames)
}
