//! The root: global (`r_g`) and local (`r_l`) form, and the pelvis' heading (MotionBricks, section
//! 4).

use serde::{Deserialize, Serialize};
use std::f32::consts::{PI, TAU};

use glam::{Quat, Vec3};

/// Global root `r_g`: position and heading of the pelvis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GlobalRoot {
    /// World position of the pelvis, metres; y is its height.
    pub position: Vec3,
    /// Heading in radians: forward is `(sin ψ, 0, cos ψ)`.
    pub heading: f32,
}

/// Local root `r_l`: motion of the pelvis. Velocities are in the world's ground plane, not turned
/// by the heading.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LocalRoot {
    /// Velocity along world X, m/s.
    pub vx: f32,
    /// Velocity along world Z, m/s.
    pub vz: f32,
    /// Change of heading, rad/s.
    pub omega: f32,
    /// Height of the pelvis, metres.
    pub height: f32,
}

impl GlobalRoot {
    /// A root at `position` with `heading` (radians).
    pub fn new(position: Vec3, heading: f32) -> Self {
        Self { position, heading }
    }

    /// The root of a pose: position of the pelvis, heading by [`heading_of`].
    pub fn of_pose(position: Vec3, pelvis: Quat, left_axis: Vec3) -> Self {
        Self {
            position,
            heading: heading_of(pelvis, left_axis),
        }
    }

    /// `[x, y, z, cos ψ, sin ψ]`.
    #[inline]
    pub fn to_array(self) -> [f32; 5] {
        let (sin, cos) = self.heading.sin_cos();
        [self.position.x, self.position.y, self.position.z, cos, sin]
    }

    /// From `[x, y, z, cos ψ, sin ψ]`; cosine and sine need not be normalised. The heading is in
    /// (-π, π].
    #[inline]
    pub fn from_array(a: [f32; 5]) -> Self {
        Self {
            position: Vec3::new(a[0], a[1], a[2]),
            heading: a[4].atan2(a[3]),
        }
    }

    /// The projected root: the pelvis position with y = 0.
    #[inline]
    pub fn projected(self) -> Vec3 {
        Vec3::new(self.position.x, 0.0, self.position.z)
    }

    /// The direction that the root faces on the ground, unit length.
    #[inline]
    pub fn forward(self) -> Vec3 {
        let (sin, cos) = self.heading.sin_cos();
        Vec3::new(sin, 0.0, cos)
    }
}

impl From<GlobalRoot> for [f32; 5] {
    fn from(r: GlobalRoot) -> Self {
        r.to_array()
    }
}

impl From<[f32; 5]> for GlobalRoot {
    fn from(a: [f32; 5]) -> Self {
        Self::from_array(a)
    }
}

impl LocalRoot {
    /// `[vx, vz, omega, height]`.
    #[inline]
    pub fn to_array(self) -> [f32; 4] {
        [self.vx, self.vz, self.omega, self.height]
    }

    /// From `[vx, vz, omega, height]`.
    #[inline]
    pub fn from_array(a: [f32; 4]) -> Self {
        Self {
            vx: a[0],
            vz: a[1],
            omega: a[2],
            height: a[3],
        }
    }
}

impl From<LocalRoot> for [f32; 4] {
    fn from(r: LocalRoot) -> Self {
        r.to_array()
    }
}

impl From<[f32; 4]> for LocalRoot {
    fn from(a: [f32; 4]) -> Self {
        Self::from_array(a)
    }
}

/// `angle` wrapped into (-π, π]. NaN and infinity give NaN.
#[inline]
pub fn wrap_angle(angle: f32) -> f32 {
    let wrapped = angle - TAU * (angle / TAU).round();
    // Rounding can leave it slightly outside the interval, and -π is the same as π.
    if wrapped <= -PI {
        wrapped + TAU
    } else if wrapped > PI {
        wrapped - TAU
    } else {
        wrapped
    }
}

/// Heading of a pose, radians in (-π, π]: the direction of the pelvis' left on the ground, turned
/// by a quarter about +Y.
///
/// `pelvis` is the pelvis' world rotation, and `left_axis` the skeleton's left in the pelvis' frame
/// of reference. Bending forward or back does not change it. If the left points straight up or
/// down, there is no heading: 0.
#[inline]
pub fn heading_of(pelvis: Quat, left_axis: Vec3) -> f32 {
    let left = pelvis * left_axis;
    // left × +Y = (-left.z, 0, left.x)
    let heading = (-left.z).atan2(left.x);
    if left.x == 0.0 && left.z == 0.0 {
        0.0
    } else if heading == -PI {
        PI
    } else {
        heading
    }
}

/// Backward differences: `v[t] = (x[t] - x[t-1]) * fps`, `omega[t] = wrap(ψ[t] - ψ[t-1]) * fps`.
/// Frame 0 copies the velocities of frame 1, or has zero if there is none.
pub fn local_from_global(roots: &[GlobalRoot], fps: f32) -> Vec<LocalRoot> {
    let mut out = Vec::with_capacity(roots.len());
    let Some(first) = roots.first() else { return out };
    out.push(LocalRoot {
        height: first.position.y,
        ..LocalRoot::default()
    });
    for pair in roots.windows(2) {
        let d = (pair[1].position - pair[0].position) * fps;
        let omega = wrap_angle(pair[1].heading - pair[0].heading) * fps;
        out.push(LocalRoot {
            vx: d.x,
            vz: d.z,
            omega,
            height: pair[1].position.y,
        });
    }
    if let [first, second, ..] = out.as_mut_slice() {
        *first = LocalRoot {
            height: first.height,
            ..*second
        };
    }
    out
}

/// Integrates local roots: the inverse of [`local_from_global`].
///
/// Frame 0 of the result is `start`. Frame t adds `local[t]`'s velocities to frame t-1, and takes
/// its height. The result has as many frames as `local`. Sums are in double precision.
pub fn global_from_local(start: GlobalRoot, local: &[LocalRoot], fps: f32) -> Vec<GlobalRoot> {
    let dt = 1.0 / f64::from(fps);
    let (mut x, mut z) = (f64::from(start.position.x), f64::from(start.position.z));
    let mut heading = f64::from(start.heading);
    let mut out = Vec::with_capacity(local.len());
    for (t, l) in local.iter().enumerate() {
        if t == 0 {
            out.push(start);
            continue;
        }
        x += f64::from(l.vx) * dt;
        z += f64::from(l.vz) * dt;
        heading += f64::from(l.omega) * dt;
        let wrapped = heading - std::f64::consts::TAU * (heading / std::f64::consts::TAU).round();
        out.push(GlobalRoot::new(
            Vec3::new(x as f32, l.height, z as f32),
            wrap_angle(wrapped as f32),
        ));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f32::consts::FRAC_PI_2;

    #[test]
    fn arrays_have_the_documented_order() {
        let r = GlobalRoot::new(Vec3::new(1.0, 2.0, 3.0), FRAC_PI_2);
        let a = r.to_array();
        assert_eq!(a[..3], [1.0, 2.0, 3.0]);
        assert!(a[3].abs() < 1e-6 && (a[4] - 1.0).abs() < 1e-6);
        assert!((GlobalRoot::from_array([0.0, 0.0, 0.0, 0.0, -2.0]).heading + FRAC_PI_2).abs() < 1e-6);
        let l = LocalRoot {
            vx: 1.0,
            vz: 2.0,
            omega: 3.0,
            height: 4.0,
        };
        assert_eq!(l.to_array(), [1.0, 2.0, 3.0, 4.0]);
    }

    #[test]
    fn heading_follows_yaw_and_ignores_a_bow() {
        // A pelvis whose left is its -Y, as in the Bandai-Namco skeleton: the rest rotation takes
        // -Y to +X.
        let rest = Quat::from_rotation_z(FRAC_PI_2);
        for psi in [-3.0f32, -1.0, 0.0, 0.5, 2.0, 3.1] {
            let bow = Quat::from_rotation_y(psi) * Quat::from_rotation_x(1.4) * rest;
            assert!((heading_of(bow, Vec3::NEG_Y) - psi).abs() < 1e-5);
        }
        assert_eq!(heading_of(Quat::IDENTITY, Vec3::X), 0.0);
        assert_eq!(heading_of(Quat::IDENTITY, Vec3::Y), 0.0, "undefined heading is 0");
    }

    #[test]
    fn local_by_hand() {
        let roots = [
            GlobalRoot::new(Vec3::new(0.0, 1.0, 0.0), 3.0),
            GlobalRoot::new(Vec3::new(0.1, 0.9, -0.2), -3.0),
        ];
        let l = local_from_global(&roots, 30.0);
        assert!((l[1].vx - 3.0).abs() < 1e-5 && (l[1].vz + 6.0).abs() < 1e-5);
        // Over the seam the short way: from 3.0 to -3.0 is 2π - 6 forwards.
        assert!((l[1].omega - (TAU - 6.0) * 30.0).abs() < 1e-3);
        assert_eq!(
            (l[0].vx, l[0].vz, l[0].omega, l[0].height),
            (l[1].vx, l[1].vz, l[1].omega, 1.0)
        );
        assert_eq!(
            local_from_global(&roots[..1], 30.0)[0],
            LocalRoot {
                height: 1.0,
                ..Default::default()
            }
        );
        assert!(local_from_global(&[], 30.0).is_empty());
    }

    #[test]
    fn wrap_at_the_ends() {
        assert_eq!(wrap_angle(PI), PI);
        assert!((wrap_angle(-PI) - PI).abs() < 1e-6);
        assert!((wrap_angle(7.0) - (7.0 - TAU)).abs() < 1e-6);
        assert!(wrap_angle(f32::NAN).is_nan());
    }

    proptest! {
        #[test]
        fn wrap_stays_inside_and_keeps_the_direction(a in -1000.0f32..1000.0) {
            let w = wrap_angle(a);
            prop_assert!(w > -PI && w <= PI);
            prop_assert!((w.sin() - a.sin()).abs() < 1e-3 && (w.cos() - a.cos()).abs() < 1e-3);
        }

        #[test]
        fn local_and_global_are_inverse(
            frames in proptest::collection::vec((-0.3f32..0.3, -0.3f32..0.3, 0.5f32..1.5, -3.0f32..3.0), 1..120),
            start in (-20.0f32..20.0, -20.0f32..20.0),
        ) {
            let mut p = Vec3::new(start.0, 0.0, start.1);
            let mut psi = 0.0;
            let roots: Vec<_> = frames.iter().map(|&(dx, dz, y, turn)| {
                p += Vec3::new(dx, 0.0, dz);
                p.y = y;
                psi = wrap_angle(psi + turn);
                GlobalRoot::new(p, psi)
            }).collect();
            let back = global_from_local(roots[0], &local_from_global(&roots, 30.0), 30.0);
            prop_assert_eq!(back.len(), roots.len());
            for (a, b) in back.iter().zip(&roots) {
                prop_assert!(a.position.abs_diff_eq(b.position, 1e-3));
                prop_assert!(wrap_angle(a.heading - b.heading).abs() < 1e-3);
            }
        }

        #[test]
        fn heading_of_any_tilt_adds_with_yaw(psi in -3.0f32..3.0, pitch in -1.4f32..1.4) {
            let q = Quat::from_rotation_y(psi) * Quat::from_rotation_x(pitch);
            prop_assert!((heading_of(q, Vec3::X) - psi).abs() < 1e-4);
        }
    }
}
