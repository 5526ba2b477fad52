//! The critically damped spring of smart locomotion (MotionBricks, equation 6).

use std::ops::{Add, Mul, Sub};

use crate::root::wrap_angle;

/// Place and velocity after `t` seconds of a spring with damping `gamma` (1/s) that started at `x0`
/// with velocity `v0` and is pulled to `target`.
///
/// The place is the paper's equation 6, `x(t) = target + (d + (v0 + γ d) t) e^(-γ t)` with
/// `d = x0 - target`. The velocity is its derivative, `(v0 - γ (v0 + γ d) t) e^(-γ t)`.
///
/// It solves `x'' = -2 γ x' - γ² (x - target)`: critically damped, so it reaches the target as fast
/// as a spring can without overshooting.
///
/// For `f32`, `glam::Vec2` and `glam::Vec3`.
#[inline]
pub fn critically_damped<T>(x0: T, v0: T, target: T, gamma: f32, t: f32) -> (T, T)
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f32, Output = T>,
{
    let decay = (-gamma * t).exp();
    let d = x0 - target;
    let j = v0 + d * gamma;
    (target + (d + j * t) * decay, (v0 - j * (gamma * t)) * decay)
}

/// [`critically_damped`] for headings, in radians and rad/s: from `heading` the shorter way round
/// to `target`. The result's heading is in (-π, π].
#[inline]
pub fn critically_damped_heading(heading: f32, omega: f32, target: f32, gamma: f32, t: f32) -> (f32, f32) {
    let turn = wrap_angle(target - heading);
    let (turned, omega) = critically_damped(0.0, omega, turn, gamma, t);
    (wrap_angle(heading + turned), omega)
}

/// Travel in `t` seconds of a velocity that follows a critically damped spring from `v0` to
/// `target`: the integral of [`critically_damped`] for velocities that do not accelerate at first.
///
/// `target t + (v0 - target) (2/γ - (2/γ + t) e^(-γ t))`. `gamma` must be above 0.
#[inline]
pub fn distance_of_damped_velocity<T>(v0: T, target: T, gamma: f32, t: f32) -> T
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f32, Output = T>,
{
    let decay = (-gamma * t).exp();
    let reach = 2.0 / gamma;
    target * t + (v0 - target) * (reach - (reach + t) * decay)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use proptest::prelude::*;
    use std::f32::consts::PI;

    /// Fourth-order Runge-Kutta on `x'' = -2 γ x' - γ² (x - target)`, in double precision.
    fn integrate(x0: f64, v0: f64, target: f64, gamma: f64, t: f64) -> (f64, f64) {
        let force = |x: f64, v: f64| -2.0 * gamma * v - gamma * gamma * (x - target);
        let steps = 2000;
        let h = t / f64::from(steps);
        let (mut x, mut v) = (x0, v0);
        for _ in 0..steps {
            let (k1x, k1v) = (v, force(x, v));
            let (k2x, k2v) = (v + h / 2.0 * k1v, force(x + h / 2.0 * k1x, v + h / 2.0 * k1v));
            let (k3x, k3v) = (v + h / 2.0 * k2v, force(x + h / 2.0 * k2x, v + h / 2.0 * k2v));
            let (k4x, k4v) = (v + h * k3v, force(x + h * k3x, v + h * k3v));
            x += h / 6.0 * (k1x + 2.0 * k2x + 2.0 * k3x + k4x);
            v += h / 6.0 * (k1v + 2.0 * k2v + 2.0 * k3v + k4v);
        }
        (x, v)
    }

    #[test]
    fn equation_six_by_hand() {
        // x0 = 0, v0 = 0, target 1, γ = 2, t = 1: 1 - (1 + 2) e^-2 = 0.59399; v = γ² t e^(-γ t) = 4
        // e^-2 = 0.54134.
        let (x, v) = critically_damped(0.0f32, 0.0, 1.0, 2.0, 1.0);
        assert!(
            (x - 0.593_994).abs() < 1e-5 && (v - 0.541_341).abs() < 1e-5,
            "{x} {v}"
        );
        assert_eq!(critically_damped(3.0f32, -2.0, 7.0, 5.0, 0.0), (3.0, -2.0));
        let (x, v) = critically_damped(3.0f32, -2.0, 7.0, 5.0, 20.0);
        assert!((x - 7.0).abs() < 1e-5 && v.abs() < 1e-5);
    }

    #[test]
    fn vectors_are_their_components() {
        let (x0, v0, target) = (
            Vec3::new(1.0, 2.0, 3.0),
            Vec3::new(-1.0, 0.0, 4.0),
            Vec3::new(0.0, 5.0, -2.0),
        );
        let (x, v) = critically_damped(x0, v0, target, 4.0, 0.3);
        for i in 0..3 {
            let (xi, vi) = critically_damped(x0[i], v0[i], target[i], 4.0, 0.3);
            assert!((x[i] - xi).abs() < 1e-6 && (v[i] - vi).abs() < 1e-6);
        }
    }

    #[test]
    fn headings_take_the_short_way() {
        // From 170° to -170° is 20° forwards, over the seam.
        let (from, to) = (170f32.to_radians(), -170f32.to_radians());
        let (mid, omega) = critically_damped_heading(from, 0.0, to, 5.0, 0.2);
        assert!(mid.abs() > from && omega > 0.0, "{mid} {omega}");
        let (end, omega) = critically_damped_heading(from, 0.0, to, 5.0, 10.0);
        assert!((end - to).abs() < 1e-5 && omega.abs() < 1e-5);
        // Whole turns do not matter.
        let (a, _) = critically_damped_heading(0.3, 0.1, 1.0 + 4.0 * PI, 5.0, 0.4);
        let (b, _) = critically_damped_heading(0.3, 0.1, 1.0, 5.0, 0.4);
        assert!((a - b).abs() < 1e-4);
    }

    proptest! {
        #[test]
        fn closed_form_solves_the_differential_equation(
            x0 in -5.0f32..5.0, v0 in -5.0f32..5.0, target in -5.0f32..5.0, gamma in 0.5f32..12.0, t in 0.0f32..2.0,
        ) {
            let (x, v) = critically_damped(x0, v0, target, gamma, t);
            let (want_x, want_v) =
                integrate(x0.into(), v0.into(), target.into(), gamma.into(), t.into());
            prop_assert!((f64::from(x) - want_x).abs() < 1e-4, "{x} {want_x}");
            prop_assert!((f64::from(v) - want_v).abs() < 1e-3, "{v} {want_v}");
        }

        #[test]
        fn two_steps_equal_one(
            x0 in -5.0f32..5.0, v0 in -5.0f32..5.0, target in -5.0f32..5.0, gamma in 0.5f32..12.0,
            a in 0.0f32..1.0, b in 0.0f32..1.0,
        ) {
            let (x, v) = critically_damped(x0, v0, target, gamma, a);
            let (x, v) = critically_damped(x, v, target, gamma, b);
            let (want_x, want_v) = critically_damped(x0, v0, target, gamma, a + b);
            prop_assert!((x - want_x).abs() < 1e-4 && (v - want_v).abs() < 1e-3);
        }

        #[test]
        fn headings_agree_with_the_closed_form(
            heading in -3.0f32..3.0, turn in -3.0f32..3.0, omega in -4.0f32..4.0, gamma in 0.5f32..12.0, t in 0.0f32..2.0,
        ) {
            let (h, w) = critically_damped_heading(heading, omega, wrap_angle(heading + turn), gamma, t);
            let (x, v) = critically_damped(heading, omega, heading + turn, gamma, t);
            prop_assert!(h > -PI && h <= PI);
            prop_assert!(wrap_angle(h - x).abs() < 1e-4 && (w - v).abs() < 1e-3);
        }

        #[test]
        fn distance_is_the_integral_of_the_velocity(
            v0 in -5.0f32..5.0, target in -5.0f32..5.0, gamma in 0.5f32..12.0, t in 0.01f32..2.0,
        ) {
            let steps = 1000;
            let h = f64::from(t) / f64::from(steps);
            let sum: f64 = (0..steps)
                .map(|i| ((f64::from(i) + 0.5) * h) as f32)
                .map(|s| f64::from(critically_damped(v0, 0.0, target, gamma, s).0) * h)
                .sum();
            let distance = distance_of_damped_velocity(v0, target, gamma, t);
            prop_assert!((f64::from(distance) - sum).abs() < 1e-3, "{distance} {sum}");
        }
    }
}
