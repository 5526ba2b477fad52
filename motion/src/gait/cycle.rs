//! The search for a gait cycle.

use std::f32::consts::PI;

use glam::Vec3;

use super::GaitError;
use super::steps::{Steps, median};
use crate::clip::Clip;
use crate::rotation::yaw;

/// Which cycles to look for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Way {
    /// Cycles that keep their direction and the clip's own speed.
    #[default]
    Straight,
    /// Cycles that turn most.
    Turning,
}

/// Limits of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CycleOptions {
    /// Which cycles to look for.
    pub way: Way,
    /// Shortest cycle, seconds.
    pub least_s: f32,
    /// Longest cycle, seconds.
    pub most_s: f32,
    /// Largest root mean square distance of the joints between a cycle's ends, metres.
    pub max_closure_m: f32,
}

impl Default for CycleOptions {
    /// Straight cycles of 0.4 to 2.5 s whose ends differ by at most 0.12 m.
    fn default() -> Self {
        Self {
            way: Way::Straight,
            least_s: 0.4,
            most_s: 2.5,
            max_closure_m: 0.12,
        }
    }
}

/// One cycle in a clip, from a left strike to the frame before the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cycle {
    /// Frame of the first left strike.
    pub start: usize,
    /// Frames to the next left strike.
    pub frames: usize,
    /// Mean velocity to the left of the heading line, m/s.
    pub left_mps: f32,
    /// Mean velocity along the heading line, m/s.
    pub forward_mps: f32,
    /// Slope of the heading line, rad/s.
    pub turn_rps: f32,
    /// Heading of the heading line at `start`, radians.
    pub heading: f32,
    /// Mean height of the root joint, metres.
    pub height_m: f32,
    /// Root mean square distance of the joints between both ends, relative to the root along the
    /// heading line, metres.
    pub closure_m: f32,
}

impl Cycle {
    /// Mean speed over the ground, m/s.
    pub fn speed_mps(&self) -> f32 {
        self.left_mps.hypot(self.forward_mps)
    }

    /// Measures the cycle between two left strikes.
    fn measure(clip: &Clip, steps: &Steps, start: usize, end: usize) -> Self {
        let frames = end - start;
        let span_s = frames as f32 / clip.fps;
        let turned = steps.headings[end] - steps.headings[start];
        let turn_rps = turned / span_s;
        let mean = |values: &mut dyn Iterator<Item = f32>| values.sum::<f32>() / frames as f32;
        let middle = mean(&mut steps.headings[start..end].iter().copied());
        let heading = middle - turned * 0.5 * (frames - 1) as f32 / frames as f32;
        let way = clip.root_positions[end] - clip.root_positions[start];
        let velocity = yaw(-(heading + 0.5 * turned)) * way / (span_s * sinc(0.5 * turned));
        let mut cycle = Self {
            start,
            frames,
            left_mps: velocity.x,
            forward_mps: velocity.z,
            turn_rps,
            heading,
            height_m: mean(&mut clip.root_positions[start..end].iter().map(|p| p.y)),
            closure_m: 0.0,
        };
        cycle.closure_m = cycle.closure(clip, steps);
        cycle
    }

    /// Heading of the heading line `frames` after the start, radians.
    pub(super) fn heading_at(&self, frames: f32, fps: f32) -> f32 {
        self.heading + self.turn_rps * frames / fps
    }

    /// Distance between the three frames around the end and the three around the start.
    fn closure(&self, clip: &Clip, steps: &Steps) -> f32 {
        let (mut here, mut there) = (Vec::new(), Vec::new());
        let mut sum = 0.0;
        let mut count = 0;
        for offset in [-1.0, 0.0, 1.0] {
            let begin = (self.start as f32 + offset) as usize;
            let end = begin + self.frames;
            steps.pose_along(begin, self.heading_at(offset, clip.fps), &mut here);
            let heading = self.heading_at(offset + self.frames as f32, clip.fps);
            steps.pose_along(end, heading, &mut there);
            sum += here
                .iter()
                .zip(&there)
                .map(|(a, b)| a.distance_squared(*b))
                .sum::<f32>();
            count += here.len();
        }
        (sum / count as f32).sqrt()
    }

    /// Lower is better: how well it closes, keeps the clip's speed, and does what is looked for.
    fn cost(&self, steps: &Steps, way: Way) -> f32 {
        let median_speed = steps.median_speed;
        let pace = 0.3 * (self.speed_mps() - median_speed).abs() / median_speed.max(0.3);
        match way {
            Way::Straight => self.closure_m + pace + 0.1 * self.turn_rps.abs(),
            Way::Turning => self.closure_m - 0.1 * self.turn_rps.abs(),
        }
    }
}

/// `sin(x) / x`: the ratio of a chord to its arc.
pub(super) fn sinc(x: f32) -> f32 {
    if x.abs() < 1e-4 { 1.0 } else { x.sin() / x }
}

/// The cycles of a clip, best first.
///
/// The clip should have at least 30 frames a second, and more than two steps at a steady speed.
///
/// # Errors
/// [`GaitError`], which says why there is none.
pub fn find_cycles(clip: &Clip, options: &CycleOptions) -> Result<Vec<Cycle>, GaitError> {
    let least = ((options.least_s * clip.fps).round() as usize).max(4);
    let most = (options.most_s * clip.fps).round() as usize;
    // A cycle and one frame more on either side.
    if clip.frames() < least + 2 {
        return Err(GaitError::TooShort {
            frames: clip.frames(),
            least: least + 2,
        });
    }
    let steps = Steps::of(clip)?;
    let pairs: Vec<(usize, usize)> = steps.strikes.windows(2).map(|p| (p[0], p[1])).collect();
    let apart = || pairs.iter().map(|(a, b)| b - a);
    let (Some(shortest), Some(longest)) = (apart().min(), apart().max()) else {
        return Err(GaitError::NoSteps {
            strikes: steps.strikes.len(),
        });
    };
    let last = clip.frames() - 1;
    let mut cycles: Vec<Cycle> = pairs
        .iter()
        .filter(|&&(a, b)| (least..=most).contains(&(b - a)) && a >= 1 && b < last)
        .map(|&(a, b)| Cycle::measure(clip, &steps, a, b))
        .collect();
    if cycles.is_empty() {
        return Err(GaitError::Period {
            shortest,
            longest,
            least,
            most,
        });
    }
    let closure_m = cycles.iter().map(|c| c.closure_m).fold(f32::INFINITY, f32::min);
    if closure_m > options.max_closure_m {
        return Err(GaitError::Open {
            closure_m,
            limit_m: options.max_closure_m,
        });
    }
    cycles.retain(|c| c.closure_m <= options.max_closure_m);
    drop_odd_periods(&mut cycles);
    cycles.sort_by(|a, b| {
        let cost = |c: &Cycle| c.cost(&steps, options.way);
        cost(a).total_cmp(&cost(b))
    });
    Ok(cycles)
}

/// Removes cycles whose period is far from the others': a stumble, or one step counted as two.
fn drop_odd_periods(cycles: &mut Vec<Cycle>) {
    let periods: Vec<f32> = cycles.iter().map(|c| c.frames as f32).collect();
    let usual = median(&periods);
    cycles.retain(|c| (c.frames as f32 - usual).abs() <= (0.15 * usual).max(2.0));
}

/// Place of a walker `time_s` after the origin, on an arc that begins along `heading` and turns.
pub(super) fn arc(left_mps: f32, forward_mps: f32, turn_rps: f32, heading: f32, time_s: f32) -> Vec3 {
    let half = 0.5 * turn_rps * time_s;
    debug_assert!(half.abs() < 1e3 * PI);
    yaw(heading + half) * Vec3::new(left_mps, 0.0, forward_mps) * (time_s * sinc(half))
}
