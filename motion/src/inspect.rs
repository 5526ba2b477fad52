//! Checks whether a clip is fit for use, and lists why not.

use crate::clip::Clip;
use crate::fk::WorldMotion;

/// Limits for a clip. The defaults are those of training
/// (`training/troupe_training/data/prepare.py`), which checks clips at 30 fps. For the same
/// verdict, resample a clip first ([`Clip::resample`]).
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    /// Fewest frames; 16 by default.
    pub min_frames: usize,
    /// Highest speed of a joint, m/s; 20 by default. Anything faster is a jump of the capture.
    pub max_speed_mps: f32,
    /// Greatest depth of the lowest joint below the ground, metres; 0.15 by default.
    pub max_depth_m: f32,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            min_frames: 16,
            max_speed_mps: 20.0,
            max_depth_m: 0.15,
        }
    }
}

/// Why a clip is not fit for use.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Issue {
    /// The clip has too few frames.
    #[error("too short: {frames} frames, fewer than {min}")]
    TooShort {
        /// Number of frames.
        frames: usize,
        /// Fewest that are allowed.
        min: usize,
    },
    /// A value is NaN or infinite, or a joint so far away that it overflows.
    #[error("not finite: joint {joint:?} in frame {frame}")]
    NotFinite {
        /// Name of the joint.
        joint: String,
        /// First frame with such a value.
        frame: usize,
    },
    /// A joint jumps.
    #[error("speed jump: joint {joint:?} moves at {speed_mps:.1} m/s into frame {frame}")]
    SpeedJump {
        /// Name of the fastest joint.
        joint: String,
        /// The frame that it moves into.
        frame: usize,
        /// Speed into that frame, m/s.
        speed_mps: f32,
    },
    /// A joint is below the ground.
    #[error("below ground: joint {joint:?} is {depth_m:.3} m under it in frame {frame}")]
    BelowGround {
        /// Name of the deepest joint.
        joint: String,
        /// Frame in which it is deepest.
        frame: usize,
        /// Depth, metres.
        depth_m: f32,
    },
}

/// All problems of `clip`: at most one of each kind, the worst frame of each. Empty if it is fit.
pub fn inspect(clip: &Clip, limits: &Limits) -> Vec<Issue> {
    let mut issues = Vec::new();
    let frames = clip.frames();
    if frames < limits.min_frames {
        issues.push(Issue::TooShort {
            frames,
            min: limits.min_frames,
        });
    }
    let motion = WorldMotion::from_clip(clip);
    let joints = motion.joints;
    let name = |joint: usize| clip.skeleton.joints[joint].name.clone();
    let place = |at: usize| (name(at % joints), at / joints);
    let bad = motion
        .positions
        .iter()
        .zip(&motion.rotations)
        .position(|(p, q)| !(p.is_finite() && q.is_finite()));
    if let Some(at) = bad {
        let (joint, frame) = place(at);
        issues.push(Issue::NotFinite { joint, frame });
        // Nothing else can be checked then.
        return issues;
    }
    let steps = motion.positions.iter().zip(motion.positions.iter().skip(joints));
    let fastest = steps
        .map(|(a, b)| a.distance(*b) * clip.fps)
        .enumerate()
        .max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((at, speed_mps)) = fastest.filter(|f| f.1 > limits.max_speed_mps) {
        let (joint, before) = place(at);
        issues.push(Issue::SpeedJump {
            joint,
            frame: before + 1,
            speed_mps,
        });
    }
    let lowest = motion
        .positions
        .iter()
        .map(|p| p.y)
        .enumerate()
        .min_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((at, y)) = lowest {
        let depth_m = clip.skeleton.ground_y_m - y;
        if depth_m > limits.max_depth_m {
            let (joint, frame) = place(at);
            issues.push(Issue::BelowGround {
                joint,
                frame,
                depth_m,
            });
        }
    }
    issues
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{stand, walk};
    use glam::Vec3;

    #[test]
    fn a_walk_is_fit() {
        assert_eq!(inspect(&walk(40), &Limits::default()), []);
    }

    #[test]
    fn every_fault_is_named_with_its_place() {
        let limits = Limits::default();
        assert_eq!(
            inspect(&stand(15), &limits),
            [Issue::TooShort { frames: 15, min: 16 }]
        );
        assert_eq!(inspect(&stand(16), &limits), []);
        let mut jump = stand(20);
        for f in 12..20 {
            jump.root_positions[f].x += 0.8;
        }
        let [
            Issue::SpeedJump {
                frame: 12, speed_mps, ..
            },
        ] = inspect(&jump, &limits)[..]
        else {
            panic!()
        };
        assert!((speed_mps - 24.0).abs() < 1e-3);
        let mut sunk = stand(20);
        sunk.root_positions[7].y -= 0.2;
        let issues = inspect(&sunk, &limits);
        let [
            Issue::BelowGround {
                joint,
                frame: 7,
                depth_m,
            },
        ] = &issues[..]
        else {
            panic!("{issues:?}")
        };
        // Toes rest at 2 cm.
        assert!(joint.starts_with("Toes") && (depth_m - 0.18).abs() < 1e-5);
        let mut broken = stand(20);
        broken.root_positions[3] = Vec3::new(0.0, f32::NAN, 0.0);
        assert_eq!(
            inspect(&broken, &limits),
            [Issue::NotFinite {
                joint: "Hips".to_owned(),
                frame: 3
            }]
        );
    }
}
