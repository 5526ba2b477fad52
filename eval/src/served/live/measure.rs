//! Measuring what characters did.

use std::f32::consts::FRAC_PI_2;

use glam::{Mat3, Vec3};
use troupe_motion::clip::Clip;
use troupe_motion::fk::WorldMotion;
use troupe_motion::gait::{GaitError, feet};
use troupe_motion::metrics::{
    LimbDistances, Limbs, MetricError, foot_skate_m_per_frame, joint_accelerations_mps2, joint_jitter_mps2,
    root_accelerations_mps2,
};
use troupe_motion::root::wrap_angle;

use super::scenario::{Course, START, Scenario};

/// Frames after the start until a gait is steady.
const STEADY_AFTER: usize = 45;
/// Frames of a turn or a stop in which limbs and the root are measured. It is done by then.
const CHANGE_FRAMES: usize = 45;
/// Frames on either side of the moment at which a heading is measured.
const HEADING_REACH: usize = 4;

/// What one character did.
#[derive(Debug, Clone)]
pub(super) struct Outcome {
    /// Mean speed along the commanded direction around 1 s after the start, m/s.
    pub(super) speed_1s: f32,
    /// The same from 1.5 s after the start until the stop or the turn.
    pub(super) speed_steady: f32,
    /// Mean horizontal movement of feet on the ground while steady, metres a frame.
    pub(super) skate_m: f64,
    /// Mean acceleration of joints while steady, m/s².
    pub(super) jitter: f64,
    /// All joint accelerations from the first command on, m/s².
    pub(super) accelerations: Vec<f64>,
    /// How far it faces on average from where it should while steady, radians.
    pub(super) facing_error: f32,
    /// Least distances between its limbs in the 1.5 s after the second command.
    pub(super) nearest: LimbDistances,
    /// The largest acceleration of its root over the ground in that time, m/s².
    pub(super) root_mps2: f64,
    pub(super) then: Then,
}

/// What the second command led to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Then {
    /// A stop.
    Stopped {
        /// Mean speed 1 s after it, m/s.
        speed_1s: f32,
    },
    /// A turn.
    Turned {
        /// The commanded turn, radians.
        angle: f32,
        /// How far the heading is off 1 s after it, without the sway of the steps, radians.
        heading_error: f32,
        /// The same with the sway.
        raw_error: f32,
        /// Mean speed along the new way around 1 s after it, m/s.
        speed_1s: f32,
    },
}

/// Why a character cannot be measured.
#[derive(Debug, thiserror::Error)]
pub(super) enum MeasureError {
    #[error(transparent)]
    Metric(#[from] MetricError),
    #[error(transparent)]
    Feet(#[from] GaitError),
}

/// Measures what a character did. The clip begins with its first frame.
pub(super) fn measure(scenario: &Scenario, clip: &Clip) -> Result<Outcome, MeasureError> {
    let motion = WorldMotion::from_clip(clip);
    let second = clip.fps.round() as usize;
    let next = match scenario.course {
        Course::Stop { at } | Course::Turn { at, .. } => at,
    };
    let steady = START + STEADY_AFTER..next;
    let speed = |at: usize, direction: Vec3| speed_around(clip, at, scenario.period / 2, direction);
    let direction = scenario.velocity.normalize_or_zero();
    let way = clip.root_positions[next] - clip.root_positions[steady.start];
    let then = match scenario.course {
        Course::Stop { at } => Then::Stopped {
            speed_1s: drift(clip, at + second),
        },
        Course::Turn { at, angle } => {
            let turned = troupe_motion::rotation::yaw(angle) * direction;
            let heading = turned.x.atan2(turned.z);
            let sway = Sway::learn(clip, &motion, at - 2 * scenario.period..at, direction)?;
            let near = at + second - HEADING_REACH..=at + second + HEADING_REACH;
            let count = (2 * HEADING_REACH + 1) as f32;
            let (mut error, mut raw) = (0.0, 0.0);
            for f in near {
                let off = wrap_angle(clip.root_at(f).heading - heading);
                raw += off / count;
                error += (off - sway.at(&motion, f, turned)) / count;
            }
            Then::Turned {
                angle,
                heading_error: error,
                raw_error: raw,
                speed_1s: speed(at + second, turned),
            }
        }
    };
    let change = next..next + CHANGE_FRAMES;
    let facing = steady
        .clone()
        .map(|frame| wrap_angle(clip.root_at(frame).heading - scenario.facing))
        .sum::<f32>()
        / steady.len() as f32;
    let root = root_accelerations_mps2(&motion, change.clone(), clip.fps)?;
    Ok(Outcome {
        facing_error: facing.abs(),
        nearest: Limbs::of(&clip.skeleton).nearest(&motion, change)?,
        root_mps2: root.into_iter().fold(0.0, f64::max),
        speed_1s: speed(START + second, direction),
        speed_steady: way.dot(direction) * clip.fps / steady.len() as f32,
        skate_m: foot_skate_m_per_frame(&clip.skeleton, &motion, steady.clone())?,
        jitter: joint_jitter_mps2(&motion, steady, clip.fps)?,
        accelerations: joint_accelerations_mps2(&motion, START..clip.frames(), clip.fps)?,
        then,
    })
}

/// Mean speed along a direction over `window` frames around one.
fn speed_around(clip: &Clip, at: usize, window: usize, direction: Vec3) -> f32 {
    let from = at - window / 2;
    let to = (from + window).min(clip.frames() - 1);
    let way = clip.root_positions[to] - clip.root_positions[from];
    way.dot(direction) * clip.fps / (to - from) as f32
}

/// Mean speed over the ground in the 10 frames around one.
fn drift(clip: &Clip, at: usize) -> f32 {
    let way = clip.root_positions[at + 5] - clip.root_positions[at - 5];
    (way * Vec3::new(1.0, 0.0, 1.0)).length() * clip.fps / 10.0
}

/// How the pelvis' heading sways with the steps: a plane through heading against the lead of the
/// left foot and its change.
struct Sway {
    feet: troupe_motion::gait::Feet,
    slopes: [f32; 2],
    means: [f32; 2],
}

impl Sway {
    /// Learns it from frames that go straight on in a direction.
    fn learn(
        clip: &Clip,
        motion: &WorldMotion,
        frames: std::ops::Range<usize>,
        direction: Vec3,
    ) -> Result<Self, MeasureError> {
        let mut sway = Self {
            feet: feet(&clip.skeleton)?,
            slopes: [0.0; 2],
            means: [0.0; 2],
        };
        let heading = direction.x.atan2(direction.z);
        // Least squares of heading = [lead, change, 1] * x.
        let (mut normal, mut right, mut sum) = (Mat3::ZERO, Vec3::ZERO, Vec3::ZERO);
        for f in frames.clone() {
            let row = sway.row(motion, f, direction);
            let off = wrap_angle(clip.root_at(f).heading - heading);
            normal += Mat3::from_cols(row * row.x, row * row.y, row * row.z);
            right += row * off;
            sum += row;
        }
        let means = sum / frames.len().max(1) as f32;
        sway.means = [means.x, means.y];
        // Nothing is learnt from feet that do not move.
        if normal.determinant().abs() > 1e-9 {
            let fitted = normal.inverse() * right;
            sway.slopes = [fitted.x, fitted.y];
        }
        Ok(sway)
    }

    fn row(&self, motion: &WorldMotion, frame: usize, direction: Vec3) -> Vec3 {
        let lead = |f: usize| self.feet.lead_m(motion.positions_at(f), direction);
        let change = (lead(frame + 1) - lead(frame - 1)) * 2.0;
        Vec3::new(lead(frame), change, 1.0)
    }

    /// The sway in a frame that goes in a direction, radians.
    fn at(&self, motion: &WorldMotion, frame: usize, direction: Vec3) -> f32 {
        let row = self.row(motion, frame, direction);
        let sway = self.slopes[0] * (row.x - self.means[0]) + self.slopes[1] * (row.y - self.means[1]);
        sway.clamp(-FRAC_PI_2, FRAC_PI_2)
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;
    use std::sync::Arc;

    use glam::Quat;
    use troupe_motion::rotation::yaw;
    use troupe_motion::skeleton::{ContactParams, Joint, Skeleton};

    use super::super::scenario::{AFTER, STRAIGHT};
    use super::*;

    /// A pelvis with two stiff legs.
    fn legs() -> Arc<Skeleton> {
        let joint = |name: &str, parent, offset_m| Joint {
            name: name.to_owned(),
            parent,
            offset_m,
        };
        let joints = vec![
            joint("Hips", None, Vec3::ZERO),
            joint("Leg_L", Some(0), Vec3::X * 0.1),
            joint("Foot_L", Some(1), Vec3::Y * -0.9),
            joint("Leg_R", Some(0), Vec3::X * -0.1),
            joint("Foot_R", Some(3), Vec3::Y * -0.9),
        ];
        let contacts = ContactParams {
            joints: vec![2, 4],
            max_height_m: vec![0.1; 2],
            max_speed_mps: 0.4,
            clearance_m: vec![0.05; 2],
        };
        Arc::new(Skeleton::new(joints, Vec3::X, 0.0, Some(contacts)).unwrap())
    }

    /// Walks at `speed` from the first command on, turns or stops within half a second of the
    /// second, and sways with its steps by 0.2 rad. A turn is too short by `short` radians.
    fn walker(scenario: &Scenario, speed: f32, short: f32) -> Clip {
        let (at, angle) = match scenario.course {
            Course::Stop { at } => (at, None),
            Course::Turn { at, angle } => (at, Some(angle - short)),
        };
        let mut place = Vec3::Y * 0.95;
        let (mut roots, mut rotations) = (Vec::new(), Vec::new());
        for f in 0..scenario.frames {
            let done = ((f as f32 - at as f32) / 15.0).clamp(0.0, 1.0);
            let heading = angle.unwrap_or(0.0) * done;
            let stopped = angle.is_none() && f >= at;
            let phase = TAU * f as f32 / scenario.period as f32;
            let swing = 0.4 * phase.cos();
            rotations.extend([
                yaw(heading + 0.2 * (phase + 0.6).sin()),
                Quat::from_rotation_x(-swing),
                Quat::IDENTITY,
                Quat::from_rotation_x(swing),
                Quat::IDENTITY,
            ]);
            roots.push(place);
            if f >= START && !stopped {
                place += yaw(heading) * Vec3::Z * (speed / 30.0);
            }
        }
        Clip::new(legs(), 30.0, roots, rotations).unwrap()
    }

    fn scenario(course: Course, frames: usize) -> Scenario {
        Scenario {
            style: "calm".to_owned(),
            gait: "walk".to_owned(),
            period: 30,
            velocity: Vec3::Z * 1.2,
            facing: 0.0,
            course,
            commands: Vec::new(),
            frames,
        }
    }

    #[test]
    fn speeds_are_those_walked() {
        let at = START + STRAIGHT;
        let scenario = scenario(Course::Stop { at }, at + AFTER);
        let outcome = measure(&scenario, &walker(&scenario, 1.1, 0.0)).unwrap();
        assert!((outcome.speed_1s - 1.1).abs() < 1e-3 && (outcome.speed_steady - 1.1).abs() < 1e-3);
        assert_eq!(outcome.then, Then::Stopped { speed_1s: 0.0 });
        let frames = at + AFTER - START - 1;
        assert_eq!(outcome.accelerations.len(), frames * 5);
        assert!(outcome.jitter > 0.1);
        // The stop takes one frame, less than the time over which the acceleration is measured.
        assert!(
            (outcome.root_mps2 - 1.1 * 6.0).abs() < 0.1,
            "{}",
            outcome.root_mps2
        );
        assert!(outcome.facing_error < 0.02, "{}", outcome.facing_error);
        // The skeleton has no knees and no arms.
        let nearest = &outcome.nearest;
        assert!(
            nearest.shins_m.is_infinite() && nearest.arms_m.is_infinite(),
            "{nearest:?}"
        );
    }

    #[test]
    fn headings_are_measured_without_the_sway() {
        let at = START + 95;
        for (angle, short) in [(FRAC_PI_2, 0.0), (-FRAC_PI_2, 0.0), (0.8, 0.15), (3.1, -0.1)] {
            let scenario = scenario(Course::Turn { at, angle }, at + AFTER);
            let outcome = measure(&scenario, &walker(&scenario, 1.2, short)).unwrap();
            let Then::Turned {
                heading_error,
                raw_error,
                speed_1s,
                ..
            } = outcome.then
            else {
                panic!("a turn");
            };
            assert!((heading_error + short).abs() < 0.02, "{angle}: {heading_error}");
            assert!(
                (raw_error + short).abs() > 0.08,
                "{angle}: the sway is 0.2 rad: {raw_error}"
            );
            assert!((speed_1s - 1.2 * short.cos()).abs() < 0.01, "{speed_1s}");
        }
    }
}
