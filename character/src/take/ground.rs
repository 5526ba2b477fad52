//! The ground that a motion stands on: points of its surface.

use troupe_motion::Vec3;

/// A foot stands on the nearest point within this distance over the ground, metres.
const REACH_M: f32 = 1.0;
/// Points whose heights differ by less are level, metres.
const LEVEL_M: f32 = 1e-3;

/// Points of the surface, world, metres. Without points the ground is a floor at height 0.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Ground(pub Vec<Vec3>);

impl Ground {
    /// The one height of level ground, metres; none for ground that is not level.
    pub fn level(&self) -> Option<f32> {
        let low = self.0.iter().map(|point| point.y).fold(f32::INFINITY, f32::min);
        let high = self
            .0
            .iter()
            .map(|point| point.y)
            .fold(f32::NEG_INFINITY, f32::max);
        match self.0.is_empty() {
            true => Some(0.0),
            false => (high - low <= LEVEL_M).then_some((low + high) / 2.0),
        }
    }

    /// Height of the nearest point to a place, metres; none for a place that has no point near.
    pub fn height(&self, x: f32, z: f32) -> Option<f32> {
        if let Some(level) = self.level_of_few() {
            return Some(level);
        }
        let away = |point: &&Vec3| (point.x - x).powi(2) + (point.z - z).powi(2);
        let nearest = self.0.iter().min_by(|a, b| away(a).total_cmp(&away(b)))?;
        (away(&nearest) <= REACH_M * REACH_M).then_some(nearest.y)
    }

    /// No points are a floor at 0, and one point is a floor at its height.
    fn level_of_few(&self) -> Option<f32> {
        match self.0.as_slice() {
            [] => Some(0.0),
            [only] => Some(only.y),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_point_counts_unless_it_is_far() {
        let stairs = Ground(vec![Vec3::ZERO, Vec3::new(0.0, 0.2, 1.0)]);
        assert_eq!(stairs.level(), None);
        assert_eq!(stairs.height(0.0, 0.3), Some(0.0));
        assert_eq!(stairs.height(0.1, 0.8), Some(0.2));
        assert_eq!(stairs.height(5.0, 0.0), None);
        assert_eq!(Ground::default().height(9.0, 9.0), Some(0.0));
        assert_eq!(Ground(vec![Vec3::Y; 3]).level(), Some(1.0));
    }
}
