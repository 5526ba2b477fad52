//! Checks sets, their keyframes, and the chains of sets that variants go through.

use std::ops::RangeInclusive;

use troupe_motion::Quat;
use troupe_motion::root::heading_of;

use super::check::joint;
use super::{
    Action, Event, EventDoc, Hold, Keyframe, KeyframeDoc, MAX_DISTANCE_M, MAX_DROP_FRAMES, MAX_EVENTS,
    MAX_HOLD_FRAMES, MAX_KEYFRAMES, MAX_POINTS, MAX_SETS, MAX_VARIANTS, MAX_WEIGHT, ObjectDoc, Origin, Point,
    Set, SetDoc, Socket, Variant,
};
use crate::document::check::{count, entries, named, number, rotation, vector};
use crate::limits::HEADING_TOLERANCE;
use crate::{FieldError, Path};
use troupe_motion::model::Rig;

/// Fewest of the left direction's length that must lie in the ground plane for a pose to have a
/// heading.
const MIN_GROUND_LEFT: f32 = 0.1;

/// Numbers of frames that a set may have: those of a plan after its context.
pub(super) fn set_frames(rig: &Rig) -> RangeInclusive<u32> {
    let context = rig.dims.context_frames;
    let frames = |all: usize| all.saturating_sub(context) as u32;
    frames(rig.dims.min_frames())..=frames(rig.dims.max_frames())
}

/// Checks all sets of a definition.
pub(super) fn check_sets(
    path: &Path<'_>,
    doc: &ObjectDoc,
    sockets: &[Socket],
    rig: &Rig,
) -> Result<Vec<Set>, FieldError> {
    named(path, "sets", &doc.sets, 1, MAX_SETS, |set| &set.name)?
        .map(|(path, set)| check_set(&path, set, (sockets, doc.shared), rig))
        .collect()
}

fn check_set(
    path: &Path<'_>,
    doc: &SetDoc,
    (sockets, shared): (&[Socket], bool),
    rig: &Rig,
) -> Result<Set, FieldError> {
    let most = MAX_KEYFRAMES.min(rig.dims.max_targets);
    entries(&path.field("keyframes"), doc.keyframes.len(), 1, most)?;
    entries(&path.field("events"), doc.events.len(), 0, MAX_EVENTS)?;
    if let Some(frames) = doc.frames {
        let (least, most) = set_frames(rig).into_inner();
        // Fewer frames than the pack makes are the matter of `Definition::too_short`.
        if frames == 0 || frames > most {
            count(&path.field("frames"), frames, least, most)?;
        }
    }
    let most_dropped = doc
        .frames
        .map_or(MAX_DROP_FRAMES, |frames| frames.min(MAX_DROP_FRAMES));
    count(&path.field("drop_frames"), doc.drop_frames, 0, most_dropped)?;
    count(&path.field("hold_frames"), doc.hold_frames, 0, MAX_HOLD_FRAMES)?;
    let hold = match (doc.hold_until_ended, doc.hold_frames) {
        (false, frames) => Hold::Frames(frames),
        (true, 0) => Hold::UntilEnded,
        (true, frames) => {
            return Err(path.field("hold_frames").error(
                format!("is {frames} for a set that is held until ended"),
                "0, or hold_until_ended = false",
            ));
        }
    };
    let events = (doc.events.iter().enumerate())
        .map(|(index, event)| check_event(&path.element("events", index), event, sockets, shared))
        .collect::<Result<_, _>>()?;
    let keyframes = (doc.keyframes.iter().enumerate())
        .map(|(index, key)| check_keyframe(&path.element("keyframes", index), key, doc.origin, rig))
        .collect::<Result<_, _>>()?;
    Ok(Set {
        name: doc.name.clone(),
        low_hips_m: rig.low_hips_m,
        origin: doc.origin,
        keyframes,
        motion: doc.motion,
        from_stand: doc.from_stand,
        frames: doc.frames,
        drop_frames: doc.drop_frames,
        hold,
        events,
    })
}

fn check_event(
    path: &Path<'_>,
    doc: &EventDoc,
    sockets: &[Socket],
    shared: bool,
) -> Result<Event, FieldError> {
    let action = match (&doc.attach, doc.release) {
        (Some(name), false) if shared => {
            return Err(path.field("attach").error(
                format!("is {name:?} for a shared object, which cannot be taken"),
                "no attach, or shared = false",
            ));
        }
        (Some(name), false) => {
            let index = sockets.iter().position(|socket| socket.name == *name);
            Action::Attach(index.ok_or_else(|| {
                let names: Vec<_> = sockets.iter().map(|socket| socket.name.as_str()).collect();
                let allowed = match names.is_empty() {
                    true => "the name of a socket, of which there are none".to_owned(),
                    false => names.join(", "),
                };
                path.field("attach")
                    .error(format!("is {name:?}, which is no socket"), allowed)
            })?)
        }
        (None, true) => Action::Release,
        (Some(_), true) => return Err(path.error("has both attach and release", "exactly one of them")),
        (None, false) => return Err(path.error("does nothing", "exactly one of attach and release")),
    };
    Ok(Event { at: doc.at, action })
}

fn check_keyframe(
    path: &Path<'_>,
    doc: &KeyframeDoc,
    origin: Origin,
    rig: &Rig,
) -> Result<Keyframe, FieldError> {
    let limit = MAX_DISTANCE_M;
    for (axis, &component) in doc.place_m.iter().flatten().enumerate() {
        number(&path.element("place_m", axis), component, -limit, limit)?;
    }
    if let Some(heading) = doc.heading_deg {
        number(&path.field("heading_deg"), heading, -360.0, 360.0)?;
    }
    if let Some(height) = doc.height_m {
        number(&path.field("height_m"), height, -limit, limit)?;
    }
    if doc.pivot && origin == Origin::Character {
        return Err(path.field("pivot").error(
            "is true in a set whose origin is the character",
            "false, or origin = \"object\"",
        ));
    }
    let rotations = match &doc.rotations {
        Some(numbers) => Some(check_rotations(path, numbers, rig)?),
        None => None,
    };
    for (field, given) in [
        ("heading_deg", doc.heading_deg.is_some()),
        ("height_m", doc.height_m.is_some()),
    ] {
        if rotations.is_some() && !given {
            return Err(path
                .field(field)
                .error("is missing", "a number, with a pose (rotations)"));
        }
    }
    let points = check_points(path, doc, rig)?;
    let gives_nothing = doc.place_m.is_none() && doc.heading_deg.is_none() && doc.height_m.is_none();
    if gives_nothing && points.is_empty() {
        return Err(path.error(
            "is empty",
            "at least one of place_m, heading_deg, height_m, rotations and points",
        ));
    }
    Ok(Keyframe {
        pivot: doc.pivot,
        place_m: doc.place_m,
        heading: doc.heading_deg.map(f32::to_radians),
        height_m: doc.height_m,
        pose_scale: None,
        from_ground: doc.from_ground,
        rotations,
        points,
    })
}

fn check_points(path: &Path<'_>, doc: &KeyframeDoc, rig: &Rig) -> Result<Vec<Point>, FieldError> {
    entries(&path.field("points"), doc.points.len(), 0, MAX_POINTS)?;
    let mut points: Vec<Point> = Vec::with_capacity(doc.points.len());
    for (index, point) in doc.points.iter().enumerate() {
        let path = path.element("points", index);
        let joint = joint(&path.field("joint"), &point.joint, &rig.skeleton)?;
        if points.iter().any(|before| before.joint == joint) {
            return Err(path.field("joint").error(
                format!("is {:?}, which another point of the keyframe has", point.joint),
                "each joint once",
            ));
        }
        points.push(Point {
            joint,
            position_m: vector(&path, "position_m", point.position_m, MAX_DISTANCE_M)?,
        });
    }
    Ok(points)
}

fn check_rotations(path: &Path<'_>, numbers: &[f32], rig: &Rig) -> Result<Vec<Quat>, FieldError> {
    let joints = &rig.skeleton.joints;
    let expected = joints.len() * 4;
    if numbers.len() != expected {
        return Err(path.field("rotations").error(
            format!("has {} numbers", numbers.len()),
            format!(
                "exactly {expected}: 4 (w, x, y, z) for each of the pack's {} joints",
                joints.len()
            ),
        ));
    }
    let rotations = (numbers.as_chunks::<4>().0.iter().zip(joints).enumerate())
        .map(|(index, (&wxyz, joint))| {
            let path = path.element("rotations", index * 4);
            rotation(&path, wxyz, &format!("the rotation of joint {}", joint.name))
        })
        .collect::<Result<Vec<_>, _>>()?;
    check_pelvis(&path.element("rotations", 0), &rotations, rig)?;
    Ok(rotations)
}

/// Refuses a pose with a heading of its own: headings belong into `heading_deg`. A pose lying on
/// its side has none.
fn check_pelvis(path: &Path<'_>, rotations: &[Quat], rig: &Rig) -> Result<(), FieldError> {
    let axis = rig.skeleton.left_axis;
    let Some(&pelvis) = rotations.first() else {
        return Ok(());
    };
    let left = pelvis * axis;
    let heading = heading_of(pelvis, axis);
    if left.x.hypot(left.z) < MIN_GROUND_LEFT || heading.abs() <= HEADING_TOLERANCE {
        return Ok(());
    }
    Err(path.error(
        format!("the pose has a heading of {:.1} degrees", heading.to_degrees()),
        format!(
            "a pose with the heading taken out, within {:.1} degrees; headings are in heading_deg",
            HEADING_TOLERANCE.to_degrees()
        ),
    ))
}

/// Checks the variants, and works out which sets each goes through.
pub(super) fn check_variants(path: &Path<'_>, doc: &ObjectDoc) -> Result<Vec<Variant>, FieldError> {
    let next = (doc.sets.iter().enumerate())
        .map(|(index, set)| match &set.next {
            Some(name) => find_set(&path.element("sets", index).field("next"), name, doc).map(Some),
            None => Ok(None),
        })
        .collect::<Result<Vec<_>, _>>()?;
    for start in 0..doc.sets.len() {
        check_cycle(path, start, &next, doc)?;
    }
    let variants = named(path, "variants", &doc.variants, 1, MAX_VARIANTS, |variant| {
        &variant.name
    })?
    .map(|(path, variant)| {
        number(&path.field("weight"), variant.weight, 0.0, MAX_WEIGHT)?;
        let entry = find_set(&path.field("entry"), &variant.entry, doc)?;
        let exit = match &variant.exit {
            Some(name) => Some(find_set(&path.field("exit"), name, doc)?),
            None => None,
        };
        Ok(Variant {
            name: variant.name.clone(),
            weight: variant.weight,
            entry: chain(Some(entry), &next),
            exit: chain(exit, &next),
        })
    })
    .collect::<Result<Vec<_>, FieldError>>()?;
    if variants.iter().all(|variant| variant.weight == 0.0) {
        let path = path.element("variants", 0);
        return Err(path.field("weight").error(
            "is 0, as that of every variant",
            "a weight above 0 for at least one variant",
        ));
    }
    for (index, set) in doc.sets.iter().enumerate() {
        let is_used = |variant: &Variant| variant.entry.contains(&index) || variant.exit.contains(&index);
        if !variants.iter().any(is_used) {
            let path = path.element("sets", index);
            return Err(path.field("name").error(
                format!("is {:?}, a set that no variant reaches", set.name),
                "sets that follow the entry or exit of a variant",
            ));
        }
    }
    Ok(variants)
}

fn find_set(path: &Path<'_>, name: &str, doc: &ObjectDoc) -> Result<usize, FieldError> {
    let index = doc.sets.iter().position(|set| set.name == name);
    index.ok_or_else(|| {
        let names: Vec<_> = doc.sets.iter().map(|set| set.name.as_str()).collect();
        path.error(format!("is {name:?}, which is no set"), names.join(", "))
    })
}

/// Refuses a chain of sets that comes back to its start.
fn check_cycle(
    path: &Path<'_>,
    start: usize,
    next: &[Option<usize>],
    doc: &ObjectDoc,
) -> Result<(), FieldError> {
    let mut way = vec![start];
    let mut at = start;
    while let Some(following) = next[at] {
        if following == start {
            let name = |&index: &usize| doc.sets[index].name.as_str();
            let names: Vec<_> = way.iter().chain([&start]).map(name).collect();
            return Err(path.element("sets", at).field("next").error(
                format!("goes round: {}", names.join(" -> ")),
                "a set that does not lead back",
            ));
        }
        // A circle further along the chain is found from its own sets.
        if way.contains(&following) {
            return Ok(());
        }
        way.push(following);
        at = following;
    }
    Ok(())
}

/// The sets from `first` on. Chains have been checked to end.
fn chain(first: Option<usize>, next: &[Option<usize>]) -> Vec<usize> {
    std::iter::successors(first, |&index| next[index])
        .take(next.len())
        .collect()
}
