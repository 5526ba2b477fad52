//! The way that a motion travels, without the sway of its steps: what a client takes out to play it
//! in place.

use troupe_motion::Skeleton;
use troupe_motion::root::wrap_angle;

use super::track::Track;

/// The root's way is averaged over this long, about a stride, seconds.
const STRIDE_S: f32 = 1.0;
/// A motion that stays this near to its begin is still, metres.
const STILL_M: f32 = 0.15;
/// How far from a line a straight way may be: metres, and a share of its length.
const LINE: (f32, f32) = (0.03, 0.03);
/// Turns of less than this are none, radians.
const STEADY_RAD: f32 = 0.07;

/// The simplest shape that a way has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// It stays in one place.
    Still,
    /// It goes straight.
    Line {
        /// Direction, degrees: 0 is +Z, 90 is +X.
        heading_deg: f32,
        /// From its first place to its last, m/s.
        speed_mps: f32,
    },
    /// It goes any way.
    Path {
        /// Along the way, m/s.
        speed_mps: f32,
    },
}

/// The way of a motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// What it looks like.
    pub shape: Shape,
    /// Whether the body faces the same way all the time; then `yaw` is 0.
    pub is_steady: bool,
    /// World x and z, one a frame, metres.
    pub places: Vec<[f32; 2]>,
    /// Turn since the first frame, one a frame, radians.
    pub yaw: Vec<f32>,
}

/// The way of a motion at so many frames a second.
pub fn trajectory(track: &Track, skeleton: &Skeleton, fps: f32, is_loop: bool) -> Trajectory {
    let places: Vec<[f32; 2]> = track.roots.iter().map(|root| [root.x, root.z]).collect();
    let mut headings = Vec::with_capacity(track.len());
    for frame in 0..track.len() {
        let heading = track.root(frame, skeleton).heading;
        let before = headings.last().copied().unwrap_or(heading);
        headings.push(before + wrap_angle(heading - before));
    }
    let half = (STRIDE_S * fps / 2.0).round() as usize;
    let smooth: Vec<[f32; 2]> = {
        let axis = |axis: usize| {
            averaged(
                &places.iter().map(|place| place[axis]).collect::<Vec<_>>(),
                half,
                is_loop,
            )
        };
        axis(0).into_iter().zip(axis(1)).map(|(x, z)| [x, z]).collect()
    };
    let (shape, places) = shaped(smooth, fps);
    let turned = averaged(&headings, half, is_loop);
    let first = turned.first().copied().unwrap_or(0.0);
    let yaw: Vec<f32> = turned.iter().map(|turn| turn - first).collect();
    let steady = yaw.iter().all(|turn| turn.abs() < STEADY_RAD);
    Trajectory {
        shape,
        is_steady: steady,
        yaw: if steady { vec![0.0; yaw.len()] } else { yaw },
        places,
    }
}

/// Means over up to `half` frames on either side. At the ends of a motion they are of fewer frames;
/// a loop goes on into its next round.
fn averaged(values: &[f32], half: usize, is_loop: bool) -> Vec<f32> {
    let count = values.len();
    let (Some(first), Some(last)) = (values.first(), values.last()) else {
        return Vec::new();
    };
    let travel = last - first;
    let period = count.saturating_sub(1).max(1) as i64;
    let at = |frame: i64| {
        let turns = frame.div_euclid(period);
        values[(frame.rem_euclid(period) as usize).min(count - 1)] + travel * turns as f32
    };
    let mean = |frame: usize| {
        let reach = if is_loop {
            half
        } else {
            half.min(frame).min(count - 1 - frame)
        } as i64;
        let frame = frame as i64;
        let sum: f32 = (frame - reach..=frame + reach)
            .map(|frame| {
                if is_loop {
                    at(frame)
                } else {
                    values[frame as usize]
                }
            })
            .sum();
        sum / (2 * reach + 1) as f32
    };
    (0..count).map(mean).collect()
}

/// The shape of a way, and the way as that shape has it.
fn shaped(way: Vec<[f32; 2]>, fps: f32) -> (Shape, Vec<[f32; 2]>) {
    let (Some(&first), Some(&last)) = (way.first(), way.last()) else {
        return (Shape::Still, way);
    };
    let away = |a: [f32; 2], b: [f32; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    if way.iter().all(|place| away(*place, first) < STILL_M) {
        let count = way.len();
        return (Shape::Still, vec![first; count]);
    }
    let length = away(first, last);
    let seconds = (way.len() - 1) as f32 / fps;
    if length > STILL_M {
        let along = [(last[0] - first[0]) / length, (last[1] - first[1]) / length];
        let across =
            |place: &[f32; 2]| ((place[0] - first[0]) * along[1] - (place[1] - first[1]) * along[0]).abs();
        if way.iter().all(|place| across(place) <= LINE.0 + LINE.1 * length) {
            let on = |place: &[f32; 2]| {
                let share = (place[0] - first[0]) * along[0] + (place[1] - first[1]) * along[1];
                [first[0] + share * along[0], first[1] + share * along[1]]
            };
            let line = Shape::Line {
                heading_deg: along[0].atan2(along[1]).to_degrees(),
                speed_mps: length / seconds,
            };
            return (line, way.iter().map(on).collect());
        }
    }
    let gone: f32 = way.windows(2).map(|pair| away(pair[0], pair[1])).sum();
    let speed_mps = gone / seconds;
    (Shape::Path { speed_mps }, way)
}

#[cfg(test)]
mod tests {
    use super::*;
    use troupe_motion::{Joint, Quat, Vec3};

    fn skeleton() -> Skeleton {
        let joint = Joint {
            name: "hips".to_owned(),
            parent: None,
            offset_m: Vec3::ZERO,
        };
        Skeleton::new(vec![joint], Vec3::X, 0.0, None).unwrap()
    }

    fn along(frames: usize, at: impl Fn(f32) -> (Vec3, f32), is_loop: bool) -> Trajectory {
        let mut track = Track::default();
        for frame in 0..frames {
            let (root, heading) = at(frame as f32 / 30.0);
            track.push(root, &[Quat::from_rotation_y(heading)], 0);
        }
        trajectory(&track, &skeleton(), 30.0, is_loop)
    }

    #[test]
    fn the_sway_of_steps_is_not_travel() {
        let sway = |t: f32| 0.03 * (t * std::f32::consts::TAU).sin();
        let line = along(121, |t| (Vec3::new(sway(t), 0.9, 1.2 * t), sway(t)), true);
        assert!(matches!(line.shape, Shape::Line { .. }) && line.is_steady);
        assert!(line.places.iter().all(|place| place[0].abs() < 5e-3));
        let travel = line.places[120][1] - line.places[0][1];
        assert!(
            (travel - 4.8).abs() < 1e-3,
            "a loop closes on its travel: {travel}"
        );
    }

    #[test]
    fn shapes_are_named() {
        assert_eq!(
            along(60, |t| (Vec3::X * 0.01 * t, 0.0), false).shape,
            Shape::Still
        );
        let round = along(120, |t| (Vec3::new(t.cos(), 0.9, t.sin()), -t), false);
        assert!(matches!(round.shape, Shape::Path { .. }) && !round.is_steady);
        assert!((round.yaw[119] + 119.0 / 30.0).abs() < 0.02, "{}", round.yaw[119]);
        assert_eq!(along(1, |_| (Vec3::ZERO, 0.0), false).places.len(), 1);
    }
}
