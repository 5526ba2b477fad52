//! Whether a path is one that its body can follow, as far as its data shows.

use troupe_character::take::{PathPlan, speed_mps};
use troupe_character::{FieldError, Path};
use troupe_motion::feasibility::{Figure, Judge, Key, Reading};
use troupe_motion::model::Rig;
use troupe_proto::v1;

use super::super::feasible::{NotFeasible, told, value};

/// Checks that a strict request is for a body with limits.
pub(super) fn check(path: &Path<'_>, goal: &v1::PathGoal, body: &str, rig: &Rig) -> Result<(), FieldError> {
    match goal.strict && rig.limits.is_none() {
        true => Err(path.field("strict").error(
            format!("is true, but body {body} has no limits"),
            "false; true for bodies with limits",
        )),
        false => Ok(()),
    }
}

/// A judge of the frames that are made, which go on from the past. None for a body without limits.
pub fn path_judge(plan: &PathPlan) -> Option<Judge> {
    let mut judge = Judge::new(&plan.body.rig)?;
    for (frame, key) in plan.newest().iter().enumerate() {
        let pose = key.pose.as_ref().map(|pose| (pose.height, &*pose.rotations));
        judge.push(frame, key.root.map(|root| root.position), pose);
    }
    judge.part();
    Some(judge)
}

/// Refuses a path that is beyond the body's limits by itself, or whose past or targets are.
///
/// # Errors
/// [`NotFeasible`], with the field at fault.
pub fn refuse_path(plan: &PathPlan) -> Result<(), NotFeasible> {
    let Some(mut judge) = Judge::new(&plan.body.rig) else {
        return Ok(());
    };
    let keys = [plan.newest(), plan.targets()];
    let [past, targets] = keys.map(|keys| keys.iter().map(|key| key.key()).collect::<Vec<Key<'_>>>());
    let (root, lists) = (Path::root(), [("past", past), ("targets", targets)]);
    let path = root.field("path");
    for (name, keys) in lists {
        let found = judge.keys(&keys, &[], keys.len());
        if !found.is_feasible() {
            let (figure, reading) = found.worst();
            let field = if name == "past" { &root } else { &path };
            let allowed = format!("at most {}", value(figure, reading.limit));
            return Err(field
                .element(name, reading.frame)
                .error(told(figure, reading), allowed)
                .into());
        }
    }
    refuse_speed(&path, plan, &judge)
}

/// Refuses a path that is faster than the body.
fn refuse_speed(path: &Path<'_>, plan: &PathPlan, judge: &Judge) -> Result<(), NotFeasible> {
    let (fps, way) = (plan.body.rig.fps, plan.way());
    let limit = judge.limits().of(Figure::RootSpeed);
    let steps = way.windows(2).map(|pair| speed_mps(pair, fps)).enumerate();
    let (frame, fastest) = steps.fold((0, 0.0), |most, one| if one.1 > most.1 { one } else { most });
    if fastest <= limit {
        return Ok(());
    }
    let reading = Reading {
        value: fastest,
        limit,
        frame,
        joint: None,
    };
    let needed_s = way.len() as f32 / fps * reading.ratio();
    let message = format!(
        "{} after {:.1} s",
        told(Figure::RootSpeed, reading),
        frame as f32 / fps
    );
    let allowed = format!(
        "at most {}, as in about {needed_s:.1} s in all",
        value(Figure::RootSpeed, limit)
    );
    Err(path.field("points").error(message, allowed).into())
}
