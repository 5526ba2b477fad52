//! A box that stands or moves.

use parry3d::bounding_volume::{Aabb, BoundingVolume as _};
use parry3d::math::{Pose, Vector};
use parry3d::query::{self, ShapeCastOptions};
use parry3d::shape::{Cuboid, Shape as _};
use troupe_motion::Vec3;

use super::convert::{pose, vector};
use super::error::{SceneError, coordinates};
use super::{HALF_EXTENT_M, MAX_COORDINATE_M, Transform, Volume};

/// A box that moves along a line: the space that a character fills, or reaches, from one place to
/// another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoxTrace {
    start: Transform,
    half_extents: Vec3,
    sweep: Vec3,
}

impl BoxTrace {
    /// A box of half extents `half_extents_m`, with its middle at `start`, turned like it, moved by
    /// `sweep_m`. A zero sweep leaves the box in place.
    ///
    /// # Errors
    /// [`SceneError::Value`] for values that are not finite or out of range.
    pub fn new(start: Transform, half_extents_m: Vec3, sweep_m: Vec3) -> Result<Self, SceneError> {
        let start = start.checked("the start of a box trace")?;
        coordinates("the sweep of a box trace", sweep_m, MAX_COORDINATE_M)?;
        let (low, high) = (*HALF_EXTENT_M.start(), *HALF_EXTENT_M.end());
        if let Some(wrong) = half_extents_m
            .to_array()
            .into_iter()
            .find(|e| !(low..=high).contains(e))
        {
            return Err(SceneError::value(
                "a half extent of a box trace",
                wrong.to_string(),
                format!("{low} to {high} m"),
            ));
        }
        Ok(Self {
            start,
            half_extents: half_extents_m,
            sweep: sweep_m,
        })
    }

    /// The middle of the box at its start.
    pub fn center(&self) -> Vec3 {
        self.start.position
    }

    pub(super) fn prepare(&self) -> Prepared {
        let cuboid = Cuboid::new(vector(self.half_extents));
        let at = pose(self.start);
        let sweep = vector(self.sweep);
        let first = cuboid.compute_aabb(&at);
        let mut last = first;
        last.mins += sweep;
        last.maxs += sweep;
        Prepared {
            cuboid,
            at,
            sweep: (self.sweep != Vec3::ZERO).then_some(sweep),
            bounds: first.merged(&last),
        }
    }
}

/// A box trace in the library's types.
pub(super) struct Prepared {
    cuboid: Cuboid,
    at: Pose,
    sweep: Option<Vector>,
    pub(super) bounds: Aabb,
}

impl Prepared {
    /// The share of the sweep after which the box meets the volume: 0 if it does from the start,
    /// `None` if never.
    pub(super) fn meets(&self, volume: &Volume, transform: Transform) -> Option<f32> {
        let at = volume.pose(transform);
        // The library gives no answer for pairs of shapes that it does not support. It supports a
        // box with every shape used here.
        let touches = query::intersection_test(&self.at, &self.cuboid, &at, volume.shape());
        if touches.is_ok_and(|test| test.intersecting) {
            return Some(0.0);
        }
        let options = ShapeCastOptions {
            max_time_of_impact: 1.0,
            target_distance: 0.0,
            stop_at_penetration: true,
            compute_impact_geometry_on_penetration: false,
        };
        let cast = query::cast_shapes(
            &self.at,
            self.sweep?,
            &self.cuboid,
            &at,
            Vector::ZERO,
            volume.shape(),
            options,
        );
        Some(cast.ok().flatten()?.time_of_impact.clamp(0.0, 1.0))
    }
}
