//! From frames of a clip to a definition.

use troupe_motion::clip::Clip;
use troupe_proto::docs::{
    AnchorDoc, ApproachDoc, BoxDoc, KeyframeDoc, ObjectDoc, ReleaseDoc, SetDoc, ShapeDoc, TriggerDoc,
    VariantDoc,
};

use super::args::{New, Size};
use super::placement::{Placement, Pose, rounded};
use super::wish::{Limits, Wish};
use super::wrong::Wrong;

/// Sets that a definition may have.
const MAX_SETS: usize = 32;
/// Sizes without --shape, metres.
const SIZE: Size = Size([0.4, 0.9, 0.4]);
const SIZE_IN_HAND: Size = Size([0.08, 0.12, 0.08]);
/// Width and depth of a seat, metres.
const SEAT_M: f32 = 0.45;
/// Reach of a trigger beyond the farthest keyframe, metres.
const TRIGGER_SPARE_M: f32 = 0.4;

/// A definition that was made from a clip.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Draft {
    pub(super) doc: ObjectDoc,
    /// Notes for its maker.
    pub(super) notes: Vec<String>,
}

/// Makes a definition. `clip` is at the pack's rate, on its skeleton. With `into`, the definition
/// to add to, only sockets, variant and sets of the result count.
pub(super) fn draft(
    new: &New,
    clip: &Clip,
    limits: Limits,
    into: Option<&ObjectDoc>,
) -> Result<Draft, Wrong> {
    check_frames(new, clip)?;
    let wish = Wish::new(new, &clip.skeleton, limits)?;
    let poses = wish.poses(clip)?;
    let size = match (wish.seat, wish.hand) {
        (Some((_, height)), _) => Size([SEAT_M, height, SEAT_M]),
        (None, Some(_)) => SIZE_IN_HAND,
        (None, None) => SIZE,
    };
    let shape = match into {
        Some(old) => old.shape.clone(),
        None => ShapeDoc::Box(standing_box(new.shape.unwrap_or(size))),
    };
    let subject = &poses[wish.object];
    let placement = match (wish.seat, wish.hand) {
        (Some((nth, _)), _) => Placement::under(&clip.skeleton, &poses[nth]),
        (None, Some(joint)) => Placement::in_hand(&clip.skeleton, subject, joint, new.grip, middle(&shape)),
        (None, None) => Placement::before(&clip.skeleton, subject, new.distance, new.height),
    };
    let mut notes = Vec::new();
    let start = new.start.map(|frame| Pose::of(clip, frame));
    let sets: Vec<SetDoc> = (0..poses.len())
        .map(|nth| wish.set(nth, &poses, start.as_ref(), &placement, &mut notes))
        .collect();
    let name = new.name.clone().unwrap_or_default();
    let farthest = sets.iter().flat_map(|set| &set.keyframes).filter_map(from_object);
    let reach = farthest.fold(0.2, f32::max) + TRIGGER_SPARE_M;
    let doc = ObjectDoc {
        format: 1,
        name,
        description: new.description.clone(),
        solid: true,
        shared: new.shared,
        shape,
        trigger: TriggerDoc {
            reach_m: (reach * 10.0).ceil() / 10.0,
            shape: None,
        },
        anchor: AnchorDoc::default(),
        release: ReleaseDoc::default(),
        approaches: if new.pivot { Vec::new() } else { vec![front(&sets)] },
        sockets: wish.socket(subject, &placement).into_iter().collect(),
        variants: vec![VariantDoc {
            name: wish.variant.clone(),
            weight: new.weight,
            entry: sets[0].name.clone(),
            exit: wish.exit().map(|first| sets[first].name.clone()),
        }],
        sets,
    };
    let doc = match into {
        Some(old) => beside(old, doc)?,
        None => doc,
    };
    Ok(Draft { doc, notes })
}

/// Fits what was made to a definition that it is added to: names that are different, and sockets
/// that it has not.
fn beside(old: &ObjectDoc, mut made: ObjectDoc) -> Result<ObjectDoc, Wrong> {
    let variant = made.variants[0].name.clone();
    if old.variants.iter().any(|other| other.name == variant) {
        let message = format!("{variant:?} is a variant that the definition has");
        return Err(Wrong::new("--variant", message, "another name"));
    }
    let is_old = |set: &&SetDoc| old.sets.iter().any(|other| other.name == set.name);
    if let Some(set) = made.sets.iter().find(is_old) {
        let message = format!("{:?} is a set that the definition has", set.name);
        return Err(Wrong::new("--sets", message, "other names"));
    }
    let count = old.sets.len() + made.sets.len();
    if count > MAX_SETS {
        let message = format!("they make {count} sets with those of the definition");
        return Err(Wrong::new(
            "--frames",
            message,
            format!("{MAX_SETS} sets together"),
        ));
    }
    for mut socket in std::mem::take(&mut made.sockets) {
        match old.sockets.iter().find(|other| other.name == socket.name) {
            Some(same) if *same == socket => continue,
            Some(_) => socket.name = format!("{}-{variant}", socket.name),
            None => {}
        }
        let events = made.sets.iter_mut().flat_map(|set| &mut set.events);
        for attach in events.filter_map(|event| event.attach.as_mut()) {
            attach.clone_from(&socket.name);
        }
        made.sockets.push(socket);
    }
    Ok(made)
}

/// Height of a shape's middle over its origin, metres.
fn middle(shape: &ShapeDoc) -> f32 {
    match shape {
        ShapeDoc::Box(shape) => shape.center_m[1],
        ShapeDoc::Convex(shape) => {
            let heights = shape.points_m.iter().map(|point| point[1]);
            let (low, high) = heights.fold((f32::MAX, f32::MIN), |(low, high), y| (low.min(y), high.max(y)));
            (low + high) / 2.0
        }
    }
}

/// A box that stands on the origin.
fn standing_box(Size([width, height, depth]): Size) -> BoxDoc {
    BoxDoc {
        center_m: [0.0, height / 2.0, 0.0],
        half_extents_m: [width / 2.0, height / 2.0, depth / 2.0],
    }
}

/// Distance of a keyframe's root from the object, metres.
fn from_object(key: &KeyframeDoc) -> Option<f32> {
    key.place_m.map(|[x, z]| x.hypot(z))
}

/// The side from which characters come if keyframes do not turn: around the object's front.
fn front(sets: &[SetDoc]) -> ApproachDoc {
    const SIDE_DEG: f32 = 60.0;
    /// A character that has to turn round first gets so much more room, metres.
    const ROOM_M: f32 = 0.4;
    let first = &sets[0].keyframes[0];
    let turns_round = first.heading_deg.is_some_and(|heading| heading.abs() < 90.0);
    let distance = from_object(first).unwrap_or(0.0) + if turns_round { ROOM_M } else { 0.0 };
    ApproachDoc {
        name: "front".to_owned(),
        directions_deg: [-SIDE_DEG, SIDE_DEG],
        distance_m: Some(rounded(distance, 2)),
    }
}

/// Checks the frames that are asked for, their names and the weight.
pub(super) fn check_frames(new: &New, clip: &Clip) -> Result<(), Wrong> {
    let last = clip.frames() - 1;
    if let Some(start) = new.start.filter(|&start| start > last) {
        let message = format!("{start} is not in the clip");
        return Err(Wrong::new("--start", message, format!("0 to {last}")));
    }
    if let Some(frame) = new.frames.iter().find(|&&frame| frame > last) {
        let message = format!("{frame} is not in the clip");
        return Err(Wrong::new("--frames", message, format!("0 to {last}")));
    }
    let count = new.frames.len();
    if count > MAX_SETS {
        let message = format!("{count} frames");
        return Err(Wrong::new(
            "--frames",
            message,
            format!("1 to {MAX_SETS} of them"),
        ));
    }
    if !new.sets.is_empty() && new.sets.len() != count {
        let message = format!("{} names for {count} frames", new.sets.len());
        return Err(Wrong::new("--sets", message, "as many as --frames, or none"));
    }
    if let Some(twice) =
        (new.sets.iter().enumerate()).find_map(|(nth, name)| new.sets[..nth].contains(name).then_some(name))
    {
        let message = format!("{twice:?} is given twice");
        return Err(Wrong::new("--sets", message, "names that are all different"));
    }
    if !(0.0..=1000.0).contains(&new.weight) {
        return Err(Wrong::new("--weight", new.weight.to_string(), "0 to 1000"));
    }
    Ok(())
}
