//! A look at the shape of a request before it is decoded. An empty message takes two bytes on the wire and a hundred
//! times as much in memory, so a body within the size limit could still take gigabytes. Counting its parts is cheap.

use std::collections::HashMap;

use bytes::Bytes;
use prost::encoding::{DecodeContext, WireType, decode_key, decode_varint, skip_field};

use super::{ApiError, ApiLimits};
use crate::session::MAX_COMMANDS;
use troupe_character::FieldError;

/// Most keyframes of a character or session that are decoded; the pack's own, smaller limit is checked later.
const MAX_KEYFRAMES: usize = 256;
/// Most keyframes of a motion to describe that are decoded; the smaller limit is checked later.
const MAX_DESCRIBED: usize = 2048;
/// Most objects and arrays of a keyframe in JSON.
const MAX_KEYFRAME_JSON_PARTS: usize = 16;
/// Most gaits of a style, and keyframes of a gait, that are decoded; the smaller limits are checked later.
const MAX_STYLE_PARTS: usize = 256;
/// Most ids to close that are decoded.
const MAX_IDS: usize = 10_000;
/// Most objects and arrays of a character, or of a session to create, in JSON. A full one has some sixty; its id may hold
/// more of their signs.
const MAX_JSON_PARTS: usize = 1024;
/// The same of a command.
const MAX_COMMAND_JSON_PARTS: usize = 64;

/// Most shapes of a scene, and points of a shape, that are decoded; the smaller limits are checked later.
const MAX_COLLIDERS: usize = 2048;
const MAX_POINTS: usize = 256;
/// Most objects of a scene, or changes of objects, that are decoded; the smaller limit is checked later.
const MAX_OBJECTS: usize = 8192;
/// Most objects and arrays of an object of a scene in JSON: place, rotation and itself, and signs in its id.
const MAX_OBJECT_JSON_PARTS: usize = 160;

/// Where a list is: field numbers and names from the request down. A name that ends in `[]` is a list's on the way.
type Steps = &'static [(u32, &'static str)];

/// A list that may have so many entries.
#[derive(Debug, Clone, Copy)]
struct Rule {
    steps: Steps,
    /// What the entries are.
    what: &'static str,
    most: usize,
}

/// What a request may look like.
#[derive(Debug, Clone, Default)]
pub(super) struct Shape {
    rules: Vec<Rule>,
    /// Most objects and arrays as JSON.
    json_parts: usize,
}

/// The shapes of requests by remote procedure, those that could grow so.
#[derive(Debug, Clone)]
pub(super) struct Shapes(HashMap<&'static str, Shape>);

impl Shapes {
    pub(super) fn new(limits: &ApiLimits) -> Self {
        let rule = |steps, what, most| Rule { steps, what, most };
        let characters = limits.characters;
        let sessions = limits.sessions;
        let commands = |steps| rule(steps, "commands", MAX_COMMANDS);
        let shape = |rules: &[Rule], json_parts| Shape {
            rules: rules.to_vec(),
            json_parts,
        };
        let command_parts = MAX_COMMAND_JSON_PARTS * MAX_COMMANDS;
        Self(HashMap::from([
            (
                "InBetween",
                shape(
                    &[
                        rule(&[(2, "characters")], "characters", characters),
                        rule(&[(2, "characters[]"), (2, "context")], "keyframes", MAX_KEYFRAMES),
                        rule(&[(2, "characters[]"), (3, "targets")], "keyframes", MAX_KEYFRAMES),
                    ],
                    MAX_JSON_PARTS.saturating_mul(characters),
                ),
            ),
            (
                "Generate",
                shape(
                    &[
                        rule(&[(4, "past")], "keyframes", MAX_KEYFRAMES),
                        rule(&[(3, "describe"), (1, "frames")], "keyframes", MAX_DESCRIBED),
                    ],
                    MAX_JSON_PARTS + MAX_DESCRIBED * MAX_KEYFRAME_JSON_PARTS,
                ),
            ),
            (
                "CreateSessions",
                shape(
                    &[
                        rule(&[(1, "sessions")], "sessions", sessions),
                        rule(&[(1, "sessions[]"), (8, "context")], "keyframes", MAX_KEYFRAMES),
                    ],
                    MAX_JSON_PARTS.saturating_mul(sessions),
                ),
            ),
            ("CloseSessions", shape(&[rule(&[(1, "ids")], "ids", MAX_IDS)], 0)),
            ("Command", shape(&[commands(&[(1, "commands")])], command_parts)),
            (
                "Step",
                shape(
                    &[
                        rule(&[(1, "session_ids")], "sessions", sessions),
                        commands(&[(4, "commands")]),
                    ],
                    command_parts,
                ),
            ),
            (
                "Drive",
                shape(&[commands(&[(4, "command"), (1, "commands")])], command_parts),
            ),
            (
                "PutScene",
                shape(
                    &[
                        rule(&[(1, "scene"), (5, "objects")], "objects", MAX_OBJECTS),
                        rule(&[(1, "scene"), (4, "colliders")], "colliders", MAX_COLLIDERS),
                        rule(
                            &[
                                (1, "scene"),
                                (4, "colliders[]"),
                                (5, "shape"),
                                (2, "convex"),
                                (1, "points"),
                            ],
                            "points",
                            MAX_POINTS,
                        ),
                    ],
                    MAX_OBJECT_JSON_PARTS * MAX_OBJECTS,
                ),
            ),
            (
                "AddObjects",
                shape(
                    &[rule(&[(3, "objects")], "objects", MAX_OBJECTS)],
                    MAX_OBJECT_JSON_PARTS * MAX_OBJECTS,
                ),
            ),
            (
                "MoveObjects",
                shape(
                    &[rule(&[(3, "moves")], "moves", MAX_OBJECTS)],
                    MAX_OBJECT_JSON_PARTS * MAX_OBJECTS,
                ),
            ),
            (
                "RemoveObjects",
                shape(
                    &[rule(&[(2, "ids")], "ids", MAX_OBJECTS)],
                    MAX_OBJECTS * MAX_OBJECT_JSON_PARTS,
                ),
            ),
            (
                "PutStyle",
                shape(
                    &[
                        rule(&[(2, "style"), (7, "gaits")], "gaits", MAX_STYLE_PARTS),
                        rule(
                            &[(2, "style"), (7, "gaits[]"), (6, "keys")],
                            "keyframes",
                            MAX_STYLE_PARTS,
                        ),
                    ],
                    MAX_STYLE_PARTS * MAX_STYLE_PARTS,
                ),
            ),
        ]))
    }

    /// The shape of a remote procedure's request. `None`: its size says enough.
    pub(super) fn of(&self, rpc: &str) -> Option<&Shape> {
        self.0.get(rpc)
    }
}

impl Shape {
    /// Checks a request in gRPC framing. What is not whole, compressed or no protobuf passes: decoding says more.
    pub(super) fn check_grpc(&self, frame: &Bytes) -> Result<(), ApiError> {
        match frame.split_first_chunk::<5>() {
            Some(([0, ..], message)) => self.check_protobuf(message),
            _ => Ok(()),
        }
    }

    /// Checks a request's message.
    pub(super) fn check_protobuf(&self, message: &[u8]) -> Result<(), ApiError> {
        self.rules
            .iter()
            .try_for_each(|rule| rule.check(message, rule.steps, ""))
    }

    /// Checks a request as JSON.
    pub(super) fn check_json(&self, body: &[u8]) -> Result<(), ApiError> {
        let parts = body.iter().filter(|&&byte| byte == b'{' || byte == b'[').count();
        match self.rules.first() {
            Some(rule) if parts > self.json_parts => {
                let names: Vec<&str> = rule
                    .steps
                    .iter()
                    .map(|(_, name)| name.trim_end_matches("[]"))
                    .collect();
                let what = format!("{}, or their parts,", rule.what);
                Err(too_many(names.join("."), &what, rule.most))
            }
            _ => Ok(()),
        }
    }
}

impl Rule {
    /// Counts the entries of a list at the end of `steps`, in every message on the way there.
    fn check(&self, message: &[u8], steps: Steps, path: &str) -> Result<(), ApiError> {
        let Some(((number, name), deeper)) = steps.split_first() else {
            return Ok(());
        };
        let entries = || Parts(message).filter(|part| part.0 == *number);
        let path = match path {
            "" => (*name).to_owned(),
            path => format!("{path}.{name}"),
        };
        if deeper.is_empty() {
            return match entries().nth(self.most) {
                Some(_) => Err(too_many(path, self.what, self.most)),
                None => Ok(()),
            };
        }
        for (index, (_, entry)) in entries().enumerate() {
            self.check(entry, deeper, &path.replace("[]", &format!("[{index}]")))?;
        }
        Ok(())
    }
}

fn too_many(field: String, what: &str, limit: usize) -> ApiError {
    FieldError {
        field,
        message: format!("has more than {limit} {what}"),
        allowed: format!("1 to {limit}"),
    }
    .into()
}
/// The length-delimited fields of a message, by number. Ends where the message ends or makes no sense.
struct Parts<'a>(&'a [u8]);

impl<'a> Iterator for Parts<'a> {
    type Item = (u32, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        while !self.0.is_empty() {
            let (number, wire_type) = decode_key(&mut self.0).ok()?;
            if wire_type == WireType::LengthDelimited {
                let length = usize::try_from(decode_varint(&mut self.0).ok()?).ok()?;
                let (part, rest) = self.0.split_at_checked(length)?;
                self.0 = rest;
                return Some((number, part));
            }
            skip_field(wire_type, number, &mut self.0, DecodeContext::default()).ok()?;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use prost::Message;
    use troupe_proto::v1;

    use super::*;

    fn framed(message: Vec<u8>) -> Bytes {
        let length = u32::try_from(message.len()).unwrap();
        [&[0], length.to_be_bytes().as_slice(), &message].concat().into()
    }

    fn shape(rpc: &str) -> Shape {
        let limits = ApiLimits {
            timeout: Duration::ZERO,
            message_bytes: 0,
            characters: 3,
            sessions: 3,
        };
        Shapes::new(&limits).of(rpc).unwrap().clone()
    }

    /// The field that a request is refused for, and what is allowed.
    fn refused<T: Message>(rpc: &str, request: &T) -> Option<(String, String)> {
        match shape(rpc).check_grpc(&framed(request.encode_to_vec())) {
            Ok(()) => None,
            Err(ApiError::Field(error)) => Some((error.field, error.allowed)),
            Err(other) => panic!("{other}"),
        }
    }

    fn at(field: &str, allowed: &str) -> Option<(String, String)> {
        Some((field.to_owned(), allowed.to_owned()))
    }

    fn request(characters: usize, targets: usize) -> v1::InBetweenRequest {
        let character = v1::Character {
            id: "{[".repeat(64),
            seed: 7,
            frame_count: Some(64),
            temperature: 1.0,
            context: vec![v1::Keyframe::default(); 4],
            targets: vec![v1::Keyframe::default(); targets],
            ..v1::Character::default()
        };
        v1::InBetweenRequest {
            pack: "human".into(),
            characters: vec![character; characters],
        }
    }

    #[test]
    fn protobuf_parts_are_counted() {
        assert_eq!(refused("InBetween", &request(3, 256)), None);
        assert_eq!(refused("InBetween", &request(4, 1)), at("characters", "1 to 3"));
        assert_eq!(
            refused("InBetween", &request(1, 257)),
            at("characters[0].targets", "1 to 256")
        );
    }

    #[test]
    fn commands_and_sessions_are_counted_wherever_they_are() {
        let commands = |count| vec![v1::Command::default(); count];
        let many = v1::CommandRequest {
            commands: commands(10_001),
        };
        assert_eq!(refused("Command", &many), at("commands", "1 to 10000"));
        let driven = v1::DriveRequest {
            message: Some(v1::drive_request::Message::Command(many)),
        };
        assert_eq!(refused("Drive", &driven), at("command.commands", "1 to 10000"));
        let step = v1::StepRequest {
            session_ids: vec![String::new(); 3],
            commands: commands(10_000),
            ..v1::StepRequest::default()
        };
        assert_eq!(refused("Step", &step), None);
        let create = v1::CreateSessionsRequest {
            sessions: vec![
                v1::SessionOptions {
                    context: vec![v1::Keyframe::default(); 257],
                    ..v1::SessionOptions::default()
                };
                2
            ],
        };
        assert_eq!(
            refused("CreateSessions", &create),
            at("sessions[0].context", "1 to 256")
        );
    }

    #[test]
    fn keyframes_of_a_style_are_counted() {
        let mut put = v1::PutStyleRequest {
            style: Some(v1::Style {
                gaits: vec![v1::Gait::default(); 2],
                ..v1::Style::default()
            }),
            ..v1::PutStyleRequest::default()
        };
        assert_eq!(refused("PutStyle", &put), None);
        put.style.as_mut().unwrap().gaits[1].keys = vec![v1::GaitKey::default(); 257];
        assert_eq!(refused("PutStyle", &put), at("style.gaits[1].keys", "1 to 256"));
    }

    #[test]
    fn parts_of_scenes_are_counted() {
        let points = |count| v1::ColliderShape {
            convex: Some(v1::ConvexShape {
                points: vec![v1::Vec3::default(); count],
            }),
            ..v1::ColliderShape::default()
        };
        let with = |objects, points| v1::PutSceneRequest {
            scene: Some(v1::Scene {
                objects: vec![v1::SceneObject::default(); objects],
                colliders: vec![v1::Collider {
                    shape: Some(points),
                    ..v1::Collider::default()
                }],
                ..v1::Scene::default()
            }),
            ..v1::PutSceneRequest::default()
        };
        assert_eq!(refused("PutScene", &with(8192, points(256))), None);
        assert_eq!(
            refused("PutScene", &with(8193, points(4))),
            at("scene.objects", "1 to 8192")
        );
        assert_eq!(
            refused("PutScene", &with(1, points(257))),
            at("scene.colliders[0].shape.convex.points", "1 to 256")
        );
        let add = v1::AddObjectsRequest {
            objects: vec![v1::SceneObject::default(); 8193],
            ..v1::AddObjectsRequest::default()
        };
        assert_eq!(refused("AddObjects", &add), at("objects", "1 to 8192"));
        let full = serde_json::to_vec(&with(4096, points(64))).unwrap();
        shape("PutScene").check_json(&full).unwrap();
    }

    #[test]
    fn json_parts_are_counted() {
        let shape = shape("InBetween");
        let full = serde_json::to_vec(&request(3, 4)).unwrap();
        shape.check_json(&full).unwrap();
        for (start, part) in [("{\"characters\":[", "{},"), ("[", "[],")] {
            let body = format!("{start}{}", part.repeat(3 * MAX_JSON_PARTS));
            assert!(shape.check_json(body.as_bytes()).is_err());
        }
    }

    #[test]
    fn what_makes_no_sense_is_left_to_the_decoder() {
        let shape = shape("InBetween");
        let good = framed(request(1, 1).encode_to_vec());
        for cut in 0..good.len() {
            shape.check_grpc(&good.slice(..cut)).unwrap();
        }
        shape.check_grpc(&framed(vec![0xff; 40])).unwrap();
        shape.check_grpc(&Bytes::from_static(&[1, 0, 0, 0, 0])).unwrap();
    }
}
