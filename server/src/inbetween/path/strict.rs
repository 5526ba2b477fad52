//! Whether a path is one that its body can follow, as far as its data shows.

use troupe_character::{FieldError, Path};
use troupe_motion::feasibility::{Figure, Judge, Key, Reading};
use troupe_motion::model::Body;
use troupe_proto::v1;

use super::super::feasible::{NotFeasible, told, value};
use super::{PathPlan, speed};

/// Checks that the body has limits where they are asked for.
pub(super) fn check(path: &Path<'_>, goal: &v1::PathGoal, body: &Body) -> Result<(), FieldError> {
    match goal.strict && body.rig.limits.is_none() {
        true => Err(path.field("strict").error(
            format!("is true, but body {} has no limits", body.name),
            "false; true for bodies with limits",
        )),
        false => Ok(()),
    }
}

impl PathPlan {
    /// A judge of the frames that are made, which go on from the past. None where the body has no
    /// limits.
    pub fn judge(&self) -> Option<Judge> {
        let mut judge = Judge::new(&self.body.rig)?;
        for (frame, key) in self.last.iter().enumerate() {
            let pose = key.pose.as_ref().map(|pose| (pose.height, &*pose.rotations));
            judge.push(frame, key.root.map(|root| root.position), pose);
        }
        judge.part();
        Some(judge)
    }

    /// Refuses what past, targets and the path itself show to be beyond the body's limits.
    ///
    /// # Errors
    /// [`NotFeasible`], with the field at fault.
    pub fn refuse(&self) -> Result<(), NotFeasible> {
        let Some(mut judge) = Judge::new(&self.body.rig) else {
            return Ok(());
        };
        let keys = [&self.last, &self.targets];
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
        self.refuse_speed(&path, &judge)
    }

    /// Refuses a path that is faster than the body.
    fn refuse_speed(&self, path: &Path<'_>, judge: &Judge) -> Result<(), NotFeasible> {
        let fps = self.body.rig.fps;
        let limit = judge.limits().of(Figure::RootSpeed);
        let steps = self.path.windows(2).map(|pair| speed(pair, fps)).enumerate();
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
        let needed_s = self.path.len() as f32 / fps * reading.ratio();
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
}
