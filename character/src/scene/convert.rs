//! Converts values for `parry3d`, which uses another version of `glam`: they cross as plain
//! numbers.

use parry3d::math::{Pose, Rotation, Vector};
use troupe_motion::Vec3;

use super::Transform;

#[inline]
pub(super) fn vector(v: Vec3) -> Vector {
    Vector::from_array(v.to_array())
}

#[inline]
pub(super) fn vec3(v: Vector) -> Vec3 {
    Vec3::from_array(v.to_array())
}

#[inline]
pub(super) fn pose(transform: Transform) -> Pose {
    Pose::from_parts(
        vector(transform.position),
        Rotation::from_array(transform.rotation.to_array()),
    )
}
