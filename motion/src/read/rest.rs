//! The rest pose of a file's skeleton.

use super::options::Options;
use super::report::{Basis, Finding, RestPose, Up};
use super::survey::Survey;

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
    let (pose, evidence) = RestPose::of(body, &survey.rest, up);
    Finding::new(pose, Basis::Found, evidence)
}
