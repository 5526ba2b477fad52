//! What the tests of live characters share.

use troupe_motion::{Quat, Vec3};

use super::buffer::{Frames, MotionBuffer};

/// The frames -3 to 0 of somebody with one joint who stands still.
pub(super) fn still_buffer() -> MotionBuffer {
    let frames = Frames {
        roots: &[Vec3::ZERO; 4],
        rotations: &[Quat::IDENTITY; 4],
        contacts: &[0; 4],
    };
    MotionBuffer::new(1, -3, frames)
}
