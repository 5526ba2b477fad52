//! Scenes and object definitions: put, asked for, changed under sessions, deleted.

use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use tonic::Code;
use tonic_types::StatusExt as _;
use troupe_proto::v1;
use troupe_server::api::ErrorBody;

use crate::common::TestServer;
use crate::common::scenes::{STOOL, YARD, put_scene, put_stool, scenes};

fn reason(status: &tonic::Status) -> (Code, String) {
    (status.code(), status.get_details_error_info().unwrap().reason)
}

async fn error_of(response: reqwest::Response) -> (StatusCode, String, String) {
    let status = response.status();
    let error = response.json::<ErrorBody>().await.unwrap().error;
    (status, error.reason, error.field.unwrap_or_default())
}

#[tokio::test]
async fn scenes_and_definitions_come_and_go_over_grpc() {
    let server = TestServer::start().await;
    let mut client = scenes(&server).await;
    let uploaded = put_stool(&mut client, STOOL).await.unwrap();
    let definition = uploaded.definition.unwrap();
    assert_eq!(
        (
            definition.name.as_str(),
            definition.pack.as_str(),
            definition.revision
        ),
        ("stool", "toy", 1)
    );
    assert_eq!((uploaded.replaced, uploaded.rebound), (false, 0));
    assert_eq!(definition.approaches, ["front"]);

    let summary = put_scene(&mut client, YARD).await.unwrap();
    assert_eq!(
        (summary.name.as_str(), summary.colliders, summary.objects),
        ("yard", 1, 2)
    );
    let listed = client
        .list_scenes(v1::ListScenesRequest {})
        .await
        .unwrap()
        .into_inner();
    assert_eq!(listed.scenes, [summary]);
    let asked = v1::GetSceneRequest {
        name: "yard".into(),
        ..v1::GetSceneRequest::default()
    };
    let scene = client.get_scene(asked.clone()).await.unwrap().into_inner();
    let ids: Vec<&str> = scene.objects.iter().map(|object| object.id.as_str()).collect();
    assert_eq!((ids, scene.ground), (vec!["stool-1", "stool-2"], 0.0));
    let unreal = v1::GetSceneRequest {
        convention: v1::Convention::Unreal.into(),
        without_colliders: true,
        ..asked.clone()
    };
    let in_unreal = client.get_scene(unreal).await.unwrap().into_inner();
    // Two metres ahead.
    assert_eq!(in_unreal.objects[0].position.unwrap().x, 200.0);
    assert!(in_unreal.colliders.is_empty());

    // What was asked for may be put back, under another name.
    let copy = v1::PutSceneRequest {
        scene: Some(v1::Scene {
            name: "copy".into(),
            ..scene.clone()
        }),
        ..v1::PutSceneRequest::default()
    };
    assert_eq!(client.put_scene(copy).await.unwrap().into_inner().objects, 2);

    let wider = STOOL.replace("reach_m = 0.6", "reach_m = 0.9");
    let again = put_stool(&mut client, &wider).await.unwrap();
    assert_eq!(
        (again.replaced, again.rebound, again.definition.unwrap().objects),
        (true, 4, 4)
    );
    let definition = client.get_object_definition(v1::GetObjectDefinitionRequest {
        name: "stool".into(),
        format: v1::DocumentFormat::Json.into(),
    });
    let answer = definition.await.unwrap().into_inner();
    let document: Value = serde_json::from_str(&answer.document.unwrap().text).unwrap();
    assert_eq!(
        (
            document["name"].as_str(),
            document["shape"]["box"]["center_m"][1].as_f64()
        ),
        (Some("stool"), Some(0.25))
    );
    let definitions = client.list_object_definitions(v1::ListObjectDefinitionsRequest {});
    assert_eq!(definitions.await.unwrap().into_inner().definitions.len(), 1);

    let stool = || v1::DeleteObjectDefinitionRequest { name: "stool".into() };
    let in_use = client.delete_object_definition(stool()).await.unwrap_err();
    assert_eq!(
        reason(&in_use),
        (Code::FailedPrecondition, "OBJECT_DEFINITION_IN_USE".into())
    );
    assert!(in_use.message().contains("copy, yard"), "{}", in_use.message());
    for name in ["yard", "copy"] {
        let request = v1::DeleteSceneRequest { name: name.into() };
        client.delete_scene(request).await.unwrap();
    }
    client.delete_object_definition(stool()).await.unwrap();
    let gone = client.delete_object_definition(stool()).await.unwrap_err();
    assert_eq!(
        reason(&gone),
        (Code::NotFound, "UNKNOWN_OBJECT_DEFINITION".into())
    );
    let gone = client.get_scene(asked).await.unwrap_err();
    assert_eq!(reason(&gone), (Code::NotFound, "UNKNOWN_SCENE".into()));
    server
        .metric("troupe_requests_total{rpc=\"PutScene\",code=\"OK\"}", "2")
        .await;
}

#[tokio::test]
async fn scenes_and_definitions_come_and_go_over_http() {
    let server = TestServer::start().await;
    let document = |text: &str| json!({"document": {"text": text}});
    let put = server
        .send(Method::PUT, "/v1/objects/stool", &document(STOOL))
        .await;
    assert_eq!(put.status(), StatusCode::OK, "{:?}", put.text().await);
    let put = server.send(Method::PUT, "/v1/scenes/yard", &document(YARD)).await;
    let summary: v1::SceneSummary = put.json().await.unwrap();
    assert_eq!((summary.objects, summary.sessions), (2, 0));

    let scene: Value = server
        .get("/v1/scenes/yard?convention=unity&without_colliders=true")
        .await
        .json()
        .await
        .unwrap();
    assert_eq!(
        (&scene["convention"], &scene["objects"][0]["state"]),
        (&json!("CONVENTION_UNITY"), &json!("OBJECT_STATE_FREE"))
    );
    assert_eq!(
        scene["objects"][0]["position"],
        json!({"x": 0.0, "y": 0.0, "z": 2.0})
    );
    let made = json!({"scene": {"ground": 1.5, "objects": [
        {"id": "one", "definition": "stool", "position": {"x": 1.0}, "heading": 0.5}]}});
    let put = server.send(Method::PUT, "/v1/scenes/made", &made).await;
    assert_eq!(put.status(), StatusCode::OK, "{:?}", put.text().await);

    let add = json!({"objects": [
        {"id": "two", "definition": "stool", "position": {"z": -3.0}},
        {"id": "one", "definition": "stool"},
        {"id": "three", "definition": "bench"}]});
    let answer = server.send(Method::POST, "/v1/scenes/made/add", &add).await;
    let answer: Value = answer.json().await.unwrap();
    let reasons: Vec<&Value> = (0..3)
        .map(|i| &answer["results"][i]["problem"]["reason"])
        .collect();
    assert_eq!(
        reasons,
        [&Value::Null, &json!("OBJECT_EXISTS"), &json!("INVALID_FIELD")]
    );
    assert_eq!(answer["results"][2]["problem"]["field"], "objects[2].definition");
    let moves = json!({"convention": "unreal", "moves": [
        {"id": "two", "position": {"x": 100.0}, "heading": 1.0},
        {"id": "unknown", "heading": 1.0},
        {"id": "one", "position": {"x": 1e9}}]});
    let answer = server.send(Method::POST, "/v1/scenes/made/move", &moves).await;
    let answer: Value = answer.json().await.unwrap();
    assert_eq!(answer["results"][1]["problem"]["reason"], "UNKNOWN_OBJECT");
    assert_eq!(answer["results"][2]["problem"]["allowed"], "-1000000 to 1000000");
    let moved: v1::Scene = server.get("/v1/scenes/made").await.json().await.unwrap();
    let two = moved.objects.iter().find(|object| object.id == "two").unwrap();
    assert_eq!(two.position.unwrap().z, 1.0);
    let remove = json!({"ids": ["two", "two"]});
    let answer = server.send(Method::POST, "/v1/scenes/made/remove", &remove).await;
    let answer: Value = answer.json().await.unwrap();
    assert_eq!(answer["results"][1]["problem"]["reason"], "UNKNOWN_OBJECT");
    assert!(answer["results"][0].get("problem").is_none());

    let list: Value = server.get("/v1/scenes").await.json().await.unwrap();
    assert_eq!(
        (&list["scenes"][0]["name"], &list["scenes"][0]["objects"]),
        (&json!("made"), &json!(1))
    );
    let one: Value = server
        .get("/v1/objects/stool?format=json")
        .await
        .json()
        .await
        .unwrap();
    assert_eq!(
        (&one["definition"]["objects"], &one["document"]["format"]),
        (&json!(3), &json!("DOCUMENT_FORMAT_JSON"))
    );
    let list: Value = server.get("/v1/objects").await.json().await.unwrap();
    assert_eq!(list["definitions"][0]["variants"][0]["name"], "sit");

    for (path, status) in [
        ("/v1/objects/stool", StatusCode::CONFLICT),
        ("/v1/scenes/yard", StatusCode::OK),
        ("/v1/scenes/made", StatusCode::OK),
        ("/v1/scenes/made", StatusCode::NOT_FOUND),
        ("/v1/objects/stool", StatusCode::OK),
        ("/v1/objects/stool", StatusCode::NOT_FOUND),
    ] {
        assert_eq!(
            server.send(Method::DELETE, path, &()).await.status(),
            status,
            "{path}"
        );
    }
}

#[tokio::test]
async fn an_error_in_a_document_has_line_and_field() {
    let server = TestServer::start().await;
    let mut client = scenes(&server).await;
    let low = STOOL.replace("reach_m = 0.6", "reach_m = 60.0");
    let error = put_stool(&mut client, &low).await.unwrap_err();
    assert_eq!(reason(&error), (Code::InvalidArgument, "INVALID_DOCUMENT".into()));
    let info = error.get_details_error_info().unwrap();
    let detail = |key: &str| info.metadata[key].clone();
    let line = 1 + low.lines().position(|line| line.starts_with("reach_m")).unwrap();
    assert_eq!(
        (detail("line"), detail("column")),
        (line.to_string(), "11".to_owned())
    );
    assert_eq!(
        (detail("field"), detail("allowed")),
        ("trigger.reach_m".to_owned(), "0 to 10".to_owned())
    );
    let violation = &error.get_details_bad_request().unwrap().field_violations[0];
    assert_eq!(violation.field, "trigger.reach_m");

    let put = |text: String| {
        let server = &server;
        async move {
            let body = json!({"document": {"text": text}});
            let answer = server.send(Method::PUT, "/v1/scenes/yard", &body).await;
            assert_eq!(answer.status(), StatusCode::BAD_REQUEST);
            answer.json::<ErrorBody>().await.unwrap().error
        }
    };
    // There is no such definition yet.
    let error = put(YARD.to_owned()).await;
    assert_eq!(
        (error.line, error.field.as_deref()),
        (Some(14), Some("objects[0].definition"))
    );
    let error = put(YARD.replace("ground_m = 0.0", "ground_m = \"low\"")).await;
    assert_eq!(
        (error.line, error.column, error.field.as_deref()),
        (Some(4), Some(12), Some("ground_m"))
    );
    let error = put(YARD.replace("\"yard\"", "\"park\"")).await;
    assert_eq!(
        (error.line, error.field.as_deref(), error.allowed.as_deref()),
        (Some(3), Some("name"), Some("the name in the request"))
    );
    let error = put("x".repeat(9 << 20)).await;
    assert_eq!(
        (error.line, error.allowed.as_deref()),
        (None, Some("at most 8388608 bytes"))
    );

    // To check alone changes nothing.
    let check = v1::PutObjectDefinitionRequest {
        document: Some(v1::Document {
            text: STOOL.into(),
            ..v1::Document::default()
        }),
        check_only: true,
        ..v1::PutObjectDefinitionRequest::default()
    };
    let checked = client.put_object_definition(check).await.unwrap().into_inner();
    assert_eq!(checked.definition.unwrap().revision, 0);
    let definitions = client.list_object_definitions(v1::ListObjectDefinitionsRequest {});
    assert!(definitions.await.unwrap().into_inner().definitions.is_empty());
}

#[tokio::test]
async fn requests_that_make_no_sense_name_their_field() {
    let server = TestServer::start().await;
    let (put, post) = (Method::PUT, Method::POST);
    let (bad, none) = (StatusCode::BAD_REQUEST, StatusCode::NOT_FOUND);
    for (method, path, body, status, reason, field) in [
        (&put, "/v1/scenes/yard", json!({}), bad, "INVALID_FIELD", "scene"),
        (
            &put,
            "/v1/scenes/yard",
            json!({"scene": {}, "document": {}}),
            bad,
            "INVALID_FIELD",
            "document",
        ),
        (
            &put,
            "/v1/scenes/yard",
            json!({"scene": {"name": "park"}}),
            bad,
            "INVALID_FIELD",
            "scene.name",
        ),
        (
            &put,
            "/v1/scenes/yard",
            json!({"name": "park"}),
            bad,
            "INVALID_FIELD",
            "name",
        ),
        (
            &put,
            "/v1/scenes/a%20b",
            json!({"scene": {}}),
            bad,
            "INVALID_FIELD",
            "scene.name",
        ),
        (
            &put,
            "/v1/scenes/yard",
            json!({"scene": {"grund": 1}}),
            bad,
            "MALFORMED_REQUEST",
            "scene.grund",
        ),
        (
            &put,
            "/v1/objects/stool",
            json!({}),
            bad,
            "INVALID_FIELD",
            "document",
        ),
        (
            &put,
            "/v1/objects/stool",
            json!({"document": {"format": "yaml"}}),
            bad,
            "MALFORMED_REQUEST",
            "document.format",
        ),
        (
            &put,
            "/v1/objects/stool",
            json!({"pack": "none", "document": {}}),
            none,
            "UNKNOWN_PACK",
            "pack",
        ),
        (
            &post,
            "/v1/scenes/park/add",
            json!({"objects": [{}]}),
            none,
            "UNKNOWN_SCENE",
            "scene",
        ),
        (&post, "/v1/detect", json!({}), bad, "INVALID_FIELD", "session_id"),
        (
            &post,
            "/v1/detect",
            json!({"session_id": "unknown"}),
            none,
            "UNKNOWN_SESSION",
            "session_id",
        ),
        (
            &post,
            "/v1/detect",
            json!({"box": {"scene": "park"}}),
            none,
            "UNKNOWN_SCENE",
            "box.scene",
        ),
    ] {
        let refused = error_of(server.send(method.clone(), path, &body).await).await;
        assert_eq!(
            refused,
            (status, reason.to_owned(), field.to_owned()),
            "{path} {body}"
        );
    }
    let refused = error_of(server.get("/v1/scenes/yard?convention=blender").await).await;
    assert_eq!(refused, (bad, "INVALID_FIELD".to_owned(), "query".to_owned()));
}

#[tokio::test]
async fn lists_of_objects_have_an_end() {
    let server = TestServer::start().await;
    let mut client = scenes(&server).await;
    put_stool(&mut client, STOOL).await.unwrap();
    put_scene(&mut client, YARD).await.unwrap();
    let objects = |from: usize, count: usize| -> Vec<v1::SceneObject> {
        let object = |index: usize| v1::SceneObject {
            id: format!("more-{index}"),
            definition: "stool".into(),
            position: Some(v1::Vec3 {
                x: index as f32,
                ..v1::Vec3::default()
            }),
            ..v1::SceneObject::default()
        };
        (from..from + count).map(object).collect()
    };
    let mut add = async |objects| {
        let request = v1::AddObjectsRequest {
            scene: "yard".into(),
            objects,
            ..v1::AddObjectsRequest::default()
        };
        client
            .add_objects(request)
            .await
            .map(|answer| answer.into_inner())
    };
    for (count, field) in [(0, "objects"), (4097, "objects"), (9000, "objects")] {
        let status = add(objects(0, count)).await.unwrap_err();
        assert_eq!(status.code(), Code::InvalidArgument);
        assert_eq!(status.get_details_error_info().unwrap().metadata["field"], field);
    }
    // Two are there already.
    let answer = add(objects(0, 4096)).await.unwrap();
    let refused: Vec<_> = answer
        .results
        .iter()
        .filter_map(|result| result.problem.as_ref())
        .collect();
    assert_eq!(refused.len(), 2);
    assert_eq!(refused[0].reason, "TOO_MANY_OBJECTS");
    let full = add(objects(5000, 1)).await.unwrap();
    assert_eq!(full.results[0].problem.as_ref().unwrap().allowed, "at most 4096");
}
