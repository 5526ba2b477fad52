//! How a skeleton stands at rest.

use std::fmt;

use glam::DVec3;
use serde::Serialize;

use super::biped::Biped;

/// Angle from upright up to which a skeleton stands, degrees.
const MAX_LEAN_DEG: f64 = 30.0;
/// Angles below the horizontal at which arms stand in a T-pose, degrees, and up to that of an
/// A-pose.
const T_DEG: f64 = 25.0;
const A_DEG: f64 = 65.0;

/// How the bones of a skeleton point at rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RestPose {
    /// Upright, arms to the sides.
    T,
    /// Upright, arms half down.
    A,
    /// Upright, arms hanging.
    Standing,
    /// Anything else: bones along an axis of their own, or a pose that is no stance.
    None,
}

impl RestPose {
    /// The pose that is written `t`, `a`, `standing` or `none`.
    pub fn of_name(name: &str) -> Option<Self> {
        match name {
            "t" => Some(Self::T),
            "a" => Some(Self::A),
            "standing" => Some(Self::Standing),
            "none" => Some(Self::None),
            _ => None,
        }
    }
}

impl fmt::Display for RestPose {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::T => "T-pose",
            Self::A => "A-pose",
            Self::Standing => "standing",
            Self::None => "none",
        })
    }
}

impl RestPose {
    /// The rest pose of a body by its joints' places, with one line of evidence. `up` is a
    /// direction.
    pub fn of(body: &Biped, places: &[DVec3], up: DVec3) -> (Self, String) {
        let legs = [0, 1].map(|side| {
            let bone = places[body.feet[side]] - places[body.hips[side]];
            bone.angle_between(-up).to_degrees()
        });
        if legs.iter().any(|&lean| lean > MAX_LEAN_DEG) {
            let lean = legs[0].max(legs[1]);
            let evidence = format!("at rest a leg points {lean:.0}° away from downwards");
            return (Self::None, evidence);
        }
        let Some(down) = arms_down_deg(body, places, up) else {
            let evidence = "upright at rest; no arms are found by name".to_owned();
            return (Self::Standing, evidence);
        };
        // Without the sign of a zero.
        let down = down.round() + 0.0;
        let pose = match down.abs() {
            angle if angle <= T_DEG => Self::T,
            _ if down < 0.0 => Self::None,
            angle if angle <= A_DEG => Self::A,
            _ => Self::Standing,
        };
        (
            pose,
            format!("upright at rest, arms {down:.0}° below the horizontal"),
        )
    }
}

/// Mean angle of the arms below the horizontal, degrees.
fn arms_down_deg(body: &Biped, places: &[DVec3], up: DVec3) -> Option<f64> {
    let angles = body.arms?.map(|[shoulder, _, wrist]| {
        let arm = places[wrist] - places[shoulder];
        Some(arm.try_normalize()?.dot(-up).clamp(-1.0, 1.0).asin().to_degrees())
    });
    Some(0.5 * (angles[0]? + angles[1]?))
}
