//! Checks the shape of a request before it is decoded. An empty message takes two bytes on the wire
//! and a hundred times as much in memory, so even a body within the size limit could take
//! gigabytes. Counting its parts is cheap.

mod json;

use std::collections::HashMap;

use bytes::Bytes;
use prost::encoding::{DecodeContext, WireType, decode_key, decode_varint, skip_field};
use troupe_proto::rpc::{List, RPCS, Step};

use super::{ApiError, ApiLimits};
use troupe_character::FieldError;
use troupe_character::primitives::path::PATH_POINTS;
use troupe_live::session::MAX_COMMANDS;
use troupe_service::inbetween::{MAX_PATH_KEYFRAMES, MAX_PATH_POINTS};

/// How many entries a list may have.
#[derive(Debug, Clone, Copy)]
struct Limit {
    /// What the entries are, for the error text.
    what: &'static str,
    /// Most entries. Smaller limits, such as a pack's, are checked after decoding.
    most: usize,
    /// Most brackets (`{` and `[`) of one entry in JSON, including those in its texts.
    json_parts: usize,
}

impl Limit {
    /// The limit of a list in a request. `None` only for a list that is missing here; a test finds
    /// those.
    fn of(list: &List, limits: &ApiLimits) -> Option<Self> {
        let limit = |what, most, json_parts| Limit {
            what,
            most,
            json_parts,
        };
        Some(match (list.of, list.field) {
            // A full character has about 120 objects and arrays. Its id may hold more brackets.
            ("Character", _) => limit("characters", limits.characters, 1024),
            ("SessionOptions", _) => limit("sessions", limits.sessions, 1024),
            ("SessionResume", _) => limit("sessions", limits.sessions, 16),
            (_, "DescribeRequest.frames" | "OtherMotion.frames") => limit("keyframes", 2048, 16),
            // Includes the frames before and the brackets in its text.
            ("Agent", _) => limit("characters", 16, 4096),
            // Includes all its frames.
            ("OtherMotion", _) => limit("characters", 16, 16_384),
            ("Keyframe", _) => limit("keyframes", 256, 64),
            ("PathKeyframe", _) => limit("keyframes", MAX_PATH_KEYFRAMES, 66),
            ("RootKey", _) => limit("roots", 256, 1),
            ("Command", _) => limit("commands", MAX_COMMANDS, 64),
            ("Gait", _) => limit("gaits", 256, 256),
            ("GaitKey", _) => limit("keyframes", 256, 2),
            (_, "FollowPath.points") => limit("points", *PATH_POINTS.end(), 2),
            (_, "Style.words") => limit("words", 64, 64),
            ("Collider", _) => limit("colliders", 2048, 512),
            (_, "PathGoal.points") => limit("points", MAX_PATH_POINTS, 2),
            ("BodyJoint", _) => limit("joints", 1024, 64),
            (_, "BodySkeleton.contact_joints") => limit("contact joints", 1024, 64),
            (_, "PathGoal.style") => limit("words", 1024, 64),
            ("Quat", _) => limit("rotations", 1024, 1),
            ("Vec3", _) => limit("points", 256, 1),
            // The object, its position and rotation, and brackets in its id.
            ("SceneObject", _) => limit("objects", 8192, 160),
            ("ObjectMove", _) => limit("moves", 8192, 160),
            (_, "RemoveObjectsRequest.ids") => limit("ids", 8192, 160),
            // Session ids hold no brackets.
            (_, "CloseSessionsRequest.ids") => limit("ids", 10_000, 1),
            (_, "StepRequest.session_ids") => limit("sessions", limits.sessions, 1),
            (_, "DriveAttach.session_ids" | "DriveDetach.session_ids") => limit("ids", 100_000, 1),
            _ => return None,
        })
    }
}

/// A list, and how many entries it may have.
#[derive(Debug, Clone, Copy)]
struct Rule {
    steps: &'static [Step],
    limit: Limit,
}

/// Limits of the lists in a request.
#[derive(Debug, Clone)]
pub(super) struct Shape {
    rules: Vec<Rule>,
    /// Most brackets (`{` and `[`) of the request in JSON.
    json_parts: usize,
}

/// Shapes by remote procedure. Requests without lists have none.
#[derive(Debug, Clone)]
pub(super) struct Shapes(HashMap<&'static str, Shape>);

impl Shapes {
    pub(super) fn new(limits: &ApiLimits) -> Self {
        let rule = |list: &List| {
            let limit = Limit::of(list, limits)?;
            Some(Rule {
                steps: list.steps,
                limit,
            })
        };
        let shapes = RPCS.iter().filter_map(|rpc| {
            let rules: Vec<Rule> = rpc.lists.iter().filter_map(rule).collect();
            Some((rpc.name, Shape::new(rules)?))
        });
        Self(shapes.collect())
    }

    /// The shape of a remote procedure's request. `None`: the size limit is enough.
    pub(super) fn of(&self, rpc: &str) -> Option<&Shape> {
        self.0.get(rpc)
    }
}

impl Shape {
    /// `None` if there are no rules.
    fn new(rules: Vec<Rule>) -> Option<Self> {
        let json_parts = rules.iter().map(Rule::json_parts).max()?;
        Some(Self { rules, json_parts })
    }

    /// Checks a request in gRPC framing. Incomplete, compressed or malformed data passes: decoding
    /// gives the better error.
    pub(super) fn check_grpc(&self, frame: &Bytes) -> Result<(), ApiError> {
        match frame.split_first_chunk::<5>() {
            Some(([0, ..], message)) => self.check_protobuf(message),
            _ => Ok(()),
        }
    }

    /// Checks a protobuf message.
    pub(super) fn check_protobuf(&self, message: &[u8]) -> Result<(), ApiError> {
        self.rules
            .iter()
            .try_for_each(|rule| rule.check(message, rule.steps, String::new()))
    }

    /// Checks a JSON body by counting its brackets. The error names the first list that is too
    /// long.
    pub(super) fn check_json(&self, body: &[u8]) -> Result<(), ApiError> {
        let parts = body.iter().filter(|&&byte| byte == b'{' || byte == b'[').count();
        if parts <= self.json_parts {
            return Ok(());
        }
        let most = self.json_parts;
        Err(match json::too_long(body, &self.rules) {
            Some((field, limit)) => too_many(field, limit.what, limit.most),
            None => FieldError {
                field: "body".to_owned(),
                message: format!("has more than {most} brackets ({{ and [)"),
                allowed: format!("at most {most}"),
            }
            .into(),
        })
    }
}

impl Rule {
    /// Most brackets of a request that is full of such entries, in JSON. A list inside another list
    /// counts as part of the outer one.
    fn json_parts(&self) -> usize {
        match self.steps {
            [way @ .., _] if way.iter().all(|step| !step.list) => {
                self.limit.json_parts.saturating_mul(self.limit.most)
            }
            _ => 0,
        }
    }

    /// Counts the entries of the list at the end of `steps`, in every message on the way.
    fn check(&self, message: &[u8], steps: &[Step], path: String) -> Result<(), ApiError> {
        let Some((step, deeper)) = steps.split_first() else {
            return Ok(());
        };
        let entries = || DelimitedFields(message).filter(|part| part.0 == step.number);
        let dot = if path.is_empty() { "" } else { "." };
        let path = format!("{path}{dot}{}", step.name);
        if deeper.is_empty() {
            return match entries().nth(self.limit.most) {
                Some(_) => Err(too_many(path, self.limit.what, self.limit.most)),
                None => Ok(()),
            };
        }
        for (index, (_, entry)) in entries().enumerate() {
            let path = match step.list {
                true => format!("{path}[{index}]"),
                false => path.clone(),
            };
            self.check(entry, deeper, path)?;
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

/// Iterates over the length-delimited fields of a message, with their numbers. Stops at the end and
/// at malformed data.
struct DelimitedFields<'a>(&'a [u8]);

impl<'a> Iterator for DelimitedFields<'a> {
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

    const LIMITS: ApiLimits = ApiLimits {
        write_timeout: Duration::from_secs(1),
        timeout: Duration::ZERO,
        message_bytes: 0,
        characters: 3,
        sessions: 3,
    };

    fn shape(rpc: &str) -> Shape {
        Shapes::new(&LIMITS).of(rpc).unwrap().clone()
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
            skeleton: String::new(),
        }
    }

    #[test]
    fn every_list_has_a_limit() {
        for list in RPCS.iter().flat_map(|rpc| rpc.lists) {
            assert!(Limit::of(list, &LIMITS).is_some(), "{}: say how many", list.field);
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
        let mut rooted = request(1, 1);
        rooted.characters[0].root = vec![v1::RootKey::default(); 257];
        assert_eq!(
            refused("InBetween", &rooted),
            at("characters[0].root", "1 to 256")
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
            let body = format!("{start}{}", part.repeat(3 * 1024));
            assert!(shape.check_json(body.as_bytes()).is_err());
        }
    }

    #[test]
    fn a_json_body_with_too_many_parts_names_the_list_at_fault() {
        let refused = |rpc: &str, body: &str| match shape(rpc).check_json(body.as_bytes()) {
            Err(ApiError::Field(error)) => error.to_string(),
            other => panic!("{other:?}"),
        };
        let keyframe = r#"{"keyframe": {"pose": {"rotations": []}}}"#;
        let body = |keyframes: usize| {
            let keyframes = vec![keyframe; keyframes].join(",");
            format!(r#"{{"path": {{"style": [{{"word": "]"}}], "keyframes": [{keyframes}]}}}}"#)
        };
        shape("Generate").check_json(body(256).as_bytes()).unwrap();
        assert_eq!(
            refused("Generate", &body(20_000)),
            "path.keyframes: has more than 256 keyframes; allowed: 1 to 256"
        );
        let body = format!(
            r#"{{"characters": [{{"id": "a"}}, {{"targets": [{}]}}]}}"#,
            vec!["{}"; 4000].join(",")
        );
        assert_eq!(
            refused("InBetween", &body),
            "characters[1].targets: has more than 256 keyframes; allowed: 1 to 256"
        );
        // What is at fault is no list of a request, or no JSON.
        for open in ["{\"seed\": [", "["] {
            assert_eq!(
                refused("InBetween", &format!("{open}{}", "[],".repeat(4000))),
                "body: has more than 3072 brackets ({ and [); allowed: at most 3072"
            );
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
