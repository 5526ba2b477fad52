//! The JSON form of scenes, interactions and events.

use serde_json::json;
use troupe_proto::v1;

use crate::round_trip;

#[test]
fn an_intent_is_a_field_of_its_command() {
    use v1::command::Intent;
    let interact = v1::Interact {
        instance: "chair".into(),
        ..v1::Interact::default()
    };
    let skill = v1::UseSkill {
        name: "jump".into(),
        ..v1::UseSkill::default()
    };
    for (intent, name) in [
        (Intent::Interact(interact), "interact"),
        (Intent::Skill(skill), "skill"),
        (Intent::EndInteraction(v1::EndInteraction {}), "end_interaction"),
        (Intent::Cancel(v1::Cancel {}), "cancel"),
        (Intent::Drop(v1::DropHeld {}), "drop"),
    ] {
        let json = round_trip(&v1::Command {
            session_id: "a".into(),
            sequence: 1,
            intent: Some(intent),
            ..v1::Command::default()
        });
        assert!(json.get(name).is_some(), "{json}");
    }
    let short: v1::Command = serde_json::from_str(r#"{"cancel":{}}"#).unwrap();
    assert_eq!(short.intent, Some(Intent::Cancel(v1::Cancel {})));
    for unknown in [
        r#"{"intent":{"cancel":{}}}"#,
        r#"{"cancel":{"now":true}}"#,
        r#"{"interact":{"object":"chair"}}"#,
    ] {
        assert!(serde_json::from_str::<v1::Command>(unknown).is_err(), "{unknown}");
    }
}

#[test]
fn scenes_name_convention_and_state_and_leave_out_messages_that_are_not_set() {
    let scene = v1::Scene {
        name: "yard".into(),
        convention: v1::Convention::Unity.into(),
        colliders: vec![v1::Collider {
            id: "wall".into(),
            shape: Some(v1::ColliderShape {
                r#box: Some(v1::BoxShape::default()),
                ..v1::ColliderShape::default()
            }),
            ..v1::Collider::default()
        }],
        objects: vec![v1::SceneObject {
            id: "cup".into(),
            state: v1::ObjectState::Held.into(),
            rotation: Some(v1::Quat {
                w: 1.0,
                ..v1::Quat::default()
            }),
            ..v1::SceneObject::default()
        }],
        ..v1::Scene::default()
    };
    let json = round_trip(&scene);
    assert_eq!(
        (&json["convention"], &json["objects"][0]["state"]),
        (&json!("CONVENTION_UNITY"), &json!("OBJECT_STATE_HELD"))
    );
    assert_eq!(json["colliders"][0]["shape"], json!({"box": {}}));
    assert!(json["objects"][0].get("heading").is_none(), "{json}");
    assert!(serde_json::from_str::<v1::Scene>(r#"{"object":[]}"#).is_err());
}

#[test]
fn documents_name_their_format() {
    let put = round_trip(&v1::PutObjectDefinitionRequest {
        document: Some(v1::Document {
            format: v1::DocumentFormat::Json.into(),
            text: "{}".into(),
        }),
        ..v1::PutObjectDefinitionRequest::default()
    });
    assert_eq!(put["document"]["format"], json!("DOCUMENT_FORMAT_JSON"));
    let usual: v1::Document = serde_json::from_str(r#"{"text":"a = 1"}"#).unwrap();
    assert_eq!(usual.format(), v1::DocumentFormat::Toml);
    let error = serde_json::from_str::<v1::Document>(r#"{"format":"yaml"}"#).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("expected `DOCUMENT_FORMAT_TOML` or `DOCUMENT_FORMAT_JSON`"),
        "{error}"
    );
}

#[test]
fn an_event_has_the_field_of_its_kind() {
    use v1::session_event::Kind;
    let written = |kind| {
        round_trip(&v1::SessionEvent {
            frame: 7,
            kind: Some(kind),
        })
    };
    let fell = written(Kind::Fell(v1::CharacterFell { height: None }));
    assert_eq!(fell, json!({"frame": "7", "fell": {}}));
    let failed = written(Kind::Failed(v1::InteractionFailed {
        reason: "MOVED".into(),
        ..v1::InteractionFailed::default()
    }));
    assert_eq!(failed["failed"]["reason"], json!("MOVED"));
    let reached = written(Kind::Reached(v1::KeyframeReached {
        before: Some(v1::KeyframeError {
            root_m: 0.5,
            ..v1::KeyframeError::default()
        }),
        ..v1::KeyframeReached::default()
    }));
    assert_eq!(reached["reached"]["before"]["root_m"], json!(0.5));
    let said = round_trip(&v1::DriveResponse {
        message: Some(v1::drive_response::Message::Events(v1::DriveEvents::default())),
    });
    assert!(said.get("events").is_some(), "{said}");
    let session = round_trip(&v1::Session {
        activity: Some(v1::Activity {
            kind: v1::ActivityKind::Held.into(),
            instance: "chair".into(),
            set: "sit".into(),
            ..v1::Activity::default()
        }),
        ..v1::Session::default()
    });
    assert_eq!(session["activity"]["kind"], json!("ACTIVITY_KIND_HELD"));
    assert!(session.get("held").is_none(), "nothing is in its hand");
}
