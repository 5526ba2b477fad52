//! Position and rotation of a thing.

use serde::{Deserialize, Serialize};
use std::ops::Mul;

use troupe_motion::root::wrap_angle;
use troupe_motion::rotation::yaw;
use troupe_motion::{Quat, Vec3};

use super::error::{SceneError, coordinates};
use super::{MAX_COORDINATE_M, UNIT_TOLERANCE};

/// A rigid transform: first rotate, then move.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Transform {
    /// Place of the origin, metres.
    pub position: Vec3,
    /// Unit quaternion.
    pub rotation: Quat,
}

impl Transform {
    /// The transform that changes nothing.
    pub const IDENTITY: Self = Self {
        position: Vec3::ZERO,
        rotation: Quat::IDENTITY,
    };

    /// A transform to `position`, rotated by `rotation`.
    pub fn new(position: Vec3, rotation: Quat) -> Self {
        Self { position, rotation }
    }

    /// Upright at `position` with +Z along `heading` (radians about +Y).
    pub fn upright(position: Vec3, heading: f32) -> Self {
        Self::new(position, yaw(heading))
    }

    /// Checks that it is finite, within range, and its rotation of unit length, which is then made
    /// exact.
    ///
    /// # Errors
    /// [`SceneError::Value`] that names `what`.
    pub fn checked(self, what: &'static str) -> Result<Self, SceneError> {
        coordinates(what, self.position, MAX_COORDINATE_M)?;
        let length = self.rotation.length();
        if !(1.0 - UNIT_TOLERANCE..=1.0 + UNIT_TOLERANCE).contains(&length) {
            return Err(SceneError::value(
                what,
                format!("turned by a rotation of length {length}"),
                format!("length 1 within {UNIT_TOLERANCE}"),
            ));
        }
        Ok(Self::new(self.position, self.rotation.normalize()))
    }

    /// `point` of this transform's frame of reference, in the world.
    #[inline]
    pub fn point(self, point: Vec3) -> Vec3 {
        self.position + self.rotation * point
    }

    /// `point` of the world, in this transform's frame of reference.
    #[inline]
    pub fn local_point(self, point: Vec3) -> Vec3 {
        self.rotation.conjugate() * (point - self.position)
    }

    /// The same place and rotation with lengths multiplied by `by`.
    #[inline]
    pub fn scaled(self, by: f32) -> Self {
        Self::new(self.position * by, self.rotation)
    }

    /// The inverse transform.
    pub fn inverse(self) -> Self {
        let rotation = self.rotation.conjugate();
        Self::new(rotation * -self.position, rotation)
    }

    /// The rotation about +Y that the rotation contains, radians in (-π, π]. A tilt does not change
    /// it. A half turn about a level axis has none: 0.
    pub fn heading(self) -> f32 {
        let q = self.rotation;
        if q.y == 0.0 && q.w == 0.0 {
            return 0.0;
        }
        wrap_angle(2.0 * q.y.atan2(q.w))
    }
}

impl Default for Transform {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Mul for Transform {
    type Output = Self;

    /// First `right`, then `self`.
    fn mul(self, right: Self) -> Self {
        Self::new(
            self.point(right.position),
            (self.rotation * right.rotation).normalize(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{any_rotation, any_transform};
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn inverse_and_product_agree(a in any_transform(20.0), b in any_transform(20.0), p in any_transform(5.0)) {
            let p = p.position;
            prop_assert!((a.local_point(a.point(p)) - p).length() < 1e-4);
            prop_assert!((a.inverse().point(p) - a.local_point(p)).length() < 1e-4);
            prop_assert!(((a * b).point(p) - a.point(b.point(p))).length() < 1e-4);
        }

        #[test]
        fn heading_is_the_one_it_was_made_with(heading in -3.1_f32..3.1, tilt in -1.5_f32..1.5) {
            let upright = Transform::upright(Vec3::ZERO, heading);
            prop_assert!((upright.heading() - heading).abs() < 1e-5);
            let tilted = Transform::new(Vec3::ZERO, upright.rotation * Quat::from_rotation_x(tilt));
            prop_assert!(wrap_angle(tilted.heading() - heading).abs() < 1e-4);
        }

        #[test]
        fn heading_is_finite_and_turns_with_the_world(q in any_rotation(), turn in -3.0_f32..3.0) {
            let before = Transform::new(Vec3::ZERO, q).heading();
            let after = Transform::new(Vec3::ZERO, yaw(turn) * q).heading();
            prop_assert!(before.is_finite());
            // Near a half turn about a level axis, the heading is only rounding.
            prop_assume!(q.y.hypot(q.w) > 0.05);
            prop_assert!(wrap_angle(after - before - turn).abs() < 1e-3);
        }
    }

    #[test]
    fn invalid_transforms_are_refused() {
        for (position, rotation) in [
            (Vec3::new(f32::NAN, 0.0, 0.0), Quat::IDENTITY),
            (Vec3::new(0.0, 2e4, 0.0), Quat::IDENTITY),
            (Vec3::ZERO, Quat::from_xyzw(0.0, 0.0, 0.0, 0.9)),
            (Vec3::ZERO, Quat::from_xyzw(0.0, f32::NAN, 0.0, 1.0)),
        ] {
            let error = Transform::new(position, rotation).checked("door").unwrap_err();
            assert!(
                error.to_string().starts_with("door") && error.to_string().contains("allowed: "),
                "{error}"
            );
        }
        assert_eq!(Transform::IDENTITY.checked("door").unwrap(), Transform::IDENTITY);
        assert_eq!(
            Transform::new(Vec3::ZERO, Quat::from_xyzw(1.0, 0.0, 0.0, 0.0)).heading(),
            0.0
        );
    }
}
