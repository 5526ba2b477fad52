//! Straight bones between two joints.

use glam::Vec3;

/// The nearest points of two straight bones, each given from end to end (Ericson 2005, "Real-time
/// collision detection", section 5.1.9). Parallel bones side by side have many such pairs; this is
/// one of them.
pub fn nearest_points([a, a_end]: [Vec3; 2], [b, b_end]: [Vec3; 2]) -> [Vec3; 2] {
    let (u, v, between) = (a_end - a, b_end - b, a - b);
    let (uu, vv, uv) = (u.length_squared(), v.length_squared(), u.dot(v));
    let (ud, vd) = (u.dot(between), v.dot(between));
    let share = |of: f32, whole: f32| match whole > 0.0 {
        true => (of / whole).clamp(0.0, 1.0),
        false => 0.0,
    };
    let along_a = share(uv * vd - ud * vv, uu * vv - uv * uv);
    let along_b = share(uv * along_a + vd, vv);
    // The point on `a` nearest to that on `b`, which changes if `b` ends before.
    let along_a = share(uv * along_b - ud, uu);
    [a + u * along_a, b + v * along_b]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn apart(a: [Vec3; 2], b: [Vec3; 2]) -> f32 {
        let [a, b] = nearest_points(a, b);
        a.distance(b)
    }

    #[test]
    fn bones_are_as_far_apart_as_their_nearest_points() {
        let upright = |x: f32, z: f32| [Vec3::new(x, 0.0, z), Vec3::new(x, 1.0, z)];
        assert!((apart(upright(0.0, 0.0), upright(0.3, 0.4)) - 0.5).abs() < 1e-6);
        // Crossing each other, 0.2 m apart.
        let across = [Vec3::new(-1.0, 0.5, 0.2), Vec3::new(1.0, 0.5, 0.2)];
        assert!((apart(upright(0.0, 0.0), across) - 0.2).abs() < 1e-6);
        assert!((apart(across, upright(0.0, 0.0)) - 0.2).abs() < 1e-6);
        // One ends before the crossing.
        let short = [Vec3::new(0.3, 2.0, 0.0), Vec3::new(0.3, 1.4, 0.0)];
        assert!((apart(upright(0.0, 0.0), short) - 0.5).abs() < 1e-6);
        // Bones without length are points.
        assert_eq!(apart([Vec3::ZERO; 2], [Vec3::X * 2.0; 2]), 2.0);
    }
}
