//! The written form of limits, the table `[limits]` of a `pack.toml`, and its checks.

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Largest difference of a vector or rotation from unit length.
const UNIT_TOLERANCE: f32 = 1e-3;
/// Largest value of a limit.
const MOST: f32 = 1e6;
/// Most entries of a list by frames.
const MOST_FRAMES: usize = 256;

/// Limits as written. The three lists of a reach have an entry for each of `reach_frames`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LimitsDoc {
    /// Share of the training windows that exceed each limit, 0 to 1.
    pub beyond: f32,
    /// Number of training windows that were measured.
    pub windows: u32,
    /// Speed of the root over the ground, m/s.
    pub root_speed_mps: f32,
    /// Acceleration of the root, m/s².
    pub root_acceleration_mps2: f32,
    /// Turning rate of the pelvis, rad/s.
    pub turning_rad_per_s: f32,
    /// Speed of a joint relative to the root, m/s.
    pub joint_speed_mps: f32,
    /// Acceleration of a joint relative to the root, m/s².
    pub joint_acceleration_mps2: f32,
    /// Depth of a joint below the ground, metres.
    pub below_ground_m: f32,
    /// Height of the lowest joint over the ground, metres.
    pub off_ground_m: f32,
    /// The world's usual up direction in the pelvis' frame of reference; unit length.
    pub upright: Vec3,
    /// Angle of the pelvis to that, radians.
    pub tilt_rad: f32,
    /// Excess of a joint over its range, radians.
    pub bend_rad: f32,
    /// Frames from the last context frame to a target; increasing.
    pub reach_frames: Vec<u32>,
    /// Distance of the root from where its velocity leads, metres.
    pub root_reach_m: Vec<f32>,
    /// Turn of the pelvis, radians.
    pub turn_reach_rad: Vec<f32>,
    /// Mean distance that the joints move, metres.
    pub pose_reach_m: Vec<f32>,
    /// The ranges of joints.
    pub bends: Vec<BendDoc>,
}

/// The range of a joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BendDoc {
    /// Name of a joint of the skeleton that has a parent.
    pub joint: String,
    /// (w, x, y, z): usual rotation relative to the parent.
    pub usual: [f32; 4],
    /// Smallest vector part of `usual⁻¹ · rotation`: the axis times the sine of half the angle.
    pub low: Vec3,
    /// Largest vector part of the same.
    pub high: Vec3,
}

/// A value of the limits that is not accepted.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field} is {found}; allowed: {allowed}")]
pub struct LimitsError {
    /// Path of the field.
    pub field: String,
    /// The value that it has.
    pub found: String,
    /// The values that are allowed.
    pub allowed: String,
}

impl LimitsError {
    pub(super) fn new(field: impl Into<String>, found: impl ToString, allowed: impl Into<String>) -> Self {
        Self {
            field: field.into(),
            found: found.to_string(),
            allowed: allowed.into(),
        }
    }
}

pub(super) fn check_numbers(doc: &LimitsDoc) -> Result<(), LimitsError> {
    let numbers = [
        ("root_speed_mps", doc.root_speed_mps),
        ("root_acceleration_mps2", doc.root_acceleration_mps2),
        ("turning_rad_per_s", doc.turning_rad_per_s),
        ("joint_speed_mps", doc.joint_speed_mps),
        ("joint_acceleration_mps2", doc.joint_acceleration_mps2),
        ("below_ground_m", doc.below_ground_m),
        ("off_ground_m", doc.off_ground_m),
        ("tilt_rad", doc.tilt_rad),
        ("bend_rad", doc.bend_rad),
    ];
    for (name, value) in numbers {
        check_limit(&format!("limits.{name}"), value)?;
    }
    if !(0.0..=1.0).contains(&doc.beyond) {
        return Err(LimitsError::new("limits.beyond", doc.beyond, "0 to 1"));
    }
    check_unit("limits.upright", doc.upright.length())
}

pub(super) fn check_lists(doc: &LimitsDoc) -> Result<(), LimitsError> {
    let frames = &doc.reach_frames;
    let grow = frames.windows(2).all(|pair| pair[0] < pair[1]);
    if !(1..=MOST_FRAMES).contains(&frames.len()) || !grow || frames[0] == 0 {
        let allowed = format!("1 to {MOST_FRAMES} counts above 0 that grow");
        return Err(LimitsError::new(
            "limits.reach_frames",
            format!("{frames:?}"),
            allowed,
        ));
    }
    let lists = [
        ("root_reach_m", &doc.root_reach_m),
        ("turn_reach_rad", &doc.turn_reach_rad),
        ("pose_reach_m", &doc.pose_reach_m),
    ];
    for (name, list) in lists {
        if list.len() != frames.len() {
            let allowed = format!("{}, as many as reach_frames", frames.len());
            return Err(LimitsError::new(
                format!("limits.{name}"),
                format!("{} long", list.len()),
                allowed,
            ));
        }
        for (index, &value) in list.iter().enumerate() {
            check_limit(&format!("limits.{name}[{index}]"), value)?;
        }
    }
    for (index, bend) in doc.bends.iter().enumerate() {
        let field = format!("limits.bends[{index}]");
        let length = bend.usual.iter().map(|v| v * v).sum::<f32>().sqrt();
        check_unit(&format!("{field}.usual"), length)?;
        let within = Vec3::NEG_ONE.cmple(bend.low) & bend.low.cmple(bend.high) & bend.high.cmple(Vec3::ONE);
        if !within.all() {
            let found = format!("{} to {}", bend.low, bend.high);
            return Err(LimitsError::new(
                format!("{field}.low"),
                found,
                "-1 to 1, at most high",
            ));
        }
    }
    Ok(())
}

fn check_limit(field: &str, value: f32) -> Result<(), LimitsError> {
    match value > 0.0 && value <= MOST {
        true => Ok(()),
        false => Err(LimitsError::new(field, value, format!("above 0, at most {MOST}"))),
    }
}

fn check_unit(field: &str, length: f32) -> Result<(), LimitsError> {
    // Rejects a length that is not a number too.
    match (1.0 - UNIT_TOLERANCE..=1.0 + UNIT_TOLERANCE).contains(&length) {
        true => Ok(()),
        false => Err(LimitsError::new(
            field,
            format!("{length} long"),
            "unit length within 0.001",
        )),
    }
}
