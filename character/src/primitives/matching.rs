//! Matching: the phase at which a blend's pose and motion are nearest to the context's.

use troupe_motion::fk::world_transforms;
use troupe_motion::rotation::yaw;
use troupe_motion::{GlobalRoot, Quat, Skeleton, Vec3};

use super::PlanContext;
use super::blend::Blend;
use crate::style::cycles::{MATCH_STEPS, MATCH_VELOCITY_S};

/// Memory that matching reuses.
#[derive(Debug, Clone, Default)]
pub(super) struct Matcher {
    before: Vec<Vec3>,
    positions: Vec<Vec3>,
    velocities: Vec<Vec3>,
    rotations: Vec<Quat>,
}

impl Matcher {
    /// The phase of `blend` nearest to the context's last frame, in cycles from 0 to 1. `frame` is
    /// its time at 30 Hz.
    pub(super) fn nearest(&mut self, blend: &Blend<'_>, context: &PlanContext<'_>, frame: u64) -> f32 {
        self.take(context);
        let mut distances = [0.0; MATCH_STEPS];
        blend.distances(
            &self.positions,
            &self.velocities,
            MATCH_VELOCITY_S,
            frame,
            &mut distances,
        );
        lowest(&distances)
    }

    /// Joint positions and velocities of the context's last frame, relative to the projected root,
    /// facing +Z.
    fn take(&mut self, context: &PlanContext<'_>) {
        let joints = context.skeleton.joint_count();
        self.rotations.resize(joints, Quat::IDENTITY);
        for (positions, frame) in [(&mut self.before, 2), (&mut self.positions, 3)] {
            positions.resize(joints, Vec3::ZERO);
            let pose = &context.rotations[frame * joints..(frame + 1) * joints];
            place(
                context.skeleton,
                context.roots[frame],
                context.roots[3].heading,
                pose,
                positions,
                &mut self.rotations,
            );
        }
        self.velocities.clear();
        let pairs = self.positions.iter().zip(&self.before);
        self.velocities
            .extend(pairs.map(|(now, before)| (*now - *before) * context.fps));
    }
}

/// Joint positions relative to the projected root, turned so that `heading` is +Z.
fn place(
    skeleton: &Skeleton,
    root: GlobalRoot,
    heading: f32,
    pose: &[Quat],
    positions: &mut [Vec3],
    rotations: &mut [Quat],
) {
    let above = Vec3::new(0.0, root.position.y, 0.0);
    world_transforms(skeleton, above, pose, positions, rotations);
    let turn = yaw(-heading);
    for position in positions {
        *position = turn * *position;
    }
}

/// The lowest point of a function given at equal steps of a cycle, interpolated by the parabola
/// through the lowest step and its neighbours. In cycles, 0 to 1.
fn lowest(values: &[f32; MATCH_STEPS]) -> f32 {
    let mut least = 0;
    for (step, value) in values.iter().enumerate() {
        if *value < values[least] {
            least = step;
        }
    }
    let before = values[(least + MATCH_STEPS - 1) % MATCH_STEPS];
    let after = values[(least + 1) % MATCH_STEPS];
    let bend = before - 2.0 * values[least] + after;
    let between = if bend > 1e-9 {
        (0.5 * (before - after) / bend).clamp(-0.5, 0.5)
    } else {
        0.0
    };
    ((least as f32 + between) / MATCH_STEPS as f32).rem_euclid(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f32::consts::TAU;

    proptest! {
        #[test]
        fn the_minimum_of_a_wave_is_found_between_steps(place in 0.0f32..1.0) {
            let wave = std::array::from_fn(|step| {
                -(TAU * (step as f32 / MATCH_STEPS as f32 - place)).cos()
            });
            let apart = (lowest(&wave) - place + 0.5).rem_euclid(1.0) - 0.5;
            prop_assert!(apart.abs() < 0.002, "{apart}");
        }
    }

    #[test]
    fn a_flat_function_is_lowest_at_the_start() {
        assert_eq!(lowest(&[1.0; MATCH_STEPS]), 0.0);
    }
}
