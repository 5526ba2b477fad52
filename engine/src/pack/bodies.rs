//! The files of bodies, `bodies/NAME.toml` in a pack's folder, and the names in manifests.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Deserialize;
use troupe_motion::Skeleton;
use troupe_motion::feasibility::{Limits, LimitsDoc};
use troupe_motion::model::{Body, BodyParts, Dims, Sway, SwayDoc};
use troupe_motion::robot::RobotDoc;
use troupe_motion::rotation::from_wxyz;

use super::manifest::field;
use super::{PackProblem, read_text};

/// Path of one body's file in a pack's folder.
pub(super) fn body_file(folder: &Path, name: &str) -> PathBuf {
    folder.join("bodies").join(format!("{name}.toml"))
}

/// Reads the file of a body. `known` has the words of the pack, and the manifest's fields of bodies
/// and words.
///
/// # Errors
/// [`PackProblem::Read`], [`PackProblem::BodyFile`], [`PackProblem::Body`],
/// [`PackProblem::BodyLimits`], or [`PackProblem::Field`] for a name or word that differs from the
/// manifest.
pub(super) fn read_body(
    folder: &Path,
    name: &str,
    known: (&[String], [&'static str; 2]),
    fps: f32,
    dims: &Dims,
) -> Result<Body, PackProblem> {
    let (words, [bodies_field, words_field]) = known;
    let text = read_text(&body_file(folder, name))?;
    let doc: BodyDoc = toml::from_str(&text).map_err(|cause| PackProblem::BodyFile {
        body: name.to_owned(),
        cause: Box::new(cause),
    })?;
    if doc.name != name {
        let allowed = format!("{:?}, the name of its file", doc.name);
        return Err(field(bodies_field, name, allowed));
    }
    if let Some(word) = doc.words.iter().find(|word| !words.contains(word)) {
        let allowed = format!("words of the pack, in bodies/{name}.toml");
        return Err(field(words_field, word, allowed));
    }
    let (limits, sway) = (doc.limits.clone(), doc.sway.clone());
    let wrong = |problem| PackProblem::Body {
        body: name.to_owned(),
        problem: Box::new(problem),
    };
    let mut body = Body::new(doc.parts()?, fps, dims).map_err(wrong)?;
    if let Some(doc) = sway {
        let sway = Sway::new(doc, &body.rig.skeleton, words).map_err(wrong)?;
        body.sway = Some(Arc::new(sway));
    }
    if let Some(doc) = limits {
        let limits = Limits::new(&doc, &body.rig.skeleton);
        let limits = limits.map_err(|problem| PackProblem::BodyLimits {
            body: name.to_owned(),
            problem: Box::new(problem),
        })?;
        Arc::make_mut(&mut body.rig).limits = Some(Arc::new(limits));
    }
    Ok(body)
}

/// Checks that a manifest's list of names has only names that requests can spell, each once.
///
/// # Errors
/// [`PackProblem::Field`] for the first other one.
pub(super) fn check_names(list: &'static str, names: &[String]) -> Result<(), PackProblem> {
    if let Some(name) = names.iter().find(|name| !is_name(name)) {
        return Err(field(list, name, "names of 1 to 64 of a-z, 0-9, - and _"));
    }
    let mut seen = HashSet::new();
    match names.iter().find(|name| !seen.insert(*name)) {
        Some(twice) => Err(field(list, twice, "each name once")),
        None => Ok(()),
    }
}

fn is_name(name: &str) -> bool {
    let allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_';
    (1..=64).contains(&name.len()) && name.chars().all(allowed)
}

/// A file in the folder `bodies`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct BodyDoc {
    name: String,
    words: Vec<String>,
    height_m: f32,
    size_m: f32,
    neutral: NeutralDoc,
    skeleton: Skeleton,
    robot: Option<RobotDoc>,
    limits: Option<LimitsDoc>,
    sway: Option<SwayDoc>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct NeutralDoc {
    sides: Vec<i8>,
    /// (w, x, y, z) of each joint, in world space.
    rotations: Vec<[f32; 4]>,
}

impl BodyDoc {
    fn parts(self) -> Result<BodyParts, PackProblem> {
        let skeleton = match &self.robot {
            Some(robot) => self.skeleton.with_robot(robot)?,
            None => self.skeleton,
        };
        Ok(BodyParts {
            name: self.name,
            skeleton,
            neutral: self.neutral.rotations.into_iter().map(from_wxyz).collect(),
            sides: self.neutral.sides,
            height_m: Some(self.height_m),
            size_m: Some(self.size_m),
            words: self.words,
        })
    }
}
