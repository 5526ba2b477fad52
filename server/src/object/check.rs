//! From what is written to a checked [`Definition`].

use std::f32::consts::TAU;
use std::sync::Arc;

use troupe_motion::rotation::from_wxyz;
use troupe_motion::{Quat, Skeleton, Vec3};

use super::check_sets::{check_sets, check_variants};
use super::{
    Align, Approach, ApproachDoc, Definition, FORMAT, MAX_APPROACHES, MAX_BLEND_FRAMES,
    MAX_DESCRIPTION_CHARS, MAX_DISTANCE_M, MAX_NAME_CHARS, MAX_REACH_M, MAX_SLOPE_DEG, MAX_SOCKETS,
    ObjectDoc, Release, ReleaseDoc, ShapeDoc, Socket, SocketDoc,
};
use crate::inbetween::{FieldError, Path, UNIT_TOLERANCE};
use crate::pack::Pack;
use crate::scene::{Body, Shape, ShapeError, Volume};

/// Most joint names that an error lists.
const MAX_LISTED: usize = 40;

impl Definition {
    /// Checks what is written for `pack`.
    ///
    /// # Errors
    /// [`FieldError`] for the first value that is not accepted.
    pub fn from_doc(doc: ObjectDoc, pack: &Pack) -> Result<Self, FieldError> {
        let path = Path::root();
        if doc.format != FORMAT {
            return Err(path
                .field("format")
                .error(format!("is {}", doc.format), format!("{FORMAT}")));
        }
        name(&path.field("name"), &doc.name)?;
        let length = doc.description.chars().count();
        if length > MAX_DESCRIPTION_CHARS {
            return Err(path.field("description").error(
                format!("has {length} characters"),
                format!("at most {MAX_DESCRIPTION_CHARS}"),
            ));
        }
        let shape = doc.shape.to_shape();
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
            .map(|(path, socket)| check_socket(&path, socket, &pack.skeleton))
            .collect::<Result<_, _>>()?;
        let sets = check_sets(&path, &doc, &sockets, pack)?;
        let variants = check_variants(&path, &doc)?;
        Ok(Self {
            name: doc.name.clone(),
            description: doc.description.clone(),
            shape,
            body: Arc::new(body),
            pivot_m,
            approaches,
            sockets,
            release,
            sets,
            variants,
            doc: Arc::new(doc),
        })
    }
}

impl ShapeDoc {
    /// The shape, unchecked.
    pub fn to_shape(&self) -> Shape {
        match self {
            Self::Box {
                center_m,
                half_extents_m,
            } => Shape::Box {
                center_m: Vec3::from(*center_m),
                half_extents_m: Vec3::from(*half_extents_m),
            },
            Self::Convex { points_m } => Shape::Convex {
                points_m: points_m.iter().copied().map(Vec3::from).collect(),
            },
        }
    }

    fn kind(&self) -> &'static str {
        match self {
            Self::Box { .. } => "box",
            Self::Convex { .. } => "convex",
        }
    }
}

fn check_body(path: &Path<'_>, doc: &ObjectDoc, shape: &Shape) -> Result<Body, FieldError> {
    let trigger = path.field("trigger");
    number(&trigger.field("reach_m"), doc.trigger.reach_m, 0.0, MAX_REACH_M)?;
    let volume = Volume::new(shape).map_err(|error| shape_error(&path.field("shape"), &doc.shape, error))?;
    let trigger = match &doc.trigger.shape {
        Some(own) => Volume::grown(&own.to_shape(), doc.trigger.reach_m)
            .map_err(|error| shape_error(&trigger.field("shape"), own, error))?,
        None => Volume::grown(shape, doc.trigger.reach_m)
            .map_err(|error| shape_error(&path.field("shape"), &doc.shape, error))?,
    };
    Ok(Body {
        volume,
        trigger,
        solid: doc.solid,
        shared: doc.shared,
    })
}

fn shape_error(path: &Path<'_>, doc: &ShapeDoc, error: ShapeError) -> FieldError {
    let path = path.field(doc.kind());
    match error {
        ShapeError::Value {
            field,
            found,
            allowed,
        } => FieldError {
            field: format!("{path}.{field}"),
            message: format!("is {found}"),
            allowed,
        },
        flat_or_hull => path.field("points_m").error(
            flat_or_hull.to_string(),
            "points apart from each other that span a volume",
        ),
    }
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
    Ok(Socket {
        name: doc.name.clone(),
        joint: joint(&path.field("joint"), &doc.joint, skeleton)?,
        position_m: vector(path, "position_m", doc.position_m, MAX_DISTANCE_M)?,
        rotation: rotation(&path.field("rotation"), doc.rotation, "the rotation")?,
        blend_frames: doc.blend_frames,
    })
}

/// Checks a name.
pub(super) fn name(path: &Path<'_>, name: &str) -> Result<(), FieldError> {
    let allowed = || format!("1 to {MAX_NAME_CHARS} letters, digits, '-', '_' or '.'");
    let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    match (name.chars().count(), name.chars().find(|&c| !fits(c))) {
        (0, _) => Err(path.error("is empty", allowed())),
        (found, _) if found > MAX_NAME_CHARS => Err(path.error(format!("has {found} characters"), allowed())),
        (_, Some(c)) => Err(path.error(format!("has the character {c:?}"), allowed())),
        _ => Ok(()),
    }
}

/// Checks how many there are, and each one's name, which no two share. Gives each with its place.
pub(super) fn named<'a, T>(
    path: &'a Path<'a>,
    field: &'static str,
    list: &'a [T],
    low: usize,
    high: usize,
    name_of: impl Fn(&T) -> &str,
) -> Result<impl Iterator<Item = (Path<'a>, &'a T)>, FieldError> {
    entries(&path.field(field), list.len(), low, high)?;
    let mut names = std::collections::HashSet::with_capacity(list.len());
    for (index, one) in list.iter().enumerate() {
        let path = path.element(field, index);
        let path = path.field("name");
        name(&path, name_of(one))?;
        if !names.insert(name_of(one)) {
            return Err(path.error(
                format!("is {:?}, which another of the {field} has", name_of(one)),
                "a name of its own for each",
            ));
        }
    }
    let places = move |(index, one)| (path.element(field, index), one);
    Ok(list.iter().enumerate().map(places))
}

/// Checks how many entries a list has.
pub(super) fn entries(path: &Path<'_>, found: usize, low: usize, high: usize) -> Result<(), FieldError> {
    if (low..=high).contains(&found) {
        return Ok(());
    }
    Err(path.error(format!("has {found} entries"), format!("{low} to {high}")))
}

/// Checks a number against its range; NaN is outside of any.
pub(super) fn number(path: &Path<'_>, value: f32, low: f32, high: f32) -> Result<(), FieldError> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(path.error(format!("is {value}"), format!("{low} to {high}")))
}

/// Checks a whole number against its range.
pub(super) fn count(path: &Path<'_>, value: u32, low: u32, high: u32) -> Result<(), FieldError> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(path.error(format!("is {value}"), format!("{low} to {high}")))
}

/// Checks each component of a vector.
pub(super) fn vector(
    path: &Path<'_>,
    field: &'static str,
    value: [f32; 3],
    limit: f32,
) -> Result<Vec3, FieldError> {
    for (axis, &component) in value.iter().enumerate() {
        number(&path.element(field, axis), component, -limit, limit)?;
    }
    Ok(Vec3::from(value))
}

/// Checks a rotation's length and makes it exactly 1. `what` begins the message.
pub(super) fn rotation(path: &Path<'_>, wxyz: [f32; 4], what: &str) -> Result<Quat, FieldError> {
    let rotation = from_wxyz(wxyz);
    let length = rotation.length();
    let (low, high) = (1.0 - UNIT_TOLERANCE, 1.0 + UNIT_TOLERANCE);
    // NaN and infinity are outside too.
    if (low..=high).contains(&length) {
        return Ok(rotation / length);
    }
    Err(path.error(
        format!("{what} has length {length}"),
        format!("unit length, {low} to {high}"),
    ))
}

/// The index of a joint by its name.
pub(super) fn joint(path: &Path<'_>, name: &str, skeleton: &Skeleton) -> Result<usize, FieldError> {
    skeleton.joint_index(name).ok_or_else(|| {
        let names: Vec<_> = skeleton.joints.iter().map(|joint| joint.name.as_str()).collect();
        let mut allowed = names[..names.len().min(MAX_LISTED)].join(", ");
        if names.len() > MAX_LISTED {
            allowed += &format!(" and {} more", names.len() - MAX_LISTED);
        }
        path.error(format!("is {name:?}, which is no joint of the pack"), allowed)
    })
}
