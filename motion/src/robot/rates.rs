//! How fast hinges turn from frame to frame, and how near that is to what they can do.

use super::{Hinge, Robot};
use crate::root::wrap_angle;

/// How fast a robot's hinges turned on the way to a frame. All 0 for the first frame of a motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HingeRate {
    /// Speed of a hinge divided by its highest speed: the largest of all hinges. Above 1 the hinge
    /// would have to be faster than it can.
    pub speed_ratio: f32,
    /// Index of that hinge.
    pub fastest: usize,
    /// Largest acceleration of any hinge, rad/s². It needs two frames before this one.
    pub acceleration_rad_per_s2: f32,
}

/// Measures the hinges' angles of frames, one after another. It keeps its memory.
#[derive(Clone, Debug, Default)]
pub struct HingeRates {
    /// Those of the newest frame. Empty before the first.
    angles: Vec<f32>,
    /// rad/s, signed. Empty before the second frame.
    speeds: Vec<f32>,
    /// rad/s², signed. Empty before the third frame.
    accelerations: Vec<f32>,
}

impl HingeRates {
    /// Takes the angles of the next frame, which comes `seconds` after the one before. A frame that
    /// comes at the same time or earlier begins a new motion.
    pub fn push(&mut self, robot: &Robot, angles: &[f32], seconds: f32) -> HingeRate {
        let mut rate = HingeRate::default();
        self.accelerations.clear();
        if self.angles.len() != angles.len() || seconds <= 0.0 {
            self.clear();
            self.angles.extend_from_slice(angles);
            return rate;
        }
        let had_speeds = !self.speeds.is_empty();
        self.speeds.resize(angles.len(), 0.0);
        for (nth, (hinge, &angle)) in robot.hinges().iter().zip(angles).enumerate() {
            let speed = way(hinge, self.angles[nth], angle) / seconds;
            if had_speeds {
                let acceleration = (speed - self.speeds[nth]) / seconds;
                self.accelerations.push(acceleration);
                rate.acceleration_rad_per_s2 = rate.acceleration_rad_per_s2.max(acceleration.abs());
            }
            let ratio = speed.abs() / hinge.max_speed_rad_per_s;
            if ratio > rate.speed_ratio {
                (rate.speed_ratio, rate.fastest) = (ratio, nth);
            }
            (self.angles[nth], self.speeds[nth]) = (angle, speed);
        }
        rate
    }

    /// Speeds of the hinges on the way to the newest frame, rad/s. Empty before the second frame.
    pub fn speeds(&self) -> &[f32] {
        &self.speeds
    }

    /// Accelerations of the hinges between the last three frames, rad/s². Empty before the third
    /// frame.
    pub fn accelerations(&self) -> &[f32] {
        &self.accelerations
    }

    /// Begins a new motion.
    pub fn clear(&mut self) {
        self.angles.clear();
        self.speeds.clear();
        self.accelerations.clear();
    }
}

/// The turn from one angle to another: for a hinge that turns all the way round, the shorter one.
fn way(hinge: &Hinge, from: f32, to: f32) -> f32 {
    match hinge.is_endless() {
        true => wrap_angle(to - from),
        false => to - from,
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use proptest::prelude::*;

    use super::super::testing::{g1, tables};
    use super::*;

    /// Seconds between two frames.
    const FRAME_S: f32 = 1.0 / 30.0;

    /// The rates of frames whose angles are all 0 but one.
    fn rates_of(robot: &Robot, hinge: usize, angles: &[f32]) -> Vec<HingeRate> {
        let mut rates = HingeRates::default();
        let mut all = vec![0.0; robot.hinges().len()];
        let mut push = |angle: f32| {
            all[hinge] = angle;
            rates.push(robot, &all, FRAME_S)
        };
        angles.iter().map(|&angle| push(angle)).collect()
    }

    #[test]
    fn the_hinge_that_is_farthest_beyond_its_own_limit_is_named() {
        let skeleton = g1();
        let robot = skeleton.robot.as_ref().unwrap();
        // The knee is limited to 20 rad/s and the ankle to 37.
        let [knee, ankle] = ["left_knee", "left_ankle_pitch"].map(|name| {
            let joint = skeleton.joint_index(name).unwrap();
            robot.hinge_of(joint).unwrap()
        });
        let mut rates = HingeRates::default();
        let mut angles = vec![0.0; robot.hinges().len()];
        assert_eq!(rates.push(robot, &angles, FRAME_S), HingeRate::default());
        (angles[knee], angles[ankle]) = (0.8, -0.9);
        let rate = rates.push(robot, &angles, FRAME_S);
        // 24 rad/s of 20, and 27 of 37.
        assert_eq!(rate.fastest, knee);
        assert!((rate.speed_ratio - 1.2).abs() < 1e-4, "{rate:?}");
        assert_eq!(rate.acceleration_rad_per_s2, 0.0);
        assert!((rates.speeds()[ankle] + 27.0).abs() < 1e-3);
        // Both stop: 27 rad/s in a frame are 810 rad/s².
        let rate = rates.push(robot, &angles, FRAME_S);
        assert_eq!(rate.speed_ratio, 0.0);
        assert!((rate.acceleration_rad_per_s2 - 810.0).abs() < 0.1, "{rate:?}");
        assert!((rates.accelerations()[knee] + 720.0).abs() < 0.1);
    }

    #[test]
    fn a_new_motion_has_no_speed() {
        let skeleton = g1();
        let robot = skeleton.robot.as_ref().unwrap();
        let far = vec![0.4; robot.hinges().len()];
        let mut rates = HingeRates::default();
        rates.push(robot, &vec![0.0; far.len()], FRAME_S);
        let mut other = rates.clone();
        other.clear();
        assert_eq!(other.push(robot, &far, FRAME_S), HingeRate::default());
        assert_eq!(rates.push(robot, &far, 0.0), HingeRate::default());
        assert!(rates.speeds().is_empty() && rates.accelerations().is_empty());
    }

    #[test]
    fn an_endless_hinge_goes_the_shorter_way() {
        let mut tables = tables();
        let hinge = &mut tables.robot.hinges[3];
        (hinge.lower_rad, hinge.upper_rad) = (-PI, PI);
        let skeleton = tables.skeleton.with_robot(&tables.robot).unwrap();
        let robot = skeleton.robot.as_ref().unwrap();
        let rates = rates_of(robot, 3, &[PI - 0.1, -PI + 0.1]);
        // 0.2 rad in a frame are 6 rad/s of 20.
        assert!((rates[1].speed_ratio - 0.3).abs() < 1e-4, "{:?}", rates[1]);
    }

    proptest! {
        #[test]
        fn only_steps_beyond_the_limit_are_beyond_it(
            hinge in 0_usize..29,
            steps in proptest::collection::vec(-1.3_f32..1.3, 1..40),
        ) {
            let skeleton = g1();
            let robot = skeleton.robot.as_ref().unwrap();
            let most = robot.hinges()[hinge].max_speed_rad_per_s * FRAME_S;
            let mut angles = vec![0.0];
            for step in &steps {
                angles.push(angles[angles.len() - 1] + step * most);
            }
            let rates = rates_of(robot, hinge, &angles);
            for (rate, step) in rates[1..].iter().zip(&steps) {
                prop_assert!((rate.speed_ratio - step.abs()).abs() < 1e-3);
                prop_assert!(rate.speed_ratio == 0.0 || rate.fastest == hinge);
            }
        }
    }
}
