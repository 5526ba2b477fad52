//! Euler angles in any order of axes, in double precision and exact at gimbal lock.

use glam::{DMat3, DQuat, DVec3};

/// The order in which three rotation channels apply: `ZXY` is the matrix product `Rz·Rx·Ry`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[allow(missing_docs, reason = "the names say the order")]
pub enum EulerOrder {
    XYZ,
    XZY,
    YXZ,
    YZX,
    #[default]
    ZXY,
    ZYX,
}

impl EulerOrder {
    /// The axes in order: 0 for X, 1 for Y, 2 for Z.
    pub fn axes(self) -> [usize; 3] {
        match self {
            Self::XYZ => [0, 1, 2],
            Self::XZY => [0, 2, 1],
            Self::YXZ => [1, 0, 2],
            Self::YZX => [1, 2, 0],
            Self::ZXY => [2, 0, 1],
            Self::ZYX => [2, 1, 0],
        }
    }

    /// Angles (radians, in this order) whose product is `q`.
    ///
    /// The product equals `q` for every rotation. At gimbal lock the first angle is arbitrary. The
    /// others come from what is left after it is undone, so they stay exact.
    pub(crate) fn angles(self, q: DQuat) -> [f64; 3] {
        let m = DMat3::from_quat(q.normalize());
        let [i, j, k] = self.axes();
        let at = |m: &DMat3, row: usize, col: usize| m.col(col)[row];
        // +1 if the axes are an even permutation of X Y Z.
        let sign = if (i + 1) % 3 == j { 1.0 } else { -1.0 };
        let first = (-sign * at(&m, j, k)).atan2(at(&m, k, k));
        let rest = DMat3::from_quat(axis_rotation(i, -first)) * m;
        let second = (sign * at(&rest, i, k)).atan2(at(&rest, k, k));
        let third = (sign * at(&rest, j, i)).atan2(at(&rest, j, j));
        [first, second, third]
    }
}

/// The rotation about axis 0, 1 or 2 by `angle` radians.
pub(super) fn axis_rotation(axis: usize, angle: f64) -> DQuat {
    DQuat::from_axis_angle(DVec3::AXES[axis], angle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    const ORDERS: [EulerOrder; 6] = [
        EulerOrder::XYZ,
        EulerOrder::XZY,
        EulerOrder::YXZ,
        EulerOrder::YZX,
        EulerOrder::ZXY,
        EulerOrder::ZYX,
    ];

    fn product(order: EulerOrder, angles: [f64; 3]) -> DQuat {
        let axes = order.axes();
        (0..3).fold(DQuat::IDENTITY, |q, n| q * axis_rotation(axes[n], angles[n]))
    }

    fn same(a: DQuat, b: DQuat, within: f64) -> bool {
        let d = a.inverse() * b;
        2.0 * d.xyz().length().atan2(d.w.abs()) < within
    }

    #[test]
    fn angles_come_back_away_from_the_lock() {
        for order in ORDERS {
            let want = [0.3, -0.7, 1.9];
            let got = order.angles(product(order, want));
            for n in 0..3 {
                assert!((got[n] - want[n]).abs() < 1e-12, "{order:?}: {got:?}");
            }
        }
    }

    proptest! {
        #[test]
        fn product_of_the_angles_is_the_rotation(
            a in -PI..PI, c in -PI..PI,
            // From far away to exactly at the lock, on both sides.
            near in prop_oneof![Just(0.0), -1e-3..1e-3f64, -1e-7..1e-7f64, -1e-12..1e-12f64, -3.0..3.0f64],
            up in any::<bool>(),
        ) {
            for order in ORDERS {
                let middle = (if up { FRAC_PI_2 } else { -FRAC_PI_2 }) + near;
                let q = product(order, [a, middle, c]);
                prop_assert!(same(product(order, order.angles(q)), q, 1e-9), "{:?}", order);
                // A clip stores single precision; the angles must work for that too.
                let rounded = q.as_quat().as_dquat().normalize();
                prop_assert!(same(product(order, order.angles(rounded)), rounded, 1e-9), "{:?}", order);
            }
        }
    }
}
