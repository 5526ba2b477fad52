//! Reads answers to in-betweening requests. Of every answer it reads the frame counts and the
//! server's timing. Only a sample of the answers is decoded in full.

use bytes::Bytes;
use prost::Message as _;
use serde::Deserialize;
use troupe_proto::v1;

use crate::measure::{Answer, Outcome};

/// The part of an answer that is always read: frame counts and timing.
#[derive(Clone, PartialEq, prost::Message, Deserialize)]
#[serde(default)]
struct Lean {
    #[prost(message, repeated, tag = "3")]
    characters: Vec<LeanCharacter>,
    #[prost(message, optional, tag = "4")]
    timing: Option<v1::Timing>,
}

#[derive(Clone, PartialEq, prost::Message, Deserialize)]
#[serde(default)]
struct LeanCharacter {
    #[prost(message, optional, tag = "2")]
    frames: Option<LeanFrames>,
}

#[derive(Clone, PartialEq, prost::Message, Deserialize)]
#[serde(default)]
struct LeanFrames {
    #[prost(uint32, tag = "1")]
    frame_count: u32,
}

/// The required contents of an answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Expected {
    pub(super) characters: u32,
    /// Number of frames of all characters together. None if the model chooses it.
    pub(super) frames: Option<u64>,
}

/// The form of an answer's body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Form {
    Protobuf,
    Json,
}

/// Reads frame counts and timing of an answer, and compares the counts with the expected ones.
pub(super) fn read(body: Bytes, form: Form, expected: Expected) -> Outcome {
    let bytes = body.len() as u64;
    let lean = match form {
        Form::Protobuf => Lean::decode(body).map_err(|e| e.to_string()),
        Form::Json => serde_json::from_slice(&body).map_err(|e| e.to_string()),
    };
    let lean = match lean {
        Ok(lean) => lean,
        Err(why) => return wrong("UNREADABLE", why),
    };
    let counts = lean
        .characters
        .iter()
        .map(|c| c.frames.as_ref().map_or(0, |f| f.frame_count));
    let frames = counts.map(u64::from).sum::<u64>();
    let characters = lean.characters.len();
    if characters != expected.characters as usize {
        let wanted = expected.characters;
        return wrong(
            "WRONG_CHARACTERS",
            format!("{characters} characters instead of {wanted}"),
        );
    }
    if let Some(wanted) = expected.frames.filter(|&wanted| wanted != frames) {
        return wrong("WRONG_FRAMES", format!("{frames} frames instead of {wanted}"));
    }
    Outcome::Right(Answer {
        characters: expected.characters,
        frames,
        bytes,
        timing: lean.timing.map(Into::into),
    })
}

pub(super) fn wrong(code: &'static str, message: String) -> Outcome {
    Outcome::Failed {
        code: code.into(),
        message,
    }
}

/// Maximum distance of a frame's root from that of its keyframe, metres.
const KEYFRAME_TOLERANCE_M: f32 = 2e-3;
/// Maximum difference of a rotation's length from 1.
const LENGTH_TOLERANCE: f32 = 1e-3;

/// Decodes an answer in full, and checks it against its request.
///
/// # Errors
/// A sentence about the first fault.
pub(super) fn check(body: &Bytes, form: Form, request: &v1::InBetweenRequest) -> Result<(), String> {
    let answer = match form {
        Form::Protobuf => v1::InBetweenResponse::decode(body.clone()).map_err(|e| e.to_string())?,
        Form::Json => serde_json::from_slice(body).map_err(|e| e.to_string())?,
    };
    for (nth, (asked, got)) in request.characters.iter().zip(&answer.characters).enumerate() {
        let at = |what: String| format!("characters[{nth}]: {what}");
        if asked.id != got.id {
            return Err(at(format!("its id is {:?} instead of {:?}", got.id, asked.id)));
        }
        let frames = got
            .frames
            .as_ref()
            .ok_or_else(|| at("it has no frames".to_owned()))?;
        check_frames(asked, frames).map_err(at)?;
    }
    Ok(())
}

fn check_frames(asked: &v1::Character, frames: &v1::Frames) -> Result<(), String> {
    let count = frames.frame_count as usize;
    let pose = asked.context.first().and_then(|key| key.pose.as_ref());
    let joints = pose.map_or(0, |pose| pose.rotations.len() / 4);
    let length = |what: &str, got: usize, wanted: usize| {
        (got == wanted)
            .then_some(())
            .ok_or_else(|| format!("{what} has {got} numbers instead of {wanted}"))
    };
    length("root_positions", frames.root_positions.len(), count * 3)?;
    length("rotations", frames.rotations.len(), count * joints * 4)?;
    let unit = |q: &[f32; 4]| (q.iter().map(|v| v * v).sum::<f32>().sqrt() - 1.0).abs() < LENGTH_TOLERANCE;
    if let Some(place) = frames.rotations.as_chunks::<4>().0.iter().position(|q| !unit(q)) {
        return Err(format!("the length of rotation {place} is not 1"));
    }
    if frames.root_positions.iter().any(|v| !v.is_finite()) {
        return Err("a root position is not finite".to_owned());
    }
    let roots = frames.root_positions.as_chunks::<3>().0;
    let first = asked.context.iter().zip(roots);
    let last = asked.targets.iter().rev().zip(roots.iter().rev());
    for (key, root) in first.chain(last) {
        let Some(place) = key.root.as_ref().and_then(|r| r.position.as_ref()) else {
            continue;
        };
        let off = [place.x - root[0], place.y - root[1], place.z - root[2]];
        let off = off.iter().map(|v| v * v).sum::<f32>().sqrt();
        if off > KEYFRAME_TOLERANCE_M {
            return Err(format!("a frame is {off} m from its keyframe"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request() -> v1::InBetweenRequest {
        let key = |z: f32| v1::Keyframe {
            root: Some(v1::Root {
                position: Some(v1::Vec3 { x: 0.0, y: 0.9, z }),
                heading: None,
            }),
            pose: Some(v1::Pose {
                rotations: vec![1.0, 0.0, 0.0, 0.0],
                root_height: None,
            }),
            ..v1::Keyframe::default()
        };
        let character = v1::Character {
            id: "a".to_owned(),
            context: vec![key(0.0)],
            targets: vec![key(0.2)],
            frame_count: Some(3),
            ..v1::Character::default()
        };
        v1::InBetweenRequest {
            pack: String::new(),
            characters: vec![character],
            skeleton: String::new(),
        }
    }

    fn response() -> v1::InBetweenResponse {
        v1::InBetweenResponse {
            characters: vec![v1::CharacterResult {
                id: "a".to_owned(),
                frames: Some(v1::Frames {
                    frame_count: 3,
                    root_positions: vec![0.0, 0.9, 0.0, 0.0, 0.9, 0.1, 0.0, 0.9, 0.2],
                    rotations: [1.0, 0.0, 0.0, 0.0].repeat(3),
                    contacts: vec![0.5; 6],
                    ..v1::Frames::default()
                }),
                intermediates: None,
                feasibility: None,
            }],
            timing: Some(v1::Timing {
                queue_us: 40,
                total_us: 900,
                batch_size: 4,
                ..v1::Timing::default()
            }),
            ..v1::InBetweenResponse::default()
        }
    }

    fn bodies(of: &v1::InBetweenResponse) -> [(Bytes, Form); 2] {
        [
            (of.encode_to_vec().into(), Form::Protobuf),
            (serde_json::to_vec(of).unwrap().into(), Form::Json),
        ]
    }

    #[test]
    fn lengths_and_times_are_read_in_both_forms() {
        for (body, form) in bodies(&response()) {
            let expected = Expected {
                characters: 1,
                frames: Some(3),
            };
            let Outcome::Right(answer) = read(body.clone(), form, expected) else {
                panic!("{form:?}")
            };
            assert_eq!((answer.characters, answer.frames), (1, 3));
            let timing = answer.timing.unwrap();
            assert_eq!(
                (timing.queue_us, timing.total_us, timing.batch_size),
                (40, 900, 4)
            );
            for (expected, code) in [((1, Some(4)), "WRONG_FRAMES"), ((2, None), "WRONG_CHARACTERS")] {
                let (characters, frames) = expected;
                let outcome = read(body.clone(), form, Expected { characters, frames });
                assert!(
                    matches!(&outcome, Outcome::Failed { code: c, .. } if c == code),
                    "{outcome:?}"
                );
            }
            let cut = read(body.slice(..body.len() - 1), form, expected);
            assert!(matches!(cut, Outcome::Failed { .. }));
        }
    }

    #[test]
    fn faults_of_an_answer_are_found() {
        type Breaks = fn(&mut v1::Frames);
        let broken: [(Breaks, &str); 4] = [
            (|f| f.rotations[5] = 0.5, "the length of rotation"),
            (|f| f.root_positions[8] = 0.3, "from its keyframe"),
            (|f| f.root_positions[4] = f32::INFINITY, "finite"),
            (|f| f.rotations.truncate(8), "8 numbers instead of 12"),
        ];
        for (break_it, wanted) in broken {
            let mut answer = response();
            break_it(answer.characters[0].frames.as_mut().unwrap());
            // JSON has no infinity.
            let (body, form) = &bodies(&answer)[0];
            let error = check(body, *form, &request()).unwrap_err();
            assert!(error.contains(wanted), "{error}");
        }
        for (body, form) in bodies(&response()) {
            assert_eq!(check(&body, form, &request()), Ok(()));
        }
    }
}
