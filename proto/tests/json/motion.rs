//! The JSON form of the messages: names, defaults, refusal of what is unknown.

use prost::Message as _;
use troupe_proto::v1::{
    self, Character, FILE_DESCRIPTOR_SET, InBetweenRequest, Keyframe, Pack, Pose, Root, RootKey,
    RootVelocity, Vec3,
};

fn request() -> InBetweenRequest {
    let keyframe = Keyframe {
        root: Some(Root {
            position: Some(Vec3 {
                x: 0.1,
                y: 0.9,
                z: -2.5,
            }),
            heading: Some(1.5),
        }),
        velocity: Some(RootVelocity {
            x: 1.0,
            z: 0.5,
            angular: -0.1,
            height: None,
        }),
        pose: Some(Pose {
            rotations: vec![1.0, 0.0, 0.0, 0.0],
            root_height: Some(0.9),
        }),
        qpos: Vec::new(),
    };
    InBetweenRequest {
        pack: "human".into(),
        characters: vec![Character {
            id: "one".into(),
            context: vec![keyframe.clone(); 4],
            targets: vec![
                keyframe,
                Keyframe {
                    qpos: vec![0.5; 36],
                    ..Keyframe::default()
                },
            ],
            frame_count: Some(40),
            seed: (1 << 53) - 1,
            temperature: 0.5,
            pose_steps: Some(3),
            return_positions: true,
            root: vec![RootKey {
                frame: 20,
                x: Some(0.5),
                z: Some(0.0),
                ..RootKey::default()
            }],
            ..Character::default()
        }],
        skeleton: String::new(),
    }
}

#[test]
fn json_and_protobuf_carry_the_same_request() {
    let request = request();
    let json = serde_json::to_string(&request).unwrap();
    assert!(
        json.contains(r#""frame_count":40"#) && json.contains(r#""return_positions":true"#),
        "{json}"
    );
    assert_eq!(serde_json::from_str::<InBetweenRequest>(&json).unwrap(), request);
    assert_eq!(
        InBetweenRequest::decode(request.encode_to_vec().as_slice()).unwrap(),
        request
    );
}

#[test]
fn missing_fields_take_protobuf_defaults() {
    let character: Character = serde_json::from_str(r#"{"context":[{"root":{}}]}"#).unwrap();
    assert_eq!(character.frame_count, None);
    assert_eq!(character.temperature, 0.0);
    assert_eq!(character.context[0].root, Some(Root::default()));
    let written = serde_json::to_value(Keyframe::default()).unwrap();
    assert_eq!(written, serde_json::json!({"qpos": []}));
}

#[test]
fn numbers_may_be_texts_and_are_checked() {
    let read = |json: &str| serde_json::from_str::<Character>(json);
    for (json, seed) in [
        (r#"{"seed":18446744073709551615}"#, u64::MAX),
        (r#"{"seed":"18446744073709551615"}"#, u64::MAX),
        (r#"{"seed":4e1}"#, 40),
        (r#"{"seed":"40.0"}"#, 40),
    ] {
        assert_eq!(read(json).unwrap().seed, seed, "{json}");
    }
    let written = serde_json::to_value(read(r#"{"seed":7}"#).unwrap()).unwrap();
    assert_eq!(written["seed"], "7");
    assert_eq!(read(r#"{"temperature":"0.5"}"#).unwrap().temperature, 0.5);
    for (json, problem) in [
        (
            r#"{"seed":-1}"#,
            "integer `-1`, expected a whole number of 64 bits that is not negative",
        ),
        (
            r#"{"frame_count":4294967296}"#,
            "expected a whole number of 32 bits that is not negative",
        ),
        (r#"{"frame_count":0.5}"#, "floating point `0.5`"),
        (r#"{"seed":""}"#, "string \"\""),
        (r#"{"temperature":"warm"}"#, "string \"warm\", expected a number"),
        (r#"{"temperature":true}"#, "boolean `true`, expected a number"),
        (r#"{"allowed_token_counts":[null]}"#, "null"),
    ] {
        let error = read(json).unwrap_err().to_string();
        assert!(error.contains(problem), "{error}");
    }
}

#[test]
fn bytes_are_read_in_every_form_of_base64() {
    let read = |json: &str| serde_json::from_str::<v1::FrameBlock>(json);
    for json in [
        r#"{"contacts":"+/8="}"#,
        r#"{"contacts":"+/8"}"#,
        r#"{"contacts":"-_8="}"#,
    ] {
        assert_eq!(read(json).unwrap().contacts, [251, 255], "{json}");
    }
    assert!(read(r#"{"contacts":"?"}"#).is_err());
}

#[test]
fn errors_name_the_way_to_the_field() {
    let json = r#"{"characters":[{"targets":[{},{"pose":{"rotations":[1,0,"x"]}}]}]}"#;
    let mut json = serde_json::Deserializer::from_str(json);
    let error = serde_path_to_error::deserialize::<_, InBetweenRequest>(&mut json).unwrap_err();
    assert_eq!(
        error.path().to_string(),
        "characters[0].targets[1].pose.rotations[2]"
    );
}

#[test]
fn requests_refuse_unknown_fields_and_answers_tolerate_them() {
    let error = serde_json::from_str::<InBetweenRequest>(r#"{"charakters":[]}"#).unwrap_err();
    assert!(error.to_string().contains("charakters"), "{error}");
    let pack: Pack = serde_json::from_str(r#"{"name":"human","since_version_9":true}"#).unwrap();
    assert_eq!(pack.name, "human");
}

#[test]
fn the_descriptor_set_describes_the_service() {
    let set = prost_types::FileDescriptorSet::decode(FILE_DESCRIPTOR_SET).unwrap();
    let methods = |service: &str| -> Vec<String> {
        let services = set
            .file
            .iter()
            .filter(|file| file.package() == "troupe.v1")
            .flat_map(|file| &file.service);
        let service = services.into_iter().find(|s| s.name() == service).unwrap();
        service.method.iter().map(|m| m.name().to_owned()).collect()
    };
    assert_eq!(
        methods("Motion"),
        [
            "InBetween",
            "Generate",
            "Describe",
            "ListPacks",
            "GetPack",
            "LoadPack",
            "UnloadPack",
            "SwapPack"
        ]
    );
    assert_eq!(
        methods("Sessions"),
        [
            "CreateSessions",
            "ResumeSessions",
            "GetSession",
            "ListSessions",
            "CloseSessions",
            "Command",
            "Step",
            "Drive",
            "Peek",
            "GetRecording",
            "Replay",
            "ListStyles",
            "GetStyle",
            "PutStyle"
        ]
    );
}
