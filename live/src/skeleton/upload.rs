//! A skeleton out of a request.

use std::sync::Arc;

use troupe_base::echo::{MAX_MESSAGE, cut};
use troupe_character::{FieldError, Path};
use troupe_motion::anatomy::PartsDoc;
use troupe_motion::fk::local_from_world_rotations;
use troupe_motion::model::Rig;
use troupe_motion::read::{self, Options, Report, Source};
use troupe_motion::retarget::{Figure, RetargetError};
use troupe_motion::{Quat, Skeleton};
use troupe_proto::v1;
use troupe_proto::v1::put_skeleton_request::Source as Given;

use super::doc::{BodyDoc, JointsDoc, MAX_JOINTS, RobotDoc, SkeletonDoc};
use super::error::SkeletonError;
use crate::wire::{inline_body, named};

/// Endings of files that are read.
const ENDINGS: &str = ".glb or .vrm with a skin, .gltf, .bvh, .npz, or a robot's .urdf or .xml";

/// Fields of `parts`.
const PARTS: [&str; 7] = [
    "trunk",
    "neck",
    "tail",
    "left_leg",
    "right_leg",
    "left_arm",
    "right_arm",
];

/// Reads the skeleton of a request. `rig` gives the frame rate of bodies that come as joints.
///
/// # Errors
/// [`SkeletonError::Field`] for the first value that is not accepted, or for a file that is no
/// body.
pub fn upload(request: &v1::PutSkeletonRequest, rig: &Rig) -> Result<SkeletonDoc, SkeletonError> {
    let root = Path::root();
    let name = named(&root.field("name"), &request.name)?;
    let parts = parts(&root.field("parts"), &request.parts)?;
    let mut notes = Vec::new();
    let body = match &request.source {
        None => {
            return Err(root.field("source").error("is missing", "file or joints").into());
        }
        Some(Given::File(file)) => of_file(&root.field("file"), file, parts, &mut notes)?,
        Some(Given::Joints(joints)) => of_joints(&root.field("joints"), joints, rig, &parts, &mut notes)?,
    };
    Ok(SkeletonDoc {
        name: name.to_owned(),
        forced: request.force,
        notes,
        body,
    })
}

/// Reads corrections of parts.
fn parts(path: &Path<'_>, text: &str) -> Result<PartsDoc, FieldError> {
    let read = toml::from_str(text);
    read.map_err(|error| {
        path.error(
            cut(&error.to_string(), MAX_MESSAGE),
            "TOML as OwnSkeleton.parts has it",
        )
    })
}

fn of_file(
    path: &Path<'_>,
    file: &v1::SkeletonFile,
    parts: PartsDoc,
    notes: &mut Vec<String>,
) -> Result<BodyDoc, FieldError> {
    let ending = file
        .name
        .rsplit_once('.')
        .map(|(_, ending)| ending.to_ascii_lowercase());
    let data = path.field("data");
    match ending.as_deref() {
        Some("urdf" | "xml") => {
            let description = std::str::from_utf8(&file.data);
            let description = description.map_err(|_| data.error("is no text", "a robot's URDF or MJCF"))?;
            let body = BodyDoc::Robot(RobotDoc {
                description: description.to_owned(),
                parts,
            });
            match body.figure() {
                Ok(_) => Ok(body),
                Err(why) => Err(correction(&why)
                    .unwrap_or_else(|| data.error(cut(&why, MAX_MESSAGE), "a robot that stands on legs"))),
            }
        }
        Some("glb" | "vrm" | "gltf" | "bvh" | "npz") => {
            let source = Source::new(&file.name, &file.data);
            let found = read::character(&source, &Options::default());
            let found = found.map_err(|error| {
                let why = cut(&error.to_string(), MAX_MESSAGE);
                data.error(
                    why,
                    "a character's file; `troupe clip convert` makes one with its options",
                )
            })?;
            notes.extend(noted(&found.report));
            let figure = found.figure(&parts).map_err(|error| not_found(path, &error))?;
            of_figure(path, &figure)
        }
        Some("fbx") => Err(path.field("name").error(
            format!("is {:?}, and the server does not read FBX", cut(&file.name, 64)),
            format!("{ENDINGS}; `troupe clip convert hero.fbx hero.glb` makes one"),
        )),
        _ => {
            let name = cut(&file.name, 64);
            Err(path.field("name").error(format!("is {name:?}"), ENDINGS))
        }
    }
}

fn noted(report: &Report) -> impl Iterator<Item = String> {
    let all = report.repairs.iter().chain(&report.oddities);
    all.map(|note| note.text.clone())
}

fn of_joints(
    path: &Path<'_>,
    joints: &v1::BodySkeleton,
    rig: &Rig,
    parts: &PartsDoc,
    notes: &mut Vec<String>,
) -> Result<BodyDoc, FieldError> {
    let body = inline_body(path, joints, rig, notes)?;
    // Joints lie inside of the foot, and nothing says how far the sole is below them.
    let given = &body.rig.skeleton;
    let skeleton = Skeleton::new(given.joints.clone(), given.left_axis, 0.0, None);
    let skeleton = skeleton.map_err(|error| path.error(error.to_string(), "one tree of joints"))?;
    let mut local = vec![Quat::IDENTITY; body.joints()];
    local_from_world_rotations(&skeleton, &body.neutral, &mut local);
    let figure = Figure::new(Arc::new(skeleton), &local, None, parts);
    of_figure(path, &figure.map_err(|error| not_found(path, &error))?)
}

fn of_figure(path: &Path<'_>, figure: &Figure) -> Result<BodyDoc, FieldError> {
    let count = figure.skeleton().joint_count();
    if count > MAX_JOINTS {
        return Err(path.error(format!("has {count} joints"), format!("1 to {MAX_JOINTS} joints")));
    }
    Ok(BodyDoc::Joints(JointsDoc::of(figure)))
}

/// The error of a correction, whose text begins with the field in `parts`.
fn correction(text: &str) -> Option<FieldError> {
    let (name, text) = text.split_once(' ')?;
    let part = name.split('.').next()?;
    let (message, allowed) = text.split_once("; allowed: ")?;
    PARTS.contains(&part).then(|| FieldError {
        field: format!("parts.{name}"),
        message: cut(message, MAX_MESSAGE),
        allowed: allowed.to_owned(),
    })
}

fn not_found(path: &Path<'_>, error: &RetargetError) -> FieldError {
    let text = error.to_string();
    if let Some(error) = correction(&text) {
        return error;
    }
    // An error that says what is allowed says it best.
    let (text, allowed) = text
        .split_once("; allowed: ")
        .unwrap_or((&text, "a body on two legs or four"));
    path.error(
        cut(text, MAX_MESSAGE),
        format!("{allowed}; `parts` corrects what is found"),
    )
}

#[cfg(test)]
mod tests {
    use troupe_character::testing::{PERSON_HIPS_M, figure_of, joints_of, person};

    use super::*;

    #[test]
    fn a_wrong_correction_names_its_field_in_parts() {
        let figure = figure_of(joints_of(&person(), 1.0), None, PERSON_HIPS_M);
        let skeleton = figure.skeleton();
        let still = vec![Quat::IDENTITY; skeleton.joint_count()];
        let limb = "girdle = []\nupper = [\"left_thigh\"]\nlower = [\"left_shin\"]\nend = \"none\"";
        for (toml, wanted) in [
            ("trunk = []", "parts.trunk: is empty; allowed: at least 1 joint"),
            (
                "neck = [\"none\"]",
                "parts.neck: names \"none\"; allowed: a joint of the skeleton",
            ),
            (
                &format!("[left_leg]\n{limb}"),
                "parts.left_leg.end: names \"none\"; allowed: a joint of the skeleton",
            ),
        ] {
            let parts: PartsDoc = toml::from_str(toml).unwrap();
            let error = Figure::new(skeleton.clone(), &still, None, &parts).unwrap_err();
            let root = Path::root();
            assert_eq!(not_found(&root.field("file"), &error).to_string(), wanted);
        }
        assert!(correction("the rest pose is no stance: it lies; allowed: upright").is_none());
    }

    #[test]
    fn every_part_is_a_field() {
        let figure = figure_of(joints_of(&person(), 1.0), None, PERSON_HIPS_M);
        let doc = PartsDoc::of(figure.parts(), figure.skeleton());
        let fields = toml::Table::try_from(doc).unwrap();
        let names = fields.keys().filter(|name| *name != "on_fours");
        let mut names: Vec<&str> = names.map(String::as_str).collect();
        names.sort_unstable();
        let mut known = PARTS;
        known.sort_unstable();
        assert_eq!(names, known);
    }
}
