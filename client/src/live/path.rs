//! A path to follow.

use glam::Vec3;
use troupe_proto::v1;

use super::act::Act;

/// A point of a path, in the session's convention.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PathPoint {
    /// Place to pass. Only the ground plane counts.
    pub position: Vec3,
    /// Heading to face, radians. None: along the path.
    pub heading: Option<f32>,
    /// Time of arrival, seconds from the command: increasing, and for all points or none.
    pub time_s: Option<f32>,
}

/// A path to follow: 2 to 1024 points. The character goes to the first point, and stands at the
/// last.
///
/// ```
/// use glam::Vec3;
/// use troupe_client::{Act, LivePath};
///
/// let square = [Vec3::ZERO, Vec3::Z * 3.0, Vec3::new(3.0, 0.0, 3.0), Vec3::X * 3.0];
/// let rounds = Act::from(LivePath::through(square).speed(1.2).style("elderly").looped());
/// # assert_ne!(rounds, Act::Cancel);
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LivePath {
    /// Places in the order of the path.
    pub points: Vec<PathPoint>,
    /// Speed along the path, in the session's units per second, for points without times. None: the
    /// style's.
    pub speed: Option<f32>,
    /// Style to move in. None: the current one.
    pub style: Option<String>,
    /// Go on from the last point to the first, for ever.
    pub is_loop: bool,
}

impl LivePath {
    /// A path through these places.
    pub fn through(places: impl IntoIterator<Item = Vec3>) -> Self {
        let point = |position| PathPoint {
            position,
            ..PathPoint::default()
        };
        Self::of(places.into_iter().map(point))
    }

    /// A path of these points.
    pub fn of(points: impl IntoIterator<Item = PathPoint>) -> Self {
        Self {
            points: points.into_iter().collect(),
            ..Self::default()
        }
    }

    /// Sets the speed, in the session's units per second.
    #[must_use]
    pub fn speed(self, speed: f32) -> Self {
        Self {
            speed: Some(speed),
            ..self
        }
    }

    /// Moves in this style.
    #[must_use]
    pub fn style(self, style: impl Into<String>) -> Self {
        Self {
            style: Some(style.into()),
            ..self
        }
    }

    /// Goes on from the last point to the first, for ever.
    #[must_use]
    pub fn looped(self) -> Self {
        Self {
            is_loop: true,
            ..self
        }
    }

    /// The intent on the wire.
    pub fn to_message(&self) -> v1::FollowPath {
        let point = |point: &PathPoint| {
            let Vec3 { x, y, z } = point.position;
            v1::PathPoint {
                position: Some(v1::Vec3 { x, y, z }),
                heading: point.heading,
                time: point.time_s,
            }
        };
        v1::FollowPath {
            points: self.points.iter().map(point).collect(),
            speed: self.speed,
            style: self.style.clone().unwrap_or_default(),
            r#loop: self.is_loop,
        }
    }
}

impl From<LivePath> for Act {
    fn from(path: LivePath) -> Self {
        Self::FollowPath(path)
    }
}
