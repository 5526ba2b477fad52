//! Whether a body can follow a path, according to the limits of its data.

use troupe_character::keyframe::Checked;
use troupe_character::take::{PathPlan, speed_mps};
use troupe_character::{FieldError, Path};
use troupe_motion::feasibility::{Figure, Judge, Key, Reading};
use troupe_motion::model::Rig;
use troupe_proto::v1;

use super::super::feasible::{NotFeasible, in_words, value};
use super::walk::Walking;

/// Checks that the body of a strict request has limits.
pub(super) fn check(path: &Path<'_>, goal: &v1::PathGoal, body: &str, rig: &Rig) -> Result<(), FieldError> {
    match goal.strict && rig.limits.is_none() {
        true => Err(path.field("strict").error(
            format!("is true, but body {body} has no limits"),
            "false; true for bodies with limits",
        )),
        false => Ok(()),
    }
}

/// A judge for the frames along a path, which continue the past. None for a body without limits.
pub fn path_judge(plan: &PathPlan) -> Option<Judge> {
    judge_after(plan.newest(), &plan.body.rig)
}

/// A judge for the frames of a walk, as [`path_judge`].
pub fn walk_judge(walking: &Walking, rig: &Rig) -> Option<Judge> {
    judge_after(&walking.past, rig)
}

fn judge_after(past: &[Checked], rig: &Rig) -> Option<Judge> {
    let mut judge = Judge::new(rig)?;
    for (frame, key) in past.iter().enumerate() {
        let pose = key.pose.as_ref().map(|pose| (pose.height, &*pose.rotations));
        judge.push(frame, key.root.map(|root| root.position), pose);
    }
    judge.part();
    Some(judge)
}

/// Rejects a path if it, its past or its targets exceed the body's limits. `root` is the request.
///
/// # Errors
/// [`NotFeasible`], with the field at fault.
pub fn refuse_path(root: &Path<'_>, plan: &PathPlan) -> Result<(), NotFeasible> {
    let Some(mut judge) = Judge::new(&plan.body.rig) else {
        return Ok(());
    };
    refuse_ends(root, &mut judge, [plan.newest(), plan.targets()])?;
    refuse_speed(root, plan.way(), plan.body.rig.fps, &judge)
}

/// Rejects a walk as [`refuse_path`] does. Also rejects keyframes beyond the limits, and a path
/// that is too fast for the style.
///
/// # Errors
/// [`NotFeasible`], with the field at fault.
pub fn refuse_walk(root: &Path<'_>, walking: &Walking, rig: &Rig) -> Result<(), NotFeasible> {
    let Some(mut judge) = Judge::new(rig) else {
        return Ok(());
    };
    refuse_ends(root, &mut judge, [&walking.past, &walking.targets])?;
    let path = root.field("path");
    for (index, key) in walking.keyframes.iter().enumerate() {
        let place = path.element("keyframes", index);
        refuse_keys(&mut judge, std::slice::from_ref(key), |_| place.field("keyframe"))?;
    }
    refuse_speed(root, &walking.path.way, rig.fps, &judge)?;
    match walking.path.too_fast {
        None => Ok(()),
        Some(fast) => {
            let message = format!(
                "goes at {:.2} m/s after {:.1} s",
                root.metres(fast.path_mps),
                fast.time_s
            );
            let allowed = format!(
                "at most {:.2} m/s, as the style {} goes",
                root.metres(fast.style_mps),
                walking.style.name
            );
            Err(path.field("points").error(message, allowed).into())
        }
    }
}

fn refuse_ends(
    root: &Path<'_>,
    judge: &mut Judge,
    [past, targets]: [&[Checked]; 2],
) -> Result<(), NotFeasible> {
    let path = root.field("path");
    refuse_keys(judge, past, |frame| root.element("past", frame))?;
    refuse_keys(judge, targets, |frame| path.element("targets", frame))
}

/// Rejects consecutive keyframes beyond the limits. `place` names their fields.
fn refuse_keys<'a>(
    judge: &mut Judge,
    keys: &[Checked],
    place: impl Fn(usize) -> Path<'a>,
) -> Result<(), NotFeasible> {
    let keys: Vec<Key<'_>> = keys.iter().map(|key| key.key()).collect();
    let found = judge.keys(&keys, &[], keys.len());
    if found.is_feasible() {
        return Ok(());
    }
    let (figure, reading) = found.worst();
    let place = place(reading.frame);
    let allowed = format!("at most {}", value(&place, figure, reading.limit));
    Err(place.error(in_words(&place, figure, reading), allowed).into())
}

/// Rejects a path that is faster than the body can move.
fn refuse_speed(root: &Path<'_>, way: &[[f32; 3]], fps: f32, judge: &Judge) -> Result<(), NotFeasible> {
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
        in_words(root, Figure::RootSpeed, reading),
        frame as f32 / fps
    );
    let allowed = format!(
        "at most {}, as in about {needed_s:.1} s in all",
        value(root, Figure::RootSpeed, limit)
    );
    let path = root.field("path");
    Err(path.field("points").error(message, allowed).into())
}
