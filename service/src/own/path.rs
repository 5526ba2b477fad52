//! Motions along paths and of words, on a user's skeleton.

use std::sync::Arc;

use troupe_character::{FieldError, Path, Size};
use troupe_live::skeleton::Worn;
use troupe_live::wire::keyframe::Role;
use troupe_motion::model::Rig;
use troupe_motion::{GlobalRoot, Vec3};
use troupe_proto::v1;
use troupe_proto::v1::generate_request::Goal;

use crate::inbetween::target_role;

use super::body::OfBody;
use super::frames::{Carrier, Columns, scaled};
use super::keys::{Keys, key, keys};
use super::pins::Pins;

/// Brings the parts of an answer to the user's skeleton.
#[derive(Debug)]
pub(crate) struct OwnAnswer {
    worn: Arc<Worn>,
    /// One for each character, as they come.
    characters: Vec<OwnCharacter>,
    /// Set for an answer on the body of a pack.
    body: Option<OfBody>,
    /// Frames at the end of the first character's motion, and whether they are its last frames.
    /// Otherwise they come after it.
    targets: (Keys, bool),
    /// Frames a second.
    fps: f32,
}

#[derive(Debug)]
struct OwnCharacter {
    carrier: Carrier,
    pins: Pins,
}

impl OwnCharacter {
    /// A character that begins after `past`.
    fn after(past: &Keys, worn: &Arc<Worn>, columns: Columns) -> Self {
        let mut carrier = Carrier::new(worn, columns);
        let mut pins = Pins::default();
        let carried = past.carried.iter().flatten();
        let count = carried.clone().count();
        for (nth, (root, rotations)) in carried.enumerate() {
            let made = carrier.before(*root, rotations);
            if let (true, Some(given)) = (nth + 1 == count, past.given.last()) {
                pins.add(worn, -1, given, made);
            }
        }
        Self { carrier, pins }
    }
}

/// Replaces a request by that of the pack, whose motion has `fps` frames a second. `body` is the
/// rig of the skeleton if that is the body of another pack.
///
/// # Errors
/// [`FieldError`] for the first value that is not accepted.
pub(crate) fn take_generate(
    request: &mut v1::GenerateRequest,
    worn: &Arc<Worn>,
    (fps, body): (f32, Option<&Rig>),
) -> Result<OwnAnswer, FieldError> {
    let root = Path::root();
    let past = keys(&root, "past", &mut request.past, Role::Context, worn)?;
    let columns = Columns {
        // Answers on a robot of a pack have it without being asked.
        qpos: body.is_some(),
        ..Columns::default()
    };
    let mut first = OwnCharacter::after(&past, worn, columns);
    let mut characters = Vec::new();
    let mut targets = (Keys::default(), true);
    match &mut request.goal {
        Some(Goal::Prompt(prompt)) => {
            let path = root.field("prompt");
            let role = target_role(prompt);
            targets = (keys(&path, "targets", &mut prompt.targets, role, worn)?, false);
            for (index, other) in prompt.others.iter_mut().enumerate() {
                let path = path.element("others", index);
                let past = keys(&path, "past", &mut other.past, Role::Context, worn)?;
                characters.push(OwnCharacter::after(&past, worn, columns));
            }
        }
        Some(Goal::Path(goal)) => {
            let path = root.field("path");
            if goal.skeleton.is_some() {
                return Err(path.field("skeleton").error(
                    "cannot be combined with the request's skeleton",
                    "only one of the two",
                ));
            }
            targets.0 = keys(&path, "targets", &mut goal.targets, Role::Context, worn)?;
            take_points(goal, worn);
            // Times count from the last frame of the past, which the answer does not have.
            let shift = i64::from(!past.given.is_empty());
            for (index, passed) in goal.keyframes.iter_mut().enumerate() {
                let path = path.element("keyframes", index);
                let frame = (passed.time * fps).round() as i64 - shift;
                if let Some(keyframe) = &mut passed.keyframe {
                    let keys = key(&path.field("keyframe"), keyframe, worn)?;
                    pin(&mut first.pins, frame, &keys, worn);
                }
            }
        }
        None => {}
    }
    characters.insert(0, first);
    Ok(OwnAnswer {
        body: body.map(|rig| OfBody::new(worn, rig)),
        worn: worn.clone(),
        characters,
        targets,
        fps,
    })
}

/// Brings the points and the speed of a path to the pack's size.
fn take_points(goal: &mut v1::PathGoal, worn: &Worn) {
    for point in &mut goal.points {
        let heading = point.heading;
        point.position = point.position.map(|v1::Vec3 { x, y, z }| {
            let place = Vec3::new(x, y, z);
            let there = match heading {
                Some(heading) => worn.root_in(GlobalRoot::new(place, heading)).position,
                None => worn.place_in(place),
            };
            v1::Vec3 {
                x: there.x,
                y,
                z: there.z,
            }
        });
    }
    goal.speed = goal.speed.map(|speed| speed / worn.scale());
}

/// Pins a keyframe that the pack meets at `frame`.
fn pin(pins: &mut Pins, frame: i64, keys: &Keys, worn: &Arc<Worn>) {
    let mut carrier = Carrier::new(worn, Columns::default());
    for (given, carried) in keys.given.iter().zip(&keys.carried) {
        if let Some((root, rotations)) = carried {
            pins.add(worn, frame, given, carrier.before(*root, rotations));
        }
    }
}

impl OwnAnswer {
    /// The size of the user's body, for errors.
    pub(crate) fn size(&self) -> Size {
        self.worn.size()
    }

    /// Replaces a part of the answer.
    pub(crate) fn part(&mut self, part: &mut v1::GenerateResponse) {
        if let Some(found) = &mut part.feasibility {
            scaled(found, self.worn.scale());
            if let Some(body) = &self.body {
                body.name_joints(found);
            }
        }
        let index = part.character as usize;
        while self.characters.len() <= index {
            self.characters.push(OwnCharacter::after(
                &Keys::default(),
                &self.worn,
                Columns::default(),
            ));
        }
        let Some(v1::generate_response::Part::Frames(frames)) = &mut part.part else {
            return;
        };
        let OwnCharacter { carrier, pins } = &mut self.characters[index];
        let carried = carrier.carry(frames);
        if part.is_last && index == 0 {
            let (keys, are_last) = &self.targets;
            let end = carrier.done() + carried.roots.len() as i64;
            let first = end - if *are_last { keys.given.len() as i64 } else { 0 };
            if !keys.given.is_empty() && carrier.done() > 0 {
                // Frames of earlier parts are sent.
                pins.none_at(carrier.done() - 1);
            }
            for (nth, (given, key)) in keys.given.iter().zip(&keys.carried).enumerate() {
                let frame = first + nth as i64;
                let made = usize::try_from(frame - carrier.done()).ok();
                match (made.and_then(|at| carried.at(at)), key) {
                    (Some(made), _) => pins.add(&self.worn, frame, given, made),
                    (None, Some((root, rotations))) => {
                        pins.add(&self.worn, frame, given, carrier.before(*root, rotations))
                    }
                    (None, None) => {}
                }
            }
        }
        carrier.write(carried, pins, frames, self.fps);
        if let Some(body) = &self.body {
            body.touch(frames);
        }
    }
}
