//! Checks a written definition and turns it into a [`Definition`].

use std::f32::consts::TAU;
use std::sync::Arc;

use troupe_motion::Skeleton;

use super::check_sets::{check_sets, check_variants, set_frames};
use super::{
    Align, Approach, ApproachDoc, Definition, FORMAT, MAX_APPROACHES, MAX_BLEND_FRAMES,
    MAX_DESCRIPTION_CHARS, MAX_DISTANCE_M, MAX_REACH_M, MAX_SLOPE_DEG, MAX_SOCKETS, ObjectDoc, Release,
    ReleaseDoc, Socket, SocketDoc, TooShort,
};
use crate::document::check::{count, format, listed, name, named, number, rotation, vector};
use crate::scene::{ObjectBody, Shape, Volume, shape_error};
use crate::{FieldError, Path};
use troupe_motion::model::Rig;

impl Definition {
    /// Checks a definition for the pack of `rig`.
    ///
    /// # Errors
    /// [`FieldError`] for the first value that is not accepted.
    pub fn from_doc(doc: ObjectDoc, rig: &Rig) -> Result<Self, FieldError> {
        let made = Self::from_kept(doc, rig)?;
        let short = made.doc.sets.iter().enumerate();
        for (index, frames) in short.filter_map(|(index, set)| Some((index, set.frames?))) {
            let allowed = set_frames(rig);
            let set = Path::root();
            let set = set.element("sets", index);
            count(&set.field("frames"), frames, *allowed.start(), *allowed.end())?;
        }
        Ok(made)
    }

    /// As [`Definition::from_doc`], for a document that is read at the start of a server. Its sets
    /// may be too short for the pack: [`Definition::too_short`] says so.
    ///
    /// # Errors
    /// [`FieldError`] for the first other value that is not accepted.
    pub fn from_kept(doc: ObjectDoc, rig: &Rig) -> Result<Self, FieldError> {
        let path = Path::root();
        format(&path, doc.format, FORMAT)?;
        name(&path.field("name"), &doc.name)?;
        let length = doc.description.chars().count();
        if length > MAX_DESCRIPTION_CHARS {
            return Err(path.field("description").error(
                format!("has {length} characters"),
                format!("at most {MAX_DESCRIPTION_CHARS}"),
            ));
        }
        let shape = Shape::from(&doc.shape);
        let body = check_body(&path, &doc, &shape)?;
        let anchor = path.field("anchor");
        let pivot_m = vector(&anchor, "pivot_m", doc.anchor.pivot_m, MAX_DISTANCE_M)?;
        let release = check_release(&path.field("release"), &doc.release)?;
        let approaches = named(&path, "approaches", &doc.approaches, 0, MAX_APPROACHES, |a| {
            &a.name
        })?
        .map(|(path, approach)| check_approach(&path, approach))
        .collect::<Result<_, _>>()?;
        let sockets: Vec<Socket> = named(&path, "sockets", &doc.sockets, 0, MAX_SOCKETS, |s| &s.name)?
            .map(|(path, socket)| check_socket(&path, socket, &rig.skeleton))
            .collect::<Result<_, _>>()?;
        let sets = check_sets(&path, &doc, &sockets, rig)?;
        let variants = check_variants(&path, &doc)?;
        Ok(Self {
            name: doc.name.clone(),
            pack: rig.name().to_owned(),
            description: doc.description.clone(),
            shape,
            middle_m: body.volume.center(),
            body: Arc::new(body),
            pivot_m,
            approaches,
            sockets,
            release,
            sets,
            variants,
            is_skill: false,
            too_short: too_short(&doc, rig),
            doc: Arc::new(doc),
        })
    }
}

/// The first set that has fewer frames than the pack's networks make at once.
fn too_short(doc: &ObjectDoc, rig: &Rig) -> Option<TooShort> {
    let least = *set_frames(rig).start();
    let short = |set: &super::SetDoc| {
        let frames = set.frames.filter(|frames| *frames < least)?;
        Some(TooShort {
            set: set.name.clone(),
            frames,
            least,
            pack: rig.name().to_owned(),
        })
    };
    doc.sets.iter().find_map(short)
}

fn check_body(path: &Path<'_>, doc: &ObjectDoc, shape: &Shape) -> Result<ObjectBody, FieldError> {
    let trigger = path.field("trigger");
    number(&trigger.field("reach_m"), doc.trigger.reach_m, 0.0, MAX_REACH_M)?;
    let volume =
        Volume::new(shape).map_err(|error| shape_error(&path.field("shape"), doc.shape.kind(), error))?;
    let trigger = match &doc.trigger.shape {
        Some(own) => Volume::grown(&Shape::from(own), doc.trigger.reach_m)
            .map_err(|error| shape_error(&trigger.field("shape"), own.kind(), error))?,
        None => Volume::grown(shape, doc.trigger.reach_m)
            .map_err(|error| shape_error(&path.field("shape"), doc.shape.kind(), error))?,
    };
    Ok(ObjectBody {
        volume,
        trigger,
        solid: doc.solid,
        shared: doc.shared,
    })
}

fn check_release(path: &Path<'_>, doc: &ReleaseDoc) -> Result<Release, FieldError> {
    number(&path.field("lift_m"), doc.lift_m, 0.0, MAX_REACH_M)?;
    number(&path.field("max_drop_m"), doc.max_drop_m, 0.0, MAX_DISTANCE_M)?;
    number(
        &path.field("max_slope_deg"),
        doc.max_slope_deg,
        0.0,
        MAX_SLOPE_DEG,
    )?;
    if !doc.snap && doc.align == Align::Surface {
        return Err(path.field("align").error(
            "is surface, but without snap there is no surface",
            "upright or keep, or snap = true",
        ));
    }
    Ok(Release {
        snap: doc.snap,
        lift_m: doc.lift_m,
        max_drop_m: doc.max_drop_m,
        max_slope: doc.max_slope_deg.to_radians(),
        align: doc.align,
    })
}

fn check_approach(path: &Path<'_>, doc: &ApproachDoc) -> Result<Approach, FieldError> {
    for (index, &degrees) in doc.directions_deg.iter().enumerate() {
        number(&path.element("directions_deg", index), degrees, -360.0, 360.0)?;
    }
    let [from, to] = doc.directions_deg;
    if !(0.0..=360.0).contains(&(to - from)) {
        return Err(path.field("directions_deg").error(
            format!("goes from {from} to {to}"),
            "first direction, then one that is 0 to 360 degrees on",
        ));
    }
    if let Some(distance) = doc.distance_m {
        number(&path.field("distance_m"), distance, 0.0, MAX_DISTANCE_M)?;
    }
    Ok(Approach {
        name: doc.name.clone(),
        from: from.to_radians(),
        span: (to - from).to_radians().min(TAU),
        distance_m: doc.distance_m,
    })
}

fn check_socket(path: &Path<'_>, doc: &SocketDoc, skeleton: &Skeleton) -> Result<Socket, FieldError> {
    count(&path.field("blend_frames"), doc.blend_frames, 0, MAX_BLEND_FRAMES)?;
    let turn = |given| rotation(&path.field("rotation"), given, "the rotation");
    Ok(Socket {
        name: doc.name.clone(),
        joint: joint(&path.field("joint"), &doc.joint, skeleton)?,
        position_m: vector(path, "position_m", doc.position_m, MAX_DISTANCE_M)?,
        rotation: doc.rotation.map(turn).transpose()?,
        blend_frames: doc.blend_frames,
        swings: doc.swings,
        upright: doc.upright,
    })
}

/// The index of the joint of this name.
pub(super) fn joint(path: &Path<'_>, name: &str, skeleton: &Skeleton) -> Result<usize, FieldError> {
    skeleton.joint_index(name).ok_or_else(|| {
        let names = skeleton.joints.iter().map(|joint| joint.name.as_str());
        path.error(
            format!("is {name:?}, which is no joint of the pack"),
            listed(names),
        )
    })
}
