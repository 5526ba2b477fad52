//! In-betweens on a user's skeleton.

use std::sync::Arc;

use troupe_character::{FieldError, Path};
use troupe_live::skeleton::Worn;
use troupe_live::wire::keyframe::Role;
use troupe_motion::{GlobalRoot, Vec3};
use troupe_proto::v1;

use super::frames::{Carrier, Columns, scaled};
use super::keys::{Keys, keys};
use super::pins::{Given, Pins};

/// What the answer to a character needs of its request.
#[derive(Debug)]
pub(crate) struct OwnSegment {
    columns: Columns,
    context: Vec<Given>,
    targets: Vec<Given>,
    /// Positions that the user gave by frames, on its skeleton.
    places: Vec<(usize, [Option<f32>; 3])>,
}

/// Replaces the characters of a request by those of the pack.
///
/// # Errors
/// [`FieldError`] for the first value that is not accepted.
pub(crate) fn take_in_between(
    request: &mut v1::InBetweenRequest,
    worn: &Worn,
) -> Result<Vec<OwnSegment>, FieldError> {
    let root = Path::root();
    let characters = request.characters.iter_mut().enumerate();
    characters
        .map(|(index, character)| take(&root.element("characters", index), character, worn))
        .collect()
}

fn take(path: &Path<'_>, character: &mut v1::Character, worn: &Worn) -> Result<OwnSegment, FieldError> {
    let context = keys(path, "context", &mut character.context, Role::Context, worn)?;
    let targets = keys(path, "targets", &mut character.targets, Role::Target, worn)?;
    let wants = Columns {
        positions: std::mem::take(&mut character.return_positions),
        six_d: std::mem::take(&mut character.return_six_d),
        qpos: character.return_qpos,
    };
    if character.return_qpos && worn.skeleton().robot.is_none() {
        let message = format!("is true, but skeleton {} has no robot", worn.name());
        return Err(path
            .field("return_qpos")
            .error(message, "false, or a robot's skeleton"));
    }
    character.return_qpos = false;
    let places = character.root.iter().map(|key| {
        let place = [key.x, key.height, key.z];
        (key.frame as usize, place)
    });
    let places = places.collect();
    let first_target = (character.frame_count.unwrap_or(0) as usize).saturating_sub(targets.given.len());
    for key in &mut character.root {
        root_key(key, &context, (&targets, first_target), worn);
    }
    Ok(OwnSegment {
        columns: wants,
        context: context.given,
        targets: targets.given,
        places,
    })
}

/// Replaces the root of a frame. A frame with a keyframe repeats what becomes of that.
fn root_key(key: &mut v1::RootKey, context: &Keys, (targets, first_target): (&Keys, usize), worn: &Worn) {
    let frame = key.frame as usize;
    let posed = |keys: &Keys, at: Option<usize>| keys.carried.get(at?)?.as_ref().map(|(root, _)| *root);
    let posed = posed(context, Some(frame)).or_else(|| posed(targets, frame.checked_sub(first_target)));
    let given = |value: Option<f32>| value.unwrap_or_default();
    let place = Vec3::new(given(key.x), given(key.height), given(key.z));
    let there = match posed {
        Some(place) => {
            key.heading = None;
            place
        }
        None => match key.heading {
            Some(heading) => worn.root_in(GlobalRoot::new(place, heading)).position,
            None => worn.place_in(place),
        },
    };
    key.x = key.x.map(|_| there.x);
    key.z = key.z.map(|_| there.z);
    key.height = key.height.map(|_| there.y);
}

impl OwnSegment {
    /// Replaces the answer of the pack, which has `fps` frames a second, by that of the user.
    pub(crate) fn finish(&self, worn: &Arc<Worn>, result: &mut v1::CharacterResult, fps: f32) {
        if let Some(found) = &mut result.feasibility {
            scaled(found, worn.scale());
        }
        if let Some(stages) = &mut result.intermediates {
            for five in [&mut stages.root_r_g3, &mut stages.root_r_g4] {
                for root in five.as_chunks_mut::<5>().0 {
                    let [x, y, z, cos, sin] = *root;
                    let out = worn.root_out(GlobalRoot::new(Vec3::new(x, y, z), sin.atan2(cos)));
                    [root[0], root[1], root[2]] = out.position.to_array();
                }
            }
        }
        let Some(frames) = &mut result.frames else {
            return;
        };
        let mut carrier = Carrier::new(worn, self.columns);
        let carried = carrier.carry(frames);
        let first_target = carried.roots.len().saturating_sub(self.targets.len());
        let mut pinned: Vec<(usize, Given)> = self.context.iter().cloned().enumerate().collect();
        let targets = self.targets.iter().cloned().enumerate();
        pinned.extend(targets.map(|(nth, given)| (first_target + nth, given)));
        self.add_places(&mut pinned);
        let mut pins = Pins::default();
        for (frame, given) in &pinned {
            if let Some(made) = carried.at(*frame) {
                pins.add(worn, *frame as i64, given, made);
            }
        }
        carrier.write(carried, &pins, frames, fps);
    }

    /// Adds the places that the user gave by frames.
    fn add_places(&self, pinned: &mut Vec<(usize, Given)>) {
        for (frame, place) in &self.places {
            match pinned.iter_mut().find(|(other, _)| other == frame) {
                // It repeats what the keyframe has.
                Some((_, given)) => {
                    let both = given.root.iter_mut().zip(place);
                    both.for_each(|(value, place)| *value = value.or(*place));
                }
                None => pinned.push((
                    *frame,
                    Given {
                        root: *place,
                        rotations: None,
                    },
                )),
            }
        }
    }
}
