//! Checks paths that requests ask for.

use std::sync::Arc;

use troupe_motion::Vec3;

use super::run::fastest;
use super::{MAX_PATH_MPS, MAX_PATH_S, MIN_PATH_MPS, PATH_POINTS, PathCommand, PathPoint};
use crate::primitives::recipe::STANDING_MPS;
use crate::style::Style;
use crate::{FieldError, Path};

/// Shortest time between two points of a path without times, seconds: a frame.
const LEAST_STEP_S: f32 = 1.0 / 30.0;
/// Points nearer to each other than this are one place, metres.
const SAME_PLACE_M: f32 = 0.01;
/// Speed of a path if neither request nor style has one, m/s.
const USUAL_MPS: f32 = 1.0;

/// A point of a requested path, in the native convention.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AskedPoint {
    /// World position, metres; y is ignored.
    pub position: Vec3,
    /// Where to face, radians.
    pub heading: Option<f32>,
    /// Time at the point, seconds from the command.
    pub time_s: Option<f32>,
}

impl PathCommand {
    /// Checks a path. `path` is its place in the request, for errors. Positions and headings must
    /// be finite. `speed_mps` is the speed of a path without times; `None`: the style's.
    ///
    /// # Errors
    /// [`FieldError`] for the first value that is not accepted.
    pub fn new(
        path: &Path<'_>,
        points: &[AskedPoint],
        speed_mps: Option<f32>,
        is_loop: bool,
        style: Arc<Style>,
    ) -> Result<Self, FieldError> {
        let count = points.len();
        if !PATH_POINTS.contains(&count) {
            let (low, high) = (PATH_POINTS.start(), PATH_POINTS.end());
            let points = path.field("points");
            return Err(points.error(format!("has {count} entries"), format!("{low} to {high}")));
        }
        if !can_move(&style) {
            return Err(path.field("style").error(
                format!("{:?} has no gait that moves", style.name),
                "a style that can walk",
            ));
        }
        let timed = points.iter().filter(|point| point.time_s.is_some()).count();
        let times = match timed {
            0 => spread(path, points, speed(path, speed_mps, &style)?)?,
            _ => given(path, points, speed_mps)?,
        };
        let points: Vec<PathPoint> = (points.iter().zip(times))
            .map(|(point, time_s)| PathPoint {
                position: point.position.with_y(0.0),
                heading: point.heading,
                time_s,
            })
            .collect();
        let closing_s = if is_loop {
            Some(closing(path, &points)?)
        } else {
            None
        };
        Ok(Self {
            style,
            points,
            closing_s,
        })
    }
}

fn can_move(style: &Style) -> bool {
    fastest(style, Vec3::Z, 0.0) >= STANDING_MPS
}

fn speed(path: &Path<'_>, speed_mps: Option<f32>, style: &Style) -> Result<f32, FieldError> {
    match speed_mps {
        Some(speed) if (MIN_PATH_MPS..=MAX_PATH_MPS).contains(&speed) => Ok(speed),
        Some(speed) => Err(path.field("speed").error(
            format!("is {} m/s", path.metres(speed)),
            format!(
                "{} to {} m/s",
                path.metres(MIN_PATH_MPS),
                path.metres(MAX_PATH_MPS)
            ),
        )),
        None if style.default_speed_mps >= MIN_PATH_MPS => Ok(style.default_speed_mps.min(MAX_PATH_MPS)),
        None => Ok(USUAL_MPS),
    }
}

/// Times of points that have none, at a constant speed.
fn spread(path: &Path<'_>, points: &[AskedPoint], speed_mps: f32) -> Result<Vec<f32>, FieldError> {
    let mut time_s = 0.0;
    let mut times = vec![time_s];
    for pair in points.windows(2) {
        time_s += (between(&pair[0], &pair[1]) / speed_mps).max(LEAST_STEP_S);
        times.push(time_s);
    }
    match time_s <= MAX_PATH_S {
        true => Ok(times),
        false => Err(path.field("points").error(
            format!("take {time_s} s at {} m/s", path.metres(speed_mps)),
            format!("at most {MAX_PATH_S} s"),
        )),
    }
}

/// The points' own times: every point has one, and they increase.
fn given(path: &Path<'_>, points: &[AskedPoint], speed_mps: Option<f32>) -> Result<Vec<f32>, FieldError> {
    if let Some(speed) = speed_mps {
        return Err(path.field("speed").error(
            format!("is {}, and the points have times", path.metres(speed)),
            "times or a speed, not both",
        ));
    }
    let mut times: Vec<f32> = Vec::with_capacity(points.len());
    for (index, point) in points.iter().enumerate() {
        let place = path.element("points", index);
        let place = place.field("time");
        let Some(time_s) = point.time_s else {
            return Err(place.error(
                "is missing, and other points have one",
                "a time for all points, or for none",
            ));
        };
        if !(0.0..=MAX_PATH_S).contains(&time_s) {
            return Err(place.error(format!("is {time_s}"), format!("0 to {MAX_PATH_S} s")));
        }
        if let (Some(&before), Some(from)) = (times.last(), index.checked_sub(1)) {
            if time_s <= before {
                return Err(place.error(
                    format!("is {time_s}, and the time of the point before is {before}"),
                    "times that increase",
                ));
            }
            let speed = between(&points[from], point) / (time_s - before);
            if speed > MAX_PATH_MPS {
                return Err(place.error(
                    format!("is {time_s}: the way there would take {} m/s", path.metres(speed)),
                    format!("at most {} m/s", path.metres(MAX_PATH_MPS)),
                ));
            }
        }
        times.push(time_s);
    }
    Ok(times)
}

/// Seconds from the last point back to the first, at the path's mean speed.
fn closing(path: &Path<'_>, points: &[PathPoint]) -> Result<f32, FieldError> {
    let [first, .., last] = points else {
        return Ok(LEAST_STEP_S);
    };
    let way = |a: &PathPoint, b: &PathPoint| a.position.distance(b.position);
    let length_m: f32 = points.windows(2).map(|pair| way(&pair[0], &pair[1])).sum();
    let length_s = last.time_s - first.time_s;
    let back_m = way(last, first);
    let speed = (length_m / length_s).max(MIN_PATH_MPS);
    if back_m < SAME_PLACE_M {
        return Ok(LEAST_STEP_S);
    }
    let closing_s = back_m / speed;
    match length_s + closing_s <= MAX_PATH_S {
        true => Ok(closing_s.max(LEAST_STEP_S)),
        false => Err(path.field("loop").error(
            format!("takes {closing_s} s from the last point back to the first, beside {length_s} s"),
            format!("at most {MAX_PATH_S} s in total"),
        )),
    }
}

fn between(a: &AskedPoint, b: &AskedPoint) -> f32 {
    (b.position - a.position).with_y(0.0).length()
}
