//! What turns frames of the buffer into frames that are shown: the lift onto the ground, and the
//! arm that carries.

use serde::{Deserialize, Serialize};
use troupe_motion::terrain::Lift;
use troupe_motion::{Quat, Skeleton, Vec3};

use super::{Carry, Footing};

/// The state of a character in a scene that no plan knows of.
#[derive(Debug, Serialize, Deserialize)]
pub(in crate::live) struct PostProcess {
    pub(super) footing: Footing,
    pub(super) carry: Carry,
}

impl PostProcess {
    /// A character with empty hands that stands at height `level`, metres.
    pub(in crate::live) fn new(skeleton: &Skeleton, level: f32) -> Self {
        Self {
            footing: Footing::new(skeleton, level),
            carry: Carry::default(),
        }
    }

    /// How far the ground lifts what is shown, `part` of the way (0 to 1) from `frame` to the next.
    pub(in crate::live) fn lift(&self, frame: i64, part: f32) -> Lift {
        self.footing.between(frame, part)
    }

    /// Changes a frame of the buffer to how it is shown, `part` of the way (0 to 1) from `frame` to
    /// the next.
    pub(in crate::live) fn apply(
        &self,
        skeleton: &Skeleton,
        (frame, part): (i64, f32),
        root: &mut Vec3,
        rotations: &mut [Quat],
    ) {
        self.footing.lift(skeleton, frame, part, root, rotations);
        self.carry.bend(skeleton, frame, part, *root, rotations);
    }
}
