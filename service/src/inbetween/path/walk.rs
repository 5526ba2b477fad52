//! Paths for a pack that makes motion from keyframe to keyframe: it walks along them in a style.

use std::sync::Arc;

use troupe_character::keyframe::Checked;
use troupe_character::style::{Style, StyleTable};
use troupe_character::take::{WalkPath, WalkRequest};
use troupe_character::{FieldError, Path};
use troupe_engine::pack::Pack;
use troupe_live::wire::keyframe::Role;
use troupe_live::wire::{keyframe, units};
use troupe_proto::v1;

use super::super::sampling::check_sampling;
use super::{MAX_LISTED, check_ends, cut, points, strict};

/// Most poses on a path.
pub const MAX_PATH_KEYFRAMES: usize = 256;
/// Temperature of a request that sets none.
const TEMPERATURE: f32 = 1.0;

/// A path for a walking pack.
#[derive(Debug)]
pub struct Walking {
    /// The take, which is made window by window.
    pub path: WalkPath,
    /// Frames before the path.
    pub past: Vec<Checked>,
    /// Poses on the path, in the order of the request.
    pub keyframes: Vec<Checked>,
    /// The last frames of the motion.
    pub targets: Vec<Checked>,
    /// Style of the walk.
    pub style: Arc<Style>,
}

impl Walking {
    /// Notes about what the pack may not do well, for the request `root`.
    pub fn notes(&self, root: &Path<'_>) -> Vec<String> {
        let note = |fast: troupe_character::take::TooFast| {
            format!(
                "the path goes at {:.1} m/s after {:.1} s, and the style {} at most at {:.1} m/s: the motion falls behind it",
                root.metres(fast.path_mps),
                fast.time_s,
                self.style.name,
                root.metres(fast.style_mps)
            )
        };
        self.path.too_fast.map(note).into_iter().collect()
    }
}

/// Checks a path with its past, poses and targets, for a pack that walks in one of `styles`.
/// `root` is the request, for errors.
///
/// # Errors
/// [`FieldError`] for the first value that is not accepted.
pub fn prepare_walk(
    root: &Path<'_>,
    request: &v1::GenerateRequest,
    goal: &v1::PathGoal,
    pack: &Pack,
    styles: &StyleTable,
) -> Result<Walking, FieldError> {
    let path = root.field("path");
    check_pack(&path, goal, pack)?;
    strict::check(&path, goal, pack.name(), &pack.rig)?;
    let style = style(&path, goal, pack, styles)?;
    let [past, targets] = check_ends(root, goal, &request.past, &pack.rig)?;
    let keyframes = keyframes(&path, goal, pack)?;
    let (points, seconds) = points(&path, goal, style.default_speed_mps)?;
    let planned = WalkRequest {
        rig: pack.rig.clone(),
        style: style.clone(),
        points,
        seconds,
        past: past.clone(),
        keyframes: keyframes.clone(),
        targets: targets.clone(),
        seed: request.seed,
        temperature: temperature(root, request, pack)?,
        hold_feet: !request.raw,
    };
    Ok(Walking {
        path: planned.plan(root)?,
        past,
        keyframes: keyframes.into_iter().map(|(_, key)| key).collect(),
        targets,
        style,
    })
}

/// Rejects fields that only networks with path input use.
fn check_pack(path: &Path<'_>, goal: &v1::PathGoal, pack: &Pack) -> Result<(), FieldError> {
    let name = pack.name();
    let one = format!("none: the pack {name} has one skeleton");
    let no_sampler = format!("none: the pack {name} has no sampler");
    let given = [
        ("body", !goal.body.is_empty(), &one),
        ("skeleton", goal.skeleton.is_some(), &one),
        ("steps", goal.steps.is_some(), &no_sampler),
    ];
    if let Some((field, _, allowed)) = given.into_iter().find(|(_, is_given, _)| *is_given) {
        return Err(path.field(field).error("is given", allowed));
    }
    match goal.guidance {
        Some(guidance) if guidance != 1.0 => {
            let allowed = format!("1, or left out: the pack {name} has no sampler");
            Err(path.field("guidance").error(format!("is {guidance}"), allowed))
        }
        Some(_) | None => Ok(()),
    }
}

/// The one style that a path names, or the default style.
fn style(
    path: &Path<'_>,
    goal: &v1::PathGoal,
    pack: &Pack,
    styles: &StyleTable,
) -> Result<Arc<Style>, FieldError> {
    let list = path.field("style");
    let Some(v1::StyleWord { word, weight }) = goal.style.first() else {
        let usual = styles.default_style();
        return usual.ok_or_else(|| list.error("is empty", "a style of the pack"));
    };
    if goal.style.len() > 1 {
        let allowed = format!("at most 1: the pack {} walks in one style", pack.name());
        return Err(list.error(format!("has {} entries", goal.style.len()), allowed));
    }
    let field = path.element("style", 0);
    if let Some(weight) = weight.filter(|weight| *weight != 1.0) {
        let allowed = format!("1, or left out: the pack {} blends no styles", pack.name());
        return Err(field.field("weight").error(format!("is {weight}"), allowed));
    }
    styles.get(word).ok_or_else(|| {
        let names = styles.list().into_iter().map(|style| style.name.clone());
        let names: Vec<String> = names.take(MAX_LISTED).collect();
        let field = field.field("word");
        field.error(format!("is {:?}", cut(word)), names.join(", "))
    })
}

/// The poses on the path, each with its time in seconds.
fn keyframes(path: &Path<'_>, goal: &v1::PathGoal, pack: &Pack) -> Result<Vec<(f32, Checked)>, FieldError> {
    units::length(
        &path.field("keyframes"),
        goal.keyframes.len(),
        0,
        MAX_PATH_KEYFRAMES,
    )?;
    let each = goal.keyframes.iter().enumerate().map(|(index, given)| {
        let path = path.element("keyframes", index);
        let time_s = units::within(&path.field("time"), given.time, 0.0, super::MAX_SECONDS)?;
        let place = path.field("keyframe");
        let Some(key) = &given.keyframe else {
            return Err(place.error("is missing", "a keyframe with a pose"));
        };
        if key.velocity.is_some() {
            return Err(place.field("velocity").error("is given", "none beside a path"));
        }
        let checked = keyframe::check(&place, key, Role::Target, &pack.rig.skeleton)?;
        match checked.pose.is_some() {
            true => Ok((time_s, checked)),
            false => Err(place
                .field("pose")
                .error("is missing", "a pose in every keyframe of a path")),
        }
    });
    each.collect()
}

fn temperature(root: &Path<'_>, request: &v1::GenerateRequest, pack: &Pack) -> Result<f32, FieldError> {
    let sampling = check_sampling(root, request.sampling.as_ref())?;
    let path = root.field("sampling");
    for (field, is_given) in [
        ("top_k", sampling.top_k.is_some()),
        ("top_p", sampling.top_p.is_some()),
        ("repetition", sampling.repetition.is_some()),
    ] {
        if is_given {
            let allowed = format!("none: the pack {} has no language model", pack.name());
            return Err(path.field(field).error("is given", allowed));
        }
    }
    Ok(sampling.temperature.unwrap_or(TEMPERATURE))
}

#[cfg(test)]
#[path = "walk_tests.rs"]
mod tests;
