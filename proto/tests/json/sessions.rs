//! The JSON form of sessions: enumerations as names, bytes as base64, the field of a choice beside
//! the others.

use serde_json::json;
use troupe_proto::v1;

use crate::round_trip;

fn walk() -> v1::Command {
    v1::Command {
        session_id: "npc-1".into(),
        sequence: 3,
        at_frame: Some(40),
        intent: Some(v1::command::Intent::Locomote(v1::Locomote {
            velocity: Some(v1::Vec3 {
                x: 1.0,
                y: 0.0,
                z: 0.5,
            }),
            facing: Some(0.25),
            style: "walk".into(),
            ..v1::Locomote::default()
        })),
        priority: None,
    }
}

#[test]
fn a_priority_stands_alone_or_beside_an_intent() {
    let alone: v1::Command =
        serde_json::from_str(r#"{"session_id":"a","sequence":1,"priority":0.25}"#).unwrap();
    assert_eq!((alone.priority, &alone.intent), (Some(0.25), &None));
    round_trip(&alone);
    let json = round_trip(&v1::Command {
        priority: Some(0.0),
        ..walk()
    });
    assert_eq!(json["priority"], json!(0.0));
    assert!(round_trip(&walk()).get("priority").is_none());
    let options: v1::SessionOptions = serde_json::from_str(r#"{"priority":1}"#).unwrap();
    assert_eq!(options.priority, Some(1.0));
}

#[test]
fn options_name_their_convention() {
    let options = v1::SessionOptions {
        convention: v1::Convention::Unreal.into(),
        ttl_ms: Some(5000),
        ..v1::SessionOptions::default()
    };
    let json = round_trip(&options);
    assert_eq!(
        (&json["convention"], &json["ttl_ms"]),
        (&json!("CONVENTION_UNREAL"), &json!(5000))
    );
    assert!(json.get("root_ratio").is_none(), "{json}");
    let short: v1::SessionOptions = serde_json::from_str(r#"{"convention":"ros"}"#).unwrap();
    assert_eq!(short.convention(), v1::Convention::Ros);
}

#[test]
fn a_wrong_value_gets_the_names_of_the_right_ones() {
    for bad in [r#"{"convention":"blender"}"#, r#"{"convention":"NATIVE"}"#] {
        let error = serde_json::from_str::<v1::SessionOptions>(bad).unwrap_err();
        assert!(
            error.to_string().contains("expected one of `CONVENTION_NATIVE`, `CONVENTION_UNREAL`, `CONVENTION_UNITY`, `CONVENTION_ROS`"),
            "{error}"
        );
    }
    let error = serde_json::from_str::<v1::StepRequest>(r#"{"encoding":"f16"}"#).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("expected one of `ENCODING_F32`, `ENCODING_COMPACT`, `ENCODING_QPOS`"),
        "{error}"
    );
    assert!(serde_json::from_str::<v1::StepRequest>(r#"{"encoding":7}"#).is_err());
    let numbered: v1::StepRequest = serde_json::from_str(r#"{"encoding":1}"#).unwrap();
    assert_eq!(numbered.encoding(), v1::Encoding::Compact);
}

#[test]
fn a_command_has_one_intent_or_none() {
    let json = round_trip(&walk());
    assert_eq!(json["locomote"]["style"], json!("walk"));
    let none: v1::Command = serde_json::from_str(r#"{"session_id":"a","sequence":1}"#).unwrap();
    assert_eq!(none.intent, None);
    for unknown in [
        r#"{"dance":{}}"#,
        r#"{"cancel":{},"drop":{}}"#,
        r#"{"locomote":{"velocty":{}}}"#,
    ] {
        assert!(serde_json::from_str::<v1::Command>(unknown).is_err(), "{unknown}");
    }
}

#[test]
fn a_message_of_a_stream_has_the_field_of_its_kind() {
    use v1::drive_request::Message as Ask;
    use v1::drive_response::Message as Say;
    let asked = [
        (Ask::Open(v1::DriveOpen::default()), "open"),
        (Ask::Attach(v1::DriveAttach::default()), "attach"),
        (Ask::Detach(v1::DriveDetach::default()), "detach"),
        (
            Ask::Command(v1::CommandRequest {
                commands: vec![walk()],
            }),
            "command",
        ),
    ];
    for (message, name) in asked {
        let json = round_trip(&v1::DriveRequest {
            message: Some(message),
        });
        assert!(json.get(name).is_some(), "{json}");
    }
    let closing = v1::DriveClosing {
        reason: Some(v1::Problem {
            reason: "DRAINING".into(),
            ..v1::Problem::default()
        }),
    };
    let said = [
        (Say::Frames(v1::DriveFrames::default()), "frames"),
        (Say::Attached(v1::DriveAttached::default()), "attached"),
        (Say::Left(v1::DriveLeft::default()), "left"),
        (Say::Commands(v1::CommandResponse::default()), "commands"),
        (Say::Closing(closing), "closing"),
    ];
    for (message, name) in said {
        let json = round_trip(&v1::DriveResponse {
            message: Some(message),
        });
        assert!(json.get(name).is_some(), "{json}");
    }
}

#[test]
fn packed_columns_are_base64() {
    let block = v1::FrameBlock {
        pack: "human".into(),
        slots: vec![0],
        frame_count: 1,
        first_frames: vec![7],
        packed_roots: vec![0; 12],
        packed_rotations: vec![1, 2, 3, 4, 5, 255],
        contacts: vec![5],
        ..v1::FrameBlock::default()
    };
    let json = round_trip(&block);
    assert_eq!(json["packed_rotations"], json!("AQIDBAX/"));
    assert_eq!(json["contacts"], json!("BQ=="));
    assert!(serde_json::from_str::<v1::FrameBlock>(r#"{"contacts":"??"}"#).is_err());
}

#[test]
fn results_name_their_status_and_clock() {
    let result = v1::CommandResult {
        session_id: "a".into(),
        sequence: 2,
        status: v1::CommandStatus::Refused.into(),
        problem: Some(v1::Problem::default()),
    };
    assert_eq!(round_trip(&result)["status"], json!("COMMAND_STATUS_REFUSED"));
    let session = v1::Session {
        clock: v1::Clock::Drive.into(),
        ..v1::Session::default()
    };
    assert_eq!(round_trip(&session)["clock"], json!("CLOCK_DRIVE"));
    assert_eq!(
        round_trip(&v1::PeekResponse::default()).get("plan"),
        None,
        "absent, not null"
    );
}
