//! The ground below a motion, as points of its surface.

use troupe_motion::Vec3;

/// Largest horizontal distance between a foot and the point that gives its ground height, metres.
const REACH_M: f32 = 1.0;
/// Ground is level if its points' heights differ by less than this, metres.
const LEVEL_M: f32 = 1e-3;

/// Points of the surface, world, metres. Without points the ground is a floor at height 0.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Ground(pub Vec<Vec3>);

impl Ground {
    /// The height of level ground, metres; none if the ground is not level.
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

    /// Height of the point nearest to a place, metres; none if no point is near.
    pub fn height(&self, x: f32, z: f32) -> Option<f32> {
        if let Some(level) = self.level_of_few() {
            return Some(level);
        }
        let away = |point: &&Vec3| (point.x - x).powi(2) + (point.z - z).powi(2);
        let nearest = self.0.iter().min_by(|a, b| away(a).total_cmp(&away(b)))?;
        (away(&nearest) <= REACH_M * REACH_M).then_some(nearest.y)
    }

    /// The height for no points, which is 0, and for one point, which is its own.
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
    fn the_nearest_point_gives_the_height_unless_it_is_far() {
        let stairs = Ground(vec![Vec3::ZERO, Vec3::new(0.0, 0.2, 1.0)]);
        assert_eq!(stairs.level(), None);
        assert_eq!(stairs.height(0.0, 0.3), Some(0.0));
        assert_eq!(stairs.height(0.1, 0.8), Some(0.2));
        assert_eq!(stairs.height(5.0, 0.0), None);
        assert_eq!(Ground::default().height(9.0, 9.0), Some(0.0));
        assert_eq!(Ground(vec![Vec3::Y; 3]).level(), Some(1.0));
    }
}
