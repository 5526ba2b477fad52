//! The baseline in-betweening: linear root, slerp rotations.

use glam::{Quat, Vec3};

use crate::clip::{Clip, ClipError};
use crate::rotation::slerp_pose;

/// Blends two poses: linear root position, slerp of every rotation along the shorter way. `t` = 0
/// gives `from`, 1 gives `to`. Writes one rotation a joint into `out` and returns the root
/// position. Does not allocate.
pub fn blend(from: (Vec3, &[Quat]), to: (Vec3, &[Quat]), t: f32, out: &mut [Quat]) -> Vec3 {
    slerp_pose(from.1, to.1, t, out);
    from.0.lerp(to.0, t)
}

/// `3t² - 2t³`: from 0 to 1 with flat ends as `t` goes from 0 to 1.
#[inline]
pub fn smoothstep(t: f32) -> f32 {
    t * t * (3.0 - 2.0 * t)
}

/// `10t³ - 15t⁴ + 6t⁵`: from 0 to 1 with speed and acceleration 0 at both ends, as a hand or a hip
/// moves (the path of least jerk, Flash and Hogan 1985). `t` outside 0 to 1 is clamped.
#[inline]
pub fn min_jerk(t: f32) -> f32 {
    let t = t.clamp(0.0, 1.0);
    t * t * t * (10.0 - t * (15.0 - 6.0 * t))
}

/// Cubic Hermite curve from one value to another `span` later, each with its slope; `t` goes from 0
/// to 1.
#[inline]
pub fn hermite(t: f32, span: f32, (from, leaving): (f32, f32), (to, arriving): (f32, f32)) -> f32 {
    let (t2, t3) = (t * t, t * t * t);
    (2.0 * t3 - 3.0 * t2 + 1.0) * from
        + (t3 - 2.0 * t2 + t) * span * leaving
        + (3.0 * t2 - 2.0 * t3) * to
        + (t3 - t2) * span * arriving
}

/// Slope of such a curve at a knot: that of the parabola through it and its neighbours. `slopes`
/// are those of the segments before and after, over `spans`. Limited after Fritsch and Carlson
/// (1980), so that the curve never overshoots a knot.
#[inline]
pub fn knot_slope([before, after]: [f32; 2], spans: [f32; 2]) -> f32 {
    let share = spans[0] / (spans[0] + spans[1]);
    let most = 3.0 * before.abs().min(after.abs());
    match before * after > 0.0 {
        true => ((1.0 - share) * before + share * after).clamp(-most, most),
        false => 0.0,
    }
}

/// A copy of `clip` whose frames strictly between `from` and `to` are interpolated between these
/// two.
///
/// # Errors
/// [`ClipError::Range`] unless `from < to < frames`.
pub fn fill_gap(clip: &Clip, from: usize, to: usize) -> Result<Clip, ClipError> {
    let frames = clip.frames();
    if from >= to || to >= frames {
        return Err(ClipError::Range {
            start: from,
            end: to.saturating_add(1),
            frames,
        });
    }
    let mut out = clip.clone();
    for frame in from + 1..to {
        let t = (frame - from) as f32 / (to - from) as f32;
        let ends = [from, to].map(|f| (clip.root_positions[f], clip.rotations_at(f)));
        out.root_positions[frame] = blend(ends[0], ends[1], t, out.rotations_at_mut(frame));
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rotation::angle_between;
    use crate::testing::walk;

    #[test]
    fn a_gap_is_filled_evenly() {
        let mut clip = walk(9);
        clip.root_positions[2] = Vec3::ZERO;
        clip.root_positions[6] = Vec3::new(4.0, 2.0, -8.0);
        clip.rotations_at_mut(2)[1] = Quat::from_rotation_x(0.2);
        clip.rotations_at_mut(6)[1] = -Quat::from_rotation_x(1.0);
        let filled = fill_gap(&clip, 2, 6).unwrap();
        assert!(filled.root_positions[3].abs_diff_eq(Vec3::new(1.0, 0.5, -2.0), 1e-6));
        for (f, angle) in [(3, 0.4), (4, 0.6), (5, 0.8)] {
            // The short way, whatever the signs of the quaternions.
            assert!(angle_between(filled.rotations_at(f)[1], Quat::from_rotation_x(angle)) < 1e-5);
        }
        for f in [0, 1, 2, 6, 7, 8] {
            assert_eq!(
                filled.rotations_at(f),
                clip.rotations_at(f),
                "frames outside the gap are unchanged"
            );
            assert_eq!(filled.root_positions[f], clip.root_positions[f]);
        }
    }

    #[test]
    fn the_path_of_least_jerk_is_flat_at_its_ends() {
        assert_eq!(
            [-1.0, 0.0, 0.5, 1.0, 2.0].map(min_jerk),
            [0.0, 0.0, 0.5, 1.0, 1.0]
        );
        assert!(min_jerk(0.01) < 1.1e-5 && 1.0 - min_jerk(0.99) < 1.1e-5);
    }

    #[test]
    fn gaps_outside_the_clip_are_refused() {
        for (from, to) in [(2, 2), (3, 2), (0, 9), (0, usize::MAX)] {
            assert!(matches!(
                fill_gap(&walk(9), from, to),
                Err(ClipError::Range { .. })
            ));
        }
    }
}
