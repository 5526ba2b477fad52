//! How many keyframes a request has. Keyframes on a skeleton of the user's own are carried over
//! before they are checked, so they are counted first.

use troupe_character::{FieldError, Path};
use troupe_engine::pack::Pack;
use troupe_live::wire::units;
use troupe_motion::model::Dims;
use troupe_proto::v1;
use troupe_proto::v1::generate_request::Goal;

use super::path::{MAX_PATH_KEYFRAMES, check_end_counts};
use super::prepare::check_keyframe_counts;
use super::prompt::{MAX_GENERATED_FRAMES, check_past, same_count};
use super::words::most_past;

/// Counts the keyframes of a request for a body of a pack with these sizes.
///
/// # Errors
/// [`FieldError`] for the first list that is too long or too short.
pub fn count_generate(request: &v1::GenerateRequest, pack: &Pack, dims: &Dims) -> Result<(), FieldError> {
    let root = Path::root();
    match &request.goal {
        None => Ok(()),
        Some(Goal::Prompt(prompt)) => {
            let path = root.field("prompt");
            let past = request.past.len();
            check_past(&root, past, (pack.rig.dims.context_frames, most_past(pack)))?;
            let targets = path.field("targets");
            units::length(&targets, prompt.targets.len(), 0, MAX_GENERATED_FRAMES)?;
            let most = pack
                .language()
                .map_or(0, |language| language.max_agents().saturating_sub(1));
            units::length(&path.field("others"), prompt.others.len(), 0, most)?;
            for (index, other) in prompt.others.iter().enumerate() {
                let path = path.element("others", index);
                same_count(&path.field("past"), other.past.len(), ("past", past))?;
            }
            Ok(())
        }
        Some(Goal::Path(goal)) => {
            check_end_counts(&root, goal, request.past.len(), dims)?;
            let path = root.field("path");
            let keyframes = path.field("keyframes");
            units::length(&keyframes, goal.keyframes.len(), 0, MAX_PATH_KEYFRAMES)
        }
    }
}

/// Counts the keyframes of an in-between for a pack with these sizes.
///
/// # Errors
/// [`FieldError`] for the first list that is too long or too short.
pub fn count_in_between(request: &v1::InBetweenRequest, dims: &Dims) -> Result<(), FieldError> {
    let root = Path::root();
    let mut characters = request.characters.iter().enumerate();
    characters.try_for_each(|(index, character)| {
        let path = root.element("characters", index);
        check_keyframe_counts(&path, character, dims)
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path as FilePath;

    use super::*;

    fn keyframes(count: usize) -> Vec<v1::Keyframe> {
        vec![v1::Keyframe::default(); count]
    }

    /// The field at fault of a request, and what is allowed.
    fn refused(request: &v1::GenerateRequest, pack: &Pack) -> Option<(String, String)> {
        let error = count_generate(request, pack, &pack.rig.dims).err()?;
        Some((error.field, error.allowed))
    }

    fn at(field: &str, allowed: &str) -> Option<(String, String)> {
        Some((field.to_owned(), allowed.to_owned()))
    }

    #[test]
    fn keyframes_are_counted_without_a_look_at_them() {
        let folder = FilePath::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../models/human"));
        let pack = Pack::load(folder).unwrap();
        let along = |past, targets, keyframes| v1::GenerateRequest {
            past: self::keyframes(past),
            goal: Some(Goal::Path(v1::PathGoal {
                targets: self::keyframes(targets),
                keyframes: vec![v1::PathKeyframe::default(); keyframes],
                ..v1::PathGoal::default()
            })),
            ..v1::GenerateRequest::default()
        };
        assert_eq!(refused(&along(4, 4, 256), &pack), None);
        let most = at("path.keyframes", "0 to 256");
        assert_eq!(refused(&along(4, 4, 1000), &pack), most);
        assert_eq!(
            refused(&along(1000, 4, 0), &pack),
            at("past", "none, or exactly 4")
        );
        assert_eq!(refused(&along(0, 1000, 0), &pack), at("path.targets", "0 to 4"));
        let said = |past, targets, others: &[usize]| v1::GenerateRequest {
            past: keyframes(past),
            goal: Some(Goal::Prompt(v1::Prompt {
                targets: keyframes(targets),
                others: others
                    .iter()
                    .map(|&count| v1::Agent {
                        past: keyframes(count),
                        ..v1::Agent::default()
                    })
                    .collect(),
                ..v1::Prompt::default()
            })),
            ..v1::GenerateRequest::default()
        };
        assert_eq!(refused(&said(4, 0, &[]), &pack), None);
        let past = at("past", "none, or exactly 4");
        assert_eq!(refused(&said(1000, 0, &[]), &pack), past);
        let targets = at("prompt.targets", "0 to 1024");
        assert_eq!(refused(&said(4, 2000, &[]), &pack), targets);
        // The pack has no language model, and takes no others.
        let others = at("prompt.others", "0 to 0");
        assert_eq!(refused(&said(4, 0, &[4]), &pack), others);
        let between = v1::InBetweenRequest {
            characters: vec![
                v1::Character {
                    context: keyframes(4),
                    targets: keyframes(1),
                    ..v1::Character::default()
                },
                v1::Character {
                    context: keyframes(4),
                    targets: keyframes(5),
                    ..v1::Character::default()
                },
            ],
            ..v1::InBetweenRequest::default()
        };
        let error = count_in_between(&between, &pack.rig.dims).unwrap_err();
        assert_eq!(
            (error.field.as_str(), error.allowed.as_str()),
            ("characters[1].targets", "1 to 4")
        );
    }
}
