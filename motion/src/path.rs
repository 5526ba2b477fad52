//! Paths over the ground: points with times, and a smooth curve through them.

use crate::interpolate::{hermite, knot_slope};
use crate::root::wrap_angle;

/// Below this speed the path has no direction to head along, m/s.
const STANDING_MPS: f32 = 0.05;
/// Half the time over which the direction of the path is measured, seconds.
const DIRECTION_S: f32 = 0.4;

/// Fewer points a second do not show the sway of steps.
const STEP_POINTS_PER_S: f32 = 6.0;

/// A point of a path, with its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathPoint {
    /// Seconds; increases from point to point.
    pub time_s: f32,
    /// World x and z, metres.
    pub place: [f32; 2],
    /// Radians. `None`: along the path.
    pub heading: Option<f32>,
}

/// A path with at least one point.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundPath {
    points: Vec<PathPoint>,
}

impl GroundPath {
    /// A path through `points`. None without points, or if times do not increase.
    pub fn new(points: Vec<PathPoint>) -> Option<Self> {
        let grows = points.windows(2).all(|pair| pair[0].time_s < pair[1].time_s);
        (grows && !points.is_empty()).then_some(Self { points })
    }

    /// Times from the distances, at `speed_mps`, beginning with 0. Points at one place are a
    /// hundredth of a second apart.
    pub fn times_at(places: &[[f32; 2]], speed_mps: f32) -> Vec<f32> {
        let mut time_s = 0.0;
        let mut last = None;
        let each = places.iter().map(|place| {
            if let Some(last) = last {
                time_s += (distance(last, *place) / speed_mps).max(0.01);
            }
            last = Some(*place);
            time_s
        });
        each.collect()
    }

    /// Whether any point has a heading.
    pub fn has_headings(&self) -> bool {
        self.points.iter().any(|point| point.heading.is_some())
    }

    /// Whether it has enough points to show how a root sways with its steps: more than six a
    /// second.
    pub fn shows_steps(&self) -> bool {
        let seconds = self.end_s() - self.points[0].time_s;
        (self.points.len() - 1) as f32 > STEP_POINTS_PER_S * seconds
    }

    /// Time of the last point, seconds.
    pub fn end_s(&self) -> f32 {
        self.points[self.points.len() - 1].time_s
    }

    /// Index of the first point that is later than a time; of the last point if there is none.
    pub fn point_after(&self, time_s: f32) -> usize {
        let after = self.points.partition_point(|point| point.time_s < time_s);
        after.min(self.points.len() - 1)
    }

    /// World x and z at a time: a cubic curve through the points, which waits at the first and
    /// stays at the last.
    pub fn place(&self, time_s: f32) -> [f32; 2] {
        let after = self.points.partition_point(|point| point.time_s <= time_s);
        let Some(before) = after.checked_sub(1) else {
            return self.points[0].place;
        };
        if after == self.points.len() {
            return self.points[before].place;
        }
        let (a, b) = (&self.points[before], &self.points[after]);
        let span = b.time_s - a.time_s;
        let t = (time_s - a.time_s) / span;
        let (from, to) = (self.velocity_at(before), self.velocity_at(after));
        std::array::from_fn(|axis| hermite(t, span, (a.place[axis], from[axis]), (b.place[axis], to[axis])))
    }

    /// Velocity at a point: that of the parabola through it and its neighbours, m/s.
    fn velocity_at(&self, index: usize) -> [f32; 2] {
        let slope = |a: usize, b: usize| {
            let (a, b) = (&self.points[a], &self.points[b]);
            [0, 1].map(|axis| (b.place[axis] - a.place[axis]) / (b.time_s - a.time_s))
        };
        match (index, index + 1 == self.points.len()) {
            (0, _) => slope(0, 1),
            (_, true) => slope(index - 1, index),
            _ => {
                let (before, after) = (slope(index - 1, index), slope(index, index + 1));
                let spans = [index - 1, index].map(|at| self.points[at + 1].time_s - self.points[at].time_s);
                [0, 1].map(|axis| knot_slope([before[axis], after[axis]], spans))
            }
        }
    }

    /// `[frames][x, z, heading]`, metres and radians, from `start_s` on. Between points with
    /// headings the heading turns evenly. A point without one heads along the path; if the path
    /// stands still, it keeps the heading before.
    pub fn frames(&self, start_s: f32, fps: f32, count: usize) -> Vec<[f32; 3]> {
        let time = |frame: usize| start_s + frame as f32 / fps;
        let mut headings: Vec<Option<f32>> = match self.has_headings() {
            false => (0..count).map(|frame| self.direction(time(frame))).collect(),
            true => {
                let at: Vec<f32> = self.point_headings();
                (0..count)
                    .map(|frame| Some(self.turned(&at, time(frame))))
                    .collect()
            }
        };
        let first = headings.iter().flatten().next().copied();
        let mut last = first.unwrap_or(0.0);
        for heading in &mut headings {
            last = heading.unwrap_or(last);
            *heading = Some(last);
        }
        let each = headings.into_iter().enumerate().map(|(frame, heading)| {
            let [x, z] = self.place(time(frame));
            [x, z, heading.unwrap_or(0.0)]
        });
        each.collect()
    }

    /// Direction of the path at a time, radians; none if it stands still.
    fn direction(&self, time_s: f32) -> Option<f32> {
        let [from, to] = [-DIRECTION_S, DIRECTION_S].map(|off| self.place(time_s + off));
        let (x, z) = (to[0] - from[0], to[1] - from[1]);
        // At the ends of a path, half of the time it stands still.
        (x.hypot(z) > STANDING_MPS * DIRECTION_S).then(|| x.atan2(z))
    }

    /// The heading of each point: its own, otherwise along the path, otherwise a neighbour's.
    fn point_headings(&self) -> Vec<f32> {
        let own = |point: &PathPoint| point.heading.or_else(|| self.direction(point.time_s));
        let own: Vec<Option<f32>> = self.points.iter().map(own).collect();
        let mut last = own.iter().flatten().next().copied().unwrap_or(0.0);
        let each = own.into_iter().map(|heading| {
            last = heading.unwrap_or(last);
            last
        });
        each.collect()
    }

    /// The heading at a time, between those of the points `at`.
    fn turned(&self, at: &[f32], time_s: f32) -> f32 {
        let after = self.points.partition_point(|point| point.time_s <= time_s);
        let (Some(before), Some(&to)) = (after.checked_sub(1), at.get(after)) else {
            return at[after.saturating_sub(1)];
        };
        let (a, b) = (self.points[before].time_s, self.points[after].time_s);
        wrap_angle(at[before] + wrap_angle(to - at[before]) * (time_s - a) / (b - a))
    }
}

/// Distance between two places, metres.
pub fn distance(a: [f32; 2], b: [f32; 2]) -> f32 {
    (b[0] - a[0]).hypot(b[1] - a[1])
}

#[cfg(test)]
mod tests {
    use std::f32::consts::{FRAC_PI_2, PI};

    use proptest::prelude::*;

    use super::*;

    fn path(points: &[(f32, [f32; 2], Option<f32>)]) -> GroundPath {
        let point = |&(time_s, place, heading)| PathPoint {
            time_s,
            place,
            heading,
        };
        GroundPath::new(points.iter().map(point).collect()).unwrap()
    }

    #[test]
    fn a_straight_path_is_walked_evenly_and_ends() {
        let path = path(&[
            (0.0, [0.0, 0.0], None),
            (1.0, [0.0, 1.2], None),
            (2.0, [0.0, 2.4], None),
        ]);
        let frames = path.frames(0.0, 30.0, 91);
        for (frame, [x, z, heading]) in frames.iter().enumerate() {
            let wanted = (frame as f32 / 30.0 * 1.2).min(2.4);
            assert!(
                x.abs() < 1e-5 && (z - wanted).abs() < 1e-4 && heading.abs() < 1e-5,
                "{frame}: {z}"
            );
        }
    }

    #[test]
    fn headings_follow_the_path_or_the_points() {
        let corner = [(0.0, [0.0, 0.0]), (2.0, [0.0, 2.0]), (4.0, [2.0, 2.0])];
        let along = path(&corner.map(|(time, place)| (time, place, None))).frames(0.0, 30.0, 121);
        assert!(
            along[0][2].abs() < 0.2 && (along[110][2] - FRAC_PI_2).abs() < 0.2,
            "{:?}",
            along[110]
        );
        let back = path(&corner.map(|(time, place)| (time, place, Some(PI - 0.1)))).frames(0.0, 30.0, 121);
        assert!(back.iter().all(|frame| (frame[2] - (PI - 0.1)).abs() < 1e-5));
        // The short way round.
        let turn = path(&[(0.0, [0.0, 0.0], Some(3.0)), (1.0, [0.0, 0.0], Some(-3.0))]).frames(0.0, 30.0, 16);
        assert!(turn.iter().all(|frame| frame[2].abs() > 2.9), "{turn:?}");
    }

    #[test]
    fn a_path_that_stands_keeps_its_heading() {
        let path = path(&[
            (0.0, [0.0, 0.0], None),
            (1.0, [1.0, 0.0], None),
            (9.0, [1.0, 0.0], None),
        ]);
        let frames = path.frames(0.0, 30.0, 240);
        assert!((frames[200][2] - FRAC_PI_2).abs() < 0.3, "{:?}", frames[200]);
        let stands = self::path(&[(0.0, [3.0, 4.0], None)]).frames(0.0, 30.0, 10);
        assert_eq!(stands[9], [3.0, 4.0, 0.0]);
    }

    #[test]
    fn times_follow_from_speed() {
        let times = GroundPath::times_at(&[[0.0, 0.0], [3.0, 4.0], [3.0, 4.0]], 2.0);
        assert_eq!(times, [0.0, 2.5, 2.51]);
        assert!(GroundPath::new(vec![]).is_none());
    }

    proptest! {
        #[test]
        fn any_path_goes_through_its_points(
            steps in prop::collection::vec((0.05f32..3.0, -5.0f32..5.0, -5.0f32..5.0, prop::option::of(-7.0f32..7.0)), 1..20),
        ) {
            let mut time_s = 0.0;
            let points: Vec<_> = steps.iter().map(|&(step, x, z, heading)| {
                time_s += step;
                (time_s, [x, z], heading)
            }).collect();
            let path = path(&points);
            for (time, place, _) in &points {
                prop_assert!(distance(path.place(*time), *place) < 1e-3);
            }
            for frame in path.frames(-1.0, 30.0, 200) {
                prop_assert!(frame.iter().all(|number| number.is_finite()));
            }
        }
    }
}
