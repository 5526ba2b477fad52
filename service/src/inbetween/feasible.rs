//! Whether answers stay within the limits of a pack's data: the figures as messages, and errors of
//! strict requests.

use troupe_character::{FieldError, Path};
use troupe_motion::Skeleton;
use troupe_motion::feasibility::{Feasibility, Figure, Judge, Key, Limits, Reading, farthest};
use troupe_motion::model::Rig;
use troupe_proto::v1;

use super::{GivenRoot, Plan};

/// A strict request whose answer would not be feasible. Names the field at fault and what would be
/// possible.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(transparent)]
pub struct NotFeasible(#[from] pub FieldError);

/// The figures as a message.
pub fn message(found: &Feasibility) -> v1::Feasibility {
    let (worst, reading) = found.worst();
    let figure = |figure: Figure| {
        let reading = found.get(figure);
        // Bodies without hinges have no limits of those.
        reading.limit.is_finite().then(|| v1::FeasibilityFigure {
            value: reading.value,
            limit: reading.limit,
            frame: reading.frame as u32,
            joint: reading.joint.map(|joint| joint as u32),
        })
    };
    v1::Feasibility {
        feasible: found.is_feasible(),
        worst: worst.name().to_owned(),
        ratio: reading.ratio(),
        root_speed: figure(Figure::RootSpeed),
        root_acceleration: figure(Figure::RootAcceleration),
        turning: figure(Figure::Turning),
        joint_speed: figure(Figure::JointSpeed),
        joint_acceleration: figure(Figure::JointAcceleration),
        below_ground: figure(Figure::BelowGround),
        off_ground: figure(Figure::OffGround),
        tilt: figure(Figure::Tilt),
        bend: figure(Figure::Bend),
        root_reach: figure(Figure::RootReach),
        turn_reach: figure(Figure::TurnReach),
        pose_reach: figure(Figure::PoseReach),
        hinge_speed: figure(Figure::HingeSpeed),
        hinge_acceleration: figure(Figure::HingeAcceleration),
    }
}

/// Rejects a strict character if its keyframes alone show that no answer is feasible.
///
/// # Errors
/// [`NotFeasible`] for the first such character.
pub fn refuse_keyframes(plans: &[Plan], rig: &Rig) -> Result<(), NotFeasible> {
    if !plans.iter().any(|plan| plan.strict) {
        return Ok(());
    }
    let Some(mut judge) = Judge::new(rig) else {
        return Ok(());
    };
    for (index, plan) in plans.iter().enumerate().filter(|(_, plan)| plan.strict) {
        let frames = plan.frames.unwrap_or(plan.most_frames);
        let found = judge_keys(&mut judge, plan, frames);
        refuse(index, plan, rig, &found, frames)?;
    }
    Ok(())
}

/// Judges the keyframes of a plan for a segment of `frames` frames.
fn judge_keys(judge: &mut Judge, plan: &Plan, frames: usize) -> Feasibility {
    let [context, targets] = keys(plan);
    let found = judge.keys(&context, &targets, frames);
    match &plan.root {
        Some(given) => found.worse_of(&judge.places(way(plan, given))),
        None => found,
    }
}

/// The ground positions of a given root with their frames. The position of the last context frame
/// comes first.
fn way(plan: &Plan, given: &GivenRoot) -> impl Iterator<Item = (usize, [f32; 2])> {
    let last = plan.context.iter().enumerate().next_back();
    let start = last.and_then(|(frame, key)| {
        let place = key.root?.position;
        Some((frame, [place.x, place.z]))
    });
    let keys = given.over.keys().iter();
    start
        .into_iter()
        .chain(keys.filter_map(|key| Some((key.frame, key.ground?))))
}

/// The context and the target keyframes of a plan.
pub(super) fn keys(plan: &Plan) -> [Vec<Key<'_>>; 2] {
    [&plan.context, &plan.targets].map(|keys| keys.iter().map(|key| key.key()).collect())
}

/// Rejects a strict character if `found`, the figures of its answer with `frames` frames, is not
/// feasible.
///
/// # Errors
/// [`NotFeasible`] if a figure is beyond its limit.
pub fn refuse(
    index: usize,
    plan: &Plan,
    rig: &Rig,
    found: &Feasibility,
    frames: usize,
) -> Result<(), NotFeasible> {
    if !plan.strict || found.is_feasible() {
        return Ok(());
    }
    let root = Path::root().sized(plan.size);
    let path = root.element("characters", index);
    let character = InfeasibleCharacter {
        path: &path,
        plan,
        rig,
        frames,
    };
    Err(NotFeasible(character.error(found)))
}

/// Rejects frames along a path that are not feasible.
///
/// # Errors
/// [`NotFeasible`] if a figure is beyond its limit.
pub fn refuse_frames(found: &v1::Feasibility) -> Result<(), NotFeasible> {
    if found.feasible {
        return Ok(());
    }
    let path = Path::root();
    let path = path.field("path");
    let message = format!(
        "leads to frames whose {} is {:.2} times {}",
        found.worst,
        found.ratio,
        match found.worst.starts_with("hinge_") {
            true => "what the robot can do",
            false => "what the body's data shows",
        }
    );
    let allowed = "a path that is slower or turns less; without strict, any path";
    Err(path.field("points").error(message, allowed).into())
}

/// A character of a strict request that is not feasible. Makes its error.
struct InfeasibleCharacter<'a> {
    path: &'a Path<'a>,
    plan: &'a Plan,
    rig: &'a Rig,
    frames: usize,
}

impl InfeasibleCharacter<'_> {
    fn error(&self, found: &Feasibility) -> FieldError {
        let (figure, reading) = found.worst();
        let first_target = self.frames.saturating_sub(self.plan.targets.len());
        let target = reading.frame.checked_sub(first_target);
        match (figure, target) {
            (Figure::RootReach | Figure::TurnReach | Figure::PoseReach, target) => {
                self.out_of_reach(figure, reading, target.unwrap_or(0))
            }
            (Figure::RootSpeed | Figure::RootAcceleration | Figure::Turning, Some(_))
                if self.plan.root.is_some() =>
            {
                self.on_the_way(figure, reading)
            }
            (_, Some(target)) => self.keyframe("targets", target, figure, reading),
            (_, None) if reading.frame < self.plan.context.len() => {
                self.keyframe("context", reading.frame, figure, reading)
            }
            _ => self.on_the_way(figure, reading),
        }
    }

    /// The error for a keyframe, by itself or compared with its neighbours.
    fn keyframe(&self, list: &'static str, index: usize, figure: Figure, reading: Reading) -> FieldError {
        let key = self.path.element(list, index);
        let message = format!(
            "{}{}",
            in_words(self.path, figure, reading),
            of_joint(reading, &self.rig.skeleton)
        );
        let allowed = self.allowed(figure, reading);
        match figure {
            Figure::RootSpeed | Figure::RootAcceleration => key.field("root").error(message, allowed),
            _ => key.field("pose").error(message, allowed),
        }
    }

    /// The error for the motion between the keyframes.
    fn on_the_way(&self, figure: Figure, reading: Reading) -> FieldError {
        if let Some(given) = &self.plan.root {
            return self.on_the_given_way(given, figure, reading);
        }
        let what = in_words(self.path, figure, reading);
        let joint = of_joint(reading, &self.rig.skeleton);
        let message = format!("take a motion that {what} in frame {}{joint}", reading.frame);
        self.path
            .field("targets")
            .error(message, self.allowed(figure, reading))
    }

    /// The error for the motion along roots that the request gives. Names the next entry.
    fn on_the_given_way(&self, given: &GivenRoot, figure: Figure, reading: Reading) -> FieldError {
        let next = given.frames.partition_point(|&frame| frame < reading.frame);
        let index = next.min(given.frames.len().saturating_sub(1));
        let what = in_words(self.path, figure, reading);
        let joint = of_joint(reading, &self.rig.skeleton);
        let message = format!("leads to a motion that {what} in frame {}{joint}", reading.frame);
        let allowed = format!("at most {}", value(self.path, figure, reading.limit));
        self.path.element("root", index).error(message, allowed)
    }

    /// The limit of a figure. If a longer segment would help, also its number of frames.
    fn allowed(&self, figure: Figure, reading: Reading) -> String {
        let limit = format!("at most {}", value(self.path, figure, reading.limit));
        let gap = self
            .frames
            .saturating_sub(self.plan.context.len() + self.plan.targets.len())
            + 1;
        let longer = match figure.power_of_time() {
            1 => reading.ratio(),
            2 => reading.ratio().sqrt(),
            _ => return limit,
        };
        // Consecutive keyframes stay consecutive in a longer segment.
        let inside = reading.frame >= self.plan.context.len()
            && reading.frame + self.plan.targets.len() <= self.frames;
        if !inside {
            return limit;
        }
        let needed = self.frames as f32 + (longer - 1.0) * gap as f32;
        let most = self.rig.dims.max_frames();
        match needed.ceil() {
            needed if needed <= most as f32 => format!("{limit}, which about {needed} frames leave time for"),
            _ => format!("{limit}, which no segment of at most {most} frames leaves time for"),
        }
    }

    /// The error for a target that is too far away for its frames.
    fn out_of_reach(&self, figure: Figure, reading: Reading, index: usize) -> FieldError {
        let [context, targets] = keys(self.plan);
        let (Some(limits), Some(target)) = (self.rig.limits.as_deref(), targets.get(index)) else {
            return self.on_the_way(figure, reading);
        };
        // Frames from the last context frame to the target.
        let steps = (reading.frame + 1).saturating_sub(context.len()).max(1);
        let key = self.path.element("targets", index);
        let (root, pose) = (key.field("root"), key.field("pose"));
        let frames = self.frames_needed(&context, target, steps);
        match figure {
            Figure::RootReach => {
                let message = format!(
                    "is {:.2} m over the ground from the place that the context leads to in {steps} frames; characters reach \
                     at most {:.2} m from there",
                    self.path.metres(reading.value),
                    self.path.metres(reading.limit)
                );
                let distance = self.distance(limits, &context, target, steps);
                root.field("position")
                    .error(message, format!("{distance}{frames}"))
            }
            Figure::TurnReach => {
                let (turn, most) = (reading.value.to_degrees(), reading.limit.to_degrees());
                let message = format!("turns the pelvis by {turn:.0}° in {steps} frames");
                let allowed = format!("at most {most:.0}° in as many{frames}");
                let field = if target.rotations.is_some() { pose } else { root };
                field.error(message, allowed)
            }
            _ => {
                let message = format!(
                    "moves the joints by {:.2} m in the mean in {steps} frames",
                    self.path.metres(reading.value)
                );
                let most = self.path.metres(reading.limit);
                pose.error(message, format!("at most {most:.2} m in as many{frames}"))
            }
        }
    }

    /// How far a target may be, in the direction of this one.
    fn distance(&self, limits: &Limits, context: &[Key<'_>], target: &Key<'_>, steps: usize) -> String {
        match farthest(limits, context, target, steps) {
            Some(most) => {
                let most = self.path.metres(most);
                format!("at most {most:.2} m from the last context frame in this direction in {steps} frames")
            }
            None => format!("a place nearer to the one that the context leads to in {steps} frames"),
        }
    }

    /// The shortest segment in which the target is within reach.
    fn frames_needed(&self, context: &[Key<'_>], target: &Key<'_>, steps: usize) -> String {
        let most = self.rig.dims.max_frames();
        let spare = most.saturating_sub(self.frames);
        let mut judge = Judge::new(self.rig);
        let enough = judge
            .as_mut()
            .and_then(|judge| (1..=spare).find(|more| judge.is_within_reach(context, target, steps + more)));
        match enough {
            Some(more) => format!("; or frame_count {} or more", self.frames + more),
            None => format!("; no segment of at most {most} frames reaches it"),
        }
    }
}

/// A figure in words, as a predicate of the keyframe or the motion at `path`.
pub(super) fn in_words(path: &Path<'_>, figure: Figure, reading: Reading) -> String {
    let found = value(path, figure, reading.value);
    match figure {
        Figure::RootSpeed => format!("moves the root at {found}"),
        Figure::RootAcceleration => format!("accelerates the root by {found}"),
        Figure::Turning => format!("turns the pelvis at {found}"),
        Figure::JointSpeed => format!("moves a joint at {found}"),
        Figure::JointAcceleration => format!("accelerates a joint by {found}"),
        Figure::BelowGround => format!("has a joint {found} below the ground"),
        Figure::OffGround => format!("has no joint nearer to the ground than {found}"),
        Figure::Tilt => format!("tilts the pelvis by {found}"),
        Figure::Bend => format!("bends a joint {found} beyond its range"),
        Figure::RootReach | Figure::TurnReach | Figure::PoseReach => format!("is {found} away"),
        Figure::HingeSpeed => format!("turns a hinge at {found}"),
        Figure::HingeAcceleration => format!("accelerates a hinge by {found}"),
    }
}

/// A value with its unit, as the caller of `path` says it.
pub(super) fn value(path: &Path<'_>, figure: Figure, value: f32) -> String {
    match figure.unit() {
        "rad" => format!("{:.0}°", value.to_degrees()),
        // The same at any size.
        unit @ ("rad/s" | "rad/s²") => format!("{value:.2} {unit}"),
        unit => format!("{:.2} {unit}", path.metres(value)),
    }
}

fn of_joint(reading: Reading, skeleton: &Skeleton) -> String {
    let joint = reading.joint.and_then(|joint| skeleton.joints.get(joint));
    joint.map_or_else(String::new, |joint| format!(" ({})", joint.name))
}

#[cfg(test)]
#[path = "feasible_tests.rs"]
mod tests;
