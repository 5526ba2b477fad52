//! The rest pose of a file's skeleton.

use glam::DVec3;

use super::body::Body;
use super::options::Options;
use super::report::{Basis, Finding, RestPose, Up};
use super::survey::Survey;

/// Angle from upright up to which a skeleton stands, degrees.
const MAX_LEAN_DEG: f64 = 30.0;
/// Angles below the horizontal at which arms stand in a T-pose, degrees, and up to that of an
/// A-pose.
const T_DEG: f64 = 25.0;
const A_DEG: f64 = 65.0;

/// How the skeleton points at rest, with `up` as the axis that it may stand along.
pub(super) fn rest_pose(survey: &Survey, resting: Option<Up>, options: &Options) -> Finding<RestPose> {
    if let Some(pose) = options.rest_pose {
        return Finding::new(pose, Basis::Given, "--rest-pose");
    }
    let none = |evidence: &str| Finding::new(RestPose::None, Basis::Found, evidence);
    let Some(body) = &survey.body else {
        return none("no body on two legs is found by its joints' names");
    };
    let Some(up) = resting.map(Up::direction) else {
        return none("at rest the bones stand along no axis");
    };
    let legs = [0, 1].map(|side| {
        let bone = survey.rest[body.feet[side]] - survey.rest[body.hips[side]];
        bone.angle_between(-up).to_degrees()
    });
    if legs.iter().any(|&lean| lean > MAX_LEAN_DEG) {
        let lean = legs[0].max(legs[1]);
        return none(&format!("at rest a leg points {lean:.0}° away from downwards"));
    }
    let Some(down) = arms_down_deg(survey, body, up) else {
        return Finding::new(
            RestPose::Standing,
            Basis::Found,
            "upright at rest; no arms are found by name",
        );
    };
    // Without the sign of a zero.
    let down = down.round() + 0.0;
    let pose = match down.abs() {
        angle if angle <= T_DEG => RestPose::T,
        _ if down < 0.0 => RestPose::None,
        angle if angle <= A_DEG => RestPose::A,
        _ => RestPose::Standing,
    };
    let evidence = format!("upright at rest, arms {down:.0}° below the horizontal");
    Finding::new(pose, Basis::Found, evidence)
}

/// Mean angle of the arms below the horizontal, degrees.
fn arms_down_deg(survey: &Survey, body: &Body, up: DVec3) -> Option<f64> {
    let angles = body.arms?.map(|[shoulder, _, wrist]| {
        let arm = survey.rest[wrist] - survey.rest[shoulder];
        Some(arm.try_normalize()?.dot(-up).clamp(-1.0, 1.0).asin().to_degrees())
    });
    Some(0.5 * (angles[0]? + angles[1]?))
}
